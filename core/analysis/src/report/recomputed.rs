//! Drift, light and settle times worked out again from positions.
//!
//! A graph of the framework's own nodes does it, so that they mean the same as anywhere. It has channel names of its own, since the
//! names of a user's channels may mean something else in it.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use athermal_core::compile::{Plan, Wanted, compile};
use athermal_core::diagnostic::{Diagnostics, Sources};
use athermal_core::document::{Memory, declare, load_text};
use athermal_core::engine::{Engine, EngineError, Fitted};
use serde_json::Value;

use super::ReportError;
use super::track::{Track, TrackRow};

/// Without the correction, and with it.
const WAYS: [&str; 2] = ["without", "with"];

/// What steps the positions of a recording.
pub(super) struct Recomputed {
    engine: Engine,
    samples: Vec<f64>,
    places: Places,
}

/// Of two ways, the first is without the correction; what is not worked out is nowhere.
type Place = [Option<usize>; 2];

/// Where the graph puts out what.
struct Places {
    /// Of each axis.
    drifts: Vec<Place>,
    losses: Vec<Losses<Place, Option<usize>>>,
}

/// What is known at a row.
pub(super) struct Now {
    /// The drift of each axis without and with the correction.
    pub(super) drifts: Vec<[f64; 2]>,
    pub(super) losses: Vec<LossNow>,
}

/// What is known of a loss at a row, without and with the correction; NaN for nothing.
pub(super) type LossNow = Losses<[f64; 2], f64>;

/// What is known of a loss, or where.
pub(super) struct Losses<Two, One> {
    /// The loss in dB.
    pub(super) loss: Two,
    /// The settle time in min where it has just come.
    pub(super) settled: Two,
    /// The minutes since a change that has not settled.
    pub(super) since: One,
}

impl Recomputed {
    /// # Errors
    /// When the graph does not compile, with the reason.
    pub(super) fn of(track: &Track) -> Result<Self, ReportError> {
        let (mut sources, mut diagnostics) = (Sources::new(), Diagnostics::new());
        let document = load_text(
            Path::new("recomputed.toml"),
            graph(track),
            &Memory::new(),
            &mut sources,
            &mut diagnostics,
        );
        let graph = document.and_then(|document| declare(document, &mut diagnostics));
        let plan = graph.and_then(|graph| compile(&graph, Wanted::default(), &mut diagnostics));
        // The user does not have this graph; the first line of the diagnostic has the reason.
        let plan = plan.ok_or_else(|| {
            let text = diagnostics.render(&sources, false, 100);
            text.lines().next().unwrap_or_default().to_owned()
        })?;
        Ok(Self {
            samples: Vec::with_capacity(plan.sources.len()),
            places: Places::of(&plan, track),
            engine: Engine::new(Arc::new(plan), &Fitted::new())?,
        })
    }

    /// Steps to a row.
    pub(super) fn step(&mut self, row: &TrackRow) -> Result<Now, EngineError> {
        self.samples.clear();
        self.samples.extend(&row.position);
        // A position that is not corrected is where it was.
        let corrections = row.correction.iter().copied().chain(std::iter::repeat(0.0));
        let corrected = row.position.iter().zip(corrections);
        self.samples.extend(corrected.map(|(of, by)| of + by));
        let set_points = row.set_points.iter();
        let known = self.places.losses.iter().map(|of| of.since.is_some());
        let known = set_points.zip(known).filter(|(_, known)| *known);
        self.samples.extend(known.map(|(set_point, _)| *set_point));
        let outputs = self.engine.step(row.at, &self.samples)?;
        let get = |place: Option<usize>| place.map_or(f64::NAN, |place| outputs[place]);
        let drifts = self.places.drifts.iter().map(|of| of.map(get)).collect();
        let losses = self.places.losses.iter().map(|of| Losses {
            loss: of.loss.map(get),
            settled: of.settled.map(get),
            since: get(of.since),
        });
        Ok(Now {
            drifts,
            losses: losses.collect(),
        })
    }

    /// Begins a segment.
    pub(super) fn segment(&mut self) {
        self.engine.segment();
    }
}

impl Places {
    fn of(plan: &Plan, track: &Track) -> Self {
        let place = |name: &str| {
            let mut outputs = plan.outputs.iter();
            outputs.position(|output| output.name.split('.').next() == Some(name))
        };
        let two = |what: &str, nth: usize| WAYS.map(|way| place(&format!("{what}_{way}_{nth}")));
        let axes = 0..track.axes.len();
        let losses = (0..track.losses.len()).map(|nth| Losses {
            loss: two("loss", nth),
            settled: two("settled", nth),
            since: place(&format!("since_{nth}")),
        });
        Self {
            drifts: axes.map(|nth| two("drift", nth)).collect(),
            losses: losses.collect(),
        }
    }
}

fn graph(track: &Track) -> String {
    let mut text = String::from("schema = 1\n");
    let mut outputs = String::new();
    for way in WAYS {
        for (nth, (name, unit)) in track.positions.iter().enumerate() {
            // What goes by the letter of an axis finds it, whatever other signs its name has.
            let axis = name.chars().next().filter(char::is_ascii_alphabetic);
            let axis = axis.unwrap_or('a');
            let _ = write!(
                text,
                "[signals.position_{way}_{nth}]\nunit = \"{unit}\"\nchannels = [\"{axis}{nth}\"]\nmax_age = \"10min\"\n"
            );
        }
        for (nth, drift) in track.drifts.iter().enumerate() {
            let _ = write!(
                text,
                "[nodes.drift_{way}_{nth}]\ntype = \"{}\"\ninputs.signal = \"position_{way}_{}\"\n",
                drift.kind, drift.position
            );
            parameters(&mut text, &drift.slope);
            let _ = writeln!(outputs, "drift_{way}_{nth} = \"drift_{way}_{nth}\"");
        }
    }
    for (nth, loss) in track.losses.iter().enumerate() {
        for way in WAYS {
            let drifts = loss.drifts.iter();
            let drifts: Vec<_> = drifts.map(|of| format!("\"drift_{way}_{of}\"")).collect();
            let _ = write!(
                text,
                "[nodes.loss_{way}_{nth}]\ntype = \"{}\"\ninputs.drift = [{}]\n",
                loss.kind,
                drifts.join(", ")
            );
            parameters(&mut text, &loss.parameters);
            let _ = writeln!(outputs, "loss_{way}_{nth} = \"loss_{way}_{nth}\"");
        }
        let Some(settled) = &loss.settled else {
            continue;
        };
        let _ = write!(
            text,
            "[signals.set_point_{nth}]\nunit = \"{}\"\nchannels = [\"set\"]\n",
            settled.set_point
        );
        for way in WAYS {
            let _ = write!(
                text,
                "[nodes.settled_{way}_{nth}]\ntype = \"{}\"\n\
                 inputs = {{ loss = \"loss_{way}_{nth}\", set_point = \"set_point_{nth}\" }}\n",
                settled.kind
            );
            parameters(&mut text, &settled.parameters);
            let _ = writeln!(outputs, "settled_{way}_{nth} = \"settled_{way}_{nth}\"");
        }
        let _ = writeln!(outputs, "since_{nth} = \"settled_without_{nth}:since\"");
    }
    text + "[outputs]\n" + &outputs
}

/// The parameters of a node as lines of TOML: texts, numbers and lists of them look the same in JSON.
fn parameters(text: &mut String, of: &Value) {
    let keys = of.as_object().into_iter().flatten();
    for (key, value) in keys.filter(|(_, value)| !value.is_null()) {
        let _ = writeln!(text, "{key} = {value}");
    }
}
