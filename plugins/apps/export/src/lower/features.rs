//! Features: what runs on a controller of each kind, with its limits in the units of its channels.

use athermal_control::{
    Compensate, Health, OpticalLoss, SafeState, Settled, Stability, Uncorrected, UntilFirst,
    WhenLost, optical_loss,
};
use athermal_core::channel::Channel;
use athermal_core::compile::{PlannedNode, PlannedRole};
use athermal_core::engine::Engine;
use athermal_core::node::Inputs;
use athermal_core::quantity::Quantity;
use athermal_core::time::Duration;
use athermal_core::unit::Unit;
use athermal_features::slope::Cold;
use athermal_features::slope::kernel::{FEWEST_ROWS, MOST_ROWS};
use athermal_features::{FirstOrder, FirstOrderOutput, Lag, Slope};
use serde::de::DeserializeOwned;

use super::{Lowering, Refused, SPARE, cross_check, first, refuse, samples, ways};
use crate::form::{Field, Record};

/// Sums over a run of rows of each channel.
pub(super) const SUMS: usize = 5;
/// Of so many rows one has its sums kept.
pub(super) const EACH: usize = 8;

/// A feature as it is planned.
pub(super) struct Planned<'a> {
    node: &'a PlannedNode,
    pub(super) inputs: &'a Inputs,
    pub(super) gathers: &'a [usize],
    wanted: &'a [bool],
}

impl Planned<'_> {
    pub(super) fn record(&self, kind: &'static str) -> Record {
        Record::new(kind, self.node.instance())
    }

    pub(super) fn slot(&self) -> usize {
        first(&self.node.slots)
    }

    /// The channels of a port and where they are gathered.
    pub(super) fn port(&self, name: &str) -> (&[Channel], usize) {
        let mut ports = self.inputs.ports.iter().zip(self.gathers);
        let port = ports.find(|((port, _), _)| port.name == name);
        port.map_or((&[], 0), |((_, channels), &gather)| (channels, gather))
    }
}

/// The parameters of a node; the kind has been looked up, so that they are its own.
pub(super) fn parameters<T: DeserializeOwned>(node: &PlannedNode) -> Result<T, Refused> {
    serde_json::from_value(node.spec.parameters()).or_else(|error| {
        refuse(
            format!("its parameters are not those of this version: {error}"),
            "export it with the version that knows it",
        )
    })
}

/// What cannot be, since the graph was compiled: a unit that does not fit.
fn fits<T>(value: Option<T>) -> Result<T, Refused> {
    value.map_or_else(
        || refuse("a limit does not fit its unit", "check the graph"),
        Ok,
    )
}

impl Lowering<'_> {
    pub(super) fn feature(
        &mut self,
        engine: &Engine,
        node: &PlannedNode,
    ) -> Result<Record, Refused> {
        let PlannedRole::Feature {
            inputs,
            gathers,
            wanted,
            fit,
            ..
        } = &node.role
        else {
            return refuse("it is no feature", "report this");
        };
        let planned = Planned {
            node,
            inputs,
            gathers,
            wanted,
        };
        match (node.kind.package, node.kind.name) {
            ("athermal-control", "cross_check") => {
                let learned = cross_check::learned(engine, node)?;
                self.cross_check(&planned, &parameters(node)?, fit.as_ref(), learned)
            }
            _ if fit.is_some() => refuse(
                format!("a fitted `{}` cannot be exported", node.kind.name),
                "use slopes, lags or first-order lags as features",
            ),
            ("athermal-features", "slope") => self.slope(&planned, &parameters(node)?),
            ("athermal-features", "lag") => self.lag(&planned, &parameters(node)?),
            ("athermal-features", "first_order") => self.first_order(&planned, &parameters(node)?),
            ("athermal-features", "pick") => {
                let (channels, gather) = planned.port("signal");
                Ok(planned
                    .record("pick")
                    .int("gather", gather)
                    .int("slot", planned.slot())
                    .int("channels", channels.len()))
            }
            ("athermal-features", "sample_at") => {
                let (channels, signal) = planned.port("signal");
                Ok(planned
                    .record("sample_at")
                    .int("signal", signal)
                    .int("instants", planned.port("instants").1)
                    .int("slot", planned.slot())
                    .int("channels", channels.len()))
            }
            ("athermal-control", "health") => self.health(&planned, &parameters(node)?),
            ("athermal-control", "compensate") => self.compensate(&planned, &parameters(node)?),
            ("athermal-control", "stability") => self.stability(&planned, &parameters(node)?),
            ("athermal-control", "safe_state") => self.safe_state(&planned, &parameters(node)?),
            ("athermal-control", "uncorrected") => self.uncorrected(&planned, &parameters(node)?),
            ("athermal-control", "optical_loss") => loss(&planned, &parameters(node)?),
            ("athermal-control", "settled") => self.settled(&planned, &parameters(node)?),
            (package, kind) => refuse(
                format!("the kind `{kind}` of {package} cannot be exported"),
                ways::around(kind).unwrap_or(
                    "leave it out of what is exported, by a graph whose outputs do not need it, or run the graph with `athermal serve`",
                ),
            ),
        }
    }

    fn health(&mut self, of: &Planned<'_>, spec: &Health) -> Result<Record, Refused> {
        let (channels, signal) = of.port("signal");
        let infinite = f64::INFINITY;
        let mut limits = [const { Vec::new() }; 5];
        for channel in channels {
            let unit = &channel.unit;
            let per_second = unit.difference().per(&Unit::second());
            let point = |at: usize, none: f64| match &spec.range {
                Some(range) => fits(range[at].in_unit(unit)),
                None => Ok(none),
            };
            let size = |of: Option<&Quantity>, unit: &Unit, none: f64| {
                of.map_or(Ok(none), |of| fits(of.as_difference(unit)))
            };
            let own = [
                point(0, -infinite)?,
                point(1, infinite)?,
                size(spec.max_rate.as_ref(), &per_second, infinite)?,
                size(spec.noise_above.as_ref(), &unit.difference(), 0.0)?,
                size(spec.noise_below.as_ref(), &unit.difference(), infinite)?,
            ];
            limits
                .iter_mut()
                .zip(own)
                .for_each(|(of, own)| of.push(own));
        }
        let [lowest, highest, rate, quiet, noisy] = limits;
        let watched = spec.noise_above.is_some() || spec.noise_below.is_some();
        let kept = match watched {
            true => spec.noise_samples.clamp(3, 100_000) - 1,
            false => 0,
        };
        let time = |of: Option<Duration>| Field::Int(of.map_or(-1, Duration::as_ns));
        let pause = spec.stuck_after.into_iter().chain(spec.max_gap).min();
        let ints = self.ints(13 * channels.len());
        let reals = self.reals((1 + 2 * kept) * channels.len());
        Ok(of
            .record("health")
            .int("signal", signal)
            .int("slot", of.slot())
            .int("channels", channels.len())
            .reals("lowest", lowest)
            .reals("highest", highest)
            .reals("rate", rate)
            .reals("quiet", quiet)
            .reals("noisy", noisy)
            .with("stuck", time(spec.stuck_after))
            .with("gap", time(spec.max_gap))
            .with("pause", time(pause))
            .with("recover", Field::Int(spec.recover.as_ns()))
            .int("kept", kept)
            .int("ints", ints)
            .int("reals", reals))
    }

    fn slope(&mut self, of: &Planned<'_>, spec: &Slope) -> Result<Record, Refused> {
        for (port, name) in ["stderr", "value", "r2"].iter().enumerate() {
            if of.wanted.get(port + 1).copied().unwrap_or(false) {
                self.unread(of.node, name);
            }
        }
        let (channels, gather) = of.port("signal");
        let windows = spec.windows.lengths();
        let windows = windows.or_else(|mistake| refuse(mistake.message, "check the graph"))?;
        let widths: Vec<i64> = windows.iter().map(|window| window.as_ns().max(1)).collect();
        let spans = widths.iter().map(|&width| {
            // As the kernel has it.
            (spec.min_coverage * width as f64).ceil().max(1.0) as i64
        });
        let open = |&width: &i64| match spec.cold {
            Cold::Absent => width,
            Cold::Partial => 0,
        };
        let mut order: Vec<i64> = (0..widths.len() as i64).collect();
        order.sort_by_key(|&nth| widths[nth as usize]);
        let mut factors = Vec::new();
        for channel in channels {
            let unit = match &spec.unit {
                Some(unit) => unit.clone(),
                None => channel
                    .unit
                    .difference()
                    .per(&fits(Unit::parse("min").ok())?),
            };
            let per_second = channel.unit.difference().per(&Unit::second());
            let factor = fits(per_second.factor_to(&unit))?;
            factors.extend(std::iter::repeat_n(factor, widths.len()));
        }
        let longest = windows.iter().copied().max().unwrap_or_default();
        let period = self.periods.of_gather(self.plan, gather);
        let room = samples(longest, period, MOST_ROWS as usize);
        let blocks = room / FEWEST_ROWS as usize + 4;
        let count = channels.len();
        let ints = self.ints((5 + blocks + widths.len() + 3 * count).saturating_add(room));
        let reals = self.reals(room.saturating_add(1).saturating_mul(count));
        self.scratch(4 * SUMS * count + 6);
        Ok(of
            .record("slope")
            .int("gather", gather)
            .int("slot", of.slot())
            .int("channels", count)
            .int("windows", widths.len())
            .with("needed_span", Field::Longs(spans.collect()))
            .with(
                "needed_open",
                Field::Longs(widths.iter().map(open).collect()),
            )
            .with("width", Field::Longs(widths))
            .with("order", Field::Ints(order))
            .reals("factors", factors)
            .int("min_samples", spec.min_samples)
            .int("room", room)
            .int("blocks", blocks)
            .maybe("kept", None)
            .int("ints", ints)
            .int("reals", reals))
    }

    fn lag(&mut self, of: &Planned<'_>, spec: &Lag) -> Result<Record, Refused> {
        let (channels, gather) = of.port("signal");
        let lags: Vec<Duration> = spec.lags.iter().map(|shift| shift.0).collect();
        let longest = lags.iter().copied().max().unwrap_or_default();
        if lags.iter().any(|lag| lag.is_negative()) {
            return refuse("it looks ahead", "give lags from 0 on");
        }
        let first_history = self.histories.len();
        for nth in 0..channels.len() {
            let period = self.periods.slots[self.gathers[gather].entries[nth].slot];
            self.history(None, longest, period, true);
        }
        let age = |channel: &Channel| {
            let age = spec.max_age.or_else(|| channel.default_max_age());
            age.unwrap_or_default().as_ns()
        };
        Ok(of
            .record("lag")
            .int("gather", gather)
            .int("slot", of.slot())
            .int("channels", channels.len())
            .int("lags", lags.len())
            .with(
                "lag",
                Field::Longs(lags.iter().map(|lag| lag.as_ns()).collect()),
            )
            .with("max_age", Field::Longs(channels.iter().map(age).collect()))
            .int("first_history", first_history))
    }

    fn first_order(&mut self, of: &Planned<'_>, spec: &FirstOrder) -> Result<Record, Refused> {
        let (channels, gather) = of.port("signal");
        let constants = spec.time_constants.list();
        let constants = constants.or_else(|mistake| refuse(mistake.message, "check the graph"))?;
        let rates: Vec<f64> = constants
            .iter()
            .map(|constant| 1.0 / constant.secs())
            .collect();
        let count = channels.len();
        let ints = self.ints(2 * count);
        let reals = self.reals(count + count * rates.len());
        Ok(of
            .record("first_order")
            .int("gather", gather)
            .int("slot", of.slot())
            .int("channels", count)
            .int("bank", rates.len())
            .reals("rates", rates)
            .int(
                "difference",
                usize::from(spec.output == FirstOrderOutput::Difference),
            )
            .int("ints", ints)
            .int("reals", reals))
    }

    fn compensate(&mut self, of: &Planned<'_>, spec: &Compensate) -> Result<Record, Refused> {
        let (rates, rate) = of.port("rate");
        let (_, state) = of.port("state");
        let (_, realigned) = of.port("realigned");
        let unit = &spec.range.unit;
        let speed = unit.difference().per(&Unit::second());
        let size = |limit: &Quantity, unit: &Unit| fits(limit.as_difference(unit));
        let mut limits = Vec::new();
        for channel in rates {
            let stop = spec.stop.as_ref();
            let part = |of: Option<&Quantity>| of.map_or(Ok(0.0), |limit| size(limit, &speed));
            limits.push(
                Record::new("compensate_limits", &*channel.name)
                    .real("factor", fits(channel.unit.factor_to(&speed))?)
                    .real("range", size(&spec.range, unit)?)
                    .real("rate", size(&spec.max_rate, &speed)?)
                    .real("slew", size(&spec.max_slew, &speed)?)
                    .real("deadband", part(spec.deadband.as_ref())?)
                    .int("stops", usize::from(stop.is_some()))
                    .real("below", part(stop.map(|stop| &stop.below))?)
                    .real("above", part(stop.map(|stop| &stop.above))?),
            );
        }
        let mut stops = vec![0; 3];
        for state in &spec.stop_in {
            stops[state.number() as usize] = 1;
        }
        let count = rates.len();
        let ints = self.ints(2 + 2 * count);
        let reals = self.reals(3 * count);
        Ok(of
            .record("compensate")
            .int("rate", rate)
            .int("state", state)
            .int("realigned", realigned)
            .int("slot", of.slot())
            .int("channels", count)
            .with("limits", Field::Structs(limits))
            .with("stops", Field::Inline(stops))
            .with("max_gap", Field::Int(spec.max_gap.as_ns()))
            .int("ints", ints)
            .int("reals", reals))
    }

    fn stability(&mut self, of: &Planned<'_>, spec: &Stability) -> Result<Record, Refused> {
        let (drift, gather) = of.port("drift");
        let all = |limit: Option<&Quantity>| {
            let of_channel = |channel: &Channel| match limit {
                Some(limit) => fits(limit.as_difference(&channel.unit)),
                None => Ok(0.0),
            };
            drift.iter().map(of_channel).collect::<Result<Vec<_>, _>>()
        };
        let record = of
            .record("stability")
            .int("gather", gather)
            .int("slot", of.slot())
            .int("channels", drift.len())
            .reals("stable", all(Some(&spec.stable_below))?)
            .reals("transient", all(Some(&spec.transient_above))?)
            .reals("hysteresis", all(spec.hysteresis.as_ref())?)
            .with("dwell", Field::Int(spec.dwell.as_ns()));
        Ok(record.int("ints", self.ints(3 * drift.len())))
    }

    fn safe_state(&mut self, of: &Planned<'_>, spec: &SafeState) -> Result<Record, Refused> {
        let (signals, signal) = of.port("signal");
        let (_, distrust) = of.port("distrust");
        let (mut when_lost, mut slew) = (Vec::new(), Vec::new());
        for channel in signals {
            when_lost.push(match (spec.when_lost, &spec.value) {
                (WhenLost::Zero, _) => 0.0,
                (WhenLost::Value, Some(value)) => fits(value.in_unit(&channel.unit))?,
                (WhenLost::Hold | WhenLost::Value, _) => f64::NAN,
            });
            let speed = channel.unit.difference().per(&Unit::second());
            slew.push(fits(spec.max_slew.as_difference(&speed))?);
        }
        let count = signals.len();
        let ints = self.ints(2 + 3 * count);
        let reals = self.reals(count);
        Ok(of
            .record("safe_state")
            .int("signal", signal)
            .int("distrust", distrust)
            .int("slot", of.slot())
            .int("channels", count)
            .reals("when_lost", when_lost)
            .reals("slew", slew)
            .with("after", Field::Int(i64::from(spec.after)))
            .with("max_gap", Field::Int(spec.max_gap.as_ns()))
            .int("ints", ints)
            .int("reals", reals))
    }

    fn uncorrected(&mut self, of: &Planned<'_>, spec: &Uncorrected) -> Result<Record, Refused> {
        let (positions, position) = of.port("position");
        let (corrections, applied) = of.port("applied");
        if spec.differs.is_some() || of.wanted.get(1) == Some(&true) {
            return refuse(
                "what was commanded, and the port `reason`, of `uncorrected` cannot be exported"
                    .to_owned(),
                "leave `differs` and what reads `reason` out of the graph that is exported",
            );
        }
        if corrections.is_empty() {
            return refuse(
                "`uncorrected` without `applied` cannot be exported".to_owned(),
                "read the position itself in the graph that is exported",
            );
        }
        let mut factors = Vec::new();
        for (position, applied) in positions.iter().zip(corrections) {
            factors.push(fits(applied.unit.factor_to(&position.unit))?);
        }
        let ints = self.ints(factors.len());
        Ok(of
            .record("uncorrected")
            .int("position", position)
            .int("applied", applied)
            .int("slot", of.slot())
            .int("channels", factors.len())
            .reals("factors", factors)
            .int(
                "from_start",
                usize::from(spec.until_first == UntilFirst::Absent),
            )
            .int("ints", ints))
    }

    fn settled(&mut self, of: &Planned<'_>, spec: &Settled) -> Result<Record, Refused> {
        let ((losses, loss), (points, set_point)) = (of.port("loss"), of.port("set_point"));
        let one = |channels: &[Channel]| fits(channels.first().cloned());
        let below = fits(spec.below.as_difference(&one(losses)?.unit))?;
        let change = fits(spec.change.as_difference(&one(points)?.unit.difference()))?;
        let ints = self.ints(SPARE);
        let reals = self.reals(1);
        let time = |time: Duration| Field::Int(time.as_ns());
        Ok(of
            .record("settled")
            .int("loss", loss)
            .int("set_point", set_point)
            .int("slot", of.slot())
            .real("below", below)
            .real("change", change)
            .with("hold", time(spec.r#for))
            .with("same_change", time(spec.same_change))
            .with("max_gap", time(spec.max_gap))
            .int("ints", ints)
            .int("reals", reals))
    }
}

fn loss(of: &Planned<'_>, spec: &OpticalLoss) -> Result<Record, Refused> {
    let (drift, gather) = of.port("drift");
    let um = fits(Unit::parse("um").ok())?;
    let um_per_min = fits(Unit::parse("um/min").ok())?;
    let mut coefficients = Vec::new();
    for (nth, channel) in drift.iter().enumerate() {
        let factor = fits(channel.unit.factor_to(&um_per_min))?;
        let stated = spec.radii.as_ref();
        let stated = stated.and_then(|radii| radii.get(nth).or(radii.first()));
        let radius = match stated {
            Some(radius) => radius.as_difference(&um),
            None => spec
                .preset
                .and_then(|preset| preset.radius_um(&channel.name)),
        };
        let of_radius = optical_loss::coefficient(spec.over.secs() / 60.0, fits(radius)?);
        coefficients.push(of_radius * factor * factor);
    }
    Ok(of
        .record("loss")
        .int("gather", gather)
        .int("slot", of.slot())
        .int("channels", drift.len())
        .reals("coefficients", coefficients))
}
