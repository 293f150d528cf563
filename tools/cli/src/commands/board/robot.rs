// SPDX-License-Identifier: MIT OR Apache-2.0
//! The option `takt board sim --robot`: hybrid robot at the pins of a simulated board. Encoders follow its axes, forces follow the PWM
//! pulses, and the host at the UART (a pseudo-terminal, as for any host) sends a point of the path in each period.

use super::plant_at_pins::{AXES, Axis, CircuitWithRobot, RobotAtPins};
use crate::commands::track;
use crate::run::controller::{self, EmulatorController};
use crate::run::deny::Watch;
use crate::terminal::files::Out;
use anyhow::{Context, Result, anyhow, ensure};
use std::io::Write;
use std::num::NonZeroU64;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};
use takt_board::host::{FeedResult, Ports};
use takt_board::protocol::{self, Receiver};
use takt_board::serial::Serial;
use takt_board::simulation::Simulation;
use takt_board::terminal::Terminal;
use takt_board::{Host, Wiring};
use takt_emu::Emulator;
use takt_isa::Program;
use takt_programs::hybrid::closed_loop::{ClosedLoop, TrackingError, distance};
use takt_programs::hybrid::kinematics::Reference;
use takt_programs::trajectory::{Sample, Trajectory};

/// Number of periods at the first point of the path before the motion starts.
const STANDS: usize = 20;
/// Wall-clock time for which the board waits for its host after a period, so that results do not depend on the machine's load. The host
/// is a thread of this process, which is silent for longer only if it has ended.
const PATIENCE: Duration = Duration::from_secs(60);

/// A drive along a path, checked and ready to run.
pub(super) struct Drive<'a> {
    program: &'a Program,
    wiring: &'a Wiring,
    path: String,
    trajectory: Trajectory,
    periods: u64,
    axes: Vec<Axis>,
    /// Address of the first value of the reference.
    reference: u16,
}

impl<'a> Drive<'a> {
    /// Prepares a drive along a path over a given number of periods.
    ///
    /// # Errors
    /// If program or wiring do not suit this robot.
    pub(super) fn new(
        program: &'a Program,
        wiring: &'a Wiring,
        gcode: Option<&Path>,
        periods: u64,
    ) -> Result<Drive<'a>> {
        let binding = controller::bind(program)?;
        let (path, trajectory) = track::trajectory(gcode)?;
        let axes = Axis::all(wiring, &trajectory.start())?;
        let addresses = binding.inputs[AXES..].iter().map(|register| program.machine.inputs.index(*register));
        let addresses: Vec<u16> = addresses.flatten().map(|index| protocol::INPUTS + index.get()).collect();
        ensure!(
            addresses.windows(2).all(|pair| pair[0] + 1 == pair[1]),
            "the ports of the reference, x to eps_gamma, must have consecutive numbers, so that they change together"
        );
        let reference = *addresses.first().context("the reference has no port")?;
        let periods = periods.min(trajectory.periods());
        Ok(Drive { program, wiring, path, trajectory, periods, axes, reference })
    }

    /// Executes the drive and reports the results.
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
        let HostResult { fed, cycles, misses } = host?;
        let positions = positions?;
        let mut error = TrackingError::default();
        for (sample, period) in samples.iter().zip(&fed.used[STANDS..]) {
            // Periods count from 1.
            let position = positions.get((*period as usize).wrapping_sub(1));
            let position = position.with_context(|| format!("the board has not run period {period}"))?;
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

    /// Tracking error over the same periods on the emulator, with ideal forces.
    fn without_pins(&self) -> Result<TrackingError> {
        let mut emulator = Emulator::new(self.program)?;
        emulator.set_tick_period(NonZeroU64::new(self.wiring.period.into()));
        let controller = EmulatorController::new(emulator, Watch::idle(), u64::MAX)?;
        let mut error = TrackingError::default();
        for record in ClosedLoop::new(&self.trajectory, controller).take(self.periods as usize) {
            error.add(&record.with_context(|| self.path.clone())?);
        }
        Ok(error)
    }

    /// Host side of the serial line.
    fn host(&self, port: &Path, samples: &[Sample]) -> Result<HostResult> {
        let mut host = Host::connect(Serial::open(port, self.wiring.baud)?.patient(), 1)?;
        let row = |sample: &Sample| -> Vec<Ports> {
            let reference: Reference<f32> = sample.reference.convert();
            vec![(self.reference, reference.to_array().map(f32::to_bits).to_vec())]
        };
        let first = samples.first().context("the path has no point")?;
        // Hold the program first, so that its first period reads the first point.
        host.set("control", protocol::RUN | protocol::HOLD | protocol::ENABLE)?;
        for (address, words) in row(first) {
            host.write(address, &words)?;
        }
        host.set("control", protocol::RUN | protocol::ENABLE)?;
        let stands = std::iter::repeat_n(first, STANDS);
        let bar = crate::terminal::progress::progress((STANDS + samples.len()) as u64, "periods", false);
        let fed = host.feed(stands.chain(samples).map(row).inspect(|_| bar.inc(1)));
        bar.finish_and_clear();
        let fed = fed?;
        let (cycles, misses) = (host.register("most_cycles")?, host.register("misses")?);
        let causes: Vec<&str> = host.status()?.causes().collect();
        ensure!(causes.is_empty(), "the drive has stopped: {}", causes.join(", "));
        host.set("control", 0)?;
        Ok(HostResult { fed, cycles, misses })
    }

    /// Board side, with the robot; returns the tool's position at each tick.
    fn robot(&self, sim: Simulation, mut terminal: Terminal, is_over: &AtomicBool) -> Result<Vec<[f64; 3]>> {
        let mut board = CircuitWithRobot::new(sim, self.wiring, &self.axes, &self.trajectory.start())?;
        let (mut frames, mut bytes) = (Receiver::default(), Vec::new());
        let (mut ticks, mut waits) = (Vec::new(), None::<Instant>);
        while !is_over.load(Ordering::Relaxed) {
            bytes.extend(terminal.receive()?);
            // A request may arrive in pieces; on a busy machine, the gaps between them are arbitrary.
            if let Some(since) = waits
                && !protocol::has_request(&bytes)
            {
                ensure!(since.elapsed() < PATIENCE, "the host is silent");
                thread::sleep(Duration::from_micros(20));
                continue;
            }
            waits = None;
            let step = board.step(&std::mem::take(&mut bytes))?;
            ticks.extend(step.state.filter(|state| state.tick > 0).map(|state| state.pose.position));
            frames.put(&step.received);
            while let Some(frame) = frames.frame() {
                waits = frame.stream.then(Instant::now).or(waits);
            }
            if !step.received.is_empty() {
                terminal.send(&step.received)?;
            }
        }
        Ok(ticks)
    }
}

/// Result of the host side.
struct HostResult {
    fed: FeedResult,
    cycles: u32,
    misses: u32,
}
