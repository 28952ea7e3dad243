//! The estimator that tells the truth from features through filters of their own.

use athermal_core::node::InputPort;

use crate::identified::identified;
use crate::keys::keys;
use crate::order::Order;

keys! {
    /// Output error: what the features bring about through filters of their own, whatever the truth was before.
    ///
    /// `y = μ + Σ B_i(q)/F_i(q) u_i(t − nk) + e` (Dugard and Landau 1980; Ljung 1999, section 4.2). The sum of
    /// squared errors of the simulated output is made least by damped Gauss–Newton steps with exact derivatives,
    /// starting where Steiglitz and McBride (1965) end. Where a filter has more than one pole, they start elsewhere
    /// too, among others from the best models with fewer coefficients; the best end is kept. Roots of each `F` stay
    /// inside the unit circle. Once it is known where the filters are, truths are not read: it is as good in a free
    /// run as beside a machine.
    ///
    /// A sample is what the run at `t` saw and the truth at `t + ahead`. Samples are a step apart: `every`, by
    /// default the span of the truth, since truths whose windows overlap share their noise. Where several come within
    /// a step, each begins a series of its own. All series are fitted together and followed side by side. The time
    /// between two truths of a series counts as so many steps, rounded. Running, it goes on by the features alone.
    ///
    /// Where truths are missing in the fit, or outside of its limits, the filters go on. After more steps without
    /// features than ten, or than the model reaches back where that is more, they start again, as in each segment.
    /// What they gave before is found for each such piece beside the coefficients (Ljung 1999, section 10.5), as far
    /// as its samples determine it. It counts as found in criteria and errors. Running, a segment begins at rest, as
    /// if the features had always been what they are first, or where such features leave filters on average. How
    /// unsure that is, is known from the fit. Truths then show where the filters are, as in a Kalman filter of the
    /// model (Harvey 1989, section 3.2). The better that is known, the less a truth moves them, until they go by the
    /// features alone. So does what comes after as many steps without features; a free run takes as many truths as
    /// the filters have past values. With `learn = false` it stays at rest. The port `std_dev` is the standard
    /// deviation of the truth about its prediction, larger until it is known where the filters are. It goes by the
    /// errors that are left in the fit. Where noise is coloured and pieces are short, what filters gave before takes
    /// slow noise up too, and the deviation is too small. Features that are missing are taken for the last ones; what
    /// that adds to the error is not in it. Since the answer changes with time alone, the node runs at every tick.
    ///
    /// The port `novelty` is that of `linear`, of the features as the run saw them; the truths that are followed do not change it.
    pub struct Oe {
        nb nf nk penalty every;
        /// Which orders are compared, such as `{ by = "aicc", nb = "1..4", nf = "1..4" }`; without it they are as given. They are compared
        /// without the penalty, with which the chosen one is fitted.
        #[serde(default)]
        pub order: Option<Order>,
    }
}

identified!(
    Oe,
    "oe",
    [nb, nf, nk, penalty, every, order],
    [
        InputPort::held("features", "what the prediction is made of"),
        InputPort::truth("what is predicted")
    ]
);
