// SPDX-License-Identifier: MIT OR Apache-2.0
//! `takt verify`, and the check of `takt asm --verify`.

use crate::files;
use crate::load::Load;
use crate::output::{self, Failure};
use crate::select::{OptionalMachine, SourceArguments};
use anyhow::{Context, Result, bail};
use clap::Args;
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use takt_asm::image;
use takt_asm::limits::IMAGE_BYTES;
use takt_asm::plain::Plain;
use takt_isa::Program;
use takt_isa::program::Location;
use takt_verify::{Difference, Established};

/// Check that an image does what its source says, for every input and on every path.
///
/// An independent checker executes both symbolically, and compares every write to a port, store, flag and state, bit for bit. It
/// shows sums that are fused with a product, and compares the cycles of sections with its own statement of the rules of issue.
#[derive(Args)]
#[command(after_help = "\
Exit status: 0 if the image is its source; 1 if it differs, or if that cannot be excluded.

Examples:
  takt verify prog.takt prog.s          the image that `takt asm prog.s` wrote
  takt verify prog.takt prog.s --json   the result for a script
  takt asm prog.s --verify              assemble and check at once")]
pub(crate) struct Verify {
    /// Image.
    image: PathBuf,
    /// Source; `-` is standard input.
    source: PathBuf,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    arguments: SourceArguments,
    /// Print the result as JSON on standard output.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Verify, color: bool, out: &mut crate::files::Out) -> Result<()> {
    files::check(&[("IMAGE", &arguments.image), ("SOURCE", &arguments.source)], &[])?;
    let name = files::input_name(&arguments.image);
    let bytes = files::read(&arguments.image, IMAGE_BYTES)?;
    if !image::is_image(&bytes) {
        bail!("{name} is no image; `takt asm {name} --verify` assembles a source and checks the image");
    }
    let program = image::read(&bytes).with_context(|| format!("{name} is not an image that can run"))?;
    let source = Load::source(&arguments.source)?;
    let machine = arguments.machine.machine.unwrap_or(program.machine);
    let load = Load::new(machine, color).with(&arguments.arguments);
    let result = check(&load, &program, &arguments.source, source)?;
    if arguments.json {
        output::json(&result.json(), out)?;
    } else {
        result.write(out)?;
    }
    if result.outcome.is_err() { Err(Failure::Reported.into()) } else { Ok(()) }
}

/// A check's result.
pub(crate) struct Checked {
    plain: Plain,
    /// The result, and the number of sections whose cycles `takt bound` states.
    outcome: Result<(Established, usize), Difference>,
}

/// Checks an image of a source that was read from a file.
pub(crate) fn check(load: &Load, program: &Program, path: &Path, source: Vec<u8>) -> Result<Checked> {
    let (plain, hints) =
        load.plain(path, source).map_err(|mistakes| Failure::Diagnostics(mistakes.render(load.color)))?;
    let claims = takt_analysis::section_cycles(program).unwrap_or_default();
    let outcome = takt_verify::verify(program, &plain, &hints)
        .and_then(|established| Ok((established.compare(&claims)?, established)))
        .map(|(compared, established)| (established, compared));
    Ok(Checked { plain, outcome })
}

impl Checked {
    /// True if the image is its source.
    pub(crate) fn is_proved(&self) -> bool {
        self.outcome.is_ok()
    }

    fn place(&self, location: Location) -> String {
        let file = self.plain.files.get(location.file as usize).map_or("?", String::as_str);
        format!("{file}:{}", location.line)
    }

    pub(crate) fn write(&self, out: &mut crate::files::Out) -> Result<()> {
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
                    "fused": fused.map(|at| place(*at)).collect::<Vec<_>>(),
                    "cuts": established.cuts,
                    "bundles": established.steps,
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
