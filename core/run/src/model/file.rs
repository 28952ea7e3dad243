//! Decides how a model is read and written.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Read as _};
use std::path::Path;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::shared::shared;
use super::{Card, ModelError};
use crate::compile::{
    Change, Plan, PlanDiff, PlannedNode, RateError, Rates, Wanted, compile_part, diff,
};
use crate::diagnostic::{Diagnostics, Place, Sources};
use crate::document::{self, Disk, Document, GraphFile, Value};
use crate::engine::{Engine, Fitted, SampleRange, When, naming_one};
use crate::node::{Mistake, Predictor};
use crate::score::Levels;

/// The format that this version writes.
pub(super) const FORMAT: u64 = 1;

/// The most bytes that a model may have.
const LARGEST: u64 = 1_000_000_000;

/// A graph with what was fitted: all that is needed to run.
#[derive(Debug, Clone)]
pub struct Model {
    /// The graph as declared; models that were read of the same one share it.
    pub graph: Arc<GraphFile>,
    /// The graph as compiled.
    pub plan: Arc<Plan>,
    /// The fitted estimators.
    pub fitted: Fitted,
    /// Where it comes from; none for a plain graph.
    pub card: Option<Card>,
}

/// The file, as it is written.
#[derive(Serialize)]
struct Written<'a> {
    athermal_model: u64,
    card: &'a Option<Card>,
    graph: serde_json::Value,
    fitted: BTreeMap<&'a str, &'a dyn Predictor>,
}

/// The file, as it is read.
#[derive(Deserialize)]
struct ReadBack {
    card: Option<Card>,
    graph: serde_json::Value,
    /// Read once the graph is: where a node type is not known, the graph is what says so.
    fitted: BTreeMap<String, serde_json::Value>,
}

#[derive(Deserialize)]
struct Version {
    athermal_model: u64,
}

/// What was fitted, where it can be used as it is written.
fn sound(written: serde_json::Value) -> Result<Box<dyn Predictor>, Vec<Mistake>> {
    let predictor: Box<dyn Predictor> = serde_json::from_value(written)
        .map_err(|error| vec![Mistake::at("", error.to_string())])?;
    let mistakes = predictor.mistakes();
    if mistakes.is_empty() {
        Ok(predictor)
    } else {
        Err(mistakes)
    }
}

/// The text of a file that may be a model. Of what does not begin as one, such as a log, the beginning is enough to be refused:
/// its end may be far away.
fn text_of(path: &Path) -> io::Result<String> {
    let mut file = BufReader::new(File::open(path)?);
    let begins = file
        .fill_buf()?
        .iter()
        .find(|byte| !byte.is_ascii_whitespace());
    if begins.is_some_and(|byte| byte.is_ascii_graphic() && *byte != b'{') {
        let beginning = file.fill_buf()?;
        return Ok(String::from_utf8_lossy(beginning).into_owned());
    }
    let mut text = String::new();
    file.take(LARGEST + 1).read_to_string(&mut text)?;
    if text.len() as u64 > LARGEST {
        let large = format!("it has more than {} MB", LARGEST / 1_000_000);
        return Err(io::Error::other(large));
    }
    Ok(text)
}

fn is_graph(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension == "toml")
}

impl Model {
    /// Reads a model, or a graph file: with the fits of the model that it names (`model = "X.json"`), without any where it names none.
    ///
    /// # Errors
    /// When the file cannot be read or has mistakes.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, ModelError> {
        Self::load_for(path, Wanted::default())
    }

    /// Reads a model or graph, and compiles it so that it offers more than it reads itself.
    ///
    /// # Errors
    /// As [`Model::load`].
    pub fn load_for(path: impl AsRef<Path>, wanted: Wanted) -> Result<Self, ModelError> {
        Self::load_from(path, wanted, &mut Sources::new(), &mut Diagnostics::new())
    }

    /// The same, adding the files of a graph to `sources`: from there the tests of the graph can be declared
    /// (`athermal_trial::declare`) without reading it again. What is doubtful in a graph file, but no mistake, is
    /// added to `doubts`.
    ///
    /// # Errors
    /// As [`Model::load`].
    pub fn load_from(
        path: impl AsRef<Path>,
        wanted: Wanted,
        sources: &mut Sources,
        doubts: &mut Diagnostics,
    ) -> Result<Self, ModelError> {
        let path = path.as_ref();
        let model = Self::load_to_fit(path, wanted, sources, doubts)?;
        match is_graph(path) {
            true => model.with_named(path, wanted, sources, doubts),
            false => Ok(model),
        }
    }

    /// Reads a graph from its text, as if it stood at a path: with the fits of the model that it names, as far as it names one.
    ///
    /// # Errors
    /// As [`Model::load`].
    pub fn load_text(
        path: &Path,
        text: &str,
        sources: &mut Sources,
        doubts: &mut Diagnostics,
    ) -> Result<Self, ModelError> {
        let name = path.display().to_string();
        let model = Self::graph_of_text(&name, text, sources, doubts)?;
        model.with_named(path, Wanted::default(), sources, doubts)
    }

    fn with_named(
        mut self,
        path: &Path,
        wanted: Wanted,
        sources: &mut Sources,
        doubts: &mut Diagnostics,
    ) -> Result<Self, ModelError> {
        let mut diagnostics = Diagnostics::new();
        self.take_named(path, wanted, sources, &mut diagnostics);
        if diagnostics.has_errors() {
            return Err(ModelError::Graph {
                diagnostics: Box::new(diagnostics),
                sources: Box::new(std::mem::take(sources)),
            });
        }
        doubts.extend(diagnostics);
        Ok(self)
    }

    /// The same without the fits of a model that the graph names, as for one that is about to be fitted.
    ///
    /// # Errors
    /// As [`Model::load`], save those of the model that is named.
    pub fn load_to_fit(
        path: impl AsRef<Path>,
        wanted: Wanted,
        sources: &mut Sources,
        doubts: &mut Diagnostics,
    ) -> Result<Self, ModelError> {
        let path = path.as_ref();
        if is_graph(path) {
            Self::load_graph(path, wanted, sources, doubts)
        } else {
            Self::load_fitted(path, wanted)
        }
    }

    /// Reads a model, and no graph.
    pub(super) fn load_fitted(path: &Path, wanted: Wanted) -> Result<Self, ModelError> {
        let text = text_of(path).map_err(|source| ModelError::Unreadable {
            path: path.to_owned(),
            source,
        })?;
        Self::read(path, text, wanted)
    }

    /// Reads the text of a model; `name` stands for its path.
    ///
    /// # Errors
    /// As [`Model::load`].
    pub fn from_text(name: impl AsRef<Path>, text: String) -> Result<Self, ModelError> {
        Self::read(name.as_ref(), text, Wanted::default())
    }

    fn read(path: &Path, text: String, wanted: Wanted) -> Result<Self, ModelError> {
        let not_a_model = |source| ModelError::NotAModel {
            path: path.to_owned(),
            source,
        };
        let version = serde_json::from_str::<Version>(&text)
            .map_err(not_a_model)?
            .athermal_model;
        if version > FORMAT {
            return Err(ModelError::TooNew {
                path: path.to_owned(),
                version,
            });
        }
        let read: ReadBack = serde_json::from_str(&text).map_err(not_a_model)?;
        let (graph, plan) = shared(read.graph.to_string(), wanted, || {
            let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
            let source = sources.add(path.display().to_string(), text);
            // A model has no places worth pointing at: all of its graph stands at its beginning.
            let tree = Value::from_json(&read.graph, Place::new(source, 0, 0))
                .map_err(|error| not_a_model(serde::de::Error::custom(error)))?;
            let graph = document::declare(Document::new(source, tree), &mut diagnostics);
            let plan = graph
                .as_ref()
                .and_then(|graph| compile_part(graph, wanted, &mut diagnostics).ok());
            graph.zip(plan).ok_or_else(|| ModelError::Graph {
                diagnostics: Box::new(diagnostics),
                sources: Box::new(sources),
            })
        })?;
        let instances = plan.nodes.iter().map(PlannedNode::instance);
        let numbers: HashMap<_, _> = instances.zip(0..).collect();
        let (mut fitted, mut refused) = (Fitted::new(), Vec::new());
        for (node, written) in read.fitted {
            let read = match numbers.get(&node) {
                Some(&number) => naming_one(&plan, number, When::Start, || sound(written)),
                None => sound(written),
            };
            match read {
                Ok(predictor) => _ = fitted.insert(node, Arc::from(predictor)),
                Err(mistakes) => refused.push((node, mistakes)),
            }
        }
        if !refused.is_empty() {
            return Err(ModelError::Fits {
                path: path.to_owned(),
                refused,
            });
        }
        Ok(Self {
            graph,
            plan,
            fitted,
            card: read.card,
        })
    }

    /// The same model, compiled so that it offers more than it reads itself.
    ///
    /// # Errors
    /// As [`Model::load`].
    pub fn compiled_for(&self, wanted: Wanted) -> Result<Self, ModelError> {
        let mut diagnostics = Diagnostics::new();
        match compile_part(&self.graph, wanted, &mut diagnostics) {
            Ok(plan) => Ok(Self {
                plan: Arc::new(plan),
                ..self.clone()
            }),
            Err(_) => Err(ModelError::Graph {
                diagnostics: Box::new(diagnostics),
                sources: Box::default(),
            }),
        }
    }

    /// Reads a graph, which is to be fitted, from its text; `name` stands for its path, and what it extends is read from files.
    ///
    /// # Errors
    /// As [`Model::load`].
    pub fn graph_of_text(
        name: &str,
        text: &str,
        sources: &mut Sources,
        doubts: &mut Diagnostics,
    ) -> Result<Self, ModelError> {
        let mut diagnostics = Diagnostics::new();
        let read = document::load_text(name, text, &Disk, sources, &mut diagnostics);
        Self::declared(read, Wanted::default(), diagnostics, sources, doubts)
    }

    /// The same from a tree as JSON, such as that of a model.
    ///
    /// # Errors
    /// As [`Model::load`]; that the tree has a null stands in the text of [`ModelError::NotAModel`].
    pub fn graph_of_tree(
        name: &str,
        tree: &serde_json::Value,
        sources: &mut Sources,
        doubts: &mut Diagnostics,
    ) -> Result<Self, ModelError> {
        let source = sources.add(name, String::new());
        let tree = Value::from_json(tree, Place::new(source, 0, 0));
        let tree = tree.map_err(|error| ModelError::NotAModel {
            path: name.into(),
            source: serde::de::Error::custom(error),
        })?;
        let read = Some(Document::new(source, tree));
        Self::declared(read, Wanted::default(), Diagnostics::new(), sources, doubts)
    }

    fn load_graph(
        path: &Path,
        wanted: Wanted,
        sources: &mut Sources,
        doubts: &mut Diagnostics,
    ) -> Result<Self, ModelError> {
        let mut diagnostics = Diagnostics::new();
        let read = document::load(path, &Disk, sources, &mut diagnostics);
        Self::declared(read, wanted, diagnostics, sources, doubts)
    }

    /// The graph that was read, compiled; `diagnostics` are those of reading it.
    fn declared(
        read: Option<Document>,
        wanted: Wanted,
        mut diagnostics: Diagnostics,
        sources: &mut Sources,
        doubts: &mut Diagnostics,
    ) -> Result<Self, ModelError> {
        let graph = read.and_then(|read| document::declare(read, &mut diagnostics));
        let plan = graph
            .as_ref()
            .and_then(|graph| compile_part(graph, wanted, &mut diagnostics).ok());
        match (graph, plan) {
            (Some(graph), Some(plan)) if !diagnostics.has_errors() => {
                doubts.extend(diagnostics);
                Ok(Self {
                    graph: Arc::new(graph),
                    plan: Arc::new(plan),
                    fitted: Fitted::new(),
                    card: None,
                })
            }
            _ => Err(ModelError::Graph {
                diagnostics: Box::new(diagnostics),
                sources: Box::new(std::mem::take(sources)),
            }),
        }
    }

    /// Between which values the samples of each measured channel lay in the data of the fit, as far as the card knows.
    #[must_use]
    pub fn sample_ranges(&self) -> &[SampleRange] {
        self.card.as_ref().map_or(&[], |card| &card.ranges)
    }

    /// How often samples come: [as given](Rates::given), else as in the data of the fit, as far as the card knows.
    ///
    /// # Errors
    /// Where what was given is no time.
    pub fn rates(&self, given: &[String]) -> Result<(Rates, bool), RateError> {
        let names = self.plan.sources.iter().map(|source| &*source.name);
        let signals: Vec<&str> = names.filter_map(|name| name.split('.').next()).collect();
        let card = self.card.as_ref();
        let mut usual = card.map_or_else(BTreeMap::new, |card| card.rates.clone());
        usual.retain(|signal, _| signals.contains(&&**signal));
        Rates::given(given, Rates::of_data(&usual))
    }

    /// The means of levels over the fit, as far as the card knows.
    #[must_use]
    pub fn levels(&self) -> Levels {
        let card = self.card.as_ref();
        card.map_or_else(Levels::new, |card| card.levels.clone())
    }

    /// The nodes that need a fit and have none.
    #[must_use]
    pub fn unfitted(&self) -> Vec<String> {
        let needs = |node: &&PlannedNode| {
            node.rows().is_some() && !self.fitted.contains_key(&node.instance())
        };
        self.plan
            .nodes
            .iter()
            .filter(needs)
            .map(PlannedNode::instance)
            .collect()
    }

    /// Takes from another model the fits of estimators that mean the same in both. Gives those among them that read, over however
    /// many nodes, what is now made in another way than it was for the fit.
    pub fn take_fits_of(&mut self, other: &Self) -> Vec<String> {
        self.take_fits_unless(other, &diff(&other.plan, &self.plan))
    }

    /// The same, where it is known what differs between the other and this one.
    pub(super) fn take_fits_unless(&mut self, other: &Self, diff: &PlanDiff) -> Vec<String> {
        let changed = |index: usize| {
            let change = diff.node(&self.plan.nodes[index].instance());
            change.is_some_and(|change| *change != Change::Unchanged)
        };
        let mut doubtful = Vec::new();
        for node in &self.plan.nodes {
            let instance = node.instance();
            let Some(fit) = other.fitted.get(&instance) else {
                continue;
            };
            let is_same = diff.node(&instance) == Some(&Change::Unchanged);
            if !is_same || self.fitted.contains_key(&instance) {
                continue;
            }
            self.fitted.insert(instance.clone(), Arc::clone(fit));
            let behind = self.plan.behind(node.slots.clone());
            let mut slots = (0..self.plan.channels.len()).filter(|&slot| behind[slot]);
            if slots.any(|slot| self.plan.channels[slot].node.is_some_and(changed)) {
                doubtful.push(instance);
            }
        }
        doubtful
    }

    /// An engine that runs the model, cold.
    ///
    /// # Errors
    /// When what was fitted does not belong to the graph.
    pub fn engine(&self) -> Result<Engine, ModelError> {
        Ok(Engine::new(Arc::clone(&self.plan), &self.fitted)?)
    }

    /// The revision of a model that can be run.
    #[must_use]
    pub fn revision(&self) -> Option<String> {
        Some(self.engine().ok()?.revision().to_owned())
    }

    /// The model as text: JSON, readable and the same for the same model.
    ///
    /// # Errors
    /// When something fitted cannot be written.
    pub fn to_text(&self) -> Result<String, serde_json::Error> {
        let fitted = self
            .fitted
            .iter()
            .map(|(node, predictor)| (node.as_str(), &**predictor))
            .collect();
        let written = Written {
            athermal_model: FORMAT,
            card: &self.card,
            graph: Value::to_json(&self.graph.tree),
            fitted,
        };
        serde_json::to_string_pretty(&written).map(|text| text + "\n")
    }
}
