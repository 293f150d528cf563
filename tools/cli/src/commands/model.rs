// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt model`: generates a program in equations from a robot description, expressions of another tool, or a control problem.

mod fpcore;
mod memory_sizes;
mod mpc;
mod policy;

use crate::run::load::Load;
use crate::terminal::files::{self, OptionPath, Out};
use crate::terminal::options::{MachineArgument, suggest};
use crate::terminal::output::Failure;
use crate::terminal::progress::DelayedActivity;
use anyhow::{Result, anyhow, bail};
use clap::{Args, ValueEnum};
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use takt_analysis::Bounds;
use takt_asm::AssembledProgram;
use takt_front::graph::{Count, Delays, Function, Rewrites};
use takt_front::robot::functions::{Options, RobotFunction, derive};
use takt_front::robot::{self, dh, urdf, xml};
use takt_front::sink::{self, Layout};
use takt_front::{DecodedText, decode, expressions};
use takt_isa::Program;
use takt_isa::timing::Cycle;

/// Turn a robot's description, expressions of CasADi or SymPy, a learned policy or a control problem into a program.
///
/// FILE is a robot in URDF or MJCF, a table of Denavit-Hartenberg parameters (.csv), a list of instructions (.json) that
/// the Python module `takt_expressions` writes from CasADi functions and SymPy expressions, kernels in FPCore (.fpcore), a multi-layer perceptron (.onnx), or a linear
/// system with weights and limits (.json) for model-predictive control.
/// The operations that it takes are printed, and the cycles on the machine beside the bound that no schedule can beat; of a policy,
/// its weights, the cycles of each, and the memory.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Model {
    /// Description; the format is determined by the extension, which must be .urdf, .xml, .csv, .json, .fpcore or .onnx.
    file: PathBuf,
    /// Quantities to compute of a robot: forward-kinematics, jacobian, inverse-dynamics, gravity, mass-matrix, forward-dynamics or
    /// computed-torque.
    #[arg(long, short, value_name = "FUNCTION", value_parser = robot_function)]
    function: Option<RobotFunction>,
    /// The link that stays where it is [default: the root].
    #[arg(long, value_name = "LINK")]
    base: Option<String>,
    /// Only the joints from the base to this link; the others are held at 0. It is the link whose pose and Jacobian are computed.
    #[arg(long, value_name = "LINK")]
    tip: Option<String>,
    /// A base that a joint lets move freely: `held` computes the robot with it where it is, `error` refuses it.
    #[arg(long, value_enum, default_value_t = Floating::Held)]
    floating: Floating,
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
    /// Output to compute, for a policy with several outputs.
    #[arg(long, value_name = "NAME")]
    result: Option<String>,
    /// Core to compute, for an FPCore file with several.
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
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
    /// Beginning of all names of the body.
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
  takt model kernels.fpcore --name doppler1       a kernel of FPBench
  takt model policy.onnx -o policy.s              a learned policy
  takt model system.json -o mpc.s --worst 100     model-predictive control";

/// The treatment of a base that floats.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Floating {
    Held,
    Error,
}

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

fn robot_function(name: &str) -> Result<RobotFunction, String> {
    RobotFunction::from_name(name).ok_or_else(|| {
        let names: Vec<&str> = RobotFunction::ALL.iter().map(|(_, name, _)| *name).collect();
        let near = suggest(name, names.iter().copied());
        format!("there is no such function{near} (functions: {})", names.join(", "))
    })
}

fn gain(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(gain) if gain.is_finite() && gain >= 0.0 => Ok(gain),
        Ok(_) => Err("a gain must be finite and not negative".to_owned()),
        Err(_) => Err("not a number".to_owned()),
    }
}

fn starts(text: &str) -> Result<usize, String> {
    let most = takt_front::mpc::MAX_RESTARTS;
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
            Err("the first number must not be greater than the second, and both must be finite".to_owned())
        }
        _ => Err("expected two numbers with a comma between them, as -1,1".to_owned()),
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

/// Cycles of a period, as in `takt bound`.
#[derive(Clone, Copy)]
struct Cycles {
    /// Worst case if the tick comes in time, possibly right after the `wait`.
    worst: Cycle,
    /// Worst case if the machine is already waiting for the tick, which comes at least `refill` cycles after the `wait`.
    waiting: Cycle,
    refill: u32,
}

impl Cycles {
    fn of(program: &Program, bounds: &Bounds) -> Cycles {
        let periods = bounds.sections.iter().filter(|section| !section.once);
        let waiting = periods.map(|section| section.cycles.worst).max().unwrap_or(0);
        Cycles { worst: bounds.worst_period().unwrap_or(0), waiting, refill: program.machine.refill }
    }

    /// Describes both numbers, for a machine of this name.
    fn on(self, machine: &str) -> String {
        let Cycles { worst, waiting, refill } = self;
        match worst == waiting {
            true => format!("{worst} cycles on {machine}"),
            false => {
                format!(
                    "{worst} cycles on {machine} ({waiting} if the tick comes {refill} cycles after the wait or later)"
                )
            }
        }
    }
}

/// Figures of a source on its machine.
struct SourceFigures {
    cycles: Cycles,
    bound: Cycle,
    bundles: usize,
}

pub(crate) fn run(arguments: &Model, color: bool, out: &mut Out) -> Result<()> {
    let mut writes: Vec<OptionPath<'_>> = Vec::new();
    writes.extend(arguments.output.as_deref().map(|path| ("--output", path)));
    if arguments.json {
        writes.push(("--json", Path::new("-")));
    }
    files::check(&[("FILE", &arguments.file)], &writes)?;
    if ending(&arguments.file).as_deref() == Some("onnx") {
        return policy::run(arguments, color, out);
    }
    if arguments.result.is_some() {
        let name = files::input_name(&arguments.file);
        return Err(
            Failure::Usage(format!("--result applies to policies, and {name} is not a policy")).into()
        );
    }
    if ending(&arguments.file).as_deref() == Some("json")
        && let Some(text) = mpc::text(arguments)?
    {
        return mpc::run(arguments, &text, color, out);
    }
    if arguments.worst.is_some() {
        let name = files::input_name(&arguments.file);
        return Err(Failure::Usage(format!(
            "--worst applies to control problems, and {name} is not a control problem"
        ))
        .into());
    }
    if ending(&arguments.file).as_deref() == Some("fpcore") {
        return fpcore::run(arguments, color, out);
    }
    if arguments.name.is_some() {
        let name = files::input_name(&arguments.file);
        return Err(Failure::Usage(format!("--name applies to .fpcore files, and {name} is none")).into());
    }
    let delays = Delays::of(arguments.machine.machine);
    let waiting =
        DelayedActivity::new(format!("deriving the equations of {}", files::input_name(&arguments.file)));
    let function = function(arguments, &delays)?;
    drop(waiting);
    match present(arguments, &function, arguments.output.as_deref(), color, out)? {
        Some(value) => files::json(&value, out),
        None => Ok(()),
    }
}

/// Writes a function's source and its figures. Returns the figures instead of writing them with --json.
fn present(
    arguments: &Model,
    function: &Function,
    output: Option<&Path>,
    color: bool,
    out: &mut Out,
) -> Result<Option<Value>> {
    let machine = arguments.machine.machine;
    let told = |error: takt_front::Error| anyhow!("{}: {error}", files::input_name(&arguments.file));
    let layout = match arguments.body {
        true => {
            Layout::body(function, &arguments.prefix).map_err(|error| Failure::Usage(error.to_string()))?
        }
        false => Layout::program(function, machine).map_err(told)?,
    };
    let source = sink::source(function, &layout);
    if let Some(path) = output {
        files::write(path, source.as_bytes())?;
    }
    let alone = output.is_some_and(files::is_dash);
    let (count, chain) = (function.count(), function.depth(&Delays::of(machine)));
    if !alone && !arguments.json {
        write_counts(function, &count, out)?;
    }
    let name = output.filter(|path| !files::is_dash(path)).unwrap_or(Path::new("model.s"));
    let load = Load::new(machine, color);
    let assembled = |source: String| built(&load.finish(load.assemble(name, source.into_bytes()))?);
    // A body takes the cycles of the equivalent program, provided that the machine can run it.
    let built = match Layout::program(function, machine) {
        Ok(alone) if arguments.body => Some(assembled(sink::source(function, &alone))?),
        Err(_) => None,
        Ok(_) => Some(assembled(source)?),
    };
    if arguments.json {
        return Ok(Some(result_json(arguments, function, &layout, &count, chain, built.as_ref())));
    }
    if let (false, Some(SourceFigures { cycles, bound, bundles })) = (alone, built) {
        let by_itself = if arguments.body { " by itself" } else { "" };
        writeln!(
            out,
            "{}{by_itself}, bound {bound}, chain {chain}; {bundles} bundles",
            cycles.on(machine.name)
        )?;
    }
    Ok(None)
}

/// Reads a file and decodes its text.
fn decoded(path: &Path, most: usize) -> Result<DecodedText> {
    decode(files::read(path, most)?).map_err(|why| anyhow!("{}: {why}", files::input_name(path)))
}

/// Loader for files that another file names, relative to its folder.
fn folder_loader(path: &Path, most: usize) -> impl Fn(&str) -> Result<String, String> {
    let folder = path.parent().unwrap_or(Path::new("")).to_owned();
    move |name| {
        decoded(&folder.join(name), most).map(|decoded| decoded.text).map_err(|error| format!("{error:#}"))
    }
}

/// Lower-case extension of a file.
fn ending(path: &Path) -> Option<String> {
    path.extension().map(|ending| ending.to_string_lossy().to_lowercase())
}

/// Rejects --body for models that become complete programs, with arrays, sections and a machine.
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

/// Rejects options that apply only to robots.
fn for_robots(arguments: &Model, content: &str) -> Result<()> {
    let unused = [
        ("--function", arguments.function.is_some()),
        ("--base", arguments.base.is_some()),
        ("--tip", arguments.tip.is_some()),
        ("--floating", arguments.floating != Floating::Held),
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

/// Function to generate, from the arguments.
fn function(arguments: &Model, delays: &Delays) -> Result<Function> {
    let path = &arguments.file;
    let name = files::input_name(path);
    let told = |error: takt_front::Error| anyhow!(error.located_text(&name));
    let DecodedText { text, note } = decoded(path, xml::MAX_BYTES)?;
    let rewrites = arguments.rewrites.rewrites();
    let stem = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let mut tree = match ending(path).as_deref() {
        Some("json") => {
            for_robots(arguments, "expressions")?;
            return Ok(expressions::read(&text, rewrites).map_err(told)?.optimised(delays));
        }
        Some("csv") => dh::read(&text, &stem, arguments.snap).map_err(told)?,
        Some("urdf" | "xml") => {
            robot::read(&text, arguments.snap, &folder_loader(path, xml::MAX_BYTES)).map_err(told)?
        }
        _ => {
            bail!(
                "{name}: the format is determined by the extension, which must be .urdf, .xml, .csv, .json, .fpcore or .onnx"
            )
        }
    };
    let Some(what) = arguments.function else {
        let names: Vec<&str> = RobotFunction::ALL.iter().map(|(_, name, _)| *name).collect();
        return Err(
            Failure::Usage(format!("name what to compute with --function: {}", names.join(", "))).into()
        );
    };
    tree.notes.extend(note);
    if arguments.floating == Floating::Held {
        tree = tree.held();
    }
    let (base, tip) = (arguments.base.as_deref(), arguments.tip.as_deref());
    let robot = tree.robot(base, tip).map_err(|error| told(error.located(&text)))?;
    let options = Options { rewrites, delays: *delays, tip, kp: arguments.kp, kd: arguments.kd };
    derive(&robot, what, &options).map_err(told)
}

fn built(assembled: &AssembledProgram) -> Result<SourceFigures> {
    let program = &assembled.program;
    let bounds = takt_analysis::bound(program).map_err(|error| anyhow!("no bound: {error}"))?;
    let cycles = Cycles::of(program, &bounds);
    // Cycles outside the blocks do not depend on the schedule.
    let above: u32 = assembled.blocks.iter().map(|block| block.cycles - block.bound.cycles()).sum();
    Ok(SourceFigures {
        cycles,
        bound: cycles.worst - Cycle::from(above),
        bundles: program.bundles() as usize,
    })
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
    built: Option<&SourceFigures>,
) -> Value {
    let port = |name: &str, text: &str| json!({ "name": name, "text": text });
    let inputs = function.inputs.iter().enumerate();
    let inputs: Vec<Value> =
        inputs.map(|(index, input)| port(layout.input(index).unwrap_or(&input.name), &input.text)).collect();
    let outputs = function.outputs.iter().enumerate();
    let outputs: Vec<Value> = outputs
        .map(|(index, (output, _))| port(layout.output(index).unwrap_or(&output.name), &output.text))
        .collect();
    let constants = sink::constants(function);
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
        "cycles": built.map(|built| built.cycles.worst),
        "cycles_waiting": built.map(|built| built.cycles.waiting),
        "bound": built.map(|built| built.bound),
        "chain": chain,
        "bundles": built.map(|built| built.bundles),
        "inputs": inputs,
        "outputs": outputs,
        "constants": constants,
    })
}
