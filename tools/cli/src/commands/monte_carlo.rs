// SPDX-License-Identifier: MIT OR Apache-2.0
//! The option `takt track --monte-carlo`: many varied robots, each controlled by the tracking program.

use crate::commands::report::variant;
use crate::run::cache::SELF;
use crate::run::controller::{ControllerError, bind};
use crate::run::workers::{self, WorkArguments, Workers};
use crate::terminal::files::{self, Out};
use crate::terminal::interrupt;
use crate::terminal::number;
use crate::terminal::output::Failure;
use crate::terminal::plot;
use crate::terminal::progress::progress;
use anyhow::{Context, Result, anyhow};
use clap::Args;
use indicatif::ProgressBar;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::io::Write;
use std::num::NonZeroU64;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use takt_analysis::period::PERIOD_LIMIT;
use takt_emu::{Batch, PeriodError};
use takt_isa::Program;
use takt_programs::hybrid::closed_loop::{Inputs, LoopError, distance, not_finite};
use takt_programs::hybrid::ports::INPUTS;
use takt_programs::hybrid::{Binding, Outputs, Robot, Spread};
use takt_programs::trajectory::Trajectory;

/// Maximum size of a spread file in bytes.
const SPREAD_LIMIT: usize = 1 << 20;
/// The paper's requirement on the tool error, m.
const REQUIREMENT: f64 = 10e-6;
/// Number of robots in the list of the worst ones.
const WORST: usize = 5;
/// Reported quantiles, in percent.
const QUANTILES: [f64; 6] = [5.0, 25.0, 50.0, 75.0, 95.0, 99.0];
/// Number of periods between updates of the progress bar.
const STEP: u64 = 1024;

/// Robot, or range of robots, to drive instead of the controller's nominal robot.
#[derive(Args)]
pub(crate) struct SpreadArguments {
    /// Drive the robot of this seed: its masses, friction, encoders and clock are drawn at random (docs/batch.md). With
    /// --monte-carlo, the first of the seeds [default: 1].
    #[arg(long, value_name = "S", value_parser = number::natural, allow_hyphen_values = true)]
    pub(crate) seed: Option<u64>,
    /// Standard deviations of the drawn parameters, as TOML; docs/batch.md states the defaults.
    #[arg(long, value_name = "FILE")]
    pub(crate) spread: Option<PathBuf>,
}

impl SpreadArguments {
    /// Reads the spread from its file, or returns the default spread.
    pub(crate) fn spread(&self) -> Result<Spread> {
        let Some(path) = &self.spread else { return Ok(Spread::default()) };
        let name = files::input_name(path);
        let bytes = files::read(path, SPREAD_LIMIT)?;
        let text = String::from_utf8(bytes).map_err(|_| anyhow!("{name} is not UTF-8 text"))?;
        let spread: Spread = toml::from_str(&text).map_err(|error| {
            let line = error.span().map_or(1, |span| text[..span.start].matches('\n').count() + 1);
            anyhow!("{name}:{line}: {}", error.message().trim().replace('\n', " "))
        })?;
        spread.check().map_err(|(value, range)| anyhow!("{name}: `{value}` must be {range}"))?;
        Ok(spread)
    }

    /// Robot for a single drive, from its seed.
    pub(crate) fn robot(&self, trajectory: &Trajectory) -> Result<Robot> {
        let start = trajectory.start();
        Ok(match self.seed {
            Some(seed) => Robot::drawn(&self.spread()?, seed, &start),
            None => Robot::nominal(&start),
        })
    }
}

/// Result of a robot's run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Drive {
    seed: u64,
    /// Largest tool error while cutting, and over the whole run, m.
    #[serde(with = "bits")]
    cutting: f64,
    #[serde(with = "bits")]
    overall: f64,
    /// Period with the largest error.
    period: u64,
    missed: u64,
    /// Error that ended the drive early.
    failure: Option<String>,
}

/// Serialises floating-point numbers as bits, so that they are transferred exactly between processes.
mod bits {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[allow(clippy::trivially_copy_pass_by_ref)] // signature that serde requires
    pub(super) fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        value.to_bits().serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        u64::deserialize(deserializer).map(f64::from_bits)
    }
}

/// A unit of a run on several computers: consecutive robots.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Job {
    first: u64,
    robots: u64,
}

/// Number of robots in a unit: about 15 s of work for the letters AGH.
const ROBOTS: u64 = 64;
/// Upper bound of the time to simulate one period of a robot.
const PERIOD: Duration = Duration::from_micros(3);

/// Drives, and the number of periods in which robots of a group took different branches.
type Group = (Vec<Drive>, u64);

impl Drive {
    fn keeps(&self) -> bool {
        self.failure.is_none() && self.cutting <= REQUIREMENT
    }
}

/// Parameters shared by all drives: robots, program, path.
pub(crate) struct MonteCarlo<'a> {
    /// Names of program and path.
    pub(crate) name: &'a str,
    pub(crate) path: &'a str,
    pub(crate) program: &'a Program,
    pub(crate) trajectory: &'a Trajectory,
    pub(crate) periods: u64,
    pub(crate) tick: Option<NonZeroU64>,
    pub(crate) spread: Spread,
    pub(crate) first: u64,
    pub(crate) robots: u64,
}

/// Results of all drives, by seed.
pub(crate) struct Drives<'a> {
    of: &'a MonteCarlo<'a>,
    all: Vec<Drive>,
    apart: u64,
}

impl<'a> MonteCarlo<'a> {
    /// Runs all robots, on the local cores or on the workers of a HyperQueue server.
    pub(crate) fn run(&'a self, quiet: bool, work: &WorkArguments) -> Result<Drives<'a>> {
        let bar = progress(self.robots.saturating_mul(self.periods), "periods", quiet);
        let (all, apart) = if work.uses_server() {
            self.run_on_workers(&Workers::new("track", work)?, &bar)?
        } else {
            self.run_on_threads(0..self.robots, &bar)?
        };
        bar.finish_and_clear();
        Ok(Drives { of: self, all, apart })
    }

    /// Performs a unit of [`MonteCarlo::run`] in this process.
    pub(crate) fn unit(&self, job: &Job, result: &Path) -> Result<()> {
        let robots = job.first..job.first.saturating_add(job.robots);
        workers::write(result, &self.run_on_threads(robots, &ProgressBar::hidden())?)
    }

    fn run_on_threads(&self, robots: Range<u64>, bar: &ProgressBar) -> Result<Group> {
        let binding = bind(self.program).with_context(|| self.name.to_owned())?;
        let groups: Vec<Range<u64>> = parts(robots, Batch::WIDTH as u64).collect();
        let groups = groups.into_par_iter().map(|robots| self.group(robots, &binding, bar));
        Ok(joined(groups.collect::<Result<Vec<_>>>()?))
    }

    fn run_on_workers(&self, workers: &Workers, bar: &ProgressBar) -> Result<Group> {
        static STOPPED: AtomicBool = AtomicBool::new(false);
        interrupt::on_interrupt(|| STOPPED.store(true, Ordering::Relaxed))?;
        let build = SELF.as_deref().unwrap_or_default();
        let key = format!(
            "{build} {:?} {:?} {:?} {:?} {}",
            self.program, self.trajectory, self.tick, self.spread, self.periods
        );
        let units = parts(0..self.robots, ROBOTS).map(|robots| {
            let job = Job { first: robots.start, robots: robots.end - robots.start };
            let name = format!("robots {} to {}", robots.start + 1, robots.end);
            let periods = u32::try_from(job.robots.saturating_mul(self.periods)).unwrap_or(u32::MAX);
            workers.unit(name, &format!("{key} {}", self.first), &job, None, PERIOD.saturating_mul(periods))
        });
        let units = units.collect::<Result<Vec<_>>>()?;
        let groups =
            workers.results(&units, &STOPPED, &mut |count| bar.inc(count * ROBOTS * self.periods))?;
        if groups.len() < units.len() {
            let (done, all) = (groups.len(), units.len());
            let text = format!("interrupted after {done} of {all} units; the same command goes on from here");
            return Err(Failure::Interrupted(text).into());
        }
        Ok(joined(groups))
    }

    /// Runs a group of robots in the lanes of one batch.
    fn group(&self, robots: Range<u64>, binding: &Binding, bar: &ProgressBar) -> Result<Group> {
        let start = self.trajectory.start();
        let mut drives: Vec<Drive> = robots
            .map(|robot| Drive {
                seed: self.first.wrapping_add(robot),
                cutting: 0.0,
                overall: 0.0,
                period: 0,
                missed: 0,
                failure: None,
            })
            .collect();
        let mut robots: Vec<Robot> =
            drives.iter().map(|drive| Robot::drawn(&self.spread, drive.seed, &start)).collect();
        let lanes = drives.len();
        let mut batch = Batch::new(self.program, lanes)?;
        batch.set_tick_period(self.tick);
        batch.set_period_limit(PERIOD_LIMIT);
        let mut words = vec![vec![0; lanes]; INPUTS.len()];
        for (period, sample) in (0..self.periods).zip(self.trajectory.samples()) {
            for (lane, (robot, drive)) in robots.iter_mut().zip(&mut drives).enumerate() {
                if drive.failure.is_some() {
                    continue;
                }
                let Some(counts) = robot.counts() else {
                    let lost: LoopError<ControllerError> = LoopError::Lost { period };
                    drive.failure = Some(lost.to_string());
                    continue;
                };
                let inputs = Inputs { counts, reference: sample.reference.convert() };
                words.iter_mut().zip(inputs.to_words()).for_each(|(row, word)| row[lane] = word);
            }
            for (register, row) in binding.inputs.iter().zip(&words) {
                batch.set_input_bits(*register, row).map_err(PeriodError::from)?;
            }
            batch.run_period();
            for (lane, (robot, drive)) in robots.iter_mut().zip(&mut drives).enumerate() {
                if drive.failure.is_some() {
                    continue;
                }
                let outputs = match outputs(&batch, lane, binding) {
                    Ok((outputs, missed)) => {
                        drive.missed += missed;
                        outputs
                    }
                    Err(error) => {
                        drive.failure = Some(format!("period {period}: {error}"));
                        continue;
                    }
                };
                if let Some(port) = not_finite(&outputs) {
                    let error: LoopError<ControllerError> = LoopError::NotFinite { period, port };
                    drive.failure = Some(error.to_string());
                    continue;
                }
                let error = distance(robot.plant().position(), sample.reference.position);
                if sample.cutting {
                    drive.cutting = drive.cutting.max(error);
                }
                if error > drive.overall {
                    (drive.overall, drive.period) = (error, period);
                }
                robot.advance(outputs.force, outputs.torque);
            }
            if (period + 1).is_multiple_of(STEP) {
                bar.inc(STEP * lanes as u64);
            }
        }
        bar.inc(self.periods % STEP * lanes as u64);
        Ok((drives, batch.periods_apart()))
    }
}

/// Splits a range into parts of `width` elements; the last part may be shorter.
fn parts(range: Range<u64>, width: u64) -> impl Iterator<Item = Range<u64>> {
    let count = (range.end - range.start).div_ceil(width);
    (0..count).map(move |part| {
        let start = range.start + part * width;
        start..(start + width).min(range.end)
    })
}

fn joined(groups: Vec<Group>) -> Group {
    let apart = groups.iter().map(|(_, apart)| apart).sum();
    (groups.into_iter().flat_map(|(drives, _)| drives).collect(), apart)
}

/// Forces that a lane commands, and the ticks that it has missed.
fn outputs(batch: &Batch, lane: usize, binding: &Binding) -> Result<(Outputs<f64>, u64), ControllerError> {
    let report = batch.outcome(lane).unwrap_or(Err(PeriodError::Halted))?;
    let outputs = binding.outputs(|register| batch.output_bits(lane, register))?;
    Ok((outputs, u64::from(report.missed) + report.lost))
}

/// Nearest-rank quantile of ascending values.
fn quantile(sorted: &[f64], percent: f64) -> Option<f64> {
    let rank = (percent / 100.0 * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.saturating_sub(1)).copied()
}

impl Drives<'_> {
    fn sorted(&self, error: impl Fn(&Drive) -> f64) -> Vec<f64> {
        let mut values: Vec<f64> =
            self.all.iter().filter(|drive| drive.failure.is_none()).map(error).collect();
        values.sort_by(f64::total_cmp);
        values
    }

    /// The worst robots: failed ones, then those with the largest errors while cutting.
    fn worst(&self) -> Vec<&Drive> {
        let mut all: Vec<&Drive> = self.all.iter().collect();
        all.sort_by(|a, b| {
            (b.failure.is_some(), b.cutting)
                .partial_cmp(&(a.failure.is_some(), a.cutting))
                .unwrap_or(std::cmp::Ordering::Equal)
                .then(a.seed.cmp(&b.seed))
        });
        all.truncate(WORST);
        all
    }

    fn kept(&self) -> usize {
        self.all.iter().filter(|drive| drive.keeps()).count()
    }

    fn failed(&self) -> usize {
        self.all.iter().filter(|drive| drive.failure.is_some()).count()
    }

    pub(crate) fn json(&self) -> Value {
        let quantiles = |sorted: &[f64]| {
            let named = QUANTILES.iter().map(|&percent| (percent.to_string(), quantile(sorted, percent)));
            let ends = [("min", sorted.first()), ("max", sorted.last())];
            let ends = ends.map(|(name, value)| (name.to_owned(), value.copied()));
            named.chain(ends).collect::<std::collections::BTreeMap<_, _>>()
        };
        let drive = |drive: &Drive| {
            json!({
                "seed": drive.seed,
                "tracking_error_m": {"cutting": drive.cutting, "overall": drive.overall},
                "period": drive.period,
                "deadlines_missed": drive.missed,
                "failure": drive.failure,
            })
        };
        json!({
            "program": self.of.name,
            "machine": self.of.program.machine.name,
            "path": self.of.path,
            "periods": self.of.periods,
            "robots": self.all.len(),
            "first_seed": self.of.first,
            "spread": self.of.spread,
            "requirement_m": REQUIREMENT,
            "kept": self.kept(),
            "failed": self.failed(),
            "periods_apart": self.apart,
            "tracking_error_m": {
                "cutting": quantiles(&self.sorted(|drive| drive.cutting)),
                "overall": quantiles(&self.sorted(|drive| drive.overall)),
            },
            "worst": self.worst().into_iter().map(drive).collect::<Vec<_>>(),
            "drives": self.all.iter().map(drive).collect::<Vec<_>>(),
        })
    }

    pub(crate) fn text(&self, out: &mut impl Write) -> Result<()> {
        let MonteCarlo { name, path, program, periods, first, .. } = self.of;
        let (robots, machine) = (self.all.len(), program.machine.name);
        let plural = if robots == 1 { "robot" } else { "robots" };
        let last = first.wrapping_add(robots as u64 - 1);
        writeln!(
            out,
            "{robots} {plural} (seeds {first} to {last}) with {name} on {machine}, {periods} periods of {path} each\n"
        )?;
        let (cutting, overall) = (self.sorted(|drive| drive.cutting), self.sorted(|drive| drive.overall));
        if !cutting.is_empty() {
            writeln!(out, "largest tracking error: {} on {machine}", variant(name))?;
            writeln!(out, "{:<34}{:>12}{:>12}", "  µm", "cutting", "overall")?;
            let mut row = |name: &str, cutting: Option<f64>, overall: Option<f64>| {
                let show =
                    |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{:.2}", value * 1e6));
                writeln!(out, "  {name:<32}{:>12}{:>12}", show(cutting), show(overall))
            };
            row("best robot", cutting.first().copied(), overall.first().copied())?;
            for percent in QUANTILES {
                let name = format!("{percent} % of the robots below");
                row(&name, quantile(&cutting, percent), quantile(&overall, percent))?;
            }
            row("worst robot", cutting.last().copied(), overall.last().copied())?;
        }
        let kept = self.kept();
        let share = 100.0 * kept as f64 / robots as f64;
        writeln!(out, "\n{kept} of {robots} ({share:.1} %) keep {:.0} µm while cutting", REQUIREMENT * 1e6)?;
        match self.failed() {
            0 => {}
            1 => writeln!(out, "1 did not come to the end of the path")?,
            failed => writeln!(out, "{failed} did not come to the end of the path")?,
        }
        let missed: u64 = self.all.iter().map(|drive| drive.missed).sum();
        if missed > 0 {
            writeln!(out, "{missed} deadlines missed")?;
        }
        writeln!(out, "\nworst:")?;
        for Drive { seed, cutting, overall, period, failure, .. } in self.worst() {
            match failure {
                Some(failure) => writeln!(out, "  seed {seed}: {failure}")?,
                None => writeln!(
                    out,
                    "  seed {seed}: {:.2} µm cutting; {:.2} µm overall, in period {period}",
                    cutting * 1e6,
                    overall * 1e6
                )?,
            }
        }
        writeln!(
            out,
            "`takt track --seed S` drives one of them, `takt debug --track --seed S` looks into it"
        )?;
        Ok(())
    }

    /// Histogram of the robots' errors as SVG.
    pub(crate) fn draw(&self) -> Result<String> {
        let microns: Vec<f64> = self.sorted(|drive| drive.cutting).iter().map(|error| error * 1e6).collect();
        let title = format!("{} along {}: {} robots", self.of.name, self.of.path, microns.len());
        plot::histogram(&title, &microns)
    }

    pub(crate) fn print(&self, json: bool, plot: Option<Out>, quiet: bool, out: &mut Out) -> Result<()> {
        if let Some(mut file) = plot {
            file.write_all(self.draw()?.as_bytes())?;
            file.finish()?;
        }
        match (json, quiet) {
            (true, _) => files::json(&self.json(), out),
            (false, true) => Ok(()),
            (false, false) => self.text(out),
        }
    }
}

/// The output goes to a file, which leaves standard output for the table.
pub(crate) fn leaves_stdout(path: Option<&Path>) -> bool {
    !path.is_some_and(files::is_dash)
}
