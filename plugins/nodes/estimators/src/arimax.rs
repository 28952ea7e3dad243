//! The estimator whose noise has no level to return to.

use athermal_core::node::InputPort;

use crate::identified::identified;
use crate::keys::keys;
use crate::order::Order;

keys! {
    /// ARMAX whose noise may be integrated: it then has no level to return to, so that an offset that comes to stay is followed.
    ///
    /// `A(q) y = Σ B_i(q) u_i(t − nk) + C(q)/(1 − q⁻¹)^d e`, `d` the `differences` (Box and Jenkins 1970; Ljung 1999,
    /// section 4.2). Without features it is ARIMA. The sum of squared one-step prediction errors is made least by
    /// damped Gauss–Newton steps, starting where Hannan and Rissanen (1982) end on the differences. Roots of `A` and
    /// `C` stay inside the unit circle.
    ///
    /// Noise that has a level is not integrated: its differences are more noise than it is. Unless `differences` says
    /// which of the two there is, an information criterion decides, from one-step predictions of the same rows (as
    /// Hyndman and Khandakar 2008 choose the order). Without any it is ARMAX, and an offset that the rows of the fit
    /// did not have stays an error.
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
    /// what that adds to the error is not in it. Since the answer changes with time alone, the node runs at every
    /// tick.
    ///
    /// The port `novelty` is that of `linear`, of the features as the run saw them; the truths that are followed do not change it.
    pub struct Arimax {
        na nb nc nk penalty every;
        /// How often the noise is integrated, 0 to 2; without it once or not at all, whichever the figure of `order` finds better.
        #[serde(default)]
        #[schemars(range(min = 0, max = 2))]
        pub differences: Option<usize>,
        /// Which orders are compared, such as `{ by = "aicc", na = "0..3", nc = "0..3" }`; without it they are as given. They are compared
        /// without the penalty, with which the chosen one is fitted.
        #[serde(default)]
        pub order: Option<Order>,
    }
}

identified!(
    Arimax,
    "arimax",
    [na, nb, nc, nk, differences, penalty, every, order],
    [
        InputPort::held("features", "what the prediction is made of beside the past").or_none(),
        InputPort::truth("what is predicted, and followed")
    ]
);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identified::{Asked, Differences, Identify, PerInput};
    use athermal_core::node::TrainingReport;
    use athermal_core::prng::Prng;
    use athermal_numerics::Samples;

    /// How often the noise is integrated of what an input brings about, beside noise of which each value keeps so much of the
    /// last one; and what was compared.
    fn told(kept: f64, order: Option<Order>) -> (usize, Vec<String>) {
        let mut prng = Prng::stream(7, "arimax");
        let mut random = || prng.normal();
        let mut samples = Samples::new(1);
        samples.segment();
        let mut noise = 0.0;
        for _ in 0..600 {
            let input = random();
            noise = kept * noise + random();
            samples.push([input], 2.0 * input + noise + 0.5 * random());
        }
        let asked = Asked {
            na: Some(0),
            nb: Some(PerInput::one()),
            nc: Some(1),
            nk: Some(PerInput::none()),
            differences: Differences::Chosen,
            order,
            places: vec![0],
            ..Asked::default()
        };
        let mut report = TrainingReport::default();
        let found = asked
            .identify(&samples, 1, &mut report, &mut |_, _| {})
            .unwrap();
        let tried = report.orders.unwrap().tried.into_iter();
        (
            found.model.differences,
            tried.map(|one| one.order).collect(),
        )
    }

    #[test]
    fn what_is_told_not_to_be_integrated_is_fitted_on_all_rows_as_if_that_had_been_given() {
        let mut prng = Prng::stream(7, "arimax in pieces");
        let mut samples = Samples::new(1);
        for nth in 0..600 {
            if nth % 20 == 0 {
                samples.segment();
            }
            let input = prng.normal();
            samples.push([input], 2.0 * input + 0.5 * prng.normal());
        }
        let asked = |differences| Asked {
            na: Some(0),
            nb: Some(PerInput::one()),
            nc: Some(1),
            nk: Some(PerInput::none()),
            differences,
            places: vec![0],
            ..Asked::default()
        };
        let fit = |differences| {
            let mut report = TrainingReport::default();
            let found = asked(differences).identify(&samples, 1, &mut report, &mut |_, _| {});
            found.unwrap()
        };
        let (told, given) = (fit(Differences::Chosen), fit(Differences::Given(0)));
        assert_eq!((told.model.differences, told.rows), (0, given.rows));
        assert_eq!(told.squared_errors, given.squared_errors);
    }

    #[test]
    fn noise_that_wanders_is_integrated_and_noise_that_has_a_level_is_not() {
        let (wandering, tried) = told(1.0, None);
        assert_eq!((wandering, told(0.3, None).0), (1, 0));
        assert_eq!(tried, ["differences 0", "differences 1"]);
    }

    #[test]
    fn each_order_is_compared_with_and_without_integrated_noise() {
        let order = Order {
            nb: Some(crate::order::OrderRange { from: 0, to: 1 }),
            ..Order::default()
        };
        let (wandering, tried) = told(1.0, Some(order));
        assert_eq!(wandering, 1);
        let expected = [
            "nb 0, differences 0",
            "nb 0, differences 1",
            "nb 1, differences 0",
            "nb 1, differences 1",
        ];
        assert_eq!(tried, expected);
    }
}
