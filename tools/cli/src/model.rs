// SPDX-License-Identifier: MIT OR Apache-2.0
//! `takt model`: from a robot's description, another tool's expressions or a control problem to a program in equations.

mod mpc;
mod policy;
mod sized;

use crate::files::{self, Given, Out};
use crate::load::Load;
use crate::output::{self, Failure};
use crate::progress::Waiting;
use crate::select::{MachineArgument, suggest};
use anyhow::{Result, anyhow, bail};
use clap::Args;
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use takt_asm::Assembled;
use takt_isa::timing::Cycle;
use takt_model::functions::{Function, Options, What, derive};
use takt_model::graph::{Count, Delays, Rewrites};
use takt_model::instructions;
use takt_model::robot::{self, dh, urdf, xml};
use takt_model::write::{self, Layout};

/// Turn a robot's description, expressions of CasADi or SymPy, a learned policy or a control problem into a program.
///
/// FILE is a robot in URDF or MJCF, a table of Denavit-Hartenberg parameters (.csv), a list of instructions (.json) that
/// the Python module `takt_expressions` writes from CasADi functions and SymPy expressions, a multi-layer perceptron (.onnx), or a linear
/// system with weights and limits (.json) for model-predictive control.
/// The operations that it takes are printed, and the cycles on the machine beside the bound that no schedule can beat; of a policy,
/// its weights, the cycles of each, and the memory.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Model {
    /// Description; the format is determined by the extension, which must be .urdf, .xml, .csv, .json or .onnx.
    file: PathBuf,
    /// Quantities to compute of a robot: forward-kinematics, jacobian, inverse-dynamics, gravity, mass-matrix, forward-dynamics or
    /// computed-torque.
    #[arg(long, short, value_name = "FUNCTION", value_parser = what)]
    function: Option<What>,
    /// The link that stays where it is [default: the root].
    #[arg(long, value_name = "LINK")]
    base: Option<String>,
    /// Only the joints from the base to this link; the others are held at 0. It is the link whose pose and Jacobian are computed.
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// For computed-torque: gain of the position error, 1/s².
    #[arg(long, value_name = "NUMBER", default_value_t = 100.0, value_parser = gain, allow_hyphen_values = true)]
    kp: f64,
    /// For computed-torque: gain of the velocity error, 1/s.
    #[arg(long, value_name = "NUMBER", default_value_t = 20.0, value_parser = gain, allow_hyphen_values = true)]
    kd: f64,
    /// Round angles this close to a multiple of a quarter turn to it, rad.
    #[arg(long, value_name = "ANGLE", default_value_t = urdf::SNAP, value_parser = angle, allow_hyphen_values = true)]
    snap: f64,
    /// For a policy: state that every number of the input lies between these, for the bounds of `takt accuracy`.
    #[arg(long, value_name = "LOW,HIGH", value_parser = range, allow_hyphen_values = true)]
    range: Option<(f64, f64)>,
    /// For a control problem: search its `x_range` for the states of the worst residuals and violation of limits, from so many starts.
    #[arg(long, value_name = "STARTS", value_parser = starts)]
    worst: Option<usize>,
    /// The seed of --worst.
    #[arg(long, value_name = "SEED", default_value_t = 0, requires = "worst")]
    seed: u64,
    #[command(flatten)]
    rewrites: RewriteArguments,
    #[command(flatten)]
    machine: MachineArgument,
    /// Write a body: equations to `.include` in the period of a hand-written law, which sets the inputs and reads the outputs.
    #[arg(long)]
    body: bool,
    /// What all names of the body begin with.
    #[arg(long, value_name = "PREFIX", default_value = "model_", requires = "body")]
    prefix: String,
    /// Write the source here; `-` is standard output.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  takt model ur5.urdf -f inverse-dynamics -o ur5.s
  takt run ur5.s --inputs states.csv              what it makes is a program
  takt model talos.urdf -f gravity --base torso_2_link --tip arm_left_7_link
  takt model arm.xml -f computed-torque -o arm.s  MJCF, MuJoCo's format
  takt model arm.urdf -f inverse-dynamics --body --prefix id_ -o dynamics.s
                                                  equations for `.include` in a law
  takt model f.json --exact -m t1                 expressions in their order
  takt model policy.onnx -o policy.s              a learned policy
  takt model system.json -o mpc.s --worst 100     model-predictive control";

/// Rewrites that are switched off.
#[derive(Args, Clone, Copy)]
#[command(next_help_heading = "Rewriting (all of it is exact over the reals)")]
struct RewriteArguments {
    /// Only rewrites that leave every operation and its rounding as given.
    #[arg(long)]
    exact: bool,
    /// Do not compute with constants beforehand.
    #[arg(long)]
    no_fold: bool,
    /// Keep x + 0, x - x, 1*x, 0*x, -(-x), x/1.
    #[arg(long)]
    no_identities: bool,
    /// Compute equal subexpressions each time.
    #[arg(long)]
    no_share: bool,
    /// Leave signs where they are.
    #[arg(long)]
    no_signs: bool,
    /// Keep divisions by constants, and powers as given.
    #[arg(long)]
    no_strength: bool,
    /// Keep a*b + a*c.
    #[arg(long)]
    no_factor: bool,
    /// Add long sums in the order as given.
    #[arg(long)]
    no_balance: bool,
    /// Keep lengths in metres.
    #[arg(long)]
    no_scale: bool,
}

impl RewriteArguments {
    fn rewrites(self) -> Rewrites {
        let all = if self.exact { Rewrites::EXACT } else { Rewrites::ALL };
        Rewrites {
            fold: all.fold && !self.no_fold,
            identities: all.identities && !self.no_identities,
            share: all.share && !self.no_share,
            signs: all.signs && !self.no_signs,
            strength: all.strength && !self.no_strength,
            factor: all.factor && !self.no_factor,
            balance: all.balance && !self.no_balance,
            scale: all.scale && !self.no_scale,
        }
    }
}

fn what(name: &str) -> Result<What, String> {
    What::from_name(name).ok_or_else(|| {
        let names: Vec<&str> = What::ALL.iter().map(|(_, name, _)| *name).collect();
        let near = suggest(name, names.iter().copied());
        format!("there is no such function{near} (functions: {})", names.join(", "))
    })
}

fn gain(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(gain) if gain.is_finite() && gain >= 0.0 => Ok(gain),
        Ok(_) => Err("a gain is finite and not negative".to_owned()),
        Err(_) => Err("not a number".to_owned()),
    }
}

fn starts(text: &str) -> Result<usize, String> {
    let most = takt_model::mpc::MAX_RESTARTS;
    match text.parse() {
        Ok(starts) if (1..=most).contains(&starts) => Ok(starts),
        _ => Err(format!("a number from 1 to {most}")),
    }
}

fn range(text: &str) -> Result<(f64, f64), String> {
    let ends =
        text.split_once(',').map(|(low, high)| (low.trim().parse::<f64>(), high.trim().parse::<f64>()));
    match ends {
        Some((Ok(low), Ok(high))) if low <= high && low.is_finite() && high.is_finite() => Ok((low, high)),
        Some((Ok(_), Ok(_))) => {
            Err("the first number is not greater than the second, and both are finite".to_owned())
        }
        _ => Err("two numbers with a comma between them, as -1,1".to_owned()),
    }
}

fn angle(text: &str) -> Result<f64, String> {
    const MOST: f64 = urdf::MAX_SNAP;
    match text.parse::<f64>() {
        Ok(angle) if (0.0..=MOST).contains(&angle) => Ok(angle),
        Ok(_) => Err(format!("between 0 and {MOST} rad")),
        Err(_) => Err("not a number".to_owned()),
    }
}

/// Figures of the source on the machine.
struct Built {
    cycles: Cycle,
    bound: Cycle,
    bundles: usize,
}

pub(crate) fn run(arguments: &Model, color: bool, out: &mut Out) -> Result<()> {
    let mut writes: Vec<Given<'_>> = Vec::new();
    writes.extend(arguments.output.as_deref().map(|path| ("--output", path)));
    if arguments.json {
        writes.push(("--json", Path::new("-")));
    }
    files::check(&[("FILE", &arguments.file)], &writes)?;
    if ending(&arguments.file).as_deref() == Some("onnx") {
        return policy::run(arguments, color, out);
    }
    if ending(&arguments.file).as_deref() == Some("json")
        && let Some(text) = mpc::text(arguments)?
    {
        return mpc::run(arguments, &text, color, out);
    }
    if arguments.worst.is_some() {
        let name = files::input_name(&arguments.file);
        return Err(Failure::Usage(format!("--worst applies to control problems, and {name} is none")).into());
    }
    let machine = arguments.machine.machine;
    let delays = Delays::of(machine);
    let told = |error: takt_model::Error| anyhow!("{}: {error}", files::input_name(&arguments.file));
    let waiting = Waiting::new(format!("deriving the equations of {}", files::input_name(&arguments.file)));
    let function = function(arguments, &delays)?;
    drop(waiting);
    let layout = match arguments.body {
        true => {
            Layout::body(&function, &arguments.prefix).map_err(|error| Failure::Usage(error.to_string()))?
        }
        false => Layout::program(&function, machine).map_err(told)?,
    };
    let source = write::source(&function, &layout);
    if let Some(path) = &arguments.output {
        files::write(path, source.as_bytes())?;
    }
    let alone = arguments.output.as_deref().is_some_and(files::is_dash);
    let (count, chain) = (function.count(), function.depth(&delays));
    if !alone && !arguments.json {
        write_counts(&function, &count, out)?;
    }
    let name = arguments.output.clone().filter(|path| !files::is_dash(path));
    let name = name.unwrap_or_else(|| PathBuf::from("model.s"));
    let load = Load::new(machine, color);
    let assembled = |source: String| built(&load.finish(load.assemble(&name, source.into_bytes()))?);
    // The cycles of a body are those of the program that it would be by itself, if there can be one.
    let built = match Layout::program(&function, machine) {
        Ok(alone) if arguments.body => Some(assembled(write::source(&function, &alone))?),
        Err(_) => None,
        Ok(_) => Some(assembled(source)?),
    };
    if arguments.json {
        return output::json(&result_json(arguments, &function, &layout, &count, chain, built.as_ref()), out);
    }
    if let (false, Some(Built { cycles, bound, bundles })) = (alone, built) {
        let by_itself = if arguments.body { " by itself" } else { "" };
        writeln!(
            out,
            "{cycles} cycles on {}{by_itself}, bound {bound}, chain {chain}; {bundles} bundles",
            machine.name
        )?;
    }
    Ok(())
}

/// What follows the last dot of a file's name, in small letters.
fn ending(path: &Path) -> Option<String> {
    path.extension().map(|ending| ending.to_string_lossy().to_lowercase())
}

/// Checks that no body is asked for of what is a program over arrays with sections and a machine of its own.
fn no_body(arguments: &Model, content: &str) -> Result<()> {
    if !arguments.body {
        return Ok(());
    }
    let name = files::input_name(&arguments.file);
    let text = format!(
        "--body applies to robots and expressions, but {name} contains {content}, whose program has loops over arrays, sections and a \
         machine of its own; let it run on a core beside the law (docs/system.md)"
    );
    Err(Failure::Usage(text).into())
}

/// Checks that no option is given that applies to robots only.
fn for_robots(arguments: &Model, content: &str) -> Result<()> {
    let unused = [
        ("--function", arguments.function.is_some()),
        ("--base", arguments.base.is_some()),
        ("--tip", arguments.tip.is_some()),
    ];
    match unused.iter().find(|(_, given)| *given) {
        Some((option, _)) => {
            let name = files::input_name(&arguments.file);
            let text = format!("{option} applies to robot descriptions, but {name} contains {content}");
            Err(Failure::Usage(text).into())
        }
        None => Ok(()),
    }
}

/// The function that is asked for.
fn function(arguments: &Model, delays: &Delays) -> Result<Function> {
    let path = &arguments.file;
    let name = files::input_name(path);
    let told = |error: takt_model::Error| match error.line {
        Some(line) => anyhow!("{name}:{line}: {error}"),
        None => anyhow!("{name}: {error}"),
    };
    let bytes = files::read(path, xml::MAX_BYTES)?;
    let text = String::from_utf8(bytes).map_err(|_| anyhow!("{name} is not UTF-8 text"))?;
    let rewrites = arguments.rewrites.rewrites();
    let stem = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let tree = match ending(path).as_deref() {
        Some("json") => {
            for_robots(arguments, "expressions")?;
            return Ok(instructions::read(&text, rewrites).map_err(told)?.optimised(delays));
        }
        Some("csv") => dh::read(&text, &stem, arguments.snap).map_err(told)?,
        Some("urdf" | "xml") => robot::read(&text, arguments.snap).map_err(told)?,
        _ => {
            bail!(
                "{name}: the format is determined by the extension, which must be .urdf, .xml, .csv, .json or .onnx"
            )
        }
    };
    let Some(what) = arguments.function else {
        let names: Vec<&str> = What::ALL.iter().map(|(_, name, _)| *name).collect();
        return Err(
            Failure::Usage(format!("say with --function what to compute: {}", names.join(", "))).into()
        );
    };
    let (base, tip) = (arguments.base.as_deref(), arguments.tip.as_deref());
    let robot = tree.robot(base, tip).map_err(|error| told(error.located(&text)))?;
    let options = Options { rewrites, delays: *delays, tip, kp: arguments.kp, kd: arguments.kd };
    derive(&robot, what, &options).map_err(told)
}

fn built(assembled: &Assembled) -> Result<Built> {
    let program = &assembled.program;
    let bounds = takt_analysis::bound(program).map_err(|error| anyhow!("no bound: {error}"))?;
    let cycles = bounds.worst_period().unwrap_or(0);
    // No schedule changes the cycles of the period beyond its blocks.
    let above: u32 = assembled.blocks.iter().map(|block| block.cycles - block.bound.cycles()).sum();
    Ok(Built { cycles, bound: cycles - Cycle::from(above), bundles: program.bundles() as usize })
}

fn write_counts(function: &Function, count: &Count, out: &mut Out) -> Result<()> {
    writeln!(out, "{}", function.title)?;
    for note in &function.notes {
        writeln!(out, "  {note}")?;
    }
    writeln!(out, "{count}")?;
    Ok(())
}

fn result_json(
    arguments: &Model,
    function: &Function,
    layout: &Layout,
    count: &Count,
    chain: u32,
    built: Option<&Built>,
) -> Value {
    let port = |name: &str, text: &str| json!({ "name": name, "text": text });
    let inputs = function.inputs.iter().enumerate();
    let inputs: Vec<Value> =
        inputs.map(|(index, input)| port(layout.input(index).unwrap_or(&input.name), &input.text)).collect();
    let outputs = function.outputs.iter().enumerate();
    let outputs: Vec<Value> = outputs
        .map(|(index, (output, _))| port(layout.output(index).unwrap_or(&output.name), &output.text))
        .collect();
    let constants = write::constants(function);
    let constants: Vec<Value> =
        constants.iter().map(|(port, value)| json!({ "name": port.name, "value": value })).collect();
    json!({
        "file": files::input_name(&arguments.file),
        "title": function.title,
        "notes": function.notes,
        "machine": arguments.machine.machine.name,
        "body": arguments.body,
        "operations": count.total(),
        "counts": count,
        "cycles": built.map(|built| built.cycles),
        "bound": built.map(|built| built.bound),
        "chain": chain,
        "bundles": built.map(|built| built.bundles),
        "inputs": inputs,
        "outputs": outputs,
        "constants": constants,
    })
}
