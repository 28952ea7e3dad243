//! The estimator whose noise has filters of its own, like its features.

use athermal_core::node::InputPort;

use crate::identified::identified;
use crate::keys::keys;
use crate::order::Order;

keys! {
    /// Box–Jenkins: what the features bring about, and noise that has filters of its own.
    ///
    /// `y = μ + Σ B_i(q)/F_i(q) u_i(t − nk) + C(q)/D(q) e` (Box and Jenkins 1970; Ljung 1999, section 4.2). The sum
    /// of squared one-step prediction errors is made least by damped Gauss–Newton steps. They start where Steiglitz
    /// and McBride (1965) end for the features and Hannan and Rissanen (1982) for the noise. Where a filter has more
    /// than one pole, they start elsewhere too, among others from the best models with fewer coefficients; the best
    /// end is kept. Roots of each `F`, `C` and `D` stay inside the unit circle.
    ///
    /// A sample is what the run at `t` saw and the truth at `t + ahead`. Samples are a step apart: `every`, by
    /// default the span of the truth, since truths whose windows overlap share their noise. Where several come within
    /// a step, each begins a series of its own. All series are fitted together and followed side by side. The time
    /// between two truths of a series counts as so many steps, rounded. Missing ones are estimated from the truths
    /// that follow too, as in a Kalman filter of the model (Jones 1980). Running, it takes each truth that the
    /// embargo lets through and predicts as many steps ahead of the newest as there are.
    ///
    /// Where truths are missing in the fit, or outside of its limits, the model is followed through them in the same
    /// way. From where as many truths a step apart are known as the noise looks back on, errors count in their
    /// variance, as the likelihood has it. After more steps without features than ten, or than the model reaches back
    /// where that is more, the filters start again, as in each segment. What those of the features gave before is
    /// found for each such piece beside the coefficients (Ljung 1999, section 10.5), as far as its samples determine
    /// it. It counts as found in criteria and errors. The noise begins without a past. Running, a segment begins with
    /// its first truth, as if that and the features had always been what they are. What they do not explain of it the
    /// filters and the noise share by how much each varies. The truths that follow separate the one from the other,
    /// as in a Kalman filter of the model (Harvey 1989, section 3.2). In the end the filters go by the features
    /// alone. So does what comes after as many steps without features; with `learn = false` it stays at rest. The
    /// port `std_dev` is the standard deviation of the truth about its prediction, larger after truths that are
    /// missing and until it is known where the filters are. Features that are missing are taken for the last ones;
    /// what that adds to the error is not in it. Where rows tell the level less well than one of them does by itself,
    /// it is taken to be their mean, which the fit reports. Since the answer changes with time alone, the node runs
    /// at every tick.
    ///
    /// The port `novelty` is that of `linear`, of the features as the run saw them; the truths that are followed do not change it.
    pub struct Bj {
        nb nc nf nk penalty every;
        /// How many past values of the noise, 0 to 100.
        #[serde(default = "crate::identified::one")]
        #[schemars(range(min = 0, max = 100))]
        pub nd: usize,
        /// Which orders are compared, such as `{ by = "aicc", nb = "1..2", nf = "1..2" }`; without it they are as given. They are compared
        /// without the penalty, with which the chosen one is fitted.
        #[serde(default)]
        pub order: Option<Order>,
    }
}

identified!(
    Bj,
    "bj",
    [nb, nc, nd, nf, nk, penalty, every, order],
    [
        InputPort::held("features", "what the prediction is made of beside the past"),
        InputPort::truth("what is predicted, and followed")
    ]
);
