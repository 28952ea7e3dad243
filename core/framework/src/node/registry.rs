//! Decides how a kind becomes known and is looked up by name; not what kinds there are.

use std::collections::BTreeMap;
use std::fmt::Debug;
use std::sync::OnceLock;

use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{Combiner, Estimator, Feature, InputPort, PortSummary, Read};
use crate::diagnostic::{Diagnostics, Place, SourceId};
use crate::document::{Value, decode_beside};

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

/// A kind of node, as registered.
#[derive(Debug)]
pub struct Kind {
    /// What a graph file says as `type`.
    pub name: &'static str,
    /// Its role.
    pub role: RoleName,
    /// The crate that brings it.
    pub package: &'static str,
    /// The version of that crate.
    pub version: &'static str,
    /// The input ports.
    pub inputs: fn() -> &'static [InputPort],
    /// Of a feature, the output ports as it tells them: see [`Feature::ports`].
    pub ports: fn() -> &'static [PortSummary],
    /// Reads its parameters, or reports their mistakes. The keys are those of the node
    /// that are read elsewhere.
    pub read: fn(&Value, &[&str], &mut Diagnostics) -> ReadSpec,
    /// The JSON Schema of its parameters, with the documentation and the ranges that the compiler checks.
    pub schema: fn() -> &'static serde_json::Value,
}

impl Kind {
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

    /// Whom a mistake in its code is for.
    #[must_use]
    pub fn author(&self) -> String {
        format!(
            "the author of `{}`, from {} {}",
            self.name, self.package, self.version
        )
    }

    /// The first paragraph of the documentation.
    #[must_use]
    pub fn summary(&self) -> String {
        first_paragraph(&self.documentation())
    }

    /// The documentation of the parameters' struct.
    #[must_use]
    pub fn documentation(&self) -> String {
        let text = (self.schema)()["description"].as_str();
        text.unwrap_or_default().to_owned()
    }
}

inventory::collect!(Kind);

/// Reads parameters of one concrete type; [`register!`](crate::register) makes use of it.
#[doc(hidden)]
pub fn read<T: NodeSpec + DeserializeOwned + JsonSchema + 'static>(
    value: &Value,
    elsewhere: &[&str],
    diagnostics: &mut Diagnostics,
) -> ReadSpec {
    let advice = |key: &str| {
        let schema = serde_json::Value::from(schemars::schema_for!(T));
        let description = schema["properties"][key]["description"].as_str()?;
        Some(format!("add `{key}`: {}", first_paragraph(description)))
    };
    let read = decode_beside::<T>(value, "the node", elsewhere, &advice, diagnostics)?;
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

/// The first paragraph of a documentation, on one line.
#[must_use]
pub fn first_paragraph(documentation: &str) -> String {
    let paragraph = documentation.split("\n\n").next().unwrap_or_default();
    paragraph.replace('\n', " ")
}

/// All kinds linked into this program, by name; where two crates brought the same name, both.
pub fn kinds() -> &'static BTreeMap<&'static str, Vec<&'static Kind>> {
    static KINDS: OnceLock<BTreeMap<&'static str, Vec<&'static Kind>>> = OnceLock::new();
    KINDS.get_or_init(|| {
        let mut kinds = BTreeMap::<_, Vec<_>>::new();
        for kind in inventory::iter::<Kind> {
            kinds.entry(kind.name).or_default().push(kind);
        }
        for same in kinds.values_mut() {
            same.sort_by_key(|kind| kind.package);
        }
        kinds
    })
}

/// The kind of a name, if there is one.
#[must_use]
pub fn kind(name: &str) -> Option<&'static Kind> {
    kinds().get(name).and_then(|same| same.first().copied())
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

        $crate::inventory::submit! {
            $crate::node::Kind {
                name: $name,
                role: $crate::node::RoleName::$role,
                package: env!("CARGO_PKG_NAME"),
                version: env!("CARGO_PKG_VERSION"),
                inputs: <$spec as $crate::node::$role>::inputs,
                ports: $ports,
                read: $crate::__private::read::<$spec>,
                schema: || {
                    use $crate::__private::{schemars::schema_for, serde_json::Value};
                    static SCHEMA: std::sync::OnceLock<Value> = std::sync::OnceLock::new();
                    SCHEMA.get_or_init(|| schema_for!($spec).into())
                },
            }
        }
    };
    ($($other:tt)*) => {
        compile_error!(
            "expected the type of the parameters, the role and the name of the kind: \
             `register!(Difference, Feature, \"difference\")`; the roles are Feature, Estimator and Combiner"
        );
    };
}
