// SPDX-License-Identifier: MIT OR Apache-2.0
//! The hybrid robot behind the pins of a simulated board: encoders turn as its axes move, its forces come from the half bridges, and
//! brakes hold it until the outputs drive.

use anyhow::{Context, Result, anyhow, bail, ensure};
use takt_board::Wiring;
use takt_board::emulated::Emulated;
use takt_board::simulation::{Simulation, Turn};
use takt_board::wiring::Peripheral;
use takt_programs::hybrid::params::SAMPLE_TIME;
use takt_programs::hybrid::plant::Plant;
use takt_programs::hybrid::ports::{INPUTS, OUTPUTS};
use takt_programs::path::Pose;

/// Axes of the robot: encoders, the first inputs, and forces and torques, the first outputs.
pub(super) const AXES: usize = 5;
/// Steps of the plant in a period: forces act a step later than the pulses that make them.
pub(super) const STEPS: u32 = 20;

/// An axis at the pins.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    encoder: String,
    /// The port that the encoder's count is.
    port: String,
    motor: String,
    /// Cycles of the motor's pulse, from none to full.
    half: f64,
    /// Force or torque at full duty, N or N·m.
    full: f64,
}

/// True if a wiring's port, of a program or of a system's core, has this name.
fn is_called(port: &str, name: &str) -> bool {
    port.rsplit('.').next() == Some(name)
}

impl Axis {
    /// The axis whose count is this input port, and whose duty that output port; it stands at `count`.
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

    /// All axes of a wiring that is for this robot, which stands in this pose.
    ///
    /// # Errors
    /// If it is for another one.
    pub(super) fn all(wiring: &Wiring, pose: &Pose) -> Result<Vec<Axis>> {
        let length = f64::from(wiring.period) / (wiring.clock * 1e6);
        ensure!(
            (length / SAMPLE_TIME - 1.0).abs() < 1e-9 && wiring.period.is_multiple_of(STEPS),
            "the robot's period is {} µs, the wiring's {} µs; in cycles ({}) it is to be divisible by {STEPS}",
            SAMPLE_TIME * 1e6,
            length * 1e6,
            wiring.period
        );
        // `drive` and `tick`: brakes, and the instants at which the plant is looked at.
        for (signal, pin) in takt_board::wiring::SIGNALS.iter().zip(&wiring.signals) {
            if ["drive", "tick"].contains(&signal.name) && pin.is_none() {
                bail!("the robot needs the signal `{}` on a pin, under [signals]", signal.name);
            }
        }
        ensure!(!wiring.autostart, "the host starts the robot: leave out `autostart`");
        let counts = Plant::at_rest(pose).counts().context("the path begins out of reach")?;
        let names = INPUTS.iter().zip(&OUTPUTS).zip(counts).take(AXES);
        names.map(|((input, output), count)| Axis::new(wiring, input.name, output.name, count)).collect()
    }
}

/// The result of a step.
#[derive(Debug, Default)]
pub(super) struct Step {
    /// Bytes from the board.
    pub(super) received: Vec<u8>,
    /// A tick in it: the state of the robot at its beginning. A board that does not run has such a state once a period, too.
    pub(super) state: Option<State>,
    /// True if the board does not run, so that only a request changes anything.
    pub(super) rests: bool,
}

/// The state of the robot at a tick, or where one would have been.
#[derive(Clone, Copy, Debug)]
pub(super) struct State {
    /// Ticks of this start of the board so far, with this one; 0 if there was none.
    pub(super) tick: u32,
    /// True if the outputs drive.
    pub(super) drives: bool,
    pub(super) pose: Pose,
    /// Forces and torques since the last one, on average, N and N·m.
    pub(super) force: [f64; AXES],
    /// True if a motor's pin was 1 since the last one.
    pub(super) is_lit: bool,
}

/// The robot's mechanics, with brakes.
struct Held {
    plant: Plant,
    was_driven: bool,
}

impl Held {
    fn new(pose: &Pose) -> Held {
        Held { plant: Plant::at_rest(pose), was_driven: false }
    }

    fn pose(&self) -> Pose {
        Pose { position: self.plant.position(), angle: self.plant.angle() }
    }

    fn counts(&self) -> Result<[i32; AXES]> {
        self.plant.counts().ok_or_else(|| anyhow!("an axis has left the range of its encoder"))
    }

    /// Lets time pass with these forces; without a drive the brakes hold it, at once.
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

/// A board with the robot behind it.
pub(super) trait Behind {
    /// Lets a short time pass, with bytes that begin to go to the board.
    fn step(&mut self, bytes: &[u8]) -> Result<Step>;

    /// Presses the button at the pin `stop`.
    fn stop(&mut self);
}

/// The way to the board's ticks, of which each is to begin a step. The robot is held until then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ticks {
    /// None has been seen in runs of a step's length.
    Sought,
    /// One has been in the last run: the next one is less than a step further than this run's end.
    Near,
    /// It comes in one of the next runs, of one cycle.
    Next,
    /// They begin steps.
    Found,
}

/// The circuit with the robot behind its pins.
pub(super) struct OnCircuit {
    sim: Simulation,
    axes: Vec<Axis>,
    pins: Vec<[usize; 2]>,
    robot: Held,
    period: u32,
    ticks: Ticks,
    tick: u32,
    /// Runs since the last tick, or since there was a state without one.
    runs: u32,
    force: [f64; AXES],
    is_lit: bool,
}

impl OnCircuit {
    pub(super) fn new(mut sim: Simulation, wiring: &Wiring, axes: &[Axis], pose: &Pose) -> Result<OnCircuit> {
        let pins = |axis: &Axis| ["a", "b"].map(|pin| sim.input(&format!("{}_{pin}", axis.encoder)));
        let pins = axes.iter().map(pins).filter_map(|[a, b]| Some([a?, b?])).collect();
        // Before the reset's end, pins may look like a tick.
        sim.run(takt_board::top::RESET, &[])?;
        Ok(OnCircuit {
            sim,
            axes: axes.to_vec(),
            pins,
            robot: Held::new(pose),
            period: wiring.period,
            ticks: Ticks::Sought,
            tick: 0,
            runs: 0,
            force: [0.0; AXES],
            is_lit: false,
        })
    }

    /// Lets the robot move as the pulses of the last step make it.
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

    /// The state of the way to the ticks after a run.
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

impl Behind for OnCircuit {
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
            self.sim.turns.push(Turn { pins: *pins, from, by: to.wrapping_sub(from) });
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

/// The emulated board with the robot at its peripherals' registers, a period a step.
pub(super) struct OnEmulation {
    board: Emulated,
    axes: Vec<Axis>,
    inputs: Vec<usize>,
    robot: Held,
}

impl OnEmulation {
    pub(super) fn new(board: Emulated, axes: &[Axis], pose: &Pose) -> Result<OnEmulation> {
        let inputs = axes.iter().map(|axis| {
            board.input(&axis.port).with_context(|| format!("`{}` is no input of the system", axis.port))
        });
        let inputs = inputs.collect::<Result<Vec<usize>>>()?;
        Ok(OnEmulation { board, axes: axes.to_vec(), inputs, robot: Held::new(pose) })
    }
}

impl Behind for OnEmulation {
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
        // A half bridge conducts in one direction or the other wherever it drives.
        let state = State { tick, drives, pose, force, is_lit: drives };
        Ok(Step { received, state: Some(state), rests })
    }

    fn stop(&mut self) {
        self.board.set_stop(true);
    }
}
