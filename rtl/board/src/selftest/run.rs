// SPDX-License-Identifier: MIT OR Apache-2.0
//! Run of the hardware kit on a board, by its host.

use super::{
    BATCH, COUNTED, DONE, ECHOES, Emulated, HALF, ROUNDS, SelftestError, address, board_cycles, operations,
};
use crate::application::Application;
use crate::host::{Host, fault_kind};
use crate::protocol::{ENABLE, Line, LinkError, RESTART, RUN};
use crate::top::image;
use crate::wiring::Wiring;
use std::time::Duration;
use takt_isa::Program;

/// Time without progress after which the program counts as standing still.
const STILL: Duration = Duration::from_secs(60);
/// Requests of which the quickest gives a time.
const SAMPLES: usize = 5;
/// Periods before the first that is compared over the wires: the outputs drive from the end of the first on, and a word comes back in
/// the period after that in which it was sent.
const BEFORE: u32 = 2;

/// Extent of a run.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Operands of each instruction.
    pub operands: u32,
    /// Least time over which the clock is compared with the host's.
    pub listen: Duration,
}

/// A value on the board, and that of the emulator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Comparison {
    /// Value on the board.
    pub found: u32,
    /// Value computed by the emulator.
    pub expected: u32,
}

impl Comparison {
    /// Both values are the same.
    pub fn is_same(self) -> bool {
        self.found == self.expected
    }
}

/// Events at the end of a wire: pulses or words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoopBack {
    /// Events that came back.
    pub found: u32,
    /// Events that were sent.
    pub expected: u32,
    /// Events more or less that are right: an edge may fall on a tick.
    pub tolerance: u32,
}

impl LoopBack {
    /// Something came back.
    pub fn is_wired(self) -> bool {
        self.found != 0
    }

    /// All that was sent came back.
    pub fn is_right(self) -> bool {
        self.found.abs_diff(self.expected) <= self.tolerance
    }
}

/// The board's clock against the host's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// Periods between two times of the host.
    pub periods: u32,
    /// Host's time of these periods in seconds.
    pub seconds: f64,
    /// Frequency against the nominal one, in millionths.
    pub ppm: f64,
    /// Bound on the error of `ppm`: requests take time, and periods are counted whole.
    pub uncertainty: f64,
}

/// Result of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// The register `circuit` of the board.
    pub circuit: u32,
    /// Operands of each instruction.
    pub operands: u32,
    /// Name, unit and digests of each instruction.
    pub digests: Vec<(String, &'static str, Comparison)>,
    /// Cycles of the longest period, from the tick to the outputs at the peripherals.
    pub cycles: Comparison,
    /// Deadlines that were missed.
    pub misses: u32,
    /// Frames that the board has dropped, for a wrong checksum or a pause.
    pub errors: u32,
    /// Requests that the host has repeated.
    pub retries: u64,
    /// Pulses of the PWM over its wire.
    pub pulses: LoopBack,
    /// Words of the SPI over its wire.
    pub words: LoopBack,
    /// The board's clock. It is no part of [`Report::is_right`]: a UART at a wrong clock says nothing at all.
    pub clock: Clock,
}

impl Report {
    /// Everything that was run is right. A wire that is not there is no failure.
    pub fn is_right(&self) -> bool {
        let wires = [self.pulses, self.words];
        self.digests.iter().all(|(_, _, digest)| digest.is_same())
            && self.cycles.is_same()
            && [self.misses, self.errors] == [0; 2]
            && wires.iter().all(|wire| !wire.is_wired() || wire.is_right())
    }
}

/// Number of periods at a time of the host, in seconds; `within` is the greatest error of the time.
struct Sample {
    periods: u32,
    time: f64,
    within: f64,
}

impl Sample {
    /// The quickest of some requests.
    fn take<L: Line>(host: &mut Host<L>) -> Result<Sample, LinkError> {
        let mut best: Option<Sample> = None;
        for _ in 0..SAMPLES {
            let from = host.line.time().as_secs_f64();
            let periods = host.register("periods")?;
            let within = (host.line.time().as_secs_f64() - from) / 2.0;
            if best.as_ref().is_none_or(|best| within < best.within) {
                best = Some(Sample { periods, time: from + within, within });
            }
        }
        Ok(best.unwrap_or(Sample { periods: 0, time: 0.0, within: 0.0 }))
    }

    /// The clock from this sample to a later one.
    fn clock(&self, later: &Sample, wiring: &Wiring) -> Clock {
        let periods = later.periods.wrapping_sub(self.periods);
        let seconds = later.time - self.time;
        let period = f64::from(wiring.period) / (wiring.clock * 1e6);
        let within = self.within + later.within + period;
        Clock {
            periods,
            seconds,
            ppm: (f64::from(periods) * period / seconds - 1.0) * 1e6,
            uncertainty: within / seconds * 1e6,
        }
    }
}

/// Checks that the board carries this kit.
///
/// # Errors
/// If it carries something else, or does not answer.
pub fn check<L: Line>(host: &mut Host<L>, wiring: &Wiring, program: &Program) -> Result<(), SelftestError> {
    if !wiring.uart {
        return Err(SelftestError::NoUart);
    }
    host.fits(program)?;
    let records = image(program)?.records.len() as u32;
    for (register, wanted) in [("period", wiring.period), ("lead", wiring.lead), ("records", records)] {
        let there = host.register(register)?;
        if there != wanted {
            return Err(SelftestError::Other { register, there, wanted });
        }
    }
    match wiring.observe {
        true => Ok(()),
        false => Err(SelftestError::Unobserved),
    }
}

/// Runs the kit on a board that carries it, and stops it afterwards. `progress` gets the operands that are done.
///
/// The program's image, which takes long to read, is compared only if a result differs: the registers of another program lie elsewhere.
///
/// # Errors
/// If the program stops or is another one, or the board does not answer.
pub fn run<L: Line>(
    host: &mut Host<L>,
    wiring: &Wiring,
    program: &Program,
    expected: &Emulated,
    options: Options,
    progress: impl FnMut(u32),
) -> Result<Report, SelftestError> {
    let result = measure(host, wiring, program, expected, options, progress);
    let is_in_doubt = match &result {
        Ok(report) => !report.is_right(),
        Err(error) => matches!(error, SelftestError::Stopped(..) | SelftestError::Still(_)),
    };
    if is_in_doubt {
        let difference = host.first_difference(&image(program)?.records)?;
        host.set("page", 0)?;
        if let Some(record) = difference {
            return Err(SelftestError::OtherProgram(record));
        }
    }
    result
}

fn measure<L: Line>(
    host: &mut Host<L>,
    wiring: &Wiring,
    program: &Program,
    expected: &Emulated,
    options: Options,
    mut progress: impl FnMut(u32),
) -> Result<Report, SelftestError> {
    check(host, wiring, program)?;
    let application = Application::from(program);
    let at = |name: &str| address(&application, name);
    let (done, counted, echoes) = (at(DONE)?, at(COUNTED)?, at(ECHOES)?);
    let operations = operations(program.machine);
    let digests =
        operations.iter().map(|operation| at(&operation.digest())).collect::<Result<Vec<_>, _>>()?;
    let errors = host.register("errors")?;
    let retries = host.retries;

    host.set("control", RUN | ENABLE | RESTART)?;
    host.settle()?;
    let begin = Sample::take(host)?;
    host.write(at(ROUNDS)?, &[options.operands])?;
    let (mut before, mut since) = (0, host.line.time());
    let count = loop {
        let now = host.read(done, 1)?[0];
        progress(now);
        if now >= options.operands {
            break now;
        }
        let status = host.status()?;
        if status.fault() {
            let kind = fault_kind(host.register("fault")?).to_owned();
            return Err(SelftestError::Stopped(format!("a fault ({kind})"), now));
        }
        if status.halted() || status.in_reset() {
            return Err(SelftestError::Stopped(status.activity(RUN).to_owned(), now));
        }
        if now != before {
            (before, since) = (now, host.line.time());
        } else if host.line.time().saturating_sub(since) > STILL {
            return Err(SelftestError::Still(now));
        }
    };
    let end = loop {
        let sample = Sample::take(host)?;
        if sample.time - begin.time >= options.listen.as_secs_f64() {
            break sample;
        }
    };

    let found = host.read_each(&digests)?;
    let digests = operations.into_iter().zip(found.into_iter().zip(&expected.digests));
    let digests = digests.map(|(operation, (found, &expected))| {
        (operation.name, operation.unit, Comparison { found, expected })
    });
    let compared = (count / BATCH).saturating_sub(BEFORE);
    let pulses = u64::from(wiring.period) / (2 * HALF) * u64::from(compared);
    let report = Report {
        circuit: host.register("circuit")?,
        operands: count,
        digests: digests.collect(),
        cycles: Comparison {
            found: host.register("most_cycles")?,
            expected: board_cycles(wiring, expected.cycles) as u32,
        },
        misses: host.register("misses")?,
        errors: host.register("errors")?.wrapping_sub(errors),
        retries: host.retries - retries,
        pulses: LoopBack { found: host.read(counted, 1)?[0], expected: pulses as u32, tolerance: 1 },
        words: LoopBack { found: host.read(echoes, 1)?[0], expected: compared, tolerance: 0 },
        clock: begin.clock(&end, wiring),
    };
    host.set("control", 0)?;
    Ok(report)
}
