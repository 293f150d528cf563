// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt cc`: translates a step function in C into a program.

use crate::terminal::files::{self, OptionPath, Out};
use crate::terminal::output::Failure;
use crate::terminal::progress::DelayedActivity;
use anyhow::{Result, anyhow};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};
use takt_front::c::{Candidate, Options, Preprocessor, candidates, translate};

/// Turn a step function in C into a program: a period is one call.
///
/// The function's parameters become ports: what it reads is an input, what it writes an output; structures and variables that it reads and
/// writes are states. The C is executed while it is translated: what is known is computed, and only what depends on inputs and states is
/// left. docs/c.md says what is read and what is refused, with the remedy. Needs gcc or clang for `-E`.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Cc {
    /// C files; a name that is `static` belongs to its file.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// The function that a period calls.
    #[arg(long, value_name = "NAME", required_unless_present = "list")]
    step: Option<String>,
    /// Try every function of the files as the step, and list which are translated and why the others are not.
    #[arg(long, conflicts_with_all = ["step", "output"])]
    list: bool,
    /// Print the list as JSON.
    #[arg(long, requires = "list")]
    json: bool,
    /// The function that sets the states before the first period; it takes pointers to the same structures.
    #[arg(long, value_name = "NAME")]
    init: Option<String>,
    /// Give a scalar or an array of the step's parameters numbers that hold in every period, as C writes it: `n=8`, `conf->taps=16`,
    /// `A->p=0,2,3`.
    #[arg(long, value_name = "NAME=NUMBER,…", value_parser = numbers)]
    set: Vec<(String, Vec<f64>)>,
    /// Leave out calls of a function that has no result, as one that prints, logs or toggles a pin.
    #[arg(long, value_name = "NAME")]
    ignore: Vec<String>,
    /// Bound the loops whose end data decide and that have no bound of their own; more iterations are a fault.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=65_535))]
    loop_bound: Option<u64>,
    /// Define a macro of the preprocessor.
    #[arg(short = 'D', value_name = "NAME[=VALUE]")]
    defines: Vec<String>,
    /// Search a folder for included files.
    #[arg(short = 'I', value_name = "DIR")]
    includes: Vec<PathBuf>,
    /// Read double as binary32, and numbers without `f` as well. Otherwise a double is an error with its place.
    #[arg(long, value_name = "TYPE")]
    double: Option<Double>,
    /// Write the program here; `-` is standard output.
    #[arg(long, short, value_name = "FILE", default_value = "-")]
    output: PathBuf,
}

const EXAMPLES: &str = "\
Examples:
  takt cc programs/examples/c/speed.c --step speed_step --init speed_init -o speed.s
  takt bound speed.s                                the file is a program like any other
  takt cc fir.c --step fir --set n=16 -o fir.s      a parameter that is the same in every period
  takt cc pid.c --list                              which functions can be the step
  takt cc foc.c math.c --step foc --double=float -I inc -DNDEBUG -o foc.s";

fn numbers(text: &str) -> Result<(String, Vec<f64>), String> {
    let (name, numbers) = text.split_once('=').ok_or("expected NAME=NUMBER")?;
    let number = |text: &str| text.trim().parse().map_err(|_| format!("`{}` is not a number", text.trim()));
    Ok((name.trim().to_owned(), numbers.split(',').map(number).collect::<Result<_, _>>()?))
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Double {
    Float,
}

pub(crate) fn run(arguments: &Cc, _: bool, out: &mut Out) -> Result<()> {
    let inputs: Vec<OptionPath<'_>> = arguments.files.iter().map(|file| ("FILE", file.as_path())).collect();
    files::check(&inputs, &[("--output", arguments.output.as_path())])?;
    if arguments.files.iter().any(|file| files::is_dash(file)) {
        return Err(Failure::Usage(
            "C is read from files: its includes are looked for beside them".to_owned(),
        )
        .into());
    }
    let double_is_float = arguments.double == Some(Double::Float);
    let mut options: Vec<String> = arguments.defines.iter().map(|define| format!("-D{define}")).collect();
    options.extend(double_is_float.then(|| "-DTAKT_DOUBLE_IS_FLOAT=1".to_owned()));
    options.extend(arguments.includes.iter().map(|folder| format!("-I{}", folder.display())));
    let shown = |error: takt_front::Error| match (&error.file, error.line) {
        (Some(file), _) => anyhow!(error.located_text(file)),
        _ => anyhow!("{error}"),
    };
    let waiting =
        DelayedActivity::new(format!("translating {}", files::input_name(Path::new(&arguments.files[0]))));
    let preprocessor = Preprocessor::new(&options).map_err(shown)?;
    let sources = arguments.files.iter().map(|file| preprocessor.run(file)).collect::<Result<Vec<_>, _>>();
    let step = arguments.step.clone().unwrap_or_default();
    let options = Options {
        step,
        init: arguments.init.clone(),
        set: arguments.set.clone(),
        ignore: arguments.ignore.clone(),
        loop_bound: arguments.loop_bound,
        double_is_float,
    };
    if arguments.list {
        let candidates = sources.and_then(|sources| candidates(&sources, &options)).map_err(shown)?;
        drop(waiting);
        return if arguments.json { list_json(&candidates, out) } else { list(&candidates, out) };
    }
    let translation = sources.and_then(|sources| translate(&sources, &options)).map_err(shown)?;
    drop(waiting);
    files::write(&arguments.output, translation.text.as_bytes())
}

/// A line for each function: the program's ports, or the reason why there is none.
fn list(candidates: &[Candidate], out: &mut Out) -> Result<()> {
    let widest = candidates.iter().map(|candidate| candidate.name.len()).max().unwrap_or(0).min(40);
    for Candidate { name, file, line, translation } in candidates {
        let text = match translation {
            Ok(program) => {
                format!("{} inputs, {} outputs", program.inputs.len(), program.outputs.len())
            }
            Err(error) => refusal(error, file),
        };
        out.lines(&format!("{name:<widest$}  line {line:<5} {text}\n"))?;
    }
    let good = candidates.iter().filter(|candidate| candidate.translation.is_ok()).count();
    out.lines(&format!("{good} of {} functions can be the step\n", candidates.len()))?;
    Ok(())
}

/// The reason with its place, unless the place is in the function's own file: then its line alone.
fn refusal(error: &takt_front::Error, own: &str) -> String {
    match (&error.file, error.line) {
        (Some(file), Some(line)) if file == own => format!("refused, line {line}: {}", error.text),
        (Some(file), Some(line)) => format!("refused, {file}:{line}: {}", error.text),
        _ => format!("refused: {}", error.text),
    }
}

fn list_json(candidates: &[Candidate], out: &mut Out) -> Result<()> {
    let rows: Vec<serde_json::Value> = candidates
        .iter()
        .map(|Candidate { name, file, line, translation }| match translation {
            Ok(program) => serde_json::json!({
                "name": name, "file": file, "line": line,
                "inputs": program.inputs.iter().map(|port| &port.name).collect::<Vec<_>>(),
                "outputs": program.outputs.iter().map(|port| &port.name).collect::<Vec<_>>(),
            }),
            Err(error) => serde_json::json!({
                "name": name, "file": file, "line": line,
                "refused": { "file": error.file, "line": error.line, "reason": error.text },
            }),
        })
        .collect();
    files::json(&rows, out)
}
