//! The estimator that tells the truth from features, its own past and what was not foreseen of it.

use athermal_core::node::InputPort;

use crate::identified::identified;
use crate::keys::keys;
use crate::order::Order;

keys! {
    /// ARX whose noise is a moving average of past innovations.
    ///
    /// `A(q) (y − μ) = Σ B_i(q) u_i(t − nk) + C(q) e` (Åström and Bohlin 1965; Ljung 1999, section 4.2). The sum of
    /// squared one-step prediction errors is made least by damped Gauss–Newton steps, starting where Hannan and
    /// Rissanen (1982) end. Roots of `A` and `C` stay inside the unit circle.
    ///
    /// A sample is what the run at `t` saw and the truth at `t + ahead`. Samples are a step apart: `every`, by
    /// default the span of the truth, since truths whose windows overlap share their noise. Where several come within
    /// a step, each begins a series of its own. All series are fitted together and followed side by side. The time
    /// between two truths of a series counts as so many steps, rounded. Missing ones are estimated from the truths
    /// that follow too, as in a Kalman filter of the model (Jones 1980). Running, it takes each truth that the
    /// embargo lets through and predicts as many steps ahead of the newest as there are. Where truths are missing in
    /// the fit, or outside of its limits, the model is followed through them in the same way. From where as many
    /// truths a step apart are known as the model looks back on, errors count in their variance, as the likelihood
    /// has it. Where truths regularly come less often than that, `every` must be as long as they are apart. A segment
    /// begins with its first truth, as if that and the features had always been what they are. So does, in the fit
    /// too, what comes after more steps without features than ten, or than the model reaches back where that is more.
    /// With `learn = false` it stays at rest. The port `std_dev` is the standard deviation of the truth about its
    /// prediction, larger after truths that are missing. Features that are missing are taken for the last ones, and
    /// what that adds to the error is not in it. Where rows tell the level less well than one of them does by itself,
    /// it is taken to be their mean, which the fit reports. Since the answer changes with time alone, the node runs
    /// at every tick.
    ///
    /// The port `novelty` is that of `linear`, of the features as the run saw them; the truths that are followed do not change it.
    pub struct Armax {
        na nb nc nk penalty every;
        /// Which orders are compared, such as `{ by = "aicc", na = "1..4", nb = "1..4" }`; without it they are as given. They are compared
        /// without the penalty, with which the chosen one is fitted.
        #[serde(default)]
        pub order: Option<Order>,
    }
}

identified!(
    Armax,
    "armax",
    [na, nb, nc, nk, penalty, every, order],
    [
        InputPort::held("features", "what the prediction is made of beside the past"),
        InputPort::truth("what is predicted, and followed")
    ]
);
