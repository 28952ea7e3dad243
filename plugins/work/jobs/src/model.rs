//! Loading a model or a graph for a command.

use athermal_core::watch::Watch;
use std::path::Path;

use athermal_core::compile::{Outside, PlannedRole, Wanted};
use athermal_core::diagnostic::{Diagnostics, Sources, listed};
use athermal_core::node::Role;
use athermal_core::quantity::Quantity;
use athermal_run::model::Model;
use athermal_run::model::ModelError;

use athermal_core::failure::Failure;

/// What stands for the file of a model that is in memory.
pub const IN_MEMORY: &str = "model";

/// A model, or a graph with the fits of the model that it names. Warns of what is doubtful in a graph file.
///
/// # Errors
/// When it cannot be loaded.
pub fn load(path: &Path, wanted: Wanted, host: &dyn Watch) -> Result<Model, Failure> {
    let (mut sources, mut doubts) = (Sources::new(), Diagnostics::new());
    let model = Model::load_from(path, wanted, &mut sources, &mut doubts)?;
    host.doubts(&doubts, &sources);
    Ok(model)
}

/// A graph that is about to be fitted, or only compared: of a model that it names nothing is read.
///
/// # Errors
/// When it cannot be loaded.
pub fn load_to_fit(path: &Path, sources: &mut Sources, host: &dyn Watch) -> Result<Model, Failure> {
    let mut doubts = Diagnostics::new();
    let model = Model::load_to_fit(path, Wanted::default(), sources, &mut doubts)?;
    host.doubts(&doubts, sources);
    Ok(model)
}

/// A model in which everything that needs a fit has one.
///
/// # Errors
/// When it cannot be loaded, or is a graph that needs fitting.
pub fn load_fitted(path: &Path, wanted: Wanted, host: &dyn Watch) -> Result<Model, Failure> {
    let model = load(path, wanted, host)?;
    check_fitted(&model, path)?;
    Ok(model)
}

/// A model in memory for scores, in which everything that needs a fit has one.
///
/// # Errors
/// When it needs fitting, or cannot be compiled.
pub fn for_scores(model: &Model) -> Result<Model, Failure> {
    check_fitted(model, Path::new(IN_MEMORY))?;
    Ok(model.compiled_for(Wanted::SCORES)?)
}

/// Refuses a graph in which something needs fitting.
///
/// # Errors
/// When it is one.
pub fn check_fitted(model: &Model, path: &Path) -> Result<(), Failure> {
    let nodes = model.unfitted();
    if model.card.is_some() || nodes.is_empty() {
        return Ok(());
    }
    let path = path.to_owned();
    Err(ModelError::NotFitted { path, nodes }.into())
}

/// Warns of the nodes of a model whose fit failed.
pub fn warn_unfitted(host: &dyn Watch, model: &Model, path: &Path) {
    warn_nodes_unfitted(host, &model.unfitted(), path);
}

/// The same, of nodes that are known.
fn warn_nodes_unfitted(host: &dyn Watch, nodes: &[String], path: &Path) {
    if !nodes.is_empty() {
        host.warning(format_args!(
            "{}: {} could not be fitted and {} nothing",
            path.display(),
            few(nodes),
            if nodes.len() == 1 { "gives" } else { "give" },
        ));
    }
}

/// Warns of estimators that do not know where the edge of their fit is: what they predict outside stays as it is. These are fits of
/// before fits kept it, or on rows that do not say, and kinds that never know.
pub fn warn_without_novelty(host: &dyn Watch, model: &Model, path: &Path) {
    let (mut unknown, mut never) = (Vec::new(), Vec::new());
    for node in &model.plan.nodes {
        let (
            Role::Estimator(estimator),
            PlannedRole::Estimator {
                outside, novelty, ..
            },
        ) = (node.spec.role(), &node.role)
        else {
            continue;
        };
        let Some(fit) = model.fitted.get(&node.instance()) else {
            continue;
        };
        let row = vec![0.0; fit.uses().len()];
        if row.is_empty() {
            continue;
        }
        if !estimator.has_novelty() {
            never.push(format!("{} ({})", node.instance(), node.kind.name));
        } else if (novelty.is_some() || *outside != Outside::Pass) && fit.novelty(&row).is_nan() {
            unknown.push(node.instance());
        }
    }
    let of = |nodes: &[String], verbs: [&'static str; 2]| verbs[usize::from(nodes.len() > 1)];
    if !unknown.is_empty() {
        host.warning(format_args!(
            "{}: {} {} no `novelty`, since the fit kept no second moments of the regressors, so predictions outside of it pass as they are; \
             fit again, on more rows than regressors and with all of them in `--memory`",
            path.display(),
            few(&unknown),
            of(&unknown, ["has", "have"]),
        ));
    }
    if !never.is_empty() {
        host.note(format_args!(
            "{}: {} {} no `novelty`, since the kind has none, so predictions outside of the fit pass as they are; put a `guard` behind",
            path.display(),
            few(&never),
            of(&never, ["has", "have"]),
        ));
    }
}

/// Names, the first few of many.
pub fn few(names: &[String]) -> String {
    listed(names, 6)
}

/// Refuses a limit that truths cannot have.
///
/// # Errors
/// When a truth is in a unit that measures something else.
pub fn check_limit(limit: &Quantity, model: &Model) -> Result<(), Failure> {
    if limit.value <= 0.0 {
        return Err(Failure::Request(format!(
            "--abs-truth-below {limit}: no truth is below that; give a limit above 0, such as \"250 nm/min\""
        )));
    }
    let truths = model
        .plan
        .channels
        .iter()
        .filter_map(|channel| channel.predicts);
    for slot in truths {
        let truth = &model.plan.channels[slot];
        if limit.in_unit(&truth.channel.unit).is_none() {
            return Err(Failure::Request(format!(
                "--abs-truth-below is in {}, and `{}` is in {}",
                limit.unit, truth.name, truth.channel.unit
            )));
        }
    }
    Ok(())
}
