// SPDX-License-Identifier: MIT OR Apache-2.0
//! Closed loop of a tracking program with the robot along the AGH path.

use crate::program::LoadedProgram;
use crate::{CYCLES, Playground};
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::OnceLock;
use takt_emu::{Emulator, PeriodError};
use takt_programs::hybrid::closed_loop::{ClosedLoop, Inputs, TrackingController, TrackingError};
use takt_programs::hybrid::params;
use takt_programs::hybrid::{Binding, LoopError, Outputs, UnwrittenOutput};
use takt_programs::trajectory::Trajectory;

/// Maximum number of periods in a call.
const SLICE: u64 = 20_000;
/// Number of periods between two poses that are kept for drawing.
const EVERY: u64 = 100;

/// Plan of the AGH path, computed once.
fn trajectory() -> Result<&'static Trajectory, String> {
    static TRAJECTORY: OnceLock<Result<Trajectory, String>> = OnceLock::new();
    let plan = || {
        let moves = takt_programs::gcode::read_bytes(takt_programs::AGH.as_bytes());
        let moves = moves.map_err(|error| format!("agh.ngc:{}: {}", error.line, error.kind))?;
        Trajectory::plan(&moves).map_err(|error| error.to_string())
    };
    TRAJECTORY.get_or_init(plan).as_ref().map_err(Clone::clone)
}

/// Errors that end the closed loop early.
pub(crate) enum LoopFailure {
    Period(PeriodError),
    Unwritten(UnwrittenOutput),
}

/// Program on the emulator as controller of the closed loop.
struct EmulatorController {
    emulator: Emulator,
    binding: Binding,
    cycles: u64,
}

impl TrackingController for EmulatorController {
    type Error = LoopFailure;

    fn step(&mut self, inputs: &Inputs) -> Result<Outputs<f64>, LoopFailure> {
        let Self { emulator, binding, cycles } = self;
        for (register, bits) in binding.inputs.iter().zip(inputs.to_words()) {
            emulator.set_input_bits(*register, bits).map_err(|error| LoopFailure::Period(error.into()))?;
        }
        emulator.set_cycle_limit(emulator.now() + CYCLES);
        *cycles = emulator.run_period(&[]).map_err(LoopFailure::Period)?.cycles;
        binding.outputs(|register| emulator.output_bits(register)).map_err(LoopFailure::Unwritten)
    }
}

/// A drive along the path in progress.
pub(crate) struct Track {
    closed_loop: ClosedLoop<'static, EmulatorController>,
    errors: TrackingError,
    /// Number of completed periods.
    done: u64,
    longest: u64,
}

/// Request to continue the drive.
#[derive(Deserialize)]
pub(crate) struct DriveRequest {
    /// Start again from the beginning, instead of continuing.
    #[serde(default)]
    begin: bool,
    periods: u64,
}

impl LoadedProgram {
    fn lost(&self, error: &LoopError<LoopFailure>) -> String {
        match error {
            LoopError::Controller { period, source: LoopFailure::Period(error) } => {
                format!("period {}: {}", period + 1, self.fault(error))
            }
            LoopError::Controller { period, source: LoopFailure::Unwritten(error) } => {
                format!("period {}: {error}", period + 1)
            }
            LoopError::NotFinite { period, port } => format!("period {}: {port} is not finite", period + 1),
            LoopError::Lost { period } => {
                format!("period {}: an axis left the range of its encoder", period + 1)
            }
        }
    }
}

impl Playground {
    /// Continues the drive; returns the poses passed.
    pub(crate) fn track(&mut self, wanted: DriveRequest) -> Result<Value, String> {
        let trajectory = trajectory()?;
        if wanted.begin {
            let loaded = self.loaded()?;
            let program = &loaded.assembled.program;
            let binding = Binding::new(program).map_err(|error| error.to_string())?;
            let emulator = Emulator::new(program).map_err(|error| error.to_string())?;
            let closed_loop =
                ClosedLoop::new(trajectory, EmulatorController { emulator, binding, cycles: 0 });
            self.track = Some(Track { closed_loop, errors: TrackingError::default(), done: 0, longest: 0 });
        }
        let mut track = self.track.take().ok_or("no drive has begun")?;
        let loaded = self.loaded()?;
        let all = trajectory.periods();
        let until = (track.done + wanted.periods.min(SLICE)).min(all);
        let (mut poses, mut fault) = (Vec::new(), None);
        while track.done < until && fault.is_none() {
            match track.closed_loop.next() {
                Some(Ok(record)) => {
                    track.errors.add(&record);
                    track.longest = track.longest.max(track.closed_loop.controller().cycles);
                    if record.period.is_multiple_of(EVERY) || track.done + 1 == all {
                        let angle =
                            |axis: usize| f64::from(record.inputs.counts[axis]) * params::RESOLUTION[axis];
                        let [x, y, z] = record.position;
                        let cutting = f64::from(u8::from(record.sample.cutting));
                        poses.push([
                            record.period as f64,
                            x,
                            y,
                            z,
                            angle(3),
                            angle(4),
                            record.tool_error,
                            cutting,
                        ]);
                    }
                    track.done += 1;
                }
                Some(Err(error)) => fault = Some(loaded.lost(&error)),
                None => break,
            }
        }
        let controller = track.closed_loop.controller();
        let statistics = controller.emulator.statistics();
        let told = json!({
            "done": track.done,
            "all": all,
            "over": track.done >= all || fault.is_some(),
            "sample_time": params::SAMPLE_TIME,
            "base": params::BASE_POINTS,
            "poses": poses,
            "cycles": controller.cycles,
            "longest": track.longest,
            "cutting": track.errors.cutting,
            "overall": track.errors.overall,
            "operations": statistics.total_operations(),
            "missed": statistics.missed,
            "fault": fault,
        });
        self.track = Some(track);
        Ok(told)
    }
}
