//! The machine `linear-axis`: an X, Y, Z stack of stages in a room. Decides its bodies and how they hang together.

use crate::bar::{ALUMINIUM, Bar, STEEL, Shape};
use crate::creep::Creep;
use crate::disturbance::World;
use crate::motors::{Duty, Motors};
use crate::recorder::{PERIOD_S, Plant, Recorder};
use crate::room::{Coupling, Room, RoomShape};
use athermal_core::prng::Prng;
use athermal_trial::machine::schedule::Track;
use athermal_trial::machine::{
    Changing, Channel, Machine, SECOND_NS, SetPoint, Setup, SetupError, Simulation, rows_of,
};

/// The machine `linear-axis`.
///
/// Three bars, from the tool to the ground: an arm that follows the room within minutes, a slide, and a slow column. `t1` to `t3` are their
/// temperatures and `t4` the air. The room is the only source of heat but for the motors, which heat the slide during alignment bursts,
/// after which the axes creep.
#[derive(Debug)]
pub struct LinearAxis {
    pub(crate) world: World,
}

const CHANNELS: [Channel; 7] = [
    Channel::temperature("t1"),
    Channel::temperature("t2"),
    Channel::temperature("t3"),
    Channel::temperature("t4"),
    Channel::position("X"),
    Channel::position("Y"),
    Channel::position("Z"),
];

const ROOM: SetPoint = SetPoint {
    name: "room",
    default: 21.5,
    range: [10.0, 40.0],
};
const SET_POINTS: [SetPoint; 1] = [ROOM];
const SETTLED_S: i64 = 12 * 3600;

impl Machine for LinearAxis {
    fn name(&self) -> &'static str {
        "linear-axis"
    }

    fn summary(&self) -> &'static str {
        "Single X, Y, Z axis system in a room of 21.5 ± 1 °C: three axes, four temperatures."
    }

    fn channels(&self) -> &[Channel] {
        &CHANNELS
    }

    fn set_points(&self) -> &[SetPoint] {
        &SET_POINTS
    }

    fn can_change(&self) -> bool {
        true
    }

    fn start(&self, setup: &Setup) -> Result<Box<dyn Simulation>, SetupError> {
        let rows = rows_of(self.name(), &SET_POINTS, setup, PERIOD_S * SECOND_NS)?;
        let room = setup
            .schedule
            .as_ref()
            .map_or_else(|| Track::constant(ROOM.default), |s| s.track(&ROOM));
        let bodies = Bodies::settled(self.world.with(&setup.changes), room, setup);
        Ok(Box::new(Recorder::new(bodies, &CHANNELS, rows, setup)))
    }
}

const AIR: RoomShape = RoomShape {
    diurnal: 0.3,
    cycle: 0.45,
    cycle_s: 1440.0,
    weather: 0.45,
    weather_s: 6000.0,
    turbulence: 0.04,
};

const ARM: Shape = Shape {
    material: ALUMINIUM,
    length_m: 0.12,
    section_m2: 4e-4,
    surface_m2: 0.016,
    transfer: 10.0,
    cells: 8,
};

const SLIDE: Shape = Shape {
    material: ALUMINIUM,
    length_m: 0.25,
    section_m2: 1.2e-3,
    surface_m2: 0.075,
    transfer: 7.0,
    cells: 8,
};

const COLUMN: Shape = Shape {
    material: STEEL,
    length_m: 0.3,
    section_m2: 1.2e-3,
    surface_m2: 0.09,
    transfer: 7.0,
    cells: 8,
};

const DUTY: Duty = Duty {
    pause_s: 9000.0,
    burst_s: [240.0, 720.0],
    power_w: 0.4,
};

/// Conductance in W/K of the joints between arm and slide, and between slide and column.
const ARM_TO_SLIDE: f64 = 0.03;
const SLIDE_TO_COLUMN: f64 = 0.1;

/// Per axis X, Y, Z: how much of the growth of arm, slide and column moves it.
const LEVERS: [[f64; 3]; 3] = [
    [0.057, 0.045, 0.056],
    [0.21, 0.05, 0.06],
    [-0.08, -0.07, -0.23],
];
const CREEP_NM: [f64; 3] = [40.0, 80.0, 120.0];

/// All bodies of the machine, stepped together.
struct Bodies {
    room_track: Track,
    room: Room,
    air: f64,
    arm: Bar,
    slide: Bar,
    column: Bar,
    arm_to_slide: f64,
    slide_to_column: f64,
    couplings: [Coupling; 3],
    motors: Motors,
    creep: [Creep; 3],
    world: World,
    time_ns: i64,
}

impl Bodies {
    fn settled(world: World, room_track: Track, setup: &Setup) -> Self {
        let (seed, one) = (setup.seed, &setup.individual);
        let air = room_track.at(0);
        let stream = |label: &str| Prng::stream(seed, label);
        let coupling = |label| Coupling::new(0.18, Self::STEP_S, stream(label));
        let creep = |axis: usize| {
            let name = ["creep X", "creep Y", "creep Z"][axis];
            Creep::new(
                CREEP_NM[axis] * one.factor(name),
                Self::STEP_S,
                stream(name),
            )
        };
        let mut bodies = Self {
            room_track,
            room: Room::new(AIR, air, -SETTLED_S as f64, Self::STEP_S, seed),
            air,
            arm: Bar::new(&ARM.of(one, "arm"), air),
            slide: Bar::new(&SLIDE.of(one, "slide"), air),
            column: Bar::new(&COLUMN.of(one, "column"), air),
            arm_to_slide: ARM_TO_SLIDE * one.factor("arm joint"),
            slide_to_column: SLIDE_TO_COLUMN * one.factor("slide joint"),
            couplings: ["coupling arm", "coupling slide", "coupling column"].map(coupling),
            motors: Motors::new(DUTY.of(one, "slide"), stream("motors")),
            creep: std::array::from_fn(creep),
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
        let (contact, load) = (
            1.0 + changed(Changing::Contact),
            1.0 + changed(Changing::Load),
        );
        let set = self.room_track.at(time_ns) + changed(Changing::Season);
        self.air = self.room.step(set);
        let motion = self.motors.step(Self::STEP_S);
        let to_slide = contact * self.arm_to_slide * (self.arm.last() - self.slide.first());
        let to_column = contact * self.slide_to_column * (self.slide.last() - self.column.first());
        self.arm.heat_last(-to_slide);
        self.slide.heat_first(to_slide + load * motion.heat_w);
        self.slide.heat_last(-to_column);
        self.column.heat_first(to_column);
        let (door, lamp) = self.world.couples_and_heats(time_ns);
        self.time_ns = time_ns;
        self.slide.heat_all(lamp);
        let [arm, slide, column] = &mut self.couplings;
        self.arm.step(Self::STEP_S, self.air, door * arm.step());
        self.slide.step(Self::STEP_S, self.air, door * slide.step());
        self.column
            .step(Self::STEP_S, self.air, door * column.step());
        self.world
            .swell(time_ns, [&mut self.arm, &mut self.slide, &mut self.column]);
        for creep in &mut self.creep {
            if motion.ended {
                creep.start();
            }
            creep.step();
        }
    }

    fn temperatures(&self, into: &mut [f64]) {
        into.copy_from_slice(&[
            self.arm.middle(),
            self.slide.middle(),
            self.column.middle(),
            self.air,
        ]);
        self.world.loosen(self.time_ns, self.air, &CHANNELS, into);
    }

    fn positions(&self, into: &mut [f64]) {
        let growth = [&self.arm, &self.slide, &self.column].map(|bar| bar.growth_nm(ROOM.default));
        for (axis, position) in into.iter_mut().enumerate() {
            let levers = LEVERS[axis].iter().zip(growth);
            *position =
                levers.map(|(lever, nm)| lever * nm).sum::<f64>() + self.creep[axis].travelled_nm();
        }
    }
}
