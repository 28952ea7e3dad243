//! The keys that several estimators share, each said once: a struct of parameters names those that it has.
//!
//! A struct that is flattened into others would do the same, but serde keeps no places in what it flattens, and a mistake has to be shown
//! where it stands.

/// Declares the parameters of an estimator: shared keys by their names, then those of its own.
macro_rules! keys {
    ($(#[$meta:meta])* pub struct $name:ident { $($shared:ident)+ $(; $($own:tt)*)? }) => {
        keys!(@ [$(#[$meta])* pub struct $name] [] $($shared)+ ; $($($own)*)?);
    };
    (@ [$($head:tt)*] [$($made:tt)*] ; $($own:tt)*) => {
        #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
        #[serde(deny_unknown_fields)]
        $($head)* { $($made)* $($own)* }
    };
    (@ $head:tt [$($made:tt)*] lags $($rest:tt)*) => {
        keys!(@ $head [$($made)*
            /// The lags of the truth, such as `["0s", "5min", "10min"]`.
            #[schemars(length(min = 1))]
            pub lags: Vec<athermal_core::time::Duration>,
        ] $($rest)*);
    };
    (@ $head:tt [$($made:tt)*] feature_lags $($rest:tt)*) => {
        keys!(@ $head [$($made)*
            /// The lags at which each feature is read.
            #[serde(default = "crate::lags::now")]
            #[schemars(length(min = 1))]
            pub feature_lags: Vec<athermal_core::time::Duration>,
        ] $($rest)*);
    };
    (@ $head:tt [$($made:tt)*] solver $($rest:tt)*) => {
        keys!(@ $head [$($made)*
            /// How coefficients are found.
            #[serde(default)]
            pub solver: crate::solver::Solver,
        ] $($rest)*);
    };
    (@ $head:tt [$($made:tt)*] na $($rest:tt)*) => {
        keys!(@ $head [$($made)*
            /// How many past values of the truth, 0 to 100.
            #[serde(default = "crate::identified::one")]
            #[schemars(range(min = 0, max = 100))]
            pub na: usize,
        ] $($rest)*);
    };
    (@ $head:tt [$($made:tt)*] nb $($rest:tt)*) => {
        keys!(@ $head [$($made)*
            /// How many values of each feature, 0 to 100: a number for all, or a list with one for each.
            #[serde(default = "crate::identified::PerInput::one")]
            pub nb: crate::identified::PerInput,
        ] $($rest)*);
    };
    (@ $head:tt [$($made:tt)*] nc $($rest:tt)*) => {
        keys!(@ $head [$($made)*
            /// How many past innovations, 0 to 100.
            #[serde(default = "crate::identified::one")]
            #[schemars(range(min = 0, max = 100))]
            pub nc: usize,
        ] $($rest)*);
    };
    (@ $head:tt [$($made:tt)*] nf $($rest:tt)*) => {
        keys!(@ $head [$($made)*
            /// How many past values of what each feature brings about, 0 to 100: a number for all, or a list with one for each.
            #[serde(default = "crate::identified::PerInput::one")]
            pub nf: crate::identified::PerInput,
        ] $($rest)*);
    };
    (@ $head:tt [$($made:tt)*] nk $($rest:tt)*) => {
        keys!(@ $head [$($made)*
            /// How many steps the newest value of each feature that counts lies before the run, 0 to 100: a number for all, or a list
            /// with one for each.
            #[serde(default = "crate::identified::PerInput::none")]
            pub nk: crate::identified::PerInput,
        ] $($rest)*);
    };
    (@ $head:tt [$($made:tt)*] penalty $($rest:tt)*) => {
        keys!(@ $head [$($made)*
            /// The penalty on the coefficients of standardised features, at least 0, as in ridge.
            #[serde(default = "crate::identified::penalty")]
            #[schemars(range(min = 0.0))]
            pub penalty: f64,
        ] $($rest)*);
    };
    (@ $head:tt [$($made:tt)*] every $($rest:tt)*) => {
        keys!(@ $head [$($made)*
            /// How long a step is; without it the span of the truth, or where that is nothing the typical time between truths.
            #[serde(default)]
            #[schemars(extend("exclusiveMinimum" = 0))]
            pub every: Option<athermal_core::time::Duration>,
        ] $($rest)*);
    };
}
pub(crate) use keys;
