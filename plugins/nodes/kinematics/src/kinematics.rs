//! The node `kinematics`: the motions of links, as they are predicted, to that of a point.

use athermal_core::channel::{ABSENT, Channel};
use athermal_core::node::{
    Feature, InputPort, Inputs, Mistake, Operator, OutputPort, Outputs, PortSummary, Tick,
};
use athermal_core::quantity::Quantity;
use athermal_core::unit::Unit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::chain::{Chain, Freedom};

/// Carries the expansions of several axes or links to the displacement of a point, such as the tip of a tool.
///
/// The links are a chain: each stands on the end of the one before, the first on the origin. `links` has one for each
/// channel of `inputs.links`, in order. A length (nm) or a rate of it (nm/min) makes its link grow along `along`. An
/// angle (urad) or a rate of it (urad/min) turns the link at its beginning `about` an axis, with all that stands on it.
///
/// The point moves by `Σ z_i l_i + Σ z_i × (p − p_i) φ_i` and the end turns by `Σ z_i φ_i`, of the lengths `l_i` and
/// angles `φ_i`. `z_i` is the direction and `p_i` the beginning of a link, `p` the point (Siciliano, Sciavicco, Villani
/// and Oriolo 2009, equations 3.26 to 3.30). The port `displacement` has X, Y and Z of the point, which `optical_loss`
/// takes. The port `rotation` has A, B and C, by how much the end turns about X, Y and Z. The motions are small against
/// the lengths, so that they add up.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Kinematics {
    /// The links from the origin to the point, one for each input channel.
    #[schemars(length(min = 1))]
    pub links: Vec<Link>,
    /// Where the point lies from the end of the last link: `["10 mm", "0 mm", "-50 mm"]`; at that end without.
    #[serde(default)]
    pub point: Option<[Quantity; 3]>,
    /// The unit of the displacement; that of the first input that is a length, or a length per time.
    #[serde(default)]
    pub unit: Option<Unit>,
}

/// A link of a chain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Link {
    /// Its length, such as `"350 mm"`.
    pub length: Quantity,
    /// Its direction in X, Y and Z, of any length above 0: `[0, 0, 1]`. A length at the input makes it grow so.
    pub along: [f64; 3],
    /// The axis about which an angle at the input turns it.
    #[serde(default)]
    pub about: Option<[f64; 3]>,
}

/// What an input makes a link do, and by which factor it is one of m or rad, or of these per s.
struct Motion {
    turns: bool,
    is_rate: bool,
    factor: f64,
}

impl Motion {
    fn of(unit: &Unit) -> Option<Self> {
        let all = [
            ("m", false, false),
            ("m/s", false, true),
            ("rad", true, false),
            ("rad/s", true, true),
        ];
        all.iter().find_map(|&(base, turns, is_rate)| {
            let factor = unit.factor_to(&Unit::parse(base).ok()?)?;
            Some(Self {
                turns,
                is_rate,
                factor,
            })
        })
    }
}

/// A vector of length 1; none of what has no direction.
fn direction(of: [f64; 3]) -> Option<[f64; 3]> {
    let length = of.iter().map(|part| part * part).sum::<f64>().sqrt();
    (length > 0.0 && length.is_finite()).then(|| of.map(|part| part / length))
}

/// A length in m.
fn metres(length: &Quantity, at: &str) -> Result<f64, Mistake> {
    let metre = Unit::parse("m").unwrap_or_else(|_| Unit::one());
    length.in_unit(&metre).ok_or_else(|| {
        let message = format!("`{at}` is in {}, which is no length", length.unit);
        Mistake::at(at, message).help("give it as a length, such as \"350 mm\"")
    })
}

/// What follows from parameters and inputs.
struct Solved {
    /// For each of X, Y, Z, A, B, C the inputs that move it, each with its coefficient.
    rows: [Vec<(usize, f64)>; 6],
    displacement: Unit,
    rotation: Unit,
}

impl Kinematics {
    /// The vector of each link in m and how it moves, as far as the input says so.
    fn link(
        &self,
        nth: usize,
        motion: Option<&Motion>,
        mistakes: &mut Vec<Mistake>,
    ) -> Option<([f64; 3], Freedom)> {
        let link = self.links.get(nth)?;
        let at = |key: &str| format!("links.{nth}.{key}");
        let length = metres(&link.length, &at("length"));
        let along = direction(link.along).ok_or_else(|| {
            Mistake::at(at("along"), "a direction has a length above 0").help("as `[0, 0, 1]`")
        });
        let about = link.about.map(|about| {
            direction(about).ok_or_else(|| {
                Mistake::at(at("about"), "an axis has a length above 0").help("as `[0, 1, 0]`")
            })
        });
        let freedom = match (motion.is_some_and(|of| of.turns), about, &along) {
            (false, None, Ok(along)) => Ok(Freedom::Grows(*along)),
            (true, Some(about), _) => about.map(Freedom::Turns),
            (true, None, _) => Err(Mistake::at(
                at("about"),
                "its input is an angle, and nothing says about which axis it turns",
            )
            .help("give the axis, as `about = [0, 1, 0]`")),
            (false, Some(_), _) if motion.is_some() => Err(Mistake::at(
                at("about"),
                "its input is a length, which turns nothing",
            )
            .help("leave `about` out, or read an angle")),
            (false, ..) => Err(Mistake::at(at("along"), "a direction has a length above 0")),
        };
        let mut sound = |mistake: Mistake| {
            if !mistakes.iter().any(|known| known.at == mistake.at) {
                mistakes.push(mistake);
            }
        };
        match (length, along, freedom) {
            (Ok(length), Ok(along), Ok(freedom)) => {
                Some((along.map(|part| part * length), freedom))
            }
            (length, along, freedom) => {
                length.err().into_iter().for_each(&mut sound);
                along.err().into_iter().for_each(&mut sound);
                if motion.is_some() {
                    freedom.err().into_iter().for_each(&mut sound);
                }
                None
            }
        }
    }

    fn solved(&self, inputs: &[Channel]) -> Result<Solved, Vec<Mistake>> {
        let mut mistakes = Vec::new();
        if inputs.len() != self.links.len() {
            let message = format!(
                "there are {} `links` for {} channels",
                self.links.len(),
                inputs.len()
            );
            let help = "give one link for each channel of `inputs.links`, in their order";
            mistakes.push(Mistake::at("links", message).help(help));
        }
        let motions: Vec<_> = inputs.iter().map(|of| Motion::of(&of.unit)).collect();
        for (channel, motion) in inputs.iter().zip(&motions) {
            let found = &channel.unit;
            if motion.is_none() {
                let message = format!("`{}` is in {found}, which moves no link", channel.name);
                let help = "a length or an angle, or one of them per time, such as nm or urad/min";
                mistakes.push(Mistake::at("inputs.links", message).help(help));
            }
        }
        let (first, of_first) = (inputs.first(), motions.first().and_then(Option::as_ref));
        let is_rate = of_first.is_some_and(|of| of.is_rate);
        if let Some(first) = first {
            let others = inputs.iter().zip(&motions);
            for (channel, motion) in others {
                let differs = motion.as_ref().is_some_and(|of| of.is_rate != is_rate);
                if differs && of_first.is_some() {
                    let message = format!(
                        "`{}` is in {} and `{}` in {}: a motion and a rate do not add up",
                        first.name, first.unit, channel.name, channel.unit
                    );
                    mistakes.push(Mistake::at("inputs.links", message));
                } else if channel.span != first.span || channel.ahead != first.ahead {
                    let message = format!(
                        "`{}` and `{}` are of different times",
                        first.name, channel.name
                    );
                    mistakes.push(Mistake::at("inputs.links", message));
                }
            }
        }
        let unit = |rate: &str, still: &str| {
            let text = if is_rate { rate } else { still };
            Unit::parse(text).unwrap_or_else(|_| Unit::one())
        };
        let lengths = inputs.iter().zip(&motions);
        let mut lengths = lengths.filter(|(_, of)| of.as_ref().is_some_and(|of| !of.turns));
        let first_length = lengths.next().map(|(of, _)| of.unit.clone());
        let displacement = self.unit.clone().or(first_length);
        let displacement = displacement.unwrap_or_else(|| unit("nm/min", "nm"));
        let rotation = unit("urad/min", "urad");
        let to_displacement = unit("m/s", "m").factor_to(&displacement);
        let to_rotation = unit("rad/s", "rad").factor_to(&rotation);
        if to_displacement.is_none() && of_first.is_some() {
            let expected = if is_rate {
                "a length per time"
            } else {
                "a length"
            };
            let message = format!("`unit` is {displacement}, and a point moves by {expected}");
            mistakes.push(Mistake::at("unit", message));
        }
        let links = self.links.iter().enumerate();
        let links: Vec<_> = links
            .map(|(nth, _)| {
                let motion = motions.get(nth).and_then(Option::as_ref);
                self.link(nth, motion, &mut mistakes)
            })
            .collect();
        let mut point = [0.0; 3];
        for (nth, part) in self.point.iter().flatten().enumerate() {
            match metres(part, "point") {
                Ok(part) => point[nth] = part,
                Err(mistake) => mistakes.push(mistake),
            }
        }
        let whole: Option<Vec<_>> = links.into_iter().collect();
        let (Some(links), Some(to_displacement), Some(to_rotation), true) =
            (whole, to_displacement, to_rotation, mistakes.is_empty())
        else {
            return Err(mistakes);
        };
        let mut rows = [const { Vec::new() }; 6];
        let columns = Chain::new(&links, point).jacobian();
        for (nth, (column, motion)) in columns.iter().zip(motions.iter().flatten()).enumerate() {
            for (freedom, (row, moved)) in rows.iter_mut().zip(column).enumerate() {
                let to = if freedom < 3 {
                    to_displacement
                } else {
                    to_rotation
                };
                if *moved != 0.0 {
                    row.push((nth, moved * motion.factor * to));
                }
            }
        }
        Ok(Solved {
            rows,
            displacement,
            rotation,
        })
    }
}

impl Feature for Kinematics {
    fn inputs() -> &'static [InputPort] {
        const {
            &[InputPort::held(
                "links",
                "the expansion or angle of each link, or its rate",
            )]
        }
    }

    fn ports() -> &'static [PortSummary] {
        const {
            &[
                PortSummary::new("displacement", "how far the point moves along X, Y and Z"),
                PortSummary::new("rotation", "by how much the end turns about X, Y and Z"),
            ]
        }
    }

    fn outputs(&self, inputs: &Inputs) -> Result<Vec<OutputPort>, Vec<Mistake>> {
        let links = inputs.port("links");
        let solved = self.solved(links)?;
        let ages = links.iter().filter_map(|of| of.max_age).min();
        let port = |name: &'static str, unit: &Unit, names: [&str; 3]| OutputPort {
            name,
            channels: names
                .map(|name| Channel {
                    name: name.to_owned(),
                    unit: unit.clone(),
                    span: links.first().map(|of| of.span).unwrap_or_default(),
                    ahead: links.first().map(|of| of.ahead).unwrap_or_default(),
                    max_age: ages,
                })
                .into(),
        };
        Ok(vec![
            port("displacement", &solved.displacement, ["X", "Y", "Z"]),
            port("rotation", &solved.rotation, ["A", "B", "C"]),
        ])
    }

    fn build(&self, inputs: &Inputs, wanted: &[bool]) -> Box<dyn Operator> {
        let solved = self.solved(inputs.port("links"));
        let rows = solved.map_or_else(|_| Vec::new(), |solved| solved.rows.into());
        let is_wanted = |nth: usize| wanted.get(nth / 3).copied().unwrap_or(true);
        let rows = rows.into_iter().enumerate();
        Box::new(Moving {
            rows: rows.filter(|(nth, _)| is_wanted(*nth)).collect(),
        })
    }
}

struct Moving {
    /// By output, the inputs that move it with their coefficients.
    rows: Vec<(usize, Vec<(usize, f64)>)>,
}

impl Operator for Moving {
    fn step(&mut self, tick: &Tick<'_>, outputs: &mut Outputs<'_>) {
        let links = tick.port(0);
        for (nth, row) in &self.rows {
            let moved = row.iter().map(|&(link, by)| by * links[link]).sum::<f64>();
            // What no link moves stands still, and needs none of them.
            outputs.set(*nth, if moved.is_nan() { ABSENT } else { moved + 0.0 });
        }
    }

    fn segment(&mut self) {}
}

athermal_core::register!(Kinematics, Feature, "kinematics");
