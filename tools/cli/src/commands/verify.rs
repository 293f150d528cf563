// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt verify`, and the check performed by `takt asm --verify`.

use crate::run::cache::SELF;
use crate::run::load::Load;
use crate::run::workers::{self, WorkArguments, Workers};
use crate::terminal::files::{self, Out};
use crate::terminal::interrupt;
use crate::terminal::number;
use crate::terminal::options::{OptionalMachine, SourceArguments};
use crate::terminal::output::Failure;
use crate::terminal::progress::DelayedProgress;
use anyhow::{Context, Result, bail};
use clap::Args;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use takt_asm::image;
use takt_asm::limits::IMAGE_BYTES;
use takt_asm::plain::PlainProgram;
use takt_isa::certificate::Times;
use takt_isa::program::Location;
use takt_isa::text::one_line;
use takt_isa::{MACHINES, Program};
use takt_verify::bound::{self, ProvedBounds, Unproved};
use takt_verify::{Difference, EquivalenceReport};
use takt_work::Unit;

/// Check that an image does what its source says, for every input and on every path.
///
/// An independent checker executes both symbolically, and compares every write to a port, store, flag and state, bit for bit. It
/// shows sums that are fused with a product, and compares the cycles of sections with its own statement of the rules of issue. With
/// --bound, it checks the proof of a program's bounds instead.
#[derive(Args)]
#[command(after_help = "\
Exit status: 0 if every image is its source, or the bounds are proved; 1 if one differs, or if that cannot be excluded.

Examples:
  takt verify prog.takt prog.s          the image that `takt asm prog.s` wrote
  takt verify prog.takt prog.s --json   the result for a script
  takt verify a.takt a.s b.takt b.s --hq-server ~/server   several, on the workers of a HyperQueue server
  takt asm prog.s --verify              assemble and check at once
  takt verify --bound prog.json prog.s  the certificate that `takt bound prog.s --certificate prog.json` wrote")]
pub(crate) struct Verify {
    /// Image, and its source, which may be `-`, standard input; or several such pairs. With --bound: one program, a source or an image.
    #[arg(required = true, num_args = 1.., value_names = ["IMAGE", "SOURCE"])]
    files: Vec<PathBuf>,
    /// Check this certificate of bounds, which `takt bound --certificate` has written, against the program (docs/verify.md).
    #[arg(long, value_name = "CERTIFICATE")]
    bound: Option<PathBuf>,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    arguments: SourceArguments,
    /// Print the result as JSON on standard output; of several images a list.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    work: WorkArguments,
}

/// Upper bound of the time to check one image.
const TIME: Duration = Duration::from_secs(600);

/// Printable result for an image.
#[derive(Serialize, Deserialize)]
struct Report {
    is_proved: bool,
    text: String,
    json: Value,
}

pub(crate) fn run(arguments: &Verify, color: bool, out: &mut Out) -> Result<()> {
    if let Some(certificate) = &arguments.bound {
        return arguments.bounds(certificate, color, out);
    }
    let names = ["IMAGE", "SOURCE"].into_iter().cycle();
    let reads: Vec<_> = names.zip(arguments.files.iter().map(PathBuf::as_path)).collect();
    files::check(&reads, &[])?;
    arguments.work.check(&reads)?;
    let pairs: Vec<(PathBuf, PathBuf)> = match arguments.files.as_chunks() {
        (pairs, []) => pairs.iter().map(|[image, source]| (image.clone(), source.clone())).collect(),
        (_, [image, ..]) => {
            let text = format!("{} has no source: expected pairs of files, IMAGE SOURCE", image.display());
            return Err(Failure::Usage(text).into());
        }
    };
    if let Some((pair, result)) = arguments.work.job::<(PathBuf, PathBuf)>()? {
        return workers::write(result, &arguments.report(&pair, color));
    }
    if let [pair] = &pairs[..]
        && !arguments.work.uses_server()
    {
        let Report { is_proved, text, json } = arguments.checked(pair, color)?;
        if arguments.json {
            files::json(&json, out)?;
        } else {
            out.write_all(text.as_bytes())?;
        }
        return if is_proved { Ok(()) } else { Err(Failure::Reported.into()) };
    }
    let results = arguments.all(&pairs, color)?;
    arguments.print(&pairs, results, out)
}

impl Verify {
    /// Checks a certificate of bounds.
    fn bounds(&self, certificate: &Path, color: bool, out: &mut Out) -> Result<()> {
        let [file] = &self.files[..] else {
            let text = "with --bound, expected one program, of which the certificate is";
            return Err(Failure::Usage(text.to_owned()).into());
        };
        if self.work.uses_server() {
            let text = "a certificate is checked here: --bound takes no server";
            return Err(Failure::Usage(text.to_owned()).into());
        }
        files::check(&[("FILE", file), ("--bound", certificate)], &[])?;
        let program = Load::new(self.machine.machine, color).with(&self.arguments).program(file)?;
        let text = files::read(certificate, usize::try_from(bound::MAX_BYTES).unwrap_or(usize::MAX))?;
        let result = bound::check(&program, &text);
        if self.json {
            files::json(&bounds_json(&result, &program), out)?;
        } else {
            write_bounds(&result, &program, out)?;
        }
        if result.is_ok() { Ok(()) } else { Err(Failure::Reported.into()) }
    }

    /// Checks several images, in threads of this process or in units; a result is the reason where an image cannot be checked.
    fn all(&self, pairs: &[(PathBuf, PathBuf)], color: bool) -> Result<Vec<Result<Report, String>>> {
        static STOPPED: AtomicBool = AtomicBool::new(false);
        if !self.work.uses_server() {
            return Ok(pairs.par_iter().map(|pair| self.report(pair, color)).collect());
        }
        interrupt::on_interrupt(|| STOPPED.store(true, Ordering::Relaxed))?;
        let workers = Workers::new("verify", &self.work)?;
        let build = SELF.as_deref().unwrap_or_default();
        let units = pairs.iter().map(|pair| {
            let image = files::read(&pair.0, IMAGE_BYTES).unwrap_or_default();
            // Include texts count, whatever the machine.
            let load = Load::new(MACHINES[0], color).with(&self.arguments);
            let texts = Load::source(&pair.1).map(|text| load.texts(&pair.1, text)).ok();
            let name = files::input_name(&pair.0);
            workers.unit(name, &format!("{build} {image:?} {texts:?} {color}"), pair, None, TIME)
        });
        let units = units.collect::<Result<Vec<Unit>>>()?;
        let bar = DelayedProgress::new(Some(units.len() as u64), "images");
        let results = workers.results(&units, &STOPPED, &mut |count| bar.add(count))?;
        if results.len() < units.len() {
            let text = format!("interrupted after {} of {} images", results.len(), units.len());
            return Err(Failure::Interrupted(text).into());
        }
        Ok(results)
    }

    /// Prints the results for several images.
    fn print(
        &self,
        pairs: &[(PathBuf, PathBuf)],
        results: Vec<Result<Report, String>>,
        out: &mut Out,
    ) -> Result<()> {
        let (mut are_proved, mut list) = (true, Vec::new());
        for ((image, source), result) in pairs.iter().zip(results) {
            let image = files::input_name(image);
            let report = result.unwrap_or_else(|reason| Report {
                is_proved: false,
                text: format!("cannot be checked: {}\n", reason.trim_end()),
                json: json!({ "verified": false, "error": reason }),
            });
            let Report { is_proved, text, mut json } = report;
            are_proved &= is_proved;
            if self.json {
                (json["image"], json["source"]) = (image.into(), files::input_name(source).into());
                list.push(json);
            } else {
                write!(out, "{image}: {text}")?;
            }
        }
        if self.json {
            files::json(&Value::from(list), out)?;
        }
        if are_proved { Ok(()) } else { Err(Failure::Reported.into()) }
    }

    /// Checks an image; the error is the reason why it cannot be checked.
    fn report(&self, pair: &(PathBuf, PathBuf), color: bool) -> Result<Report, String> {
        self.checked(pair, color).map_err(|error| format!("{error:#}"))
    }

    fn checked(&self, (image, source): &(PathBuf, PathBuf), color: bool) -> Result<Report> {
        let name = files::input_name(image);
        let bytes = files::read(image, IMAGE_BYTES)?;
        if !image::is_image(&bytes) {
            bail!(
                "{name} is not an image; `takt asm {name} --verify` assembles a source and checks the image"
            );
        }
        let program = image::read(&bytes).with_context(|| format!("{name} is not an image that can run"))?;
        let text = Load::source(source)?;
        let machine = self.machine.machine.unwrap_or(program.machine);
        let load = Load::new(machine, color).with(&self.arguments);
        let result = check(&load, &program, source, text)?;
        let mut text = Vec::new();
        result.write(&mut text)?;
        let text = String::from_utf8_lossy(&text).into_owned();
        Ok(Report { is_proved: result.is_proved(), text, json: result.json() })
    }
}

/// Places of the promises that bounds rest on: `.loop_bound` of loops, which the emulator checks.
fn promises(program: &Program) -> Vec<String> {
    let place = |at| program.bundle_place(at).unwrap_or_else(|| format!("bundle {at}"));
    program.loop_bounds.iter().map(|bound| place(bound.address)).collect()
}

fn bounds_json(result: &Result<ProvedBounds, Unproved>, program: &Program) -> Value {
    match result {
        Ok(ProvedBounds { sections, lemmas, places, bundles }) => json!({
            "proved": true,
            "promises": promises(program),
            "sections": sections,
            "lemmas": lemmas,
            "places": places,
            "bundles": bundles,
        }),
        Err(Unproved { part, bundle, what }) => {
            json!({ "proved": false, "reason": what, "bundle": bundle, "part": part })
        }
    }
}

fn write_bounds(result: &Result<ProvedBounds, Unproved>, program: &Program, out: &mut Out) -> Result<()> {
    let proved = match result {
        Ok(proved) => proved,
        Err(reason) => return Ok(writeln!(out, "not proved: {}", one_line(&reason.to_string()))?),
    };
    let text = |(best, worst)| number::least_to_most(best, worst);
    let promises = promises(program).join(", ");
    let promised = if promises.is_empty() {
        promises
    } else {
        format!(", if loops keep their `.loop_bound` ({promises})")
    };
    writeln!(out, "proved: these cycles hold on every path, for all inputs{}", one_line(&promised))?;
    for section in &proved.sections {
        let Times { refilled, in_time, missed } = section.cycles;
        write!(out, "  {}: {}", one_line(&section.name), text(refilled))?;
        if let (Some(in_time), Some(missed)) = (in_time, missed) {
            write!(
                out,
                "; {} if the tick comes soon after the wait, {} after a missed deadline",
                text(in_time),
                text(missed)
            )?;
        }
        if let Some(published) = section.published {
            write!(out, "; outputs published after {}", text(published.refilled))?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Outcome of a check.
pub(crate) struct CheckOutcome {
    plain: PlainProgram,
    /// Equivalence, and the number of sections whose cycles `takt bound` states; or the first difference.
    outcome: Result<(EquivalenceReport, usize), Difference>,
}

/// Checks an image against a source read from a file.
pub(crate) fn check(load: &Load, program: &Program, path: &Path, source: Vec<u8>) -> Result<CheckOutcome> {
    let (plain, contractions) =
        load.plain(path, source).map_err(|mistakes| Failure::Diagnostics(mistakes.render(load.color)))?;
    let claims = takt_analysis::section_cycles(program).unwrap_or_default();
    let outcome = takt_verify::verify(program, &plain, &contractions)
        .and_then(|established| Ok((established.compare(&claims)?, established)))
        .map(|(compared, established)| (established, compared));
    Ok(CheckOutcome { plain, outcome })
}

impl CheckOutcome {
    /// The image is proved equivalent to its source.
    pub(crate) fn is_proved(&self) -> bool {
        self.outcome.is_ok()
    }

    fn place(&self, location: Location) -> String {
        let file = self.plain.files.get(location.file as usize).map_or("?", String::as_str);
        format!("{file}:{}", location.line)
    }

    pub(crate) fn write(&self, out: &mut impl Write) -> Result<()> {
        match &self.outcome {
            Ok((established, compared)) => {
                writeln!(out, "verified: the image is its source, on every path and for all inputs")?;
                for time in &established.times {
                    let place = time.location.map_or_else(|| "a section".to_owned(), |at| self.place(at));
                    let from = if time.before > 0 { "reset" } else { "the tick" };
                    let cycles = time.before + time.cycles;
                    let plural = if cycles == 1 { "" } else { "s" };
                    writeln!(out, "  {cycles} cycle{plural} from {from} to {place}, on every path")?;
                }
                if *compared > 0 {
                    let plural = if *compared == 1 { "" } else { "s" };
                    writeln!(
                        out,
                        "  cycles that `takt bound` states and that were found again: {compared} section{plural}"
                    )?;
                }
                if established.deadlines > 0 {
                    writeln!(out, "  deadlines that hold: {}", established.deadlines)?;
                }
                if !established.faults.is_empty() {
                    let places: Vec<String> = established.faults.iter().map(|at| self.place(*at)).collect();
                    writeln!(
                        out,
                        "  not compared: paths on which the source faults or leaves an array, at {} (if data lead there)",
                        places.join(", ")
                    )?;
                }
                let places = established.fused.iter().flatten().map(|at| self.place(*at));
                let mut places: Vec<String> = places.collect();
                places.dedup();
                if !established.fused.is_empty() {
                    writeln!(
                        out,
                        "  fused with a product, one rounding fewer than written: {} sums, at {}",
                        established.fused.len(),
                        places.join(", ")
                    )?;
                }
            }
            Err(difference) => {
                let place = difference.place.map_or_else(|| "the program".to_owned(), |at| self.place(at));
                writeln!(out, "not verified: {place}: {}", difference.what)?;
                for (whose, what) in [("source", &difference.source), ("image", &difference.image)] {
                    if difference.source.is_some() || difference.image.is_some() {
                        writeln!(out, "  {whose}: {}", what.as_deref().unwrap_or("nothing"))?;
                    }
                }
            }
        }
        Ok(())
    }

    pub(crate) fn json(&self) -> Value {
        let place = |at: Option<Location>| {
            at.map(|at| json!({ "file": self.plain.files.get(at.file as usize), "line": at.line }))
        };
        match &self.outcome {
            Ok((established, compared)) => {
                let times = established.times.iter();
                let fused = established.fused.iter();
                json!({
                    "verified": true,
                    "sections": times.map(|time| json!({ "end": place(time.location), "cycles": time.cycles })).collect::<Vec<_>>(),
                    "sections_compared": compared,
                    "deadlines": established.deadlines,
                    "faults": established.faults.iter().map(|at| place(Some(*at))).collect::<Vec<_>>(),
                    "fused": fused.map(|at| place(*at)).collect::<Vec<_>>(),
                    "cuts": established.cuts,
                    "steps": established.steps,
                })
            }
            Err(difference) => json!({
                "verified": false,
                "place": place(difference.place),
                "difference": difference.what,
                "source": difference.source,
                "image": difference.image,
            }),
        }
    }
}
