// SPDX-License-Identifier: MIT OR Apache-2.0
//! `takt board sim --robot`: the hybrid robot behind the pins of a simulated board. Encoders turn as its axes move, its forces come from
//! the PWMs' pulses, and the host at the UART, a pseudo-terminal as for every host, gives a point of the path each period.

use crate::controller::{self, OnEmulator};
use crate::deny::Watch;
use crate::files::Out;
use crate::track;
use anyhow::{Context, Result, anyhow, bail, ensure};
use std::io::Write;
use std::num::NonZeroU64;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};
use takt_board::host::{Fed, Ports};
use takt_board::protocol::{self, Receiver};
use takt_board::serial::Serial;
use takt_board::simulation::{Simulation, Turn};
use takt_board::terminal::Terminal;
use takt_board::wiring::Peripheral;
use takt_board::{Host, Wiring};
use takt_emu::Emulator;
use takt_isa::Program;
use takt_programs::hybrid::closed_loop::{ClosedLoop, TrackingError, distance};
use takt_programs::hybrid::kinematics::Reference;
use takt_programs::hybrid::params::SAMPLE_TIME;
use takt_programs::hybrid::plant::Plant;
use takt_programs::hybrid::ports::{INPUTS, OUTPUTS};
use takt_programs::trajectory::{Sample, Trajectory};

/// Axes of the robot: encoders, the first inputs, and forces and torques, the first outputs.
const AXES: usize = 5;
/// Steps of the plant in a period: forces act a step later than the pulses that make them.
const STEPS: u32 = 20;
/// Periods at the path's first point before it begins.
const STANDS: usize = 20;
/// The time for which the board waits for its host after the end of a period, so that what runs here depends on no other load of the machine.
const PATIENCE: Duration = Duration::from_secs(10);

/// An axis at the pins.
#[derive(Clone, Debug)]
struct Axis {
    encoder: String,
    motor: String,
    /// Force or torque at full duty, N or N·m.
    full: f64,
}

impl Axis {
    /// The axis whose count is this input port, and whose duty that output port; it stands at `count`.
    fn new(wiring: &Wiring, input: &str, output: &str, count: i32) -> Result<Axis> {
        let of = |kind: &str, port: &dyn Fn(&Peripheral) -> bool| {
            wiring.peripherals.iter().find(|peripheral| peripheral.kind.name == kind && port(peripheral))
        };
        let encoder = of("quadrature", &|peripheral| peripheral.reads[0].as_deref() == Some(input));
        let encoder = encoder.with_context(|| {
            format!("the wiring has no quadrature whose `count` is the port `{input}`: an axis of the robot is missing")
        })?;
        let start = encoder.parameter("start").cast_signed();
        ensure!(
            start == count,
            "the robot stands at {count} counts of `{input}`, and `{}` starts at {start}: `start = {count}`",
            encoder.name
        );
        let wired =
            |peripheral: &Peripheral| peripheral.writes[0].as_ref().is_some_and(|write| write.port == output);
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
        let full = f64::from(motor.parameter("half")) / f64::from(scale).exp2();
        Ok(Axis { encoder: encoder.name.clone(), motor: motor.name.clone(), full })
    }
}

/// A drive that is about to begin.
pub(super) struct Drive<'a> {
    program: &'a Program,
    wiring: &'a Wiring,
    path: String,
    trajectory: Trajectory,
    periods: u64,
    axes: Vec<Axis>,
    /// Address of the first value of a reference.
    reference: u16,
}

impl<'a> Drive<'a> {
    /// A drive along a path, of so many periods.
    ///
    /// # Errors
    /// If program or wiring is not for this robot.
    pub(super) fn new(
        program: &'a Program,
        wiring: &'a Wiring,
        gcode: Option<&Path>,
        periods: u64,
    ) -> Result<Drive<'a>> {
        let binding = controller::bind(program)?;
        let (path, trajectory) = track::trajectory(gcode)?;
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
        let counts = Plant::at_rest(&trajectory.start()).counts().context("the path begins out of reach")?;
        let names = INPUTS.iter().zip(&OUTPUTS).zip(counts).take(AXES);
        let axes = names.map(|((input, output), count)| Axis::new(wiring, input.name, output.name, count));
        let axes = axes.collect::<Result<Vec<Axis>>>()?;
        let addresses = binding.inputs[AXES..].iter().map(|register| program.machine.inputs.index(*register));
        let addresses: Vec<u16> = addresses.flatten().map(|index| protocol::INPUTS + index.get()).collect();
        ensure!(
            addresses.windows(2).all(|pair| pair[0] + 1 == pair[1]),
            "the ports of the reference, x to eps_gamma, have no consecutive numbers: they could not change together"
        );
        let reference = *addresses.first().context("a reference has values")?;
        let periods = periods.min(trajectory.periods());
        Ok(Drive { program, wiring, path, trajectory, periods, axes, reference })
    }

    /// Drives, and says how it went.
    pub(super) fn run(&self, board: &str, sim: Simulation, out: &mut Out) -> Result<()> {
        let terminal = Terminal::new()?;
        let port = terminal.path().to_owned();
        let samples: Vec<Sample> = self.trajectory.samples().take(self.periods as usize).collect();
        let is_over = AtomicBool::new(false);
        let (robot, host) = thread::scope(|scope| {
            let robot = scope.spawn(|| self.robot(sim, terminal, &is_over));
            let host = self.host(&port, &samples);
            is_over.store(true, Ordering::Relaxed);
            (robot.join(), host)
        });
        let positions = robot.map_err(|_| anyhow!("the simulated board has failed"))?;
        let Hosted { fed, cycles, misses } = host?;
        let positions = positions?;
        let mut error = TrackingError::default();
        for (sample, period) in samples.iter().zip(&fed.used[STANDS..]) {
            // Periods count from 1.
            let position = positions.get((*period as usize).wrapping_sub(1));
            let position = position.with_context(|| format!("the board has had no period {period}"))?;
            error.add_distance(distance(*position, sample.reference.position), sample.cutting);
        }
        let alone = self.without_pins()?;
        writeln!(
            out,
            "{} on {board}, simulated: {} at {} MHz, {} periods of {} from its beginning",
            self.program.files.first().map_or("the program", String::as_str),
            self.program.machine.name,
            self.wiring.clock,
            samples.len(),
            self.path,
        )?;
        writeln!(out, "largest tracking error, µm     through the pins    takt track")?;
        if samples.iter().any(|sample| sample.cutting) {
            writeln!(out, "  while cutting {:>31.2} {:>13.2}", error.cutting * 1e6, alone.cutting * 1e6)?;
        }
        writeln!(out, "  overall       {:>31.2} {:>13.2}", error.overall * 1e6, alone.overall * 1e6)?;
        writeln!(
            out,
            "from tick to outputs {cycles} cycles at most, of {}; {misses} deadlines missed; {} points of the path late",
            self.wiring.period, fed.late
        )?;
        Ok(())
    }

    /// The same periods on the emulator, with forces as the program writes them.
    fn without_pins(&self) -> Result<TrackingError> {
        let mut emulator = Emulator::new(self.program)?;
        emulator.set_tick_period(NonZeroU64::new(self.wiring.period.into()));
        let controller = OnEmulator::new(emulator, Watch::idle(), u64::MAX)?;
        let mut error = TrackingError::default();
        for record in ClosedLoop::new(&self.trajectory, controller).take(self.periods as usize) {
            error.add(&record.with_context(|| self.path.clone())?);
        }
        Ok(error)
    }

    /// The host's half, at its end of the line.
    fn host(&self, port: &Path, samples: &[Sample]) -> Result<Hosted> {
        let mut host = Host::connect(Serial::open(port, self.wiring.baud)?, 1)?;
        let row = |sample: &Sample| -> Vec<Ports> {
            let reference: Reference<f32> = sample.reference.convert();
            vec![(self.reference, reference.to_array().map(f32::to_bits).to_vec())]
        };
        let first = samples.first().context("a path has a point")?;
        // Held, so that the first period has the first point, too.
        host.set("control", protocol::RUN | protocol::HOLD | protocol::ENABLE)?;
        for (address, words) in row(first) {
            host.write(address, &words)?;
        }
        host.set("control", protocol::RUN | protocol::ENABLE)?;
        let stands = std::iter::repeat_n(first, STANDS);
        let bar = crate::progress::progress((STANDS + samples.len()) as u64, "periods", false);
        let fed = host.feed(stands.chain(samples).map(row).inspect(|_| bar.inc(1)));
        bar.finish_and_clear();
        let fed = fed?;
        let (cycles, misses) = (host.register("most_cycles")?, host.register("misses")?);
        let causes: Vec<&str> = host.status()?.causes().collect();
        ensure!(causes.is_empty(), "the drive has stopped: {}", causes.join(", "));
        host.set("control", 0)?;
        Ok(Hosted { fed, cycles, misses })
    }

    /// The board's half, with the robot: where the tool was at each tick.
    fn robot(
        &self,
        mut sim: Simulation,
        mut terminal: Terminal,
        is_over: &AtomicBool,
    ) -> Result<Vec<[f64; 3]>> {
        let lost = || anyhow!("an axis has left the range of its encoder");
        let step = self.wiring.period / STEPS;
        let seconds = SAMPLE_TIME / f64::from(STEPS);
        let mut plant = Plant::at_rest(&self.trajectory.start());
        let mut counts = plant.counts().ok_or_else(lost)?;
        let pins = |axis: &Axis| ["a", "b"].map(|pin| sim.input(&format!("{}_{pin}", axis.encoder)));
        let pins: Vec<[usize; 2]> = self.axes.iter().map(pins).filter_map(|[a, b]| Some([a?, b?])).collect();
        let (mut frames, mut bytes) = (Receiver::default(), Vec::new());
        let mut ticks = Vec::new();
        // Before the reset's end, pins may look like a tick.
        sim.run(takt_board::top::RESET, &[])?;
        // Cycles of the next run: one, until the first tick is seen; then steps, of which one begins at each tick.
        let (mut next, mut waits) = (1, None::<Instant>);
        while !is_over.load(Ordering::Relaxed) {
            bytes.extend(terminal.receive()?);
            // A request can come in pieces, between which a busy machine leaves any time.
            if let Some(since) = waits
                && !protocol::has_request(&bytes)
            {
                ensure!(since.elapsed() < PATIENCE, "the host is silent");
                thread::sleep(Duration::from_micros(20));
                continue;
            }
            waits = None;
            let from = counts;
            let seen = |name: &str, pin: &str| sim.output(&format!("{name}_{pin}")).unwrap_or_default();
            if next == step && seen("signal", "drive").0 {
                let high = |axis: &Axis, pin| f64::from(seen(&axis.motor, pin).1);
                let force =
                    |axis: &Axis| (high(axis, "high") - high(axis, "low")) / f64::from(step) * axis.full;
                let [a, b, c, d, e] = std::array::from_fn(|i| force(&self.axes[i]));
                plant.advance_by(seconds, [a, b, c], [d, e]);
                counts = plant.counts().ok_or_else(lost)?;
            }
            for (pins, (from, to)) in pins.iter().zip(from.into_iter().zip(counts)) {
                sim.turns.push(Turn { pins: *pins, from, by: to.wrapping_sub(from) });
            }
            let before = plant.position();
            sim.run(next, &std::mem::take(&mut bytes))?;
            let tick = sim.output("signal_tick").unwrap_or_default().1;
            if tick > 0 {
                ticks.push(before);
                next = step;
            }
            let received = sim.take_received();
            frames.put(&received);
            while let Some(frame) = frames.frame() {
                waits = frame.stream.then(Instant::now).or(waits);
            }
            if !received.is_empty() {
                terminal.send(&received)?;
            }
        }
        Ok(ticks)
    }
}

/// The result of the host's half.
struct Hosted {
    fed: Fed,
    cycles: u32,
    misses: u32,
}
