//! The machine `die-tester`: two fibre holders on six axes about a chip on a heated chuck. Decides its bodies and how they hang together.

use crate::bar::{ALUMINIUM, Bar, STAINLESS, STEEL, Shape};
use crate::chuck::{Chuck, View};
use crate::creep::Creep;
use crate::disturbance::World;
use crate::motors::{Duty, Motors};
use crate::recorder::{PERIOD_S, Plant, Recorder};
use crate::room::{Coupling, Room, RoomShape};
use athermal_core::prng::Prng;
use athermal_trial::machine::schedule::{Schedule, Track};
use athermal_trial::machine::{
    Changing, Channel, Machine, SECOND_NS, SetPoint, Setup, SetupError, Simulation, rows_of,
};

/// The machine `die-tester`.
///
/// On each side a holder carries the fibre to the chip and stands on a stage; both stages are mounted on one frame.
/// The chuck heats the holders by radiation and through the air, and the stages through their mounts; the room heats and cools everything;
/// motors heat the stages during alignment bursts, after which the axes creep. Z follows mostly the holder, X and Y stage and frame.
///
/// By default the chuck goes through the levels of the published settle times, 20, 30 and 50 °C, four hours each.
#[derive(Debug)]
pub struct DieTester {
    pub(crate) world: World,
}

const CHANNELS: [Channel; 12] = [
    Channel::temperature("plate1"),
    Channel::temperature("holder1"),
    Channel::temperature("plate2"),
    Channel::temperature("holder2"),
    Channel::temperature("room"),
    Channel::temperature("chuck"),
    Channel::position("X1"),
    Channel::position("Y1"),
    Channel::position("Z1"),
    Channel::position("X2"),
    Channel::position("Y2"),
    Channel::position("Z2"),
];

const CHUCK: SetPoint = SetPoint {
    name: "chuck",
    default: 20.0,
    range: [-20.0, 200.0],
};
const ROOM: SetPoint = SetPoint {
    name: "room",
    default: 21.5,
    range: [10.0, 40.0],
};
const SET_POINTS: [SetPoint; 2] = [CHUCK, ROOM];

const LEVELS: [f64; 3] = [20.0, 30.0, 50.0];
const HOLD_S: i64 = 4 * 3600;
const SETTLED_S: i64 = 12 * 3600;

impl Machine for DieTester {
    fn name(&self) -> &'static str {
        "die-tester"
    }

    fn summary(&self) -> &'static str {
        "Two-sided fibre to chip die tester: heated chuck, six axes, six temperatures."
    }

    fn channels(&self) -> &[Channel] {
        &CHANNELS
    }

    fn set_points(&self) -> &[SetPoint] {
        &SET_POINTS
    }

    fn schedule(&self, _seed: u64) -> Option<Schedule> {
        Some(Schedule::cycle(CHUCK.name, &LEVELS, HOLD_S))
    }

    fn can_change(&self) -> bool {
        true
    }

    fn start(&self, setup: &Setup) -> Result<Box<dyn Simulation>, SetupError> {
        let rows = rows_of(self.name(), &SET_POINTS, setup, PERIOD_S * SECOND_NS)?;
        let own = || self.schedule(setup.seed);
        let schedule = setup.schedule.clone().or_else(own).unwrap_or_default();
        let bodies = Bodies::settled(self.world.with(&setup.changes), &schedule, setup);
        Ok(Box::new(Recorder::new(bodies, &CHANNELS, rows, setup)))
    }
}

const AIR: RoomShape = RoomShape {
    diurnal: 0.25,
    cycle: 0.4,
    cycle_s: 1320.0,
    weather: 0.4,
    weather_s: 7200.0,
    turbulence: 0.04,
};

const HOLDER: Shape = Shape {
    material: STAINLESS,
    length_m: 0.08,
    section_m2: 2.8e-4,
    surface_m2: 0.008,
    transfer: 15.0,
    cells: 8,
};

const STAGE: Shape = Shape {
    material: ALUMINIUM,
    length_m: 0.25,
    section_m2: 1.2e-3,
    surface_m2: 0.06,
    transfer: 7.0,
    cells: 8,
};

const FRAME: Shape = Shape {
    material: STEEL,
    length_m: 0.5,
    section_m2: 2.5e-3,
    surface_m2: 0.3,
    transfer: 7.0,
    cells: 8,
};

const DUTY: Duty = Duty {
    pause_s: 9000.0,
    burst_s: [240.0, 720.0],
    power_w: 0.3,
};

/// Conductance in W/K of the joints between holder and stage, and between stage and frame.
const HOLDER_TO_STAGE: f64 = 0.04;
const STAGE_TO_FRAME: f64 = 0.1;

/// What makes one side of the machine, as designed.
#[derive(Clone, Copy)]
struct SideShape {
    holder: Shape,
    holder_view: View,
    stage_view: View,
    /// Per axis: how much of the growth of holder, stage and frame moves it.
    levers: [[f64; 3]; 3],
    creep_nm: [f64; 3],
}

const SIDES: [SideShape; 2] = [
    SideShape {
        holder: HOLDER,
        holder_view: View {
            radiating_m2: 1.2e-3,
            conducting: 0.040,
        },
        stage_view: View {
            radiating_m2: 2e-4,
            conducting: 0.010,
        },
        levers: [[0.12, -0.25, 0.16], [-0.15, 0.23, -0.18], [1.1, 0.12, -0.1]],
        creep_nm: [35.0, 50.0, 120.0],
    },
    SideShape {
        holder: Shape {
            section_m2: 3.0e-4,
            transfer: 14.0,
            ..HOLDER
        },
        holder_view: View {
            radiating_m2: 1.1e-3,
            conducting: 0.036,
        },
        stage_view: View {
            radiating_m2: 2e-4,
            conducting: 0.009,
        },
        levers: [
            [-0.18, 0.32, -0.22],
            [0.14, -0.35, 0.27],
            [0.97, 0.08, -0.1],
        ],
        creep_nm: [35.0, 50.0, 120.0],
    },
];

/// One side: a holder on a stage.
struct Side {
    shape: SideShape,
    holder_to_stage: f64,
    stage_to_frame: f64,
    holder: Bar,
    stage: Bar,
    coupling: Coupling,
    motors: Motors,
    creep: [Creep; 3],
}

impl Side {
    fn new(mut shape: SideShape, number: usize, room: f64, setup: &Setup) -> Self {
        let one = &setup.individual;
        let [holder, stage] = [format!("holder {number}"), format!("stage {number}")];
        shape.holder_view = shape.holder_view.of(one, &holder);
        shape.stage_view = shape.stage_view.of(one, &stage);
        let stream = |what: &str| Prng::stream(setup.seed, &format!("{what} {number}"));
        let creep = |axis: usize| {
            let name = ["creep X", "creep Y", "creep Z"][axis];
            let sigma_nm = shape.creep_nm[axis] * one.factor(&format!("{name} {number}"));
            Creep::new(sigma_nm, Bodies::STEP_S, stream(name))
        };
        Self {
            shape,
            holder_to_stage: HOLDER_TO_STAGE * one.factor(&format!("{holder} joint")),
            stage_to_frame: STAGE_TO_FRAME * one.factor(&format!("{stage} joint")),
            holder: Bar::new(&shape.holder.of(one, &holder), room),
            stage: Bar::new(&STAGE.of(one, &stage), room),
            coupling: Coupling::new(0.18, Bodies::STEP_S, stream("coupling")),
            motors: Motors::new(DUTY.of(one, &stage), stream("motors")),
            creep: std::array::from_fn(creep),
        }
    }

    /// One step; gives the heat in W that has flowed into the frame.
    fn step(
        &mut self,
        (air, door): (f64, f64),
        chuck: &Chuck,
        frame: f64,
        (contact, load): (f64, f64),
    ) -> f64 {
        let motion = self.motors.step(Bodies::STEP_S);
        let to_stage = contact * self.holder_to_stage * (self.holder.last() - self.stage.first());
        let to_frame = contact * self.stage_to_frame * (self.stage.last() - frame);
        let to_holder_w = chuck.heat_w(self.shape.holder_view, self.holder.first());
        let to_stage_w = chuck.heat_w(self.shape.stage_view, self.stage.first());
        self.holder.heat_first(to_holder_w);
        self.holder.heat_last(-to_stage);
        self.stage.heat_first(to_stage + to_stage_w);
        self.stage.heat_last(load * motion.heat_w - to_frame);
        let coupling = door * self.coupling.step();
        self.holder.step(Bodies::STEP_S, air, coupling);
        self.stage.step(Bodies::STEP_S, air, coupling);
        for creep in &mut self.creep {
            if motion.ended {
                creep.start();
            }
            creep.step();
        }
        to_frame
    }

    fn position_nm(&self, axis: usize, frame_nm: f64) -> f64 {
        let [holder, stage, frame] = self.shape.levers[axis];
        holder * self.holder.growth_nm(ROOM.default)
            + stage * self.stage.growth_nm(ROOM.default)
            + frame * frame_nm
            + self.creep[axis].travelled_nm()
    }
}

/// All bodies of the machine, stepped together.
struct Bodies {
    chuck_track: Track,
    room_track: Track,
    room: Room,
    air: f64,
    chuck: Chuck,
    frame: Bar,
    sides: [Side; 2],
    world: World,
    time_ns: i64,
}

impl Bodies {
    fn settled(world: World, schedule: &Schedule, setup: &Setup) -> Self {
        let one = &setup.individual;
        let [chuck_track, room_track] = [CHUCK, ROOM].map(|what| schedule.track(&what));
        let (chuck, air) = (chuck_track.at(0), room_track.at(0));
        let start_s = -SETTLED_S as f64;
        let mut bodies = Self {
            chuck_track,
            room_track,
            room: Room::new(AIR, air, start_s, Self::STEP_S, setup.seed),
            air,
            chuck: Chuck::new(chuck).of(one),
            frame: Bar::new(&FRAME.of(one, "frame"), air),
            sides: [0, 1].map(|side| Side::new(SIDES[side], side + 1, air, setup)),
            world,
            time_ns: 0,
        };
        for _ in 0..(SETTLED_S as f64 / Self::STEP_S) as i64 {
            // Nothing changes before the recording begins.
            bodies.step(-1);
        }
        bodies
    }
}

impl Plant for Bodies {
    const STEP_S: f64 = 5.0;

    fn step(&mut self, time_ns: i64) {
        let changed = |kind| self.world.changed(kind, time_ns);
        let of_sides = (
            1.0 + changed(Changing::Contact),
            1.0 + changed(Changing::Load),
        );
        let set = self.room_track.at(time_ns) + changed(Changing::Season);
        self.air = self.room.step(set);
        self.chuck.step(Self::STEP_S, self.chuck_track.at(time_ns));
        // Side 1 stands at one end of the frame, side 2 at the other.
        let ends = [self.frame.first(), self.frame.last()];
        let (door, lamp) = self.world.couples_and_heats(time_ns);
        self.time_ns = time_ns;
        let [one, two] = &mut self.sides;
        one.stage.heat_all(lamp);
        let heat_w = [
            one.step((self.air, door), &self.chuck, ends[0], of_sides),
            two.step((self.air, door), &self.chuck, ends[1], of_sides),
        ];
        self.frame.heat_first(heat_w[0]);
        self.frame.heat_last(heat_w[1]);
        self.frame.step(Self::STEP_S, self.air, door);
        let sides = self.sides.iter_mut();
        let of_sides = sides.flat_map(|side| [&mut side.holder, &mut side.stage]);
        self.world.swell(time_ns, of_sides.chain([&mut self.frame]));
    }

    fn temperatures(&self, into: &mut [f64]) {
        let [one, two] = &self.sides;
        into.copy_from_slice(&[
            one.stage.middle(),
            one.holder.middle(),
            two.stage.middle(),
            two.holder.middle(),
            self.air,
            self.chuck.temperature(),
        ]);
        self.world.loosen(self.time_ns, self.air, &CHANNELS, into);
    }

    fn positions(&self, into: &mut [f64]) {
        let frame_nm = self.frame.growth_nm(ROOM.default);
        for (index, position) in into.iter_mut().enumerate() {
            *position = self.sides[index / 3].position_nm(index % 3, frame_nm);
        }
    }
}
