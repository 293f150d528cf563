// SPDX-License-Identifier: MIT OR Apache-2.0
//! Hybrid robot at the pins of a simulated board: encoders follow the axes, forces follow the half bridges, and brakes hold the robot
//! while the outputs are safe.

use anyhow::{Context, Result, anyhow, bail, ensure};
use takt_board::Wiring;
use takt_board::emulated::EmulatedBoard;
use takt_board::simulation::{EncoderMotion, Simulation};
use takt_board::wiring::Peripheral;
use takt_programs::hybrid::params::SAMPLE_TIME;
use takt_programs::hybrid::plant::Plant;
use takt_programs::hybrid::ports::{INPUTS, OUTPUTS};
use takt_programs::path::Pose;

/// Number of axes: the first inputs are encoders, the first outputs forces and torques.
pub(super) const AXES: usize = 5;
/// Plant steps per period: forces act one step after the pulses that command them.
pub(super) const STEPS: u32 = 20;

/// Pins of an axis.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    encoder: String,
    /// Input port for the encoder's count.
    port: String,
    motor: String,
    /// Range of the motor's pulse length in cycles, from duty 0 to full duty.
    half: f64,
    /// Force or torque at full duty, N or N·m.
    full: f64,
}

/// A port of the wiring has this name, with or without a core's name as prefix.
fn is_called(port: &str, name: &str) -> bool {
    port.rsplit('.').next() == Some(name)
}

impl Axis {
    /// Axis with this input port for the count and this output port for the duty; `count` is its initial count.
    fn new(wiring: &Wiring, input: &str, output: &str, count: i32) -> Result<Axis> {
        let of = |kind: &str, port: &dyn Fn(&Peripheral) -> bool| {
            wiring.peripherals.iter().find(|peripheral| peripheral.kind.name == kind && port(peripheral))
        };
        let read =
            |peripheral: &Peripheral| peripheral.reads[0].clone().filter(|port| is_called(port, input));
        let encoder = of("quadrature", &|peripheral| read(peripheral).is_some());
        let encoder = encoder.with_context(|| {
            format!("the wiring has no quadrature whose `count` is the port `{input}`: an axis of the robot is missing")
        })?;
        let start = encoder.parameter("start").cast_signed();
        ensure!(
            start == count,
            "the robot stands at {count} counts of `{input}`, and `{}` starts at {start}: `start = {count}`",
            encoder.name
        );
        let wired = |peripheral: &Peripheral| {
            peripheral.writes[0].as_ref().is_some_and(|write| is_called(&write.port, output))
        };
        let motor = of("pwm", &wired);
        let motor = motor.with_context(|| {
            format!(
                "the wiring has no pwm whose `duty` is the port `{output}`: an axis of the robot is missing"
            )
        })?;
        ensure!(
            motor.parameter("signed") == 1 && motor.pins.iter().all(Option::is_some),
            "`{}`: a force in both directions needs a signed pwm with both pins",
            motor.name
        );
        let scale = motor.writes[0].as_ref().and_then(|write| write.scale).unwrap_or(0);
        let half = f64::from(motor.parameter("half"));
        Ok(Axis {
            encoder: encoder.name.clone(),
            port: read(encoder).unwrap_or_default(),
            motor: motor.name.clone(),
            half,
            full: half / f64::from(scale).exp2(),
        })
    }

    /// Axes of a wiring for this robot in this pose.
    ///
    /// # Errors
    /// If the wiring is not for this robot.
    pub(super) fn all(wiring: &Wiring, pose: &Pose) -> Result<Vec<Axis>> {
        let length = f64::from(wiring.period) / (wiring.clock * 1e6);
        ensure!(
            (length / SAMPLE_TIME - 1.0).abs() < 1e-9 && wiring.period.is_multiple_of(STEPS),
            "the robot's period is {} µs, the wiring's {} µs; in cycles ({}) it must be divisible by {STEPS}",
            SAMPLE_TIME * 1e6,
            length * 1e6,
            wiring.period
        );
        // The brakes need the signal `drive`; sampling the plant needs `tick`.
        for (signal, pin) in takt_board::wiring::SIGNALS.iter().zip(&wiring.signals) {
            if ["drive", "tick"].contains(&signal.name) && pin.is_none() {
                bail!("the robot needs the signal `{}` on a pin, under [signals]", signal.name);
            }
        }
        ensure!(!wiring.autostart, "the host starts the robot: leave out `autostart`");
        let counts = Plant::at_rest(pose)
            .counts()
            .context("the robot's start position is outside the range of its encoders")?;
        let names = INPUTS.iter().zip(&OUTPUTS).zip(counts).take(AXES);
        names.map(|((input, output), count)| Axis::new(wiring, input.name, output.name, count)).collect()
    }
}

/// Result of a step.
#[derive(Debug, Default)]
pub(super) struct Step {
    /// Bytes sent by the board.
    pub(super) received: Vec<u8>,
    /// State of the robot at the beginning of the step, if a tick occurred there. A stopped board also reports a state once per period.
    pub(super) state: Option<State>,
    /// The board is idle: only a request can change its state.
    pub(super) rests: bool,
}

/// State of the robot at a tick, or at the time when a stopped board would have one.
#[derive(Clone, Copy, Debug)]
pub(super) struct State {
    /// Number of the tick since the board's start, from 1; 0 before the first tick.
    pub(super) tick: u32,
    /// The outputs drive; otherwise they are at their safe levels.
    pub(super) drives: bool,
    pub(super) pose: Pose,
    /// Mean forces and torques since the previous state, N and N·m.
    pub(super) force: [f64; AXES],
    /// A motor's pin was 1 since the previous state.
    pub(super) is_lit: bool,
}

/// Mechanics of the robot, including brakes.
struct BrakedPlant {
    plant: Plant,
    was_driven: bool,
}

impl BrakedPlant {
    fn new(pose: &Pose) -> BrakedPlant {
        BrakedPlant { plant: Plant::at_rest(pose), was_driven: false }
    }

    fn pose(&self) -> Pose {
        Pose { position: self.plant.position(), angle: self.plant.angle() }
    }

    fn counts(&self) -> Result<[i32; AXES]> {
        self.plant.counts().ok_or_else(|| anyhow!("an axis has left the range of its encoder"))
    }

    /// Integrates the plant with these forces; if the outputs do not drive, the brakes hold it immediately.
    fn advance(&mut self, seconds: f64, drives: bool, force: [f64; AXES]) {
        if drives {
            let [a, b, c, d, e] = force;
            self.plant.advance_by(seconds, [a, b, c], [d, e]);
        } else if self.was_driven {
            self.plant = Plant::at_rest(&self.pose());
        }
        self.was_driven = drives;
    }
}

/// A board with the robot at its pins.
pub(super) trait RobotAtPins {
    /// Simulates one step while `bytes` are sent to the board.
    fn step(&mut self, bytes: &[u8]) -> Result<Step>;

    /// Presses the button at the pin `stop`.
    fn stop(&mut self);
}

/// Phase of the search for the board's ticks, to which steps are then aligned. The robot does not move during the search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ticks {
    /// No tick yet; each run is as long as a step.
    Sought,
    /// The last run contained a tick: the next one is less than a step after the end of this run.
    Near,
    /// The tick is expected in one of the next runs, of one cycle each.
    Next,
    /// Steps begin at ticks.
    Found,
}

/// Simulated circuit with the robot at its pins.
pub(super) struct CircuitWithRobot {
    sim: Simulation,
    axes: Vec<Axis>,
    pins: Vec<[usize; 2]>,
    robot: BrakedPlant,
    period: u32,
    ticks: Ticks,
    tick: u32,
    /// Number of runs since the last tick or state.
    runs: u32,
    force: [f64; AXES],
    is_lit: bool,
}

impl CircuitWithRobot {
    pub(super) fn new(
        mut sim: Simulation,
        wiring: &Wiring,
        axes: &[Axis],
        pose: &Pose,
    ) -> Result<CircuitWithRobot> {
        let pins = |axis: &Axis| ["a", "b"].map(|pin| sim.input(&format!("{}_{pin}", axis.encoder)));
        let pins = axes.iter().map(pins).filter_map(|[a, b]| Some([a?, b?])).collect();
        // During reset, the pins may show a spurious tick.
        sim.run(takt_board::top::RESET, &[])?;
        Ok(CircuitWithRobot {
            sim,
            axes: axes.to_vec(),
            pins,
            robot: BrakedPlant::new(pose),
            period: wiring.period,
            ticks: Ticks::Sought,
            tick: 0,
            runs: 0,
            force: [0.0; AXES],
            is_lit: false,
        })
    }

    /// Moves the robot according to the forces of the last step's pulses.
    fn move_robot(&mut self, drives: bool) {
        let cycles = f64::from(self.period / STEPS);
        let mut force = [0.0; AXES];
        for (force, axis) in force.iter_mut().zip(&self.axes) {
            let [high, low] = ["high", "low"]
                .map(|pin| self.sim.output(&format!("{}_{pin}", axis.motor)).unwrap_or_default().1);
            self.is_lit |= high + low > 0;
            *force = (f64::from(high) - f64::from(low)) / cycles * axis.full;
        }
        self.robot.advance(SAMPLE_TIME / f64::from(STEPS), drives, force);
        self.force.iter_mut().zip(force).for_each(|(sum, force)| *sum += force / f64::from(STEPS));
    }

    /// Next phase of the search for ticks, given whether the last run contained one.
    fn follow(&mut self, has_tick: bool) -> Ticks {
        self.runs = if has_tick { 0 } else { self.runs + 1 };
        match (self.ticks, has_tick) {
            (Ticks::Sought, true) => Ticks::Near,
            (Ticks::Near, _) => Ticks::Next,
            (Ticks::Next | Ticks::Found, true) => Ticks::Found,
            (Ticks::Next, false) if self.runs <= self.period => Ticks::Next,
            (Ticks::Found, false) if self.runs <= 2 * STEPS => Ticks::Found,
            (Ticks::Sought | Ticks::Next | Ticks::Found, false) => Ticks::Sought,
        }
    }
}

impl RobotAtPins for CircuitWithRobot {
    fn step(&mut self, bytes: &[u8]) -> Result<Step> {
        let step = self.period / STEPS;
        let drives = self.sim.output("signal_drive").unwrap_or_default().0;
        let from = self.robot.counts()?;
        let cycles = match self.ticks {
            Ticks::Sought => step,
            Ticks::Near => self.period - step,
            Ticks::Next => 1,
            Ticks::Found => {
                self.move_robot(drives);
                step
            }
        };
        let to = self.robot.counts()?;
        for (pins, (from, to)) in self.pins.iter().zip(from.into_iter().zip(to)) {
            self.sim.turns.push(EncoderMotion { pins: *pins, from, by: to.wrapping_sub(from) });
        }
        self.sim.run(cycles, bytes)?;
        let has_tick = self.sim.output("signal_tick").unwrap_or_default().1 > 0;
        let was = self.ticks;
        self.ticks = self.follow(has_tick);
        if has_tick {
            self.tick = if was == Ticks::Sought { 1 } else { self.tick + 1 };
        }
        let rests = self.ticks == Ticks::Sought;
        let has_state = has_tick || rests && self.runs.is_multiple_of(STEPS);
        let state = has_state.then(|| State {
            tick: if has_tick { self.tick } else { 0 },
            drives,
            pose: self.robot.pose(),
            force: std::mem::take(&mut self.force),
            is_lit: std::mem::take(&mut self.is_lit),
        });
        Ok(Step { received: self.sim.take_received(), state, rests: false })
    }

    fn stop(&mut self) {
        self.sim.set("signal_stop", true);
    }
}

/// Emulated board with the robot at its peripheral registers; a step is a period.
pub(super) struct EmulationWithRobot {
    board: EmulatedBoard,
    axes: Vec<Axis>,
    inputs: Vec<usize>,
    robot: BrakedPlant,
}

impl EmulationWithRobot {
    pub(super) fn new(board: EmulatedBoard, axes: &[Axis], pose: &Pose) -> Result<EmulationWithRobot> {
        let inputs = axes.iter().map(|axis| {
            board.input(&axis.port).with_context(|| format!("`{}` is not an input of the system", axis.port))
        });
        let inputs = inputs.collect::<Result<Vec<usize>>>()?;
        Ok(EmulationWithRobot { board, axes: axes.to_vec(), inputs, robot: BrakedPlant::new(pose) })
    }
}

impl RobotAtPins for EmulationWithRobot {
    fn step(&mut self, bytes: &[u8]) -> Result<Step> {
        let mut received = self.board.receive(bytes);
        let pose = self.robot.pose();
        for (input, count) in self.inputs.iter().zip(self.robot.counts()?) {
            self.board.capture(*input, count.cast_unsigned());
        }
        let before = self.board.ticks();
        received.extend(self.board.pass());
        let (drives, tick) = (self.board.drives(), self.board.ticks());
        let force = |axis: &Axis| {
            let duty = f64::from(self.board.output(&axis.motor).unwrap_or(0));
            duty.clamp(-axis.half, axis.half) / axis.half * axis.full
        };
        let force = std::array::from_fn(|i| force(&self.axes[i]));
        self.robot.advance(SAMPLE_TIME, drives, force);
        let rests = tick == before;
        let tick = if rests { 0 } else { tick };
        // A half bridge that drives always conducts in one of the two directions.
        let state = State { tick, drives, pose, force, is_lit: drives };
        Ok(Step { received, state: Some(state), rests })
    }

    fn stop(&mut self) {
        self.board.set_stop(true);
    }
}
