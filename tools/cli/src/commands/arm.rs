// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt arm`: kinematics of the six-axis arm for the paper's examples, random poses and a path.

use crate::run::account::{fused_operations, rounding};
use crate::run::fault;
use crate::run::load::Load;
use crate::run::loaded_program::LoadedProgram;
use crate::run::ports;
use crate::terminal::files::{self, OptionPath, Out};
use crate::terminal::number;
use crate::terminal::options::{self, ContractArgument, SourceArguments};
use crate::terminal::plot::ArmPlot;
use crate::terminal::progress::progress;
use anyhow::{Context, Result, bail};
use clap::Args;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};
use takt_analysis::period::PERIOD_LIMIT;
use takt_emu::Emulator;
use takt_isa::program::Port;
use takt_isa::{Function, Machine, Register, T3};
use takt_programs::arm::{
    Arm as OnArm, CONFIGURATIONS, Configuration, FORWARD_EXAMPLE, ForwardResult, GOOD, INVERSE_EXAMPLE,
    InverseResult, Pose, RoundTrip, Sweep, forward, inverse, square, sweep,
};

/// Run the six-axis arm's kinematics: the second founding paper's examples, and random poses.
///
/// Assembles `arm/forward.s` and `arm/inverse.s`, runs them on the emulator, and prints results, errors against binary64, and cycles
/// beside the paper's fixed-point circuits. For each random pose, the inverse kinematics are computed in all eight
/// configurations, and the forward kinematics from each result.
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arm {
    /// The machine, one with arctangents.
    #[arg(long, short, value_name = "MACHINE", default_value = T3.name, value_parser = options::machine)]
    machine: &'static Machine,
    #[command(flatten)]
    contract: ContractArgument,
    /// Random poses.
    #[arg(long, value_name = "N", default_value_t = 10_000, value_parser = number::count, allow_hyphen_values = true)]
    poses: u64,
    /// Seed of the random poses.
    #[arg(long, value_name = "SEED", default_value_t = 1, value_parser = number::natural, allow_hyphen_values = true)]
    seed: u64,
    /// Clock in MHz, for cycles to time; the first paper's is 125.
    #[arg(long, value_name = "MHZ", default_value_t = options::PAPER_CLOCK, value_parser = number::clock, allow_hyphen_values = true)]
    clock: f64,
    /// Draw a square in space with the tool and write each period's joint angles as CSV; `-` is standard output.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Draw that square in space, as the joint angles bring the tool along it, and the angles over time, as SVG; `-` is
    /// standard output.
    #[arg(long, value_name = "SVG", value_parser = options::picture())]
    plot: Option<PathBuf>,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
    /// Show no progress.
    #[arg(long, short)]
    quiet: bool,
}

const EXAMPLES: &str = "\
Examples:
  takt arm                                      the paper's examples and 10,000 random poses
  takt arm --poses 1000000                      a million: the figures of the README
  takt arm --csv square.csv --plot square.svg   the tool along a square in space, through the inverse kinematics";

/// Figures of the paper's circuits: steps at 50 MHz, and errors relative to Matlab.
const PAPER_FORWARD_STEPS: u64 = 215;
const PAPER_INVERSE_STEPS: u64 = 269;
const PAPER_FORWARD_MM: f64 = 0.0054;
const PAPER_FORWARD_DEG: f64 = 0.011;
const PAPER_INVERSE_DEG: f64 = 0.022;
const PAPER_ARM_CLOCK: f64 = 50.0;

/// A program, with its ports in the order of the kinematics' arguments.
struct PortedProgram {
    loaded: LoadedProgram,
    color: bool,
    emulator: Emulator,
    inputs: Vec<Register>,
    outputs: Vec<Register>,
}

impl PortedProgram {
    fn new(loaded: LoadedProgram, color: bool, inputs: &[&str], outputs: &[&str]) -> Result<PortedProgram> {
        let program = &loaded.program;
        let registers = |ports: &[Port], names: &[&str]| -> Result<Vec<Register>> {
            let find = |name: &&str| ports.iter().find(|port| port.name == **name).map(|port| port.register);
            names
                .iter()
                .map(|name| find(name).with_context(|| format!("there is no port `{name}`")))
                .collect()
        };
        let (inputs, outputs) = (registers(&program.inputs, inputs)?, registers(&program.outputs, outputs)?);
        Ok(PortedProgram { emulator: Emulator::new(program)?, loaded, color, inputs, outputs })
    }

    /// Runs a period; returns the outputs and the number of cycles.
    fn period(&mut self, inputs: impl Iterator<Item = u32>) -> Result<(Vec<u32>, u64)> {
        for (register, bits) in self.inputs.iter().zip(inputs) {
            self.emulator.set_input_bits(*register, bits)?;
        }
        self.emulator.set_cycle_limit(self.emulator.now() + PERIOD_LIMIT);
        let report = self.emulator.run_period(&[]);
        let report = report.map_err(|error| fault::located_error(error.into(), &self.loaded, self.color))?;
        if !report.nan_writes.is_empty() {
            bail!("a NaN was written to an output port");
        }
        let value = |register: &Register| {
            self.emulator.output_bits(*register).context("an output port was not written")
        };
        Ok((self.outputs.iter().map(value).collect::<Result<_>>()?, report.cycles))
    }
}

/// Forward and inverse kinematics on the emulator.
struct EmulatedKinematics {
    forward: PortedProgram,
    inverse: PortedProgram,
}

const JOINTS: [&str; 6] = ["th1", "th2", "th3", "th4", "th5", "th6"];
const POSE: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];
const TOOL: [&str; 3] = ["tx", "ty", "tz"];
const CONFIGURATION: [&str; 3] = ["config0", "config1", "config2"];

impl EmulatedKinematics {
    fn new(load: Load) -> Result<EmulatedKinematics> {
        let (pose, joints) =
            ([&POSE[..], &CONFIGURATION, &["status"]].concat(), [&JOINTS[..], &["status"]].concat());
        let ported = |path, inputs: &[&str], outputs: &[&str]| {
            let mut ported = PortedProgram::new(load.builtin(path)?, load.color, inputs, outputs)?;
            // Run the code before the first `wait`, which is not part of a period.
            let zeros = vec![0; inputs.len()];
            ported.period(zeros.into_iter())?;
            anyhow::Ok(ported)
        };
        Ok(EmulatedKinematics {
            forward: ported("arm/forward.s", &[&JOINTS[..], &TOOL].concat(), &pose)?,
            inverse: ported("arm/inverse.s", &[&POSE[..], &TOOL, &CONFIGURATION].concat(), &joints)?,
        })
    }
}

fn floats<const N: usize>(words: &[u32]) -> [f32; N] {
    std::array::from_fn(|i| f32::from_bits(words[i]))
}

impl OnArm for EmulatedKinematics {
    type Error = anyhow::Error;

    fn forward(&mut self, joints: [f32; 6], tool: [f32; 3]) -> Result<ForwardResult> {
        let (words, cycles) = self.forward.period(joints.into_iter().chain(tool).map(f32::to_bits))?;
        Ok(ForwardResult {
            pose: Pose { position: floats(&words), orientation: floats(&words[3..]) },
            configuration: [6, 7, 8].map(|i| words[i] != 0),
            status: words[9],
            cycles,
        })
    }

    fn inverse(
        &mut self,
        pose: &Pose<f32>,
        tool: [f32; 3],
        configuration: Configuration,
    ) -> Result<InverseResult> {
        let values = pose.position.into_iter().chain(pose.orientation).chain(tool).map(f32::to_bits);
        let (words, cycles) = self.inverse.period(values.chain(configuration.map(u32::from)))?;
        Ok(InverseResult { joints: floats(&words), status: words[6], cycles })
    }
}

fn narrow<const N: usize>(values: [f64; N]) -> [f32; N] {
    values.map(|value| value as f32)
}

fn narrow_pose(pose: &Pose<f64>) -> Pose<f32> {
    Pose { position: narrow(pose.position), orientation: narrow(pose.orientation) }
}

/// Result for the square: joint angles from the program, and the path of the tool.
struct SquareResult {
    joints: Vec<[f32; 6]>,
    /// Tool positions at these joint angles, mm.
    tool: Vec<[f64; 3]>,
    /// Largest deviation from the square, mm.
    deviation: f64,
}

fn draw_square(arm: &mut EmulatedKinematics) -> Result<SquareResult> {
    let tool = narrow(square::TOOL);
    let mut drawn = SquareResult { joints: Vec::new(), tool: Vec::new(), deviation: 0.0 };
    for period in 0..=square::PERIODS {
        let pose = square::square(period);
        let found = arm.inverse(&narrow_pose(&pose), tool, square::CONFIGURATION)?;
        if found.status != GOOD {
            bail!("period {period}: the square is out of reach (status {})", found.status);
        }
        let (reached, _) = forward(found.joints.map(f64::from), square::TOOL);
        let off = (0..3).map(|i| (reached.position[i] - pose.position[i]).powi(2)).sum::<f64>().sqrt();
        drawn.deviation = drawn.deviation.max(off);
        drawn.joints.push(found.joints);
        drawn.tool.push(reached.position);
    }
    Ok(drawn)
}

pub(crate) fn run(arguments: &Arm, color: bool, out: &mut Out) -> Result<()> {
    let outputs = [("--csv", arguments.csv.as_deref()), ("--plot", arguments.plot.as_deref())];
    let mut writes: Vec<OptionPath<'_>> =
        outputs.into_iter().filter_map(|(name, path)| Some((name, path?))).collect();
    let draws = !writes.is_empty();
    if arguments.json {
        writes.push(("--json", Path::new("-")));
    }
    files::check(&[], &writes)?;

    let machine = arguments.machine;
    if machine.host(Function::Arctangent).is_none() {
        bail!("{} has no arctangent, which the arm's programs need; {} has", machine.name, T3.name);
    }
    let source = SourceArguments { contract: arguments.contract, ..SourceArguments::default() };
    let mut arm = EmulatedKinematics::new(Load::new(machine, color).with(&source))?;
    let mut table = arguments.csv.as_deref().map(Out::create).transpose()?;
    let mut picture = arguments.plot.as_deref().map(Out::create).transpose()?;
    let drawn = if draws { Some(draw_square(&mut arm)?) } else { None };
    if let (Some(file), Some(drawn)) = (&mut table, &drawn) {
        let titles = ["period", "time"].into_iter().chain(POSE).chain(JOINTS);
        ports::write_row(file, titles.map(str::to_owned))?;
        for (period, joints) in (0..).zip(&drawn.joints) {
            let pose = narrow_pose(&square::square(period));
            let first = [period.to_string(), format!("{:.3}", period as f64 * square::PERIOD)];
            let values = pose.position.into_iter().chain(pose.orientation).chain(*joints);
            ports::write_row(file, first.into_iter().chain(values.map(|value| value.to_string())))?;
        }
    }
    if let (Some(file), Some(drawn)) = (&mut picture, &drawn) {
        let plot = ArmPlot { tool: &drawn.tool, joints: &drawn.joints, period: square::PERIOD };
        let title = format!("The tool along a square of {} mm in space", square::SIDE);
        file.write_all(plot.draw(&title)?.as_bytes())?;
    }
    for file in [table, picture].into_iter().flatten() {
        file.finish()?;
    }

    let bar = progress(arguments.poses, "poses", arguments.quiet);
    let found = sweep(&mut arm, arguments.poses, arguments.seed, |done| {
        if done.is_multiple_of(1024) {
            bar.set_position(done);
        }
    })?;
    bar.finish_and_clear();
    let examples = Examples::run(&mut arm)?;
    let fused = [&arm.forward, &arm.inverse].map(|ported| fused_operations(ported.emulator.program()));
    let report = Report { arguments, found, examples, drawn, fused };
    if arguments.json {
        files::json(&report.json(), out)?;
    } else if !writes.iter().any(|(_, path)| files::is_dash(path)) {
        out.write_all(report.text().as_bytes())?;
    }
    Ok(())
}

/// Results of the paper's examples: from the programs, and in binary64.
struct Examples {
    forward: ForwardResult,
    inverse: InverseResult,
    exact: [f64; 6],
}

impl Examples {
    fn run(arm: &mut EmulatedKinematics) -> Result<Examples> {
        let forward = arm.forward(narrow(FORWARD_EXAMPLE.joints), narrow(FORWARD_EXAMPLE.tool))?;
        let (pose, tool) = (&INVERSE_EXAMPLE.pose, INVERSE_EXAMPLE.tool);
        let inverse_result = arm.inverse(&narrow_pose(pose), narrow(tool), [false; 3])?;
        let exact = inverse(pose, tool, [false; 3])?.joints;
        Ok(Examples { forward, inverse: inverse_result, exact })
    }
}

struct Report<'a> {
    arguments: &'a Arm,
    found: Sweep,
    examples: Examples,
    drawn: Option<SquareResult>,
    /// Number of fused operations in the forward and in the inverse program.
    fused: [usize; 2],
}

impl Report<'_> {
    fn text(&self) -> String {
        let mut out = String::new();
        let _ = self.write(&mut out);
        out
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        let Report { arguments, found, examples, drawn, .. } = self;
        let (machine, clock) = (arguments.machine.name, arguments.clock);
        writeln!(
            out,
            "programs/arm/forward.s and inverse.s on {machine}, {} random poses\n",
            arguments.poses
        )?;
        writeln!(out, "Time of one run{:>25}{:>10}{:>12}", "clock MHz", "cycles", "time µs")?;
        let mut time = |name: &str, clock: f64, cycles: u64| {
            writeln!(out, "  {name:<30}{clock:>8}{cycles:>10}{:>12.3}", cycles as f64 / clock)
        };
        let longest = |cycles: Option<(u64, u64)>| cycles.map_or(0, |(_, longest)| longest);
        time("forward, the paper's circuit", PAPER_ARM_CLOCK, PAPER_FORWARD_STEPS)?;
        time("forward, Takt, longest", clock, longest(found.forward_cycles))?;
        time("inverse, the paper's circuit", PAPER_ARM_CLOCK, PAPER_INVERSE_STEPS)?;
        time("inverse, Takt, longest", clock, longest(found.inverse_cycles))?;

        writeln!(out, "\nLargest error against binary64{:>10}{:>12}", "paper", "Takt")?;
        let mut error =
            |name: &str, paper: f64, ours: f64| writeln!(out, "  {name:<28}{paper:>10}{ours:>12.6}");
        error("forward: position, mm", PAPER_FORWARD_MM, found.forward_mm)?;
        error("forward: orientation, °", PAPER_FORWARD_DEG, found.forward_deg)?;
        error("inverse: joints, °", PAPER_INVERSE_DEG, found.inverse_deg)?;
        let fused = rounding(self.fused.iter().sum());
        writeln!(out, "  of both programs together, {fused}")?;
        writeln!(
            out,
            "  over {} poses and {} solutions at least 10° from the singularities; {} closer ones do not count, {} \
             configurations\n  do not reach their pose; status and configuration differ from binary64's in {}",
            found.forward_poses,
            found.inverse_solutions,
            found.near_singular,
            found.unreachable,
            found.disagreements
        )?;

        writeln!(out, "\nThere and back{:>44}{:>12}", "mm", "degrees")?;
        let mut trip = |name: &str, trip: &RoundTrip| {
            let tried: u64 = trip.tried.iter().sum();
            writeln!(
                out,
                "  {name:<26}{tried:>10} times{:>14.6}{:>12.6}",
                trip.max_error_mm, trip.max_error_deg
            )
        };
        trip("pose to joints to pose", &found.forward_of_inverse)?;
        trip("joints to pose to joints", &found.inverse_of_forward)?;
        writeln!(out, "  by configuration (config0 config1 config2)")?;
        for (i, configuration) in CONFIGURATIONS.into_iter().enumerate() {
            let [a, b, c] = configuration.map(u8::from);
            let (there, back) = (found.forward_of_inverse.tried[i], found.inverse_of_forward.tried[i]);
            writeln!(out, "    {a} {b} {c}{there:>26} and {back:>8}")?;
        }

        writeln!(out, "\nThe paper's example, forward{:>14}{:>16}{:>16}", "paper", "binary64", "Takt")?;
        let [circuit, exact] = [&FORWARD_EXAMPLE.circuit, &FORWARD_EXAMPLE.binary64].map(flat);
        let ours = flat(&examples.forward.pose);
        for i in 0..6 {
            writeln!(out, "  {:<24}{:>16.6}{:>16.6}{:>16.6}", POSE[i], circuit[i], exact[i], ours[i])?;
        }
        writeln!(out, "The paper's example, inverse")?;
        let (circuit, exact, ours) = (INVERSE_EXAMPLE.circuit, examples.exact, examples.inverse.joints);
        for i in 0..6 {
            writeln!(out, "  {:<24}{:>16.6}{:>16.6}{:>16.6}", JOINTS[i], circuit[i], exact[i], ours[i])?;
        }
        if let Some(drawn) = drawn {
            writeln!(
                out,
                "\nThe square of {} mm, {} periods of {} ms: the tool is at most {:.6} mm off",
                square::SIDE,
                drawn.joints.len(),
                square::PERIOD * 1e3,
                drawn.deviation
            )?;
        }
        Ok(())
    }

    fn json(&self) -> Value {
        let Report { arguments, found, examples, drawn, fused: [forward_fused, inverse_fused] } = self;
        let cycles = |cycles: Option<(u64, u64)>| {
            let (shortest, longest) = cycles.unwrap_or_default();
            json!({"min": shortest, "max": longest})
        };
        let time =
            |cycles: Option<(u64, u64)>| cycles.map_or(0.0, |(_, longest)| longest as f64 / arguments.clock);
        let trip = |trip: &RoundTrip| {
            json!({
                "tried": trip.tried.iter().sum::<u64>(), "tried_by_configuration": trip.tried,
                "max_error_mm": trip.max_error_mm, "max_error_deg": trip.max_error_deg,
            })
        };
        let by_name = |names: [&str; 6], values: [f64; 6]| -> Value {
            names.into_iter().zip(values).map(|(name, value)| (name.to_owned(), json!(value))).collect()
        };
        let ours = examples.forward;
        json!({
            "machine": arguments.machine.name,
            "clock_mhz": arguments.clock,
            "seed": arguments.seed,
            "poses": arguments.poses,
            "forward": {
                "cycles": cycles(found.forward_cycles),
                "fused_operations": forward_fused,
                "time_us": time(found.forward_cycles),
                "max_error_mm": found.forward_mm,
                "max_error_deg": found.forward_deg,
                "compared": found.forward_poses,
                "example": {
                    "takt": by_name(POSE, flat(&ours.pose)),
                    "binary64": by_name(POSE, flat(&FORWARD_EXAMPLE.binary64)),
                    "paper": by_name(POSE, flat(&FORWARD_EXAMPLE.circuit)),
                    "configuration": ours.configuration.map(u8::from),
                    "status": ours.status,
                },
            },
            "inverse": {
                "cycles": cycles(found.inverse_cycles),
                "fused_operations": inverse_fused,
                "time_us": time(found.inverse_cycles),
                "max_error_deg": found.inverse_deg,
                "compared": found.inverse_solutions,
                "unreachable": found.unreachable,
                "near_singular": found.near_singular,
                "example": {
                    "takt": by_name(JOINTS, examples.inverse.joints.map(f64::from)),
                    "binary64": by_name(JOINTS, examples.exact),
                    "paper": by_name(JOINTS, INVERSE_EXAMPLE.circuit),
                    "status": examples.inverse.status,
                },
            },
            "round_trips": {
                "forward_of_inverse": trip(&found.forward_of_inverse),
                "inverse_of_forward": trip(&found.inverse_of_forward),
            },
            "disagreements": found.disagreements,
            "paper": {
                "forward": {"cycles": PAPER_FORWARD_STEPS, "max_error_mm": PAPER_FORWARD_MM, "max_error_deg": PAPER_FORWARD_DEG},
                "inverse": {"cycles": PAPER_INVERSE_STEPS, "max_error_deg": PAPER_INVERSE_DEG},
                "clock_mhz": PAPER_ARM_CLOCK,
            },
            "square": drawn.as_ref().map(|drawn| json!({"periods": drawn.joints.len(), "max_deviation_mm": drawn.deviation})),
        })
    }
}

fn flat<T: Copy + Into<f64>>(pose: &Pose<T>) -> [f64; 6] {
    let [x, y, z] = pose.position.map(Into::into);
    let [roll, pitch, yaw] = pose.orientation.map(Into::into);
    [x, y, z, roll, pitch, yaw]
}
