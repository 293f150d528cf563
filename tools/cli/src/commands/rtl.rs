// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt rtl`: writes the Verilog of a machine or a system.

use crate::run::load::{self, Load};
use crate::run::ports;
use crate::run::system;
use crate::terminal::files::{self, Out};
use crate::terminal::number;
use crate::terminal::options::{OptionalMachine, SourceArguments};
use crate::terminal::output;
use anyhow::{Context, Result, bail};
use clap::Args;
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};
use takt_family::REFERENCE;
use takt_isa::MACHINES;
use takt_isa::manual::memories_in;
use takt_rtl::{Library, Plan, Safety, bench, export, memories};

/// Write the circuit of a machine, or of a system: a complete Verilog design.
///
/// Of a system the folder holds one top with all cores and links, their programs in a memory image that it reads at power-up
/// (docs/system.md), and the lists of files.
/// For a machine it holds a core and a test bench.
///
/// The folder of a machine holds the core and its parts, one module per file; `takt_<machine>.f`, the list of them for other tools; a top
/// level for synthesis without a board; a test bench, which with --program runs that program on the rows of --inputs.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Rtl {
    /// A system, a `.toml` file; without it, a machine's circuit is written.
    #[arg(value_name = "SYSTEM", conflicts_with_all = ["machine", "program", "inputs", "periods"])]
    system: Option<PathBuf>,
    /// Output folder; created if it does not exist.
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    source: SourceArguments,
    /// Source or image whose memory image the test bench loads; `-` is standard input.
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
    /// CSV with one named column for each input port and one row for each period of the test bench; `-` is standard input.
    #[arg(long, value_name = "CSV", requires = "program")]
    inputs: Option<PathBuf>,
    /// Run at most this many periods in the test bench [default: one for each row; without --inputs, 3, with zeros].
    #[arg(long, value_name = "N", value_parser = number::count, requires = "program", allow_hyphen_values = true)]
    periods: Option<u64>,
    /// Put a second core beside the first one, CYCLES later (1 to 16), whose outputs are compared with the first one's: the top is the pair
    /// (docs/safety.md).
    #[arg(long, value_name = "CYCLES", num_args = 0..=1, default_missing_value = "2", conflicts_with = "system",
        value_parser = cycles_later)]
    second_core: Option<u32>,
    /// Correct one wrong bit of each word of program and data memory, detect wrong bytes of register banks, and repair all of them while the
    /// program waits (docs/safety.md).
    #[arg(long, conflicts_with = "system")]
    ecc: bool,
    /// Print top module and written files as JSON.
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  takt rtl -o t3                                 the fast machine
  takt rtl -o t1 --machine t1 --program prog.s --inputs in.csv   the small one, and what its test bench runs
  takt rtl system.toml -o system                 several cores and their links (docs/system.md)
  cd t1 && iverilog -g2005 -f takt_t1_bench.f -o bench && ./bench";

/// Parses the cycles by which a second core is later, for clap.
fn cycles_later(text: &str) -> Result<u32, String> {
    text.parse().ok().filter(|cycles| (1..=16).contains(cycles)).ok_or_else(|| {
        "expected cycles, 1 to 16; second cores of a system stand in its wiring (docs/safety.md)".to_owned()
    })
}

/// Default number of periods, without `--inputs`.
const PERIODS: u64 = 3;

pub(crate) fn run(arguments: &Rtl, color: bool, out: &mut Out) -> Result<()> {
    let reads = [("--program", &arguments.program), ("--inputs", &arguments.inputs)];
    let reads: Vec<_> = reads.into_iter().filter_map(|(name, path)| Some((name, path.as_deref()?))).collect();
    files::check(&reads, &[])?;
    if let Some(file) = &arguments.system {
        if !load::is_system(file) {
            let name = file.display();
            let message = format!(
                "{name} is not a system (`.toml`); for the core of a program, write --program {name}"
            );
            return Err(output::Failure::Usage(message).into());
        }
        return of_system(arguments, file, color, out);
    }
    let load = Load::new(arguments.machine.machine, color).with(&arguments.source);
    let program = arguments.program.as_deref().map(|path| load.program(path)).transpose()?;
    let machine = match (&program, arguments.machine.machine) {
        (Some(program), _) => program.machine,
        (None, machine) => machine.unwrap_or(MACHINES[0]),
    };
    let periods = match &program {
        Some(program) => {
            ports::rows(arguments.inputs.as_deref(), arguments.periods, PERIODS, &program.inputs)?
        }
        None => Vec::new(),
    };
    let stimuli = periods.iter().map(|inputs| inputs.len() + 1).sum::<usize>();
    if stimuli > bench::STIMULI {
        let most = bench::STIMULI / (periods[0].len() + 1);
        bail!(
            "{} periods are too many for the test bench, which takes at most {most}: use --periods {most}",
            periods.len()
        );
    }
    let latched = program.as_ref().map_or(0, takt_isa::Program::latched_inputs);
    let design = export(machine, &Library::builtin())?.latching(latched)?;
    let design = design.with(Safety { ecc: arguments.ecc, second_core: arguments.second_core })?;
    let mut written = Vec::new();
    for file in bench::folder(&design, program.as_ref(), &periods) {
        write(&arguments.output, &file.name, &file.text)?;
        written.push(file.name);
    }
    if arguments.json {
        return files::json(&json!({ "machine": machine.name, "top": design.top, "files": written }), out);
    }
    let folder = arguments.output.display();
    let (what, each) = match arguments.second_core {
        Some(_) => ("pair of cores", " of each core"),
        None => ("core", ""),
    };
    writeln!(out, "{} files in {folder}; the {what} is {}.v", written.len(), design.top)?;
    let rams = |plan: &Plan| memories::block_rams(plan, &Library::builtin(), REFERENCE.block_ram());
    let with = rams(&design.plan);
    writeln!(out, "memories{each}: {}", memories_in(machine, with.program, with.data))?;
    if arguments.ecc {
        let without = rams(&Plan { ecc: false, ..design.plan.clone() }).total();
        writeln!(out, "error correction: block RAMs{each} are {}, without it {without}", with.total())?;
    }
    tell_others(&arguments.output, &written);
    Ok(())
}

/// Writes the circuit of a system.
fn of_system(arguments: &Rtl, file: &Path, color: bool, out: &mut Out) -> Result<()> {
    let design = system::circuit(&system::load(file, &arguments.source, color)?, file)?;
    let mut written = Vec::new();
    for file in design.folder() {
        write(&arguments.output, &file.name, &file.text)?;
        written.push(file.name);
    }
    if arguments.json {
        let cores = design.plan.description.cores.iter();
        let cores: Vec<_> =
            cores.map(|core| json!({ "name": core.name, "machine": core.program.machine.name })).collect();
        return files::json(&json!({ "cores": cores, "top": design.top, "files": written }), out);
    }
    let folder = arguments.output.display();
    writeln!(out, "{} files in {folder}; the system is {}.v", written.len(), design.top)?;
    tell_others(&arguments.output, &written);
    Ok(())
}

/// Notes that circuits of an earlier export are in the folder.
fn tell_others(folder: &Path, written: &[String]) {
    let files = |folder: &Path| std::fs::read_dir(folder).into_iter().flatten().flatten();
    let all = files(folder).flat_map(|entry| {
        let path = entry.path();
        if path.is_dir() { files(&path).map(|entry| entry.path()).collect() } else { vec![path] }
    });
    let is_circuit = |path: &Path| path.extension().is_some_and(|ending| ending == "v" || ending == "f");
    let other = |path: PathBuf| {
        let name = path.strip_prefix(folder).ok()?.to_str()?.to_owned();
        (is_circuit(&path) && !written.contains(&name)).then_some(name)
    };
    let mut others: Vec<String> = all.filter_map(other).collect();
    others.sort_unstable();
    if let [first, ..] = &others[..] {
        let folder = folder.display();
        let text = match others.len() {
            1 => format!("a circuit file in {folder} is not of this export: {first}"),
            count => format!("{count} circuit files in {folder} are not of this export, such as {first}"),
        };
        output::note(&text);
    }
}

fn write(folder: &Path, name: &str, text: &str) -> Result<()> {
    let path = folder.join(name);
    let parent = path.parent().unwrap_or(folder);
    std::fs::create_dir_all(parent)
        .with_context(|| format!("cannot make the folder {}", parent.display()))?;
    files::write(&path, text.as_bytes())
}
