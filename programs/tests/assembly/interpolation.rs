// SPDX-License-Identifier: MIT OR Apache-2.0
//! Points of `interpolation.s` against the cubics in binary64: the test plays the planner and the host's end of the FIFO.

use super::processor::assemble;
use std::collections::VecDeque;
use takt_asm::Schedule;
use takt_emu::Emulator;
use takt_isa::program::Port;
use takt_isa::{Register, T3};
use takt_programs::accuracy::Accuracy;
use takt_programs::gcode;
use takt_programs::hybrid::ports::{INPUTS, REFERENCE_LEN};
use takt_programs::trajectory::Trajectory;

/// Periods from knot to knot, and the same time in s.
const EVERY: usize = 10;
const TIME: f64 = 1e-3;
/// Knots in the FIFO at which the motion begins, and the FIFO's depth.
const BEGIN: usize = 3;
const DEPTH: usize = 8;
/// Units of positions and angles, m and rad, then the deceleration, m/s².
const UNITS: [f64; 2] = [1.0 / (1 << 30) as f64, 1.0 / (1 << 26) as f64];
const BRAKE: f64 = 8.0;
const AXES: usize = 5;

/// Knot: positions, m and rad, with velocities, m/s and rad/s.
#[derive(Clone, Copy, Debug)]
struct Knot {
    position: [f64; AXES],
    velocity: [f64; AXES],
}

fn unit(axis: usize) -> f64 {
    UNITS[usize::from(axis >= 3)]
}

impl Knot {
    /// Knot as transmitted: positions in whole units, velocities in binary32.
    fn rounded(self) -> Knot {
        Knot {
            position: std::array::from_fn(|i| (self.position[i] / unit(i)).round() * unit(i)),
            velocity: self.velocity.map(|v| f64::from(v as f32)),
        }
    }

    /// Knot with zero velocities.
    fn at_rest(position: [f64; AXES]) -> Knot {
        Knot { position, velocity: [0.0; AXES] }
    }

    /// Point of the cubic to the next knot, `phase` periods after this one, in the order of the reference.
    fn to(&self, next: &Knot, phase: usize) -> [f64; REFERENCE_LEN] {
        let s = phase as f64 / EVERY as f64;
        let axis = |i: usize| {
            let d = next.position[i] - self.position[i];
            let (u, w) = (self.velocity[i] * TIME, next.velocity[i] * TIME);
            // Cubic Hermite polynomial with its first and second derivatives.
            let (b, c) = (3.0 * d - 2.0 * u - w, u + w - 2.0 * d);
            [
                self.position[i] + u * s + b * s * s + c * s * s * s,
                (u + 2.0 * b * s + 3.0 * c * s * s) / TIME,
                (2.0 * b + 6.0 * c * s) / (TIME * TIME),
            ]
        };
        let [x, y, z, a, c]: [[f64; 3]; AXES] = std::array::from_fn(axis);
        let tool = (0..3).flat_map(|order| [x[order], y[order], z[order]]);
        let table = (0..3).flat_map(|order| [a[order], c[order]]);
        let all: Vec<f64> = tool.chain(table).collect();
        all.try_into().expect("fifteen values")
    }
}

/// Program with a FIFO in front of it.
struct Core {
    emulator: Emulator,
    inputs: Vec<Port>,
    outputs: Vec<Port>,
    queue: VecDeque<Knot>,
    popped: u32,
}

impl Core {
    /// Starts a core that has taken the first knot and waits for its first tick.
    fn new(first: Knot) -> Core {
        let program = &assemble("hybrid/interpolation.s", &T3, Schedule::AsWritten).program;
        let mut core = Core {
            emulator: Emulator::new(program).expect("the program fits its machine"),
            inputs: program.inputs.clone(),
            outputs: program.outputs.clone(),
            queue: VecDeque::from([first]),
            popped: 0,
        };
        core.show();
        core.emulator.run_to_wait().expect("it starts");
        core.pop();
        core
    }

    fn register(ports: &[Port], name: &str) -> Register {
        ports.iter().find(|port| port.name == name).unwrap_or_else(|| panic!("no port {name}")).register
    }

    fn set(&mut self, name: &str, bits: u32) {
        let register = Core::register(&self.inputs, name);
        self.emulator.set_input_bits(register, bits).expect("it is an input");
    }

    fn read(&self, name: &str) -> u32 {
        self.emulator.register(Core::register(&self.outputs, name)).expect("it is written")
    }

    /// Drives the FIFO's head and status on the ports, and encoder counts that identify the axis and the entry.
    fn show(&mut self) {
        self.set("empty", u32::from(self.queue.is_empty()));
        self.set("count", self.queue.len() as u32);
        for axis in 1..=AXES {
            self.set(&format!("n{axis}"), (100 * axis as u32) + self.popped);
        }
        let Some(head) = self.queue.front().copied() else { return };
        for i in 0..AXES {
            let to = (head.position[i] / unit(i)).round() as i32;
            self.set(&format!("to_{}", i + 1), to.cast_unsigned());
            self.set(&format!("speed_{}", i + 1), (head.velocity[i] as f32).to_bits());
        }
    }

    fn pop(&mut self) {
        let popped = self.read("pop");
        if popped != self.popped {
            assert_eq!(popped, self.popped + 1, "one at a time");
            assert!(self.queue.pop_front().is_some(), "none that is not there");
            self.popped = popped;
        }
    }

    /// Runs a period and returns the point.
    fn period(&mut self) -> [f32; REFERENCE_LEN] {
        self.show();
        let counts: Vec<u32> = (1..=AXES as u32).map(|axis| 100 * axis + self.popped).collect();
        self.emulator.run_period(&[]).expect("it does not fault");
        let measured: Vec<u32> = (1..=AXES).map(|axis| self.read(&format!("m{axis}"))).collect();
        assert_eq!(measured, counts, "the encoders of this tick");
        self.pop();
        std::array::from_fn(|i| f32::from_bits(self.read(INPUTS[AXES + i].name)))
    }
}

/// Knots from the AGH path: the end of the first letter, then the first move of the table, with all axes.
fn knots(count: usize) -> Vec<Knot> {
    let trajectory = Trajectory::plan(&gcode::read(takt_programs::AGH).expect("a path")).expect("short");
    let turns = trajectory.samples().position(|sample| sample.reference.angular_velocity[0] != 0.0);
    let from = turns.expect("the table moves") - count / 3 * EVERY;
    let samples = trajectory.samples().skip(from).step_by(EVERY).take(count);
    let knot = |sample: takt_programs::trajectory::Sample| {
        let at = sample.reference;
        let ([x, y, z], [a, c]) = (at.position, at.angle);
        let ([vx, vy, vz], [va, vc]) = (at.velocity, at.angular_velocity);
        Knot { position: [x, y, z, a, c], velocity: [vx, vy, vz, va, vc] }.rounded()
    };
    samples.map(knot).collect()
}

/// Limits on errors of velocity and acceleration, of the tool in m/s and m/s², of the table in rad/s and rad/s²: binary32 differences of
/// positions 1 ms apart. Positions are rounded once.
const ERRORS: [[f64; 2]; 2] = [[2e-7, 5e-4], [1e-6, 2e-3]];

#[test]
fn points_lie_on_the_cubics() {
    let knots = knots(600);
    let first = Knot::at_rest(knots[0].position);
    let mut core = Core::new(first);
    assert_eq!(core.read("standing"), 1);
    // The core stands until enough knots wait.
    for knot in &knots[..BEGIN] {
        let point = core.period();
        assert_eq!(point[2], first.position[2] as f32, "{} wait", core.queue.len());
        assert_eq!((core.read("standing"), core.read("phase")), (1, 0));
        core.queue.push_back(*knot);
    }
    let mut next = BEGIN;
    let mut accuracy = Accuracy::<REFERENCE_LEN>::default();
    let mut before = first;
    for (segment, knot) in knots.iter().enumerate() {
        for phase in 0..EVERY {
            let point = core.period();
            assert_eq!((core.read("standing"), core.read("starved")), (0, 0));
            assert_eq!((core.read("knot"), core.read("phase")), (segment as u32 + 2, phase as u32));
            accuracy.add(&point, &before.to(knot, phase));
            // The planner is late by up to two of its steps, and catches up.
            if phase == segment % EVERY && (segment % 3 == 2 || segment > knots.len() - 9) {
                while core.queue.len() < BEGIN && next < knots.len() {
                    core.queue.push_back(knots[next]);
                    next += 1;
                }
            }
        }
        before = *knot;
    }
    assert!(core.emulator.flags().is_empty() && core.queue.len() < DEPTH);
    for (i, error) in accuracy.errors.iter().enumerate() {
        let (table, order) = if i < 9 { (0, i / 3) } else { (1, (i - 9) / 2) };
        let name = INPUTS[AXES + i].name;
        assert_eq!(error.count, 6000);
        let holds = match order {
            0 => error.ulps_of_largest() <= 0.51,
            _ => error.absolute <= ERRORS[table][order - 1],
        };
        assert!(holds, "{name}: {error} at {}", error.worst);
    }
}

#[test]
fn without_knots_brakes_on_the_tangent_to_rest() {
    let velocity = [0.12, -0.16, 0.0, 0.1, 0.0];
    let position =
        |time: f64| -> [f64; AXES] { std::array::from_fn(|i| 0.01 * i as f64 + velocity[i] * time) };
    let mut core = Core::new(Knot::at_rest(position(0.0)));
    let knot = |k: usize| Knot { position: position(k as f64 * TIME), velocity }.rounded();
    core.queue.extend((1..=BEGIN).map(knot));
    for _ in 0..BEGIN * EVERY {
        core.period();
    }
    assert_eq!(core.read("starved"), 0);
    // Braking from 0.2 m/s at 8 m/s² takes 25 ms.
    let mut before = core.period();
    let mut speeds = Vec::new();
    for period in 1..300 {
        let point = core.period();
        let speed = f64::from(point[3]).hypot(f64::from(point[4]));
        let along = (f64::from(point[3]) * velocity[0] + f64::from(point[4]) * velocity[1]) / 0.2;
        assert!((speed - along).abs() < 1e-6, "on the tangent: {point:?}");
        let step = f64::from(point[0] - before[0]);
        assert!(
            (step - f64::from(point[3] + before[3]) / 2.0 * 1e-4).abs() < 2e-9,
            "period {period}: {step}"
        );
        speeds.push(speed);
        before = point;
    }
    let expected = |period: usize| (0.2 - BRAKE * 1e-4 * (period + 1) as f64).max(0.0);
    for (period, speed) in speeds.iter().enumerate() {
        assert!((speed - expected(period)).abs() < 1e-4, "period {period}: {speed}");
    }
    // Late knots do not restart a core that has stopped.
    core.queue.push_back(knot(40));
    let starved = core.read("starved");
    let point = core.period();
    assert_eq!(point[3..9], [0.0; 6], "{point:?}");
    for _ in 0..2 * EVERY {
        assert_eq!(core.period()[0], point[0]);
    }
    assert_eq!((core.queue.len(), core.read("starved")), (1, starved + 3));
}
