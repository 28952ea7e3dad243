//! What is known of a service: each fact is declared once, and JSON, `status`, metrics, the description of the control interface and the
//! guide read that.

mod declare;
mod reasons;
mod service;
mod words;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::LazyLock;

use athermal_run::live::Report;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Serialize, Serializer};
use serde_json::{Value, json};

pub use declare::{Declared, Fact, Known, Labels, Metrics, Words};
pub use reasons::Reasons;
pub use service::{
    CardFacts, ChannelFacts, ChannelsFacts, ErrorFacts, EventFacts, FaultFacts, HeldFacts,
    JournalFacts, LearnerFacts, Look, NoOutputFacts, NodeFacts, NodesFacts, OutputFacts,
    OutputsFacts, OutsideFitFacts, SinkFacts, SourceFacts, StagedFacts, State, StatusFacts,
    TickFacts, TicksFacts, WarningFacts, WatchedFacts,
};

use crate::service::{Service, event_kinds};

/// How many events there were since the start, by their names.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Counts(pub(crate) BTreeMap<&'static str, u64>);

impl Known for Counts {
    fn measure(&self, labels: &Labels, metrics: &mut Metrics) {
        let help = "What happened since the start, by event.";
        for (event, count) in &self.0 {
            let mut labels = labels.clone();
            labels.push(("event", (*event).to_owned()));
            let name = ("athermal_events_total", "counter");
            metrics.put(name, help, &labels, Some(*count as f64));
        }
        let mut own = BTreeMap::<_, (_, u64)>::new();
        for kind in event_kinds() {
            if let Some((metric, help)) = kind.counter {
                own.entry(metric).or_insert((help, 0)).1 +=
                    self.0.get(kind.name).copied().unwrap_or(0);
            }
        }
        for (metric, (help, count)) in own {
            metrics.put((metric, "counter"), help, labels, Some(count as f64));
        }
    }
}

/// Facts that a companion knows, whatever they are.
pub trait SectionFacts: Known + Send {
    /// They as JSON.
    fn json(&self) -> Value;
}

impl<T: Known + Send + Serialize> SectionFacts for T {
    fn json(&self) -> Value {
        json!(self)
    }
}

/// Facts of companions, as registered.
#[derive(Debug)]
pub struct SectionKind {
    /// The name of the section.
    pub name: &'static str,
    /// What is declared of them.
    pub declared: fn() -> Option<&'static Declared>,
    /// Their JSON Schema.
    pub schema: fn(&mut SchemaGenerator) -> Schema,
}

inventory::collect!(SectionKind);

/// Makes facts known that a companion gives by [`Service::contribute`](crate::service::Service::contribute): their type, which
/// [`facts!`](crate::facts!) has declared, and the name of their section in a status.
#[macro_export]
macro_rules! register_facts {
    ($facts:ty, $section:literal) => {
        $crate::__private::inventory::submit! {
            $crate::facts::SectionKind {
                name: $section,
                declared: <$facts as $crate::facts::Known>::declared,
                schema: |of| of.subschema_for::<$facts>(),
            }
        }
    };
}

fn section_kinds() -> Vec<&'static SectionKind> {
    let mut kinds: Vec<_> = inventory::iter::<SectionKind>.into_iter().collect();
    kinds.sort_by_key(|of| of.name);
    kinds
}

/// What companions know, each in a section of its own.
#[derive(Debug)]
pub struct Sections(pub(crate) Vec<(&'static str, Box<dyn SectionFacts>)>);

impl Serialize for Sections {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, of)| (name, of.json())))
    }
}

impl JsonSchema for Sections {
    fn schema_name() -> Cow<'static, str> {
        "Sections".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let sections = section_kinds().into_iter();
        let sections = sections.map(|of| (of.name.to_owned(), (of.schema)(generator).into()));
        let properties: serde_json::Map<_, _> = sections.collect();
        schemars::json_schema!({ "type": "object", "properties": properties })
    }
}

impl Known for Sections {
    fn declared() -> Option<&'static Declared> {
        static DECLARED: LazyLock<Declared> = LazyLock::new(|| {
            let sections = section_kinds().into_iter();
            let facts = sections.map(|of| Fact {
                key: of.name,
                help: (of.declared)().map_or("", |of| of.help),
                metric: None,
                words: None,
                below: of.declared,
            });
            Declared {
                help: "What companions know.",
                head: "",
                facts: Vec::leak(facts.collect()),
            }
        });
        Some(&DECLARED)
    }

    fn measure(&self, labels: &Labels, metrics: &mut Metrics) {
        self.0
            .iter()
            .for_each(|(_, of)| of.measure(labels, metrics));
    }
}

/// All metrics of a service.
#[must_use]
pub fn metrics(service: &Service) -> Metrics {
    let look = Look::at(service);
    let (labels, mut metrics) = (
        vec![("machine", service.name().to_owned())],
        Metrics::default(),
    );
    StatusFacts::read(&look).measure(&labels, &mut metrics);
    ChannelsFacts::read(&look).measure(&labels, &mut metrics);
    NodesFacts::read(&look).measure(&labels, &mut metrics);
    metrics
}

/// All facts of a service with the paths of their keys, by where they are asked for.
fn all() -> Vec<(&'static str, String, &'static Fact)> {
    let of = [
        ("status", StatusFacts::declared()),
        ("channels", ChannelsFacts::declared()),
        ("outputs", OutputsFacts::declared()),
        ("ticks", TicksFacts::declared()),
        ("nodes", NodesFacts::declared()),
    ];
    let facts = of.into_iter().flat_map(|(of, declared)| {
        let all = declared.map_or_else(Vec::new, |of| of.all(""));
        all.into_iter().map(move |(path, fact)| (of, path, fact))
    });
    facts.collect()
}

/// The names of all metrics.
#[must_use]
pub fn metric_names() -> Vec<&'static str> {
    let facts = all().into_iter().filter_map(|(.., of)| Some(of.metric?.0));
    facts
        .chain(event_kinds().filter_map(|of| Some(of.counter?.0)))
        .collect()
}

/// What is declared, as tables of the guide.
#[must_use]
pub fn guide() -> String {
    let code = |of: &str| {
        if of.is_empty() {
            String::new()
        } else {
            format!("`{of}`")
        }
    };
    let mut text = "| key | metric | kind | what it is |\n|---|---|---|---|\n".to_owned();
    for (of, path, fact) in all() {
        let (metric, kind) = fact.metric.unwrap_or_default();
        let (metric, help) = (code(metric), fact.help.trim());
        text += &format!("| `/v1/{of}`: `{path}` | {metric} | {kind} | {help} |\n");
    }
    let of_runs = Report::KINDS.iter().collect::<Vec<_>>();
    for (what, all) in [
        ("event", event_kinds().collect()),
        ("event of a run", of_runs),
    ] {
        text += &format!(
            "\n| {what} | how grave | facts | counted by | what it is |\n|---|---|---|---|---|\n"
        );
        for of in all {
            let facts: Vec<_> = of.facts.iter().map(|(key, _)| code(key)).collect();
            let counter = code(of.counter.map_or("", |(name, _)| name));
            let (name, level, facts, help) = (of.name, of.level, facts.join(", "), of.help.trim());
            text += &format!("| `{name}` | {level} | {facts} | {counter} | {help} |\n");
        }
    }
    text
}
