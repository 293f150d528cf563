//! `takt accuracy`: how far the outputs are from binary64, and which lines lose it; or how far they can be at most.

use crate::fault;
use crate::files::{self, Out};
use crate::load::Load;
use crate::number;
use crate::output::{self, Failure};
use crate::ports::Inputs;
use crate::select::{OptionalMachine, SourceArguments};
use anyhow::{Context, Result, anyhow};
use clap::Args;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use takt_analysis::follow::PERIOD_LIMIT;
use takt_analysis::accuracy::{
    Assumed, Decision, Enclosure, Hazard, Interval, Lost, Moment, OperationAccuracy, OutputAccuracy,
    OutputBound, Part, Shadow, Worst, enclose,
};
use takt_emu::Emulator;
use takt_isa::Program;
use takt_isa::program::Location;

/// Measure the outputs' errors against binary64, or bound them for every run, and name the lines that they come from.
///
/// With --inputs, runs the program on recorded inputs, and beside it the same operations in binary64. Without, follows every path through a
/// period for all inputs and states within their `.range`: bounds each output's error, and shows that there is no NaN, no overflow, no
/// division by zero and no conversion out of range, or names the operations where there may be (status 1).
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Accuracy {
    /// Source or image; `-` is standard input.
    file: PathBuf,
    #[command(flatten)]
    machine: OptionalMachine,
    #[command(flatten)]
    source: SourceArguments,
    /// CSV with one named column for each input port and one row for each period; `-` is standard input.
    #[arg(long, value_name = "CSV")]
    inputs: Option<PathBuf>,
    /// Run at most this many periods.
    #[arg(long, value_name = "N", requires = "inputs", value_parser = number::count, allow_hyphen_values = true)]
    periods: Option<u64>,
    /// Let each period begin with exact values: errors that states carry from period to period are left out.
    #[arg(long, requires = "inputs")]
    each_period: bool,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  takt accuracy prog.s                                bounds that no run exceeds, from the ranges in the source
  takt accuracy prog.s --inputs in.csv                errors against binary64, and the lines that they come from
  takt accuracy prog.s --inputs in.csv --each-period  without what states carry from period to period";

/// Lines of each list of the text; --json has all.
const SHOWN: usize = 12;
/// Lines that are shown of those an output's error comes from.
const SHOWN_PARTS: usize = 3;

pub(crate) fn run(arguments: &Accuracy, color: bool, out: &mut Out) -> Result<()> {
    let mut reads = vec![("FILE", arguments.file.as_path())];
    reads.extend(arguments.inputs.as_deref().map(|path| ("--inputs", path)));
    files::check(&reads, &[])?;
    let loaded =
        Load::new(arguments.machine.machine, color).with(&arguments.source).with_source(&arguments.file)?;
    let program = &loaded.program;
    let Some(inputs) = &arguments.inputs else {
        let enclosure = enclose(program).map_err(|error| anyhow!("no bound: {error}"))?;
        let bounded = Bounded { program, enclosure: &enclosure };
        if arguments.json {
            let mut value = bounded.json();
            value["program"] = json!(files::input_name(&arguments.file));
            output::json(&value, out)?;
        } else {
            bounded.text(out)?;
        }
        let safe = enclosure.hazards.is_empty() && enclosure.first().next().is_none();
        return if safe { Ok(()) } else { Err(Failure::Reported.into()) };
    };
    let shadow = measure(arguments, inputs, program).map_err(|error| fault::told(error, &loaded, color))?;
    let measured = Measured::new(program, &shadow);
    if arguments.json {
        let mut value = measured.json();
        value["program"] = json!(files::input_name(&arguments.file));
        value["each_period"] = json!(arguments.each_period);
        return output::json(&value, out);
    }
    measured.text(arguments.each_period, out)
}

fn measure(arguments: &Accuracy, inputs: &Path, program: &Program) -> Result<Shadow> {
    let mut inputs = Inputs::open(Some(inputs), &program.inputs)?;
    let mut emulator = Emulator::new(program)?;
    let mut shadow = Shadow::new(program);
    if arguments.each_period {
        shadow = shadow.each_period_afresh();
    }
    let most = arguments.periods.unwrap_or(u64::MAX);
    let mut once = true;
    while shadow.periods() < most
        && let Some(row) = inputs.next()?
    {
        for &(register, bits) in row {
            emulator.set_input_bits(register, bits)?;
        }
        // What runs once sees the first period's inputs.
        for _ in 0..if once { 2 } else { 1 } {
            emulator.set_cycle_limit(emulator.now() + PERIOD_LIMIT);
            let goes_on = shadow.run_period(&mut emulator);
            if !goes_on.with_context(|| format!("period {}", shadow.periods()))? {
                return Ok(shadow);
            }
        }
        once = false;
    }
    Ok(shadow)
}

/// What a source line does to accuracy, all its operations together.
#[derive(Default)]
pub(crate) struct Line {
    accuracy: OperationAccuracy,
    /// Its part in the errors of the outputs at their worst: the largest, and the output.
    share: f64,
    output: Option<String>,
}

fn location(program: &Program, word: u32) -> Option<Location> {
    *program.lines.get(word as usize)?
}

fn line_text(program: &Program, location: Option<Location>) -> String {
    location.map_or_else(|| "(no source line)".to_owned(), |location| program.place_text(location))
}

/// The lines that an error comes from, with the sum of their shares, and the part that each has of all that was added up; the
/// largest first.
fn by_line(program: &Program, parts: &[Part]) -> Vec<(Option<Location>, f64, f64)> {
    let mut lines: BTreeMap<_, (Option<Location>, f64)> = BTreeMap::new();
    for part in parts {
        let location = location(program, part.word);
        let key = location.map(|location| (location.file, location.line));
        lines.entry(key).or_insert((location, 0.0)).1 += part.error;
    }
    let all: f64 = lines.values().map(|(_, error)| error.abs()).sum();
    let mut lines: Vec<_> = lines.into_values().map(|(at, error)| (at, error, error.abs() / all)).collect();
    lines.sort_by(|a, b| b.2.total_cmp(&a.2));
    lines
}

/// What was measured of a program.
pub(crate) struct Measured<'a> {
    program: &'a Program,
    shadow: &'a Shadow,
}

impl<'a> Measured<'a> {
    pub(crate) fn new(program: &'a Program, shadow: &'a Shadow) -> Measured<'a> {
        Measured { program, shadow }
    }

    fn by_line(&self, parts: &[Part]) -> Vec<(Option<Location>, f64, f64)> {
        by_line(self.program, parts)
    }

    fn place(&self, word: u32) -> String {
        self.program.word_text(word as usize)
    }

    /// Lines by place, those that add most to an output's error first.
    pub(crate) fn lines(&self) -> Vec<(Location, Line)> {
        let mut lines: BTreeMap<(u32, u32), (Location, Line)> = BTreeMap::new();
        for (&word, operation) in self.shadow.operations() {
            let Some(location) = location(self.program, word) else { continue };
            let entry = lines.entry((location.file, location.line)).or_insert((location, Line::default()));
            let known = &mut entry.1.accuracy;
            known.count += operation.count;
            known.rounding = known.rounding.max(operation.rounding);
            known.absorbed += operation.absorbed;
            if operation.cancelled > known.cancelled {
                (known.cancelled, known.cancelled_in) = (operation.cancelled, operation.cancelled_in);
            }
        }
        for output in self.shadow.outputs() {
            for (location, _, share) in self.by_line(&output.parts) {
                let Some(location) = location else { continue };
                let entry = lines.entry((location.file, location.line));
                let line = &mut entry.or_insert((location, Line::default())).1;
                if share > line.share {
                    (line.share, line.output) = (share, Some(output.name.clone()));
                }
            }
        }
        let mut lines: Vec<_> = lines.into_values().collect();
        lines.sort_by(|a, b| b.1.share.total_cmp(&a.1.share));
        lines
    }

    fn line_text(&self, location: Option<Location>) -> String {
        line_text(self.program, location)
    }

    /// The result, but for the program's name.
    pub(crate) fn json(&self) -> Value {
        let worst = |worst: Option<Worst>| {
            worst.map(|Worst { error, period, value, exact }| {
                json!({ "error": error, "period": period, "value": value, "exact": exact })
            })
        };
        let output = |output: &OutputAccuracy| {
            let from = self.by_line(&output.parts).into_iter().map(|(location, error, share)| {
                json!({ "place": self.line_text(location), "error": error, "share": share })
            });
            let operations = output.parts.iter();
            let operations =
                operations.map(|part| json!({ "place": self.place(part.word), "error": part.error }));
            json!({
                "name": output.name,
                "periods": output.periods,
                "absolute": worst(output.absolute),
                "ulp": worst(output.ulp),
                "relative": worst(output.relative),
                "lines": from.collect::<Vec<_>>(),
                "operations": operations.collect::<Vec<_>>(),
            })
        };
        let line = |(location, line): (Location, Line)| {
            let OperationAccuracy { count, rounding, cancelled, cancelled_in, absorbed } = line.accuracy;
            json!({
                "place": self.program.place_text(location),
                "operations": count,
                "rounding_ulp": rounding,
                "cancelled_digits": cancelled,
                "cancelled_in": (cancelled > 0.0).then_some(cancelled_in),
                "absorbed": absorbed,
                "share": line.share,
                "output": line.output,
            })
        };
        let decision = |(&word, decision): (&u32, &Decision)| json!({ "place": self.place(word), "count": decision.count, "period": decision.period });
        let lost = |(&word, lost): (&u32, &Lost)| {
            let why = if lost.infinite { "no finite number" } else { "taken as bits" };
            json!({ "place": self.place(word), "why": why, "count": lost.count, "period": lost.period })
        };
        json!({
            "machine": self.program.machine.name,
            "periods": self.shadow.periods(),
            "outputs": self.shadow.outputs().iter().map(output).collect::<Vec<_>>(),
            "lines": self.lines().into_iter().map(line).collect::<Vec<_>>(),
            "decisions": self.shadow.decisions().iter().map(decision).collect::<Vec<_>>(),
            "lost": self.shadow.lost().iter().map(lost).collect::<Vec<_>>(),
        })
    }

    fn text(&self, each_period: bool, out: &mut Out) -> Result<()> {
        let Measured { program, shadow } = self;
        let periods = shadow.periods();
        let plural = if periods == 1 { "" } else { "s" };
        let alone = if each_period { ", each period alone" } else { "" };
        writeln!(out, "{periods} period{plural} on {} beside binary64{alone}", program.machine.name)?;
        let outputs = shadow.outputs();
        let width = outputs.iter().map(|output| output.name.len()).max().unwrap_or(0).max(6);
        writeln!(out, "\nlargest error of each output, and its period")?;
        writeln!(
            out,
            "  {:<width$}  {:>12} {:>8}  {:>12} {:>8}  {:>12} {:>8}",
            "output", "absolute", "period", "ulp", "period", "relative", "period"
        )?;
        for output in outputs {
            let cell = |worst: Option<Worst>, ulps: bool| match worst {
                Some(Worst { error, period, .. }) if ulps => format!("{error:>12.2} {period:>8}"),
                Some(Worst { error, period, .. }) => format!("{error:>12.3e} {period:>8}"),
                None => format!("{:>12} {:>8}", "-", "-"),
            };
            let [absolute, ulp, relative] =
                [(output.absolute, false), (output.ulp, true), (output.relative, false)]
                    .map(|(worst, ulps)| cell(worst, ulps));
            writeln!(out, "  {:<width$}  {absolute}  {ulp}  {relative}", output.name)?;
        }
        let others = program.outputs.len() - outputs.len();
        if others > 0 {
            writeln!(out, "  {others} more carry integers or bits")?;
        }

        writeln!(out, "\nlines that the largest absolute errors come from")?;
        for output in outputs {
            let lines = self.by_line(&output.parts);
            let shown = lines.iter().take(SHOWN_PARTS).map(|(location, error, share)| {
                format!("{} {error:+.2e} ({:.0} %)", self.line_text(*location), 100.0 * share)
            });
            let shown: Vec<String> = shown.collect();
            let shown = if shown.is_empty() { "exact".to_owned() } else { shown.join(", ") };
            writeln!(out, "  {:<width$}  {shown}", output.name)?;
        }

        let lines = self.lines();
        let places: Vec<String> =
            lines.iter().map(|(location, _)| program.place_text(*location)).take(SHOWN).collect();
        let wide = places.iter().map(String::len).max().unwrap_or(0).max(4);
        writeln!(out, "\nwhat each line does, those that add most to an output's error first")?;
        writeln!(
            out,
            "  {:<wide$}  {:>14} {:>12}  {:>16} {:>9}  share of",
            "line", "rounding (ulp)", "cancels", "in period", "absorbs"
        )?;
        for ((_, line), place) in lines.iter().zip(&places) {
            let OperationAccuracy { rounding, cancelled, cancelled_in, absorbed, .. } = line.accuracy;
            let cancels = if cancelled > 0.0 { format!("{cancelled:.1} digits") } else { "-".to_owned() };
            let period = if cancelled > 0.0 { cancelled_in.to_string() } else { "-".to_owned() };
            let share = line.output.as_ref();
            let share = share.map_or(String::new(), |name| format!("{:.0} % of {name}", 100.0 * line.share));
            writeln!(
                out,
                "  {place:<wide$}  {rounding:>14.3} {cancels:>12}  {period:>16} {absorbed:>9}  {share}"
            )?;
        }
        if lines.len() > SHOWN {
            writeln!(out, "  and {} more (--json has all)", lines.len() - SHOWN)?;
        }

        if !shadow.decisions().is_empty() {
            writeln!(out, "\ndecisions that binary64 makes otherwise (it follows those of the run)")?;
        }
        for (&word, decision) in shadow.decisions().iter().take(SHOWN) {
            let (count, period) = (decision.count, decision.period);
            writeln!(out, "  {}: {count} times, first in period {period}", self.place(word))?;
        }
        if !shadow.lost().is_empty() {
            writeln!(out, "\nerrors are not followed any further at")?;
        }
        for (&word, lost) in shadow.lost().iter().take(SHOWN) {
            let why =
                if lost.infinite { "a result that is no finite number" } else { "a value taken as bits" };
            let (count, period) = (lost.count, lost.period);
            writeln!(out, "  {}: {why}, {count} times, first in period {period}", self.place(word))?;
        }
        Ok(())
    }
}

/// What was proved of a program.
struct Bounded<'a> {
    program: &'a Program,
    enclosure: &'a Enclosure,
}

fn interval(interval: Option<Interval>) -> String {
    interval
        .map_or_else(|| "anywhere".to_owned(), |Interval { low, high }| format!("[{low:.6e}, {high:.6e}]"))
}

impl Bounded<'_> {
    fn parts(&self, output: &OutputBound) -> Vec<(Option<Location>, f64, f64)> {
        let parts: Vec<Part> =
            output.parts.iter().map(|(word, error)| Part { word: *word, error: *error }).collect();
        by_line(self.program, &parts)
    }

    fn operands(&self, hazard: &Hazard) -> Vec<(String, Option<Interval>)> {
        let named = hazard.operands.iter();
        named.map(|(register, range)| (self.program.register_text(*register), *range)).collect()
    }

    fn json(&self) -> Value {
        let Bounded { program, enclosure } = self;
        let ends = |interval: Option<Interval>| interval.map(|Interval { low, high }| [low, high]);
        let output = |output: &OutputBound| {
            let lines = self.parts(output).into_iter().map(|(location, error, share)| {
                json!({ "place": line_text(program, location), "error": error, "share": share })
            });
            json!({
                "name": output.name,
                "range": ends(output.range),
                "error": output.error,
                "ulp": output.ulps(),
                "lines": lines.collect::<Vec<_>>(),
            })
        };
        let hazard = |hazard: &Hazard| {
            let operands = self.operands(hazard).into_iter();
            let operands = operands.map(|(name, range)| json!({ "name": name, "range": ends(range) }));
            json!({
                "place": program.word_text(hazard.word as usize),
                "problem": hazard.problem.to_string(),
                "operands": operands.collect::<Vec<_>>(),
            })
        };
        let assumed = |Assumed { range, moment, found }: &Assumed| {
            json!({
                "name": program.register_text(range.register),
                "range": range.ends(),
                "when": match moment {
                    Moment::First => "first period begins",
                    Moment::Later => "period ends",
                },
                "found": ends(*found),
            })
        };
        json!({
            "machine": program.machine.name,
            "outputs": enclosure.outputs.iter().map(output).collect::<Vec<_>>(),
            "hazards": enclosure.hazards.iter().map(hazard).collect::<Vec<_>>(),
            "assumed": enclosure.assumed.iter().map(assumed).collect::<Vec<_>>(),
            "operations": enclosure.operations,
        })
    }

    fn text(&self, out: &mut Out) -> Result<()> {
        let Bounded { program, enclosure } = self;
        let machine = program.machine.name;
        writeln!(out, "one period on {machine}, all inputs and states in their ranges, the states exact")?;
        let outputs = &enclosure.outputs;
        let width = outputs.iter().map(|output| output.name.len()).max().unwrap_or(0).max(6);
        writeln!(
            out,
            "\n  {:<width$}  {:>32}  {:>12}  {:>9}  most of it from",
            "output", "range", "error up to", "ulp"
        )?;
        for output in outputs {
            let error = output.error.map_or_else(|| "-".to_owned(), |error| format!("{error:.3e}"));
            let ulps = output.ulps().map_or_else(|| "-".to_owned(), |ulps| format!("{ulps:.2}"));
            let lines = self.parts(output);
            let lines = lines.iter().take(SHOWN_PARTS);
            let lines =
                lines.map(|(at, _, share)| format!("{} ({:.0} %)", line_text(program, *at), 100.0 * share));
            let lines: Vec<String> = lines.collect();
            let range = interval(output.range);
            writeln!(
                out,
                "  {:<width$}  {range:>32}  {error:>12}  {ulps:>9}  {}",
                output.name,
                lines.join(", ")
            )?;
        }
        writeln!(out, "  ulp: of the largest value in the range")?;
        if enclosure.hazards.is_empty() {
            writeln!(
                out,
                "\nno NaN, no overflow, no division by zero, no conversion out of range is possible"
            )?;
        } else {
            writeln!(out, "\nnot excluded (operations that depend on these are not examined)")?;
        }
        for hazard in &enclosure.hazards {
            let operands = self.operands(hazard).into_iter();
            let operands: Vec<String> =
                operands.map(|(name, range)| format!("{name} in {}", interval(range))).collect();
            let what = hazard.problem;
            writeln!(out, "  {}: {what}: {}", program.word_text(hazard.word as usize), operands.join(", "))?;
        }
        let states = |Assumed { range, found, .. }: &Assumed, found_text: &str, out: &mut Out| {
            let (low, high) = range.ends();
            let name = program.register_text(range.register);
            writeln!(out, "  {name}: [{low:.6e}, {high:.6e}], {found_text} {}", interval(*found))
        };
        if enclosure.first().next().is_some() {
            writeln!(
                out,
                "\nstates not shown to begin the first period in their range; then nothing above holds"
            )?;
        }
        enclosure.first().try_for_each(|state| states(state, "begins in", out))?;
        if enclosure.later().next().is_some() {
            writeln!(out, "\nranges that a period is not shown to keep; they are taken as promised")?;
        }
        enclosure.later().try_for_each(|state| states(state, "may be left in", out))?;
        Ok(())
    }
}
