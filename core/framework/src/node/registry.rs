//! Decides what a kind of node is, and how it becomes known; not what kinds there are.

use std::fmt::Debug;

use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{Combiner, Duty, Estimator, Feature, InputPort, KindFacts, PortSummary, Read};
use crate::diagnostic::{Diagnostics, Place, SourceId};
use crate::document::{Value, decode_beside};
use crate::registry::{Registered, Sort};

/// The specification of a node: the parameters of some kind, read from a graph.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not known as a kind of node",
    label = "make it known: `athermal_core::register!({Self}, Feature, \"name\")`"
)]
pub trait NodeSpec: Debug + Send + Sync {
    /// The parameters seen as their role.
    fn role(&self) -> Role<'_>;

    /// The parameters as data, with defaults filled in: two equal ones behave alike.
    fn parameters(&self) -> serde_json::Value;

    /// The name of the kind, as graph files use it.
    fn kind_name() -> &'static str
    where
        Self: Sized;
}

/// A specification as what it is.
#[derive(Debug, Clone, Copy)]
pub enum Role<'a> {
    /// Channels from channels.
    Feature(&'a dyn Feature),
    /// A prediction of the truth.
    Estimator(&'a dyn Estimator),
    /// One prediction of several.
    Combiner(&'a dyn Combiner),
}

/// The name of a role.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum RoleName {
    /// See [`Feature`].
    Feature,
    /// See [`Estimator`].
    Estimator,
    /// See [`Combiner`].
    Combiner,
}

impl std::fmt::Display for RoleName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Feature => "feature",
            Self::Estimator => "estimator",
            Self::Combiner => "combiner",
        })
    }
}

/// The parameters of a node; nothing where they have mistakes.
pub type ReadSpec = Option<Box<dyn NodeSpec>>;

/// A kind of node, by its name in graph files; its schema is that of its parameters, with the ranges that the compiler checks.
pub type Kind = Registered<NodeKind>;

/// What a kind of node is.
#[derive(Debug)]
pub struct NodeKind {
    /// Its role.
    pub role: RoleName,
    /// The input ports.
    pub inputs: fn() -> &'static [InputPort],
    /// Of a feature, the output ports as it tells them: see [`Feature::ports`].
    pub ports: fn() -> &'static [PortSummary],
    /// What reports ask of it.
    pub facts: fn() -> KindFacts,
    /// Reads its parameters, or reports their mistakes. The keys are those of the node
    /// that are read elsewhere.
    pub read: fn(&Value, &[&str], &mut Diagnostics) -> ReadSpec,
}

impl Sort for NodeKind {
    const ONE: &'static str = "node type";
    const MANY: &'static str = "types";
}

impl NodeKind {
    /// What it does, where reports go by that.
    #[must_use]
    pub fn duty(&self) -> Duty {
        (self.facts)().duty
    }

    /// The specification that parameters as a table give, with defaults for the others; none where they cannot be read.
    #[must_use]
    pub fn given(&self, parameters: &serde_json::Value) -> Option<Box<dyn NodeSpec>> {
        let parameters = Value::from_json(parameters, Place::new(SourceId(0), 0, 0)).ok()?;
        (self.read)(&parameters, &[], &mut Diagnostics::new())
    }

    /// The keys of a node's table that the framework reads itself.
    #[must_use]
    pub fn framework_keys(&self) -> &'static [&'static str] {
        let learns_from_truth = || (self.inputs)().iter().any(|port| port.read == Read::Truth);
        match self.role {
            RoleName::Estimator => &["ahead", "train", "learn", "outside"],
            RoleName::Feature if learns_from_truth() => &["ahead", "train"],
            RoleName::Feature | RoleName::Combiner => &[],
        }
    }

    /// The output ports that a node of it may have; none where it does not tell them.
    #[must_use]
    pub fn outputs(&self) -> Vec<&'static str> {
        match self.role {
            RoleName::Feature => (self.ports)().iter().map(|port| port.name).collect(),
            RoleName::Estimator => vec!["prediction", "learning", "std_dev", "novelty"],
            RoleName::Combiner => vec![
                "prediction",
                "weights",
                "reason",
                "lower",
                "upper",
                "std_dev",
                "novelty",
            ],
        }
    }
}

/// Reads parameters of one concrete type; [`register!`](crate::register) makes use of it.
#[doc(hidden)]
pub fn read<T: NodeSpec + DeserializeOwned + JsonSchema + 'static>(
    value: &Value,
    elsewhere: &[&str],
    diagnostics: &mut Diagnostics,
) -> ReadSpec {
    let read = decode_beside::<T>(value, "the node", elsewhere, diagnostics)?;
    Some(Box::new(read))
}

/// A value as a graph file has it.
#[must_use]
pub fn inline_toml(value: &serde_json::Value) -> String {
    as_toml(value).map_or_else(String::new, |value| value.to_string())
}

/// Data as TOML has it, without its nulls.
#[must_use]
pub fn as_toml(json: &serde_json::Value) -> Option<toml::Value> {
    Some(match json {
        serde_json::Value::Null => return None,
        serde_json::Value::Bool(value) => toml::Value::Boolean(*value),
        serde_json::Value::Number(number) => match number.as_i64() {
            Some(integer) => toml::Value::Integer(integer),
            None => toml::Value::Float(number.as_f64()?),
        },
        serde_json::Value::String(text) => toml::Value::String(text.clone()),
        serde_json::Value::Array(list) => {
            toml::Value::Array(list.iter().filter_map(as_toml).collect())
        }
        serde_json::Value::Object(object) => toml::Value::Table(
            object
                .iter()
                .filter_map(|(key, value)| Some((key.clone(), as_toml(value)?)))
                .collect(),
        ),
    })
}

/// Makes a kind of node known: its parameters' type, its role, and the name that graph files use.
///
/// The type implements the role's trait, `Serialize`, `Deserialize` and `JsonSchema`; its doc comments become the
/// documentation of the kind.
#[macro_export]
macro_rules! register {
    ($spec:ty, Feature, $name:literal) => {
        $crate::register!(@ $spec, Feature, $name, <$spec as $crate::node::Feature>::ports);
    };
    ($spec:ty, Estimator, $name:literal) => { $crate::register!(@ $spec, Estimator, $name, || &[]); };
    ($spec:ty, Combiner, $name:literal) => { $crate::register!(@ $spec, Combiner, $name, || &[]); };
    (@ $spec:ty, $role:ident, $name:literal, $ports:expr) => {
        impl $crate::node::NodeSpec for $spec {
            fn role(&self) -> $crate::node::Role<'_> {
                $crate::node::Role::$role(self)
            }

            fn parameters(&self) -> $crate::__private::serde_json::Value {
                $crate::__private::serde_json::to_value(self).unwrap_or_default()
            }

            fn kind_name() -> &'static str {
                $name
            }
        }

        $crate::__private::list!(
            $crate::node::NodeKind,
            $name,
            $crate::__private::schema_of!($spec),
            $crate::node::NodeKind {
                role: $crate::node::RoleName::$role,
                inputs: <$spec as $crate::node::$role>::inputs,
                ports: $ports,
                facts: <$spec as $crate::node::$role>::facts,
                read: $crate::__private::read::<$spec>,
            }
        );
    };
    ($($other:tt)*) => {
        compile_error!(
            "expected the type of the parameters, the role and the name of the kind: \
             `register!(Mine, Feature, \"mine\")`; the roles are Feature, Estimator and Combiner"
        );
    };
}
