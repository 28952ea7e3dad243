//! How a fact is declared, once: its key and type, what it is, where it is read, its metric, and its words.

use std::fmt::{Debug, Write as _};

use indexmap::IndexMap;
use serde_json::Value;

use crate::engine::NodeCarry;

/// A fact, as it is declared.
#[derive(Debug)]
pub struct Fact {
    /// Its key in JSON.
    pub key: &'static str,
    /// What it is.
    pub help: &'static str,
    /// Its metric, and of what kind that is.
    pub metric: Option<(&'static str, &'static str)>,
    /// What is said of it for people.
    pub words: Option<Words>,
    /// The facts that stand in it, or in each of its items.
    pub below: fn() -> Option<&'static Declared>,
}

/// What is said of a fact for people.
#[derive(Debug)]
pub enum Words {
    /// A part of the line of what it is of: `{key}` stands for a value, and what ends in `_s` is in s.
    Part(&'static str),
    /// A line of its own, where there is something: it is neither absent, nor 0, `false` or empty.
    Line(&'static str),
    /// A part that is made of all that stands beside it.
    More(fn(&Value) -> Option<String>),
    /// Lines that are made so.
    Made(fn(&Value) -> Option<String>),
}

/// The facts of one thing.
#[derive(Debug)]
pub struct Declared {
    /// What they are of.
    pub help: &'static str,
    /// How the line of one begins.
    pub head: &'static str,
    /// The facts, in their order.
    pub facts: &'static [Fact],
}

/// What a metric is of: names and values.
pub type Labels = Vec<(&'static str, String)>;

/// A value that is known.
pub trait Known: Debug {
    /// The facts in it; none of a plain value.
    #[must_use]
    fn declared() -> Option<&'static Declared>
    where
        Self: Sized,
    {
        None
    }

    /// It as a number; none where it is absent, and of what is none.
    fn number(&self) -> Option<f64> {
        None
    }

    /// It as the value of a label; none where it is absent.
    fn label(&self) -> Option<String> {
        None
    }

    /// Gives all metrics in it.
    fn measure(&self, labels: &Labels, metrics: &mut Metrics) {
        let _ = (labels, metrics);
    }
}

macro_rules! numbers {
    ($($of:ty),*) => {
        $(impl Known for $of {
            fn number(&self) -> Option<f64> {
                Some(*self as f64)
            }
        })*
    };
}

numbers!(u64, usize, f64);

impl Known for bool {
    fn number(&self) -> Option<f64> {
        Some(f64::from(u8::from(*self)))
    }
}

impl Known for String {
    fn label(&self) -> Option<String> {
        Some(self.clone())
    }
}

impl Known for &'static str {
    fn label(&self) -> Option<String> {
        Some((*self).to_owned())
    }
}

impl Known for Value {}
impl Known for NodeCarry {}

impl<T: Known> Known for Option<T> {
    fn declared() -> Option<&'static Declared> {
        T::declared()
    }

    fn number(&self) -> Option<f64> {
        self.as_ref()?.number()
    }

    fn label(&self) -> Option<String> {
        self.as_ref()?.label()
    }

    fn measure(&self, labels: &Labels, metrics: &mut Metrics) {
        self.iter().for_each(|of| of.measure(labels, metrics));
    }
}

impl<T: Known> Known for Vec<T> {
    fn declared() -> Option<&'static Declared> {
        T::declared()
    }

    fn number(&self) -> Option<f64> {
        Some(self.len() as f64)
    }

    fn measure(&self, labels: &Labels, metrics: &mut Metrics) {
        self.iter().for_each(|of| of.measure(labels, metrics));
    }
}

/// Metrics in the text format of Prometheus, family by family.
#[derive(Debug, Default)]
pub struct Metrics(IndexMap<&'static str, String>);

impl Metrics {
    /// What it is called.
    pub const CONTENT_TYPE: &'static str = "text/plain; version=0.0.4; charset=utf-8";

    /// A value of a metric; what is absent has no line.
    pub fn put(
        &mut self,
        (name, kind): (&'static str, &str),
        help: &str,
        labels: &Labels,
        value: Option<f64>,
    ) {
        let Some(value) = value.filter(|value| !value.is_nan()) else {
            return;
        };
        let family = self
            .0
            .entry(name)
            .or_insert_with(|| format!("# HELP {name} {}\n# TYPE {name} {kind}\n", help.trim()));
        let labels = labels.iter().map(|(label, of)| {
            let of = of.replace('\\', "\\\\").replace('"', "\\\"");
            format!("{label}=\"{}\"", of.replace('\n', "\\n"))
        });
        let labels: Vec<_> = labels.collect();
        let value = match value {
            f64::INFINITY => "+Inf".to_owned(),
            f64::NEG_INFINITY => "-Inf".to_owned(),
            value => value.to_string(),
        };
        let _ = writeln!(family, "{name}{{{}}} {value}", labels.join(","));
    }

    /// The whole text.
    #[must_use]
    pub fn text(&self) -> String {
        self.0.values().map(String::as_str).collect()
    }
}

/// Declares facts: `Name["head"](what they are read from) { /// What it is` `key: type [how …] = where it is read; }`.
///
/// | how | |
/// |---|---|
/// | `[counter "name"]`, `[gauge "name"]` | a metric of its number; a gauge of another one with a closure behind the name |
/// | `[info "name"]` | a metric that is 1 and has it as a label |
/// | `[label]` | what the metrics beside it and below it are of |
/// | `[apart]` | the metrics below it are not of these labels |
/// | `[part "words {key}"]`, `[line "words {key}"]`, `[more function]`, `[made function]` | its [`Words`](crate::facts::Words) |
///
/// It makes the struct, `read`, which makes one, and its [`Known`](crate::facts::Known). A crate that declares facts has `serde` and
/// `schemars` among its dependencies.
#[macro_export]
macro_rules! facts {
    (@metric) => { None };
    (@metric [counter $name:literal] $($more:tt)*) => { Some(($name, "counter")) };
    (@metric [gauge $name:literal $($by:expr)?] $($more:tt)*) => { Some(($name, "gauge")) };
    (@metric [info $name:literal] $($more:tt)*) => { Some(($name, "gauge")) };
    (@metric [$($other:tt)*] $($more:tt)*) => { $crate::facts!(@metric $($more)*) };
    (@words) => { None };
    (@words [part $words:literal] $($more:tt)*) => { Some($crate::facts::Words::Part($words)) };
    (@words [line $words:literal] $($more:tt)*) => { Some($crate::facts::Words::Line($words)) };
    (@words [more $words:expr] $($more:tt)*) => { Some($crate::facts::Words::More($words)) };
    (@words [made $words:expr] $($more:tt)*) => { Some($crate::facts::Words::Made($words)) };
    (@words [$($other:tt)*] $($more:tt)*) => { $crate::facts!(@words $($more)*) };
    (@label $labels:ident $key:expr, $value:expr;) => {};
    (@label $labels:ident $key:expr, $value:expr; [label] $($more:tt)*) => {
        $labels.extend($crate::facts::Known::label($value).map(|of| ($key, of)));
    };
    (@label $labels:ident $key:expr, $value:expr; [$($other:tt)*] $($more:tt)*) => {
        $crate::facts!(@label $labels $key, $value; $($more)*);
    };
    (@put $of:ident $labels:ident $metrics:ident $key:expr, $help:expr, $value:expr;) => {};
    (@put $of:ident $labels:ident $metrics:ident $key:expr, $help:expr, $value:expr; [counter $name:literal] $($more:tt)*) => {
        $metrics.put(($name, "counter"), $help, &$labels, $crate::facts::Known::number($value));
    };
    (@put $of:ident $labels:ident $metrics:ident $key:expr, $help:expr, $value:expr; [gauge $name:literal] $($more:tt)*) => {
        $metrics.put(($name, "gauge"), $help, &$labels, $crate::facts::Known::number($value));
    };
    (@put $of:ident $labels:ident $metrics:ident $key:expr, $help:expr, $value:expr; [gauge $name:literal $by:expr] $($more:tt)*) => {
        $metrics.put(($name, "gauge"), $help, &$labels, ($by)($of));
    };
    (@put $of:ident $labels:ident $metrics:ident $key:expr, $help:expr, $value:expr; [info $name:literal] $($more:tt)*) => {
        if let Some(label) = $crate::facts::Known::label($value) {
            let mut labels = $labels.clone();
            labels.push(($key, label));
            $metrics.put(($name, "gauge"), $help, &labels, Some(1.0));
        }
    };
    (@put $of:ident $labels:ident $metrics:ident $key:expr, $help:expr, $value:expr; [$($other:tt)*] $($more:tt)*) => {
        $crate::facts!(@put $of $labels $metrics $key, $help, $value; $($more)*);
    };
    (@below $labels:ident) => { &$labels };
    (@below $labels:ident [apart] $($more:tt)*) => { &$labels[..$labels.len().min(1)].to_vec() };
    (@below $labels:ident [$($other:tt)*] $($more:tt)*) => { $crate::facts!(@below $labels $($more)*) };
    ($(
        $(#[doc = $about:literal])+
        $name:ident $([$head:literal])? ($($from:ident: $from_of:ty),*) {$(
            $(#[doc = $help:literal])+
            $(#[serde($($serde:tt)*)])?
            $key:ident: $of:ty $([$($how:tt)*])* = $read:expr;
        )*}
    )*) => {$(
        $(#[doc = $about])+
        #[derive(Debug, serde::Serialize, schemars::JsonSchema)]
        pub struct $name {$(
            $(#[doc = $help])+
            $(#[serde($($serde)*)])?
            pub $key: $of,
        )*}

        impl $name {
            /// As it is now.
            #[must_use]
            pub fn read($($from: $from_of),*) -> Self {
                // What is locked for one is free again for the next.
                Self { $($key: { $read },)* }
            }
        }

        impl $crate::facts::Known for $name {
            fn declared() -> Option<&'static $crate::facts::Declared> {
                const DECLARED: $crate::facts::Declared = $crate::facts::Declared {
                    help: concat!($($about),+),
                    head: concat!($($head)?),
                    facts: &[$($crate::facts::Fact {
                        key: stringify!($key),
                        help: concat!($($help),+),
                        metric: $crate::facts!(@metric $([$($how)*])*),
                        words: $crate::facts!(@words $([$($how)*])*),
                        below: <$of as $crate::facts::Known>::declared,
                    },)*],
                };
                Some(&DECLARED)
            }

            #[allow(unused_variables, unused_mut, clippy::redundant_closure_call)]
            fn measure(&self, labels: &$crate::facts::Labels, metrics: &mut $crate::facts::Metrics) {
                let (of, mut labels) = (self, labels.clone());
                $($crate::facts!(@label labels stringify!($key), &self.$key; $([$($how)*])*);)*
                $(
                    $crate::facts!(@put of labels metrics stringify!($key), concat!($($help),+), &self.$key; $([$($how)*])*);
                    let below = $crate::facts!(@below labels $([$($how)*])*);
                    $crate::facts::Known::measure(&self.$key, below, metrics);
                )*
            }
        }
    )*};
}

/// A value as words have it.
fn shown(key: &str, value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Null => "none".to_owned(),
        Value::Number(of) if key.ends_with("_s") => {
            format!("{:.1} s", of.as_f64().unwrap_or(f64::NAN))
        }
        other => other.to_string(),
    }
}

/// Words with the values that they name.
fn filled(words: &str, of: &Value) -> String {
    let mut text = String::new();
    let mut rest = words;
    while let Some((before, after)) = rest.split_once('{') {
        let (key, after) = after.split_once('}').unwrap_or((after, ""));
        let value = key.split('.').fold(of, |of, key| &of[key]);
        text += before;
        text += &shown(key, value);
        rest = after;
    }
    text + rest
}

/// Whether there is something to be said.
fn is_some(value: &Value) -> bool {
    match value {
        Value::Null | Value::Bool(false) => false,
        Value::Number(of) => of.as_f64() != Some(0.0),
        Value::String(of) => !of.is_empty(),
        Value::Array(of) => !of.is_empty(),
        Value::Object(of) => !of.is_empty(),
        Value::Bool(true) => true,
    }
}

impl Declared {
    /// The facts in words, line by line, as JSON has them: of this program or another release.
    #[must_use]
    pub fn words(&self, of: &Value) -> String {
        let (mut parts, mut lines) = (Vec::new(), String::new());
        for fact in self.facts {
            let value = &of[fact.key];
            match fact.words {
                Some(Words::Part(words)) => parts.push(filled(words, of)),
                Some(Words::Line(words)) if is_some(value) => {
                    lines += &(filled(words, of) + "\n");
                }
                Some(Words::More(make)) => parts.extend(make(of)),
                Some(Words::Made(make)) => lines.extend(make(of).map(|of| of + "\n")),
                _ => {}
            }
            if let Some(below) = (fact.below)() {
                let items = value
                    .as_array()
                    .map_or(std::slice::from_ref(value), Vec::as_slice);
                let items = items.iter().filter(|of| of.is_object());
                lines.extend(items.map(|of| below.words(of)));
            }
        }
        let head = filled(self.head, of) + &parts.join(", ");
        match head.is_empty() {
            true => lines,
            false => head + "\n" + &lines,
        }
    }

    /// All facts, with the paths of their keys: those in others behind them.
    #[must_use]
    pub fn all(&self, above: &str) -> Vec<(String, &'static Fact)> {
        let all = self.facts.iter().flat_map(|fact| {
            let path = format!("{above}{}", fact.key);
            let below = (fact.below)().map(|of| of.all(&format!("{path}.")));
            std::iter::once((path, fact)).chain(below.unwrap_or_default())
        });
        all.collect()
    }
}
