//! The estimator that tells the truth from its own past and from what was not foreseen of it.

use athermal_core::node::InputPort;

use crate::identified::identified;
use crate::keys::keys;
use crate::order::Order;

keys! {
    /// Autoregressive moving average: the truth by its own past and by past innovations.
    ///
    /// `A(q) (y − μ) = C(q) e`, with `A(q) = 1 + a₁q⁻¹ + …` and `C(q) = 1 + c₁q⁻¹ + …` (Box and Jenkins 1970; Ljung
    /// 1999, section 4.2). The sum of squared one-step prediction errors is made least by damped Gauss–Newton steps,
    /// starting where Hannan and Rissanen (1982) end. Roots of `A` and `C` stay inside the unit circle.
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
    /// begins with its first truth, as if that had always been; with `learn = false` it stays at the level of the
    /// fit. The port `std_dev` is the standard deviation of the truth about its prediction, larger after truths that
    /// are missing. Where rows tell the level less well than one of them does by itself, it is taken to be their
    /// mean, which the fit reports. Since the answer changes with time alone, the node runs at every tick.
    ///
    /// The limit of `learn.outliers` keeps spikes out, and with them the beginning of what really changes within a
    /// truth or two. There is nothing else to go by: the drift of the die tester's axis Z1 leaps by hundreds of
    /// nm/min when a die is loaded. There the error is 62 nm/min instead of 55. Where truths are sound, say
    /// `learn = { outliers = inf }`.
    pub struct Arma {
        na nc every;
        /// Which orders are compared, such as `{ by = "aicc", na = "0..3", nc = "0..3" }`; without it they are as given.
        #[serde(default)]
        pub order: Option<Order>,
    }
}

identified!(
    Arma,
    "arma",
    [na, nc, every, order],
    [InputPort::truth("what is predicted, and followed")]
);
