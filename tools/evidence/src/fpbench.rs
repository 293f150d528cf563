// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bounds of FPBench's kernels beside those of other makers: Gappa, which runs here on the same operations in binary32, and the published
//! figures of FPTaylor and Daisy for binary64 (`fpbench.toml`).

use crate::documents::between;
use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use takt_analysis::accuracy::{Reals, enclose_in_boxes, in_gappa};
use takt_asm::{MemoryLoader, Options, Search};
use takt_automation::command::{apt_install, root, works};
use takt_front::fpcore::read;
use takt_front::graph::{Binary, Delays, Function, Node, Rewrites, Unary};
use takt_front::sink::{self, Layout};
use takt_isa::T3;

const FIGURES: &str = "tools/evidence/fpbench.toml";
const DOCUMENT: &str = "docs/accuracy.md";
/// Seconds that Gappa may take for a kernel.
const PATIENCE: &str = "5";
/// Parts into which Gappa divides the range of an input, where it divides one.
const PARTS: u32 = 16;
/// Inputs up to which Gappa divides each.
const MOST_DIVIDED: usize = 3;
/// Factor that the table shows as 1.00, or as the limit: bounds are rounded outwards in different formats.
const AS_SHOWN: f64 = 1.005;
/// A unit in the last place of binary32 by one of binary64.
const SCALE: f64 = 536_870_912.0;

#[derive(Args)]
pub(crate) struct Arguments {
    /// Change nothing; fail if the document differs.
    #[arg(long)]
    check: bool,
}

/// Published figures, and the reasons for bounds that are wider.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Figures {
    /// Smallest figure of FPTaylor's configurations, by kernel.
    fptaylor: BTreeMap<String, f64>,
    /// Daisy's figure, by kernel.
    daisy: BTreeMap<String, f64>,
    /// Reasons by kernel.
    reasons: BTreeMap<String, String>,
}

/// A kernel with its bounds; `None` where there is none.
struct Row {
    name: String,
    operations: usize,
    /// A function of the library is among the operations.
    library: bool,
    ours: Option<f64>,
    gappa: Option<f64>,
    /// Bound that counts the rounding of inputs and constants, as the published figures do.
    real: Option<f64>,
    fptaylor: Option<f64>,
    daisy: Option<f64>,
}

pub(crate) fn compare(arguments: &Arguments) -> Result<()> {
    if !works("gappa", "--version") {
        apt_install(&["gappa"])?;
    }
    let figures: Figures = toml::from_str(&fs::read_to_string(root().join(FIGURES))?).context(FIGURES)?;
    let mut rows = Vec::new();
    for path in files()? {
        let text = fs::read_to_string(&path)?;
        for core in
            read(&text, Rewrites::EXACT).map_err(|error| anyhow::anyhow!("{}: {error}", path.display()))?
        {
            let function = core.function.map_err(|error| anyhow::anyhow!("{}: {error}", core.name))?;
            if rows.iter().any(|row: &Row| row.name == core.name)
                || sink::inputs_read(&function).iter().all(|read| !read)
            {
                continue;
            }
            rows.push(row(core.name, &function.optimised(&Delays::of(&T3)), &figures)?);
        }
    }
    let table = table(&rows, &figures)?;
    println!("{table}");
    let path = root().join(DOCUMENT);
    let document = fs::read_to_string(&path).context(DOCUMENT)?;
    let written = between(DOCUMENT, &document, ("fpbench", "fpbench"), &table)?;
    match arguments.check {
        true => ensure!(written == document, "{DOCUMENT} is stale: `cargo evidence fpbench` writes it"),
        false => fs::write(path, written)?,
    }
    Ok(())
}

fn files() -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(root().join("programs/fpbench"))?;
    let mut files: Vec<PathBuf> = entries.map(|entry| Ok(entry?.path())).collect::<Result<_>>()?;
    files.retain(|path| path.extension().is_some_and(|ending| ending == "fpcore"));
    files.sort();
    Ok(files)
}

fn row(name: String, function: &Function, figures: &Figures) -> Result<Row> {
    let layout = Layout::program(function, &T3).map_err(|error| anyhow::anyhow!("{name}: {error}"))?;
    let loader = Search::new(MemoryLoader::default()).library(takt_programs::LIBRARY);
    let options = Options { machine: &T3, effort: 0, ..Options::default() };
    let assembled =
        takt_asm::assemble_bytes("kernel.s", sink::source(function, &layout).into_bytes(), &loader, &options);
    let program = match assembled {
        Ok(assembled) => assembled.program,
        Err(errors) => bail!("{name}: {}", errors.render(false)),
    };
    let bound = |reals: &Reals| enclose_in_boxes(&program, reals).ok()?.outputs.first()?.error;
    let graph = &function.graph;
    let uses = graph.uses(&function.nodes());
    let live = || (0..graph.len()).filter(|index| uses[*index] > 0).map(|index| graph.node_at(index));
    let constants = live().filter_map(|node| match node {
        Node::Constant(bits) => Some(f64::from_bits(bits)),
        _ => None,
    });
    let library = live().any(|node| {
        matches!(node, Node::Unary(Unary::Exp | Unary::Log | Unary::Tan | Unary::Atan | Unary::Asin, _))
            || matches!(node, Node::Binary(Binary::Pow, ..))
    });
    let key = name.as_str();
    let (fptaylor, daisy) = (figures.fptaylor.get(key), figures.daisy.get(key));
    Ok(Row {
        operations: function.count().total(),
        library,
        ours: bound(&Reals::default()),
        gappa: gappa(&name, function)?,
        real: bound(&Reals { inputs: true, constants: constants.collect() }),
        fptaylor: fptaylor.map(|figure| figure * SCALE),
        daisy: daisy.map(|figure| figure * SCALE),
        name,
    })
}

/// Text of an operation, given the choice between an operand's names in the run and in exact arithmetic.
type Expression = dyn Fn(&dyn Fn(&(String, String)) -> String) -> String;

/// The operations of a function as a script; `None` if Gappa lacks one, or an input has no range.
fn script(function: &Function) -> Option<(String, Vec<String>)> {
    let graph = &function.graph;
    let uses = graph.uses(&function.nodes());
    let mut text = "@rnd = float<ieee_32, ne>;\n".to_owned();
    let (mut names, mut given, mut inputs) = (BTreeMap::new(), Vec::new(), Vec::new());
    for index in (0..graph.len()).filter(|index| uses[*index] > 0) {
        let id = graph.id_at(index);
        // Names of a value in the run and in exact arithmetic.
        let of = |id| names.get(&id).cloned().unwrap_or_else(|| (String::new(), String::new()));
        let expression: Box<Expression> = match graph.node_at(index) {
            Node::Constant(bits) => {
                let value = in_gappa(f64::from(f64::from_bits(bits) as f32));
                names.insert(id, (format!("({value})"), format!("({value})")));
                continue;
            }
            Node::Input(input) => {
                let (low, high) = function.inputs[input as usize].range?;
                let name = format!("x{input}");
                let _ = writeln!(text, "{name} = rnd({name}_);");
                given.push(format!("{name} in [{}, {}]", in_gappa(low), in_gappa(high)));
                inputs.push(name.clone());
                names.insert(id, (name.clone(), name));
                continue;
            }
            Node::Unary(op, a) => {
                let a = of(a);
                let call = match op {
                    Unary::Neg => "-",
                    Unary::Sqrt => "sqrt",
                    Unary::Abs => "fabs",
                    _ => return None,
                };
                Box::new(move |which| format!("{call}({})", which(&a)))
            }
            Node::Binary(op, a, b) => {
                let (a, b) = (of(a), of(b));
                let sign = match op {
                    Binary::Add => "+",
                    Binary::Sub => "-",
                    Binary::Mul => "*",
                    Binary::Div => "/",
                    _ => return None,
                };
                Box::new(move |which| format!("{} {sign} {}", which(&a), which(&b)))
            }
            Node::Select(..) => return None,
        };
        let (run, real) = (format!("r{index}"), format!("M{index}"));
        let _ = writeln!(
            text,
            "{run} rnd= {};\n{real} = {};",
            expression(&|of| of.0.clone()),
            expression(&|of| of.1.clone())
        );
        names.insert(id, (run, real));
    }
    let (run, real) = names.get(&function.outputs[0].1)?;
    let assumed = given.join(" /\\ ");
    let _ = writeln!(text, "{{ {assumed} -> |{run} - {real}| in ? }}");
    Some((text, inputs))
}

/// Smallest bound that Gappa finds: without hints, and with the range of each input divided.
fn gappa(name: &str, function: &Function) -> Result<Option<f64>> {
    let Some((text, inputs)) = script(function) else { return Ok(None) };
    // With more inputs, dividing one of them gains little.
    let inputs = if inputs.len() <= MOST_DIVIDED { inputs } else { Vec::new() };
    let hints = inputs.iter().map(|input| format!("$ {input} in {PARTS};\n"));
    let mut best: Option<f64> = None;
    for hint in std::iter::once(String::new()).chain(hints) {
        let path = std::env::temp_dir().join(format!("takt-gappa-{}.g", std::process::id()));
        fs::write(&path, format!("{text}{hint}"))?;
        let found = ask(&path).with_context(|| name.to_owned())?;
        fs::remove_file(&path)?;
        best = best.into_iter().chain(found).reduce(f64::min);
    }
    Ok(best)
}

/// The upper end of the interval that Gappa prints.
fn ask(path: &Path) -> Result<Option<f64>> {
    let output = Command::new("timeout").arg(PATIENCE).arg("gappa").arg(path).output().context("gappa")?;
    let text =
        String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout);
    // Without a range for an intermediate value, such as a root's operand, Gappa finds no bound.
    let is_open = text.contains("some properties were not satisfied");
    ensure!(is_open || !text.contains("Error"), "gappa: {text}");
    let Some(line) = text.lines().find(|line| line.contains("| in [")) else { return Ok(None) };
    let high =
        line.rsplit_once("in [").and_then(|(_, ends)| ends.split_once(", ")).map_or("", |(_, high)| high);
    let number = high.split([' ', ']']).next().unwrap_or("");
    let (digits, exponent) = number.split_once('b').unwrap_or((number, "0"));
    let value = digits.parse::<f64>().ok().zip(exponent.parse::<i32>().ok());
    Ok(value.map(|(digits, exponent)| digits * 2f64.powi(exponent)))
}

/// Our bound of a kernel, and another.
type BoundAndOther = dyn Fn(&Row) -> (Option<f64>, Option<f64>);

/// Ratio of our bound to another.
fn ratio(ours: Option<f64>, other: Option<f64>) -> Option<f64> {
    Some(ours? / other?)
}

fn table(rows: &[Row], figures: &Figures) -> Result<String> {
    let number = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.2e}"));
    let factor = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.2}"));
    let mut text = String::new();
    let (mut worse, mut wrong) = (String::new(), Vec::new());
    for library in [false, true] {
        if library {
            text.push_str("\nKernels with exponential, logarithm, tangent or arcsine, which are functions of the library:\n\n");
        }
        text.push_str(
            "| kernel | operations | bound | Gappa | factor | reals rounded | FPTaylor | factor | Daisy | factor |\n|---|---|---|---|---|---|---|---|---|---|\n",
        );
        for row in rows.iter().filter(|row| row.library == library) {
            let (by_gappa, by_fptaylor) = (ratio(row.ours, row.gappa), ratio(row.real, row.fptaylor));
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
                row.name,
                row.operations,
                number(row.ours),
                number(row.gappa),
                factor(by_gappa),
                number(row.real),
                number(row.fptaylor),
                factor(by_fptaylor),
                number(row.daisy),
                factor(ratio(row.real, row.daisy)),
            );
            let is_worse = by_gappa.is_some_and(|by| by > AS_SHOWN)
                || by_fptaylor.is_some_and(|by| by > 2.0 * AS_SHOWN)
                || row.ours.is_none() && (row.gappa.is_some() || row.fptaylor.is_some());
            match figures.reasons.get(&row.name) {
                Some(reason) if is_worse => _ = writeln!(worse, "- {}: {reason}", row.name),
                Some(_) => wrong.push(format!("`{}` needs no reason any more", row.name)),
                None if is_worse => wrong.push(format!("`{}` needs a reason", row.name)),
                None => {}
            }
        }
    }
    ensure!(wrong.is_empty(), "{FIGURES}: {}\n{text}", wrong.join(", "));
    // A bound that one has and the other lacks counts for the one.
    let share = |of: &BoundAndOther, most: f64| {
        let pairs = rows.iter().filter(|row| !row.library).map(of).filter(|(_, other)| other.is_some());
        let factors: Vec<f64> =
            pairs.map(|(ours, other)| ratio(ours, other).unwrap_or(f64::INFINITY)).collect();
        let within = factors.iter().filter(|factor| **factor <= most * AS_SHOWN).count();
        (within, factors.len(), 100 * within / factors.len().max(1))
    };
    let (within, all, percent) = share(&|row| (row.ours, row.gappa), 1.0);
    let _ = writeln!(text, "\nAt most Gappa's bound: {within} of {all} kernels, {percent} %.");
    let (within, all, percent) = share(&|row| (row.real, row.fptaylor), 2.0);
    let _ = writeln!(text, "Within 2 times FPTaylor's figure: {within} of {all}, {percent} %.");
    let (within, all, percent) = share(&|row| (row.real, row.daisy), 1.0);
    let _ = writeln!(text, "At most Daisy's figure: {within} of {all}, {percent} %.");
    if !worse.is_empty() {
        let _ = write!(text, "\nWider than Gappa's bound, or than 2 times FPTaylor's figure:\n\n{worse}");
    }
    Ok(text.trim_end().to_owned() + "\n")
}
