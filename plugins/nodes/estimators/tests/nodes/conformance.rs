//! Every kind of this crate through the rules that every node keeps.

use athermal_estimators::{
    Ar, Arimax, Arma, Armax, Arx, Bj, ElasticNet, Huber, Kalman, Lasso, Linear, Narx, Oe,
    Persistence, Polynomial, Rls, Stack, StateSpace, Zero,
};
use athermal_testkit::conformance;
use athermal_testkit::{Case, Rule, assert_every_kind_conforms};

conformance!(
    Zero,
    Case::new(r#"ahead = "1min""#).speaks_without_input(&["prediction"]),
);

conformance!(
    Persistence,
    Case::new(r#"ahead = "1min""#),
    Case::new(r#"ahead = "0s""#),
);

conformance!(
    Linear,
    Case::new(r#"ahead = "1min""#),
    Case::new(
        r#"
        ahead = "0s"
        solver = { type = "ols" }
        selection = { method = "forward", folds = 3, tolerance = 1e-3, most = 2 }
        "#
    ),
    Case::new(
        r#"
        ahead = "30s"
        solver = { type = "sgd", alpha = 1e-4, eta0 = 0.01, power = 0.25, epochs = 3 }
        "#
    )
    .input("features", 1, "Cel"),
    Case::new(
        r#"
        ahead = "10s"
        solver = { type = "sgd", power = 0.0 }
        learn = { outliers = 8.0, margin = 0.5 }
        "#
    )
    .input("freeze", 1, "1"),
    Case::new(
        r#"
        ahead = "30s"
        solver = { type = "ridge", alpha = { by = "cross_validation", folds = 3, smallest = 1e-2, largest = 1e2, per_decade = 2 } }
        selection = { method = "backward", folds = { type = "blocked", count = 3, gap_rows = 1, embargo_rows = 1 }, by = "sensor" }
        "#
    ),
    Case::new(
        r#"
        ahead = "30s"
        solver = { type = "ridge", alpha = { by = "generalised_cross_validation", smallest = 1e-2, largest = 1e2, per_decade = 2 } }
        selection = { method = "floating", folds = { type = "expanding", count = 3, gap_rows = 1 }, one_standard_error = true }
        "#
    ),
    Case::new(
        r#"
        ahead = "30s"
        selection = { method = "stepwise", f_enter = 4.0, leave_share = 0.9, most = 2 }
        "#
    ),
);

conformance!(
    Lasso,
    Case::new(
        r#"
        ahead = "1min"
        alpha = 0.01
        "#
    ),
    Case::new(
        r#"
        ahead = "1min"
        alpha = { folds = 3, smallest_share = 0.01, per_decade = 5 }
        "#
    ),
);

conformance!(
    ElasticNet,
    Case::new(
        r#"
        ahead = "1min"
        alpha = 0.01
        l1_ratio = 0.5
        "#
    ),
    Case::new(r#"ahead = "1min""#),
);

conformance!(
    Huber,
    Case::new(
        r#"
        ahead = "1min"
        epsilon = 1.35
        alpha = 1e-4
        "#
    ),
);

conformance!(
    Polynomial,
    Case::new(r#"ahead = "1min""#),
    Case::new(
        r#"
        ahead = "1min"
        squares = true
        interactions = false
        solver = { type = "ols" }
        selection = { method = "forward", folds = 3 }
        "#
    ),
);

conformance!(
    Ar,
    Case::new(
        r#"
        ahead = "1min"
        lags = ["0s", "30s"]
        "#
    ),
    Case::new(
        r#"
        ahead = "0s"
        lags = ["30s"]
        solver = { type = "ridge", alpha = 0.1 }
        "#
    ),
);

conformance!(
    Arx,
    Case::new(
        r#"
        ahead = "1min"
        lags = ["0s", "30s"]
        "#
    ),
    Case::new(
        r#"
        ahead = "30s"
        lags = ["30s"]
        feature_lags = ["0s", "30s"]
        solver = { type = "ols" }
        selection = { method = "forward" }
        "#
    ),
    Case::new(
        r#"
        ahead = "30s"
        lags = ["30s", "1min"]
        feature_lags = ["0s", "30s"]
        order = { by = "aicc", na = "1..2", nb = "0..2" }
        "#
    ),
);

conformance!(
    Arma,
    Case::new(r#"ahead = "1min""#),
    Case::new(
        r#"
        ahead = "0s"
        na = 0
        nc = 2
        every = "20s"
        "#
    ),
    Case::new(
        r#"
        ahead = "30s"
        order = { by = "bic", na = "0..2", nc = "0..1" }
        learn = { outliers = 8.0 }
        "#
    )
    .input("freeze", 1, "1"),
    Case::new(
        r#"
        ahead = "30s"
        learn = false
        "#
    )
    .speaks_without_input(&["prediction", "std_dev"]),
);

conformance!(
    Armax,
    Case::new(r#"ahead = "1min""#),
    Case::new(
        r#"
        ahead = "30s"
        na = 2
        nb = [2, 1]
        nk = [0, 1]
        nc = 0
        penalty = 0.0
        "#
    )
    .input("features", 2, "K"),
    Case::new(
        r#"
        ahead = "0s"
        order = { by = "aicc", na = "0..1", nb = "1..2", nk = "0..1" }
        "#
    )
    .input("features", 1, "Cel"),
);

conformance!(
    Oe,
    Case::new(r#"ahead = "1min""#),
    Case::new(
        r#"
        ahead = "0s"
        nb = [2, 1]
        nf = [1, 2]
        nk = 1
        every = "20s"
        "#
    )
    .input("features", 2, "K"),
    Case::new(
        r#"
        ahead = "30s"
        order = { by = "fpe", nf = "0..1" }
        learn = false
        "#
    )
    .input("features", 1, "Cel"),
);

conformance!(
    Bj,
    Case::new(r#"ahead = "1min""#).input("features", 1, "K"),
    Case::new(
        r#"
        ahead = "0s"
        nb = 2
        nf = 2
        nc = 0
        nd = 2
        penalty = 0.1
        "#
    )
    .input("features", 1, "K"),
    Case::new(
        r#"
        ahead = "30s"
        nb = [2, 1]
        nf = [1, 0]
        "#
    )
    .input("features", 2, "K"),
    Case::new(
        r#"
        ahead = "0s"
        nf = [0, 2]
        nc = 0
        penalty = 0.0
        "#
    )
    .input("features", 2, "K"),
    Case::new(r#"ahead = "1min""#).except(
        Rule::Units,
        "filters of several features that bring nothing about leave a valley in which rounding says where the search ends",
    ),
);

conformance!(
    Arimax,
    Case::new(r#"ahead = "1min""#),
    Case::new(
        r#"
        ahead = "0s"
        na = 2
        differences = 0
        "#
    )
    .input("features", 2, "K"),
    Case::new(
        r#"
        ahead = "30s"
        nc = 2
        differences = 2
        "#
    )
    .input("features", 1, "K"),
    Case::new(
        r#"
        ahead = "1min"
        learn = false
        "#
    )
    .speaks_without_input(&["prediction", "std_dev"]),
);

conformance!(
    Narx,
    Case::new(
        r#"
        ahead = "1min"
        lags = ["0s", "30s"]
        "#
    ),
    Case::new(
        r#"
        ahead = "30s"
        lags = ["30s"]
        feature_lags = ["0s", "30s"]
        degree = 3
        tolerance = 0.0
        most = 7
        "#
    )
    .input("features", 1, "Cel"),
);

conformance!(
    Kalman,
    Case::new(r#"ahead = "1min""#).speaks_without_input(&["prediction", "std_dev"]),
    Case::new(
        r#"
        ahead = "0s"
        trend = true
        every = "30s"
        penalty = 0.5
        "#
    )
    .input("features", 2, "K"),
    Case::new(
        r#"
        ahead = "30s"
        learn = false
        noises = { observation = "4 nm", level = "10 nm", per = "1h" }
        "#
    )
    .input("features", 1, "K"),
    Case::new(
        r#"
        ahead = "30s"
        noises = { observation = "4 nm", level = "10 nm", per = "1h", returns = "10min" }
        "#
    )
    .input("features", 1, "K"),
);

conformance!(
    Rls,
    Case::new(r#"ahead = "10s""#).input("features", 3, "K"),
    Case::new(
        r#"
        ahead = "0s"
        lags = ["30s"]
        memory = "100s"
        learn = { margin = 1.0 }
        "#
    )
    .input("features", 2, "K")
    .input("freeze", 1, "1"),
    Case::new(
        r#"
        ahead = "10s"
        learn = false
        alpha = 0.1
        selection = { method = "forward", most = 2 }
        "#
    )
    .input("features", 3, "Cel"),
);

conformance!(
    StateSpace,
    Case::new(
        r#"
        ahead = "1min"
        horizon = 3
        "#
    )
    .speaks_without_input(&["prediction", "std_dev"]),
    Case::new(
        r#"
        ahead = "0s"
        states = 2
        horizon = 4
        weighting = "n4sid"
        "#
    )
    .input("features", 1, "K"),
    Case::new(
        r#"
        ahead = "30s"
        states = { by = "gap" }
        horizon = 3
        weighting = "moesp"
        every = "1min"
        learn = false
        "#
    )
    .input("features", 2, "K"),
);

conformance!(
    Stack,
    Case::new(r#"ahead = "0s""#),
    Case::new(r#"ahead = "0s""#).input("voters", 1, "nm"),
);

#[test]
fn every_kind_of_this_crate_conforms() {
    assert_every_kind_conforms(env!("CARGO_PKG_NAME"));
}
