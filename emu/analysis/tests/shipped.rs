// SPDX-License-Identifier: MIT OR Apache-2.0
//! Enclosures of every program in `programs/`, beside what runs measure: the table in `docs/accuracy.md`.
//!
//! `TAKT_BLESS=1 cargo test --release -p takt-analysis --test suite shipped::` writes the table. Otherwise the rows that took up to
//! [`QUICK`] are made again and compared, with TAKT_FULL all.
#![allow(clippy::print_stdout)]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use takt_analysis::accuracy::{
    Enclosure, Moment, OutputBound, OutputPlace, Problem, Reals, Shadow, StateRange, enclose_in_boxes,
};
use takt_asm::{FileLoader, Options, Search};
use takt_emu::Emulator;
use takt_emu::testing::Random;
use takt_isa::program::Range;
use takt_isa::{Program, Register, Type};

/// Seconds that a row may have taken when the table was written, to be made again by the quick test.
const QUICK: f64 = 1.0;
/// Operations of the random runs of one program.
const OPERATIONS: u64 = 400_000;
/// Operations of the directed search for large errors of one program.
const SEARCHED: u64 = 3_000_000;
/// Outputs that the search takes, one after the other, always the loosest; and the factor from which it does.
const ROUNDS: usize = 4;
const LOOSE: f64 = 10.0;
/// Limit on the values at a period's beginning that are searched.
const VALUES: usize = 64;
/// Limits on the periods of these.
const PERIODS: [u64; 2] = [8, 1000];
/// Folders of the programs.
const FOLDERS: [&str; 7] = ["examples", "hybrid", "arm", "servo", "systems", "kernels", "taclebench"];

fn programs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../programs")
}

/// The source has a period: in itself, or in a file of its folder that it includes.
fn has_period(path: &Path) -> bool {
    let text = std::fs::read_to_string(path).expect("a source");
    let included = text.lines().filter_map(|line| line.strip_prefix(".include \"")?.strip_suffix('"'));
    text.lines().any(|line| line.starts_with(".period"))
        || included.into_iter().any(|file| has_period(&path.with_file_name(file)))
}

/// Paths of the programs, relative to `programs/`: sources with a period. Those of `three/` are for machines that a system names.
fn paths() -> Vec<String> {
    let mut paths = Vec::new();
    for folder in FOLDERS {
        let mut folders = vec![folder.to_owned()];
        let mut found = Vec::new();
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(programs().join(&folder)).expect("a folder") {
                let path = entry.expect("an entry").path();
                let name = format!("{folder}/{}", path.file_name().unwrap().to_str().unwrap());
                if path.is_dir() {
                    folders.push(name);
                } else if takt_asm::is_source(&name) && has_period(&path) {
                    found.push(name);
                }
            }
        }
        found.sort();
        paths.append(&mut found);
    }
    paths
}

fn assembled(path: &str) -> Program {
    let (folder, file) = path.rsplit_once('/').unwrap();
    let loader = Search::new(FileLoader::new(programs().join(folder))).library(takt_programs::LIBRARY);
    let assembled = takt_asm::assemble(file, &loader, &Options::default());
    assembled.unwrap_or_else(|diagnostics| panic!("{path}: {}", diagnostics.render(false))).program
}

/// Value within a range: an end, or any.
fn draw(ty: Type, (low, high): (f64, f64), random: &mut Random) -> u32 {
    let part = f64::from(random.below(1 << 30)) / f64::from(1 << 30);
    let value = match random.below(16) {
        0 => low,
        1 => high,
        _ => low + part * (high - low),
    };
    match ty {
        Type::F => (value as f32).clamp(low as f32, high as f32).to_bits(),
        _ => (value.round() as i32).cast_unsigned(),
    }
}

/// Runs of a program, each of whose periods begins with inputs and states within their ranges.
struct Measured<'p> {
    program: &'p Program,
    shadow: Shadow,
    /// Largest errors that a directed search has found.
    found: Vec<(OutputPlace, f64)>,
}

/// Inputs, states and words of arrays at a period's beginning, with their ranges.
#[derive(Clone)]
struct Case(Vec<(Cell, Type, (f64, f64), u32)>);

#[derive(Clone, Copy)]
enum Cell {
    Input(Register),
    State(Register),
    Word(u32),
}

impl Measured<'_> {
    fn emulator(&self) -> Emulator {
        Emulator::new(self.program).expect("a program that loads")
    }

    /// Registers with a range that are inputs, or states.
    fn ranges(&self, inputs: bool) -> impl Iterator<Item = &Range> {
        let machine = self.program.machine;
        self.program.ranges.iter().filter(move |range| machine.is_input(range.register) == inputs)
    }

    /// Periods that begin with random inputs, states and words of arrays. A fault ends the run.
    fn at_random(&mut self, periods: u64) {
        let mut emulator = self.emulator();
        let mut random = Random::new(54);
        for period in 0..=periods {
            let inputs: Vec<(Register, u32)> = self
                .ranges(true)
                .map(|range| (range.register, draw(range.ty, range.ends(), &mut random)))
                .collect();
            for (register, bits) in inputs {
                emulator.set_input_bits(register, bits).expect("an input");
            }
            if period > 0 {
                for range in self.ranges(false) {
                    emulator.set_register(range.register, draw(range.ty, range.ends(), &mut random));
                }
                for range in &self.program.array_ranges {
                    for word in range.span() {
                        emulator.memory_mut()[word as usize] = draw(range.ty, range.ends(), &mut random);
                    }
                }
            }
            if !self.shadow.run_period(&mut emulator).unwrap_or(false) {
                return;
            }
        }
    }

    /// A run with the recorded inputs beside the program, if any: rows within the ranges, to the first period that leaves a state's.
    fn recorded(&mut self, path: &str) {
        let path = programs().join(path).with_extension("csv");
        let Ok(table) = std::fs::read_to_string(path) else { return };
        let mut lines = table.lines();
        let names: Vec<&str> = lines.next().unwrap_or_default().split(',').map(str::trim).collect();
        let port = |name: &str| self.program.inputs.iter().find(|port| port.name == name).expect("an input");
        let ports: Vec<_> = names.into_iter().map(port).collect();
        let mut emulator = self.emulator();
        let mut begun = false;
        for line in lines.filter(|line| !line.trim().is_empty()) {
            let values = line.split(',').map(|value| value.trim().parse::<f64>().expect("a number"));
            let row: Vec<(Register, u32)> = ports
                .iter()
                .zip(values)
                .map(|(port, value)| match port.ty {
                    Type::F => (port.register, (value as f32).to_bits()),
                    _ => (port.register, (value as i32).cast_unsigned()),
                })
                .collect();
            let range = |register| self.program.range(register);
            if row.iter().any(|&(register, bits)| range(register).is_some_and(|range| !range.holds(bits))) {
                continue;
            }
            for (register, bits) in row {
                emulator.set_input_bits(register, bits).expect("an input");
            }
            for _ in 0..if std::mem::replace(&mut begun, true) { 1 } else { 2 } {
                if !self.shadow.run_period(&mut emulator).unwrap_or(false) {
                    return;
                }
            }
            if self.ranges(false).any(|range| !range.holds(emulator.register(range.register).unwrap_or(0))) {
                return;
            }
        }
    }

    /// A case with random values; `None` if there are too many.
    fn case(&self, random: &mut Random) -> Option<Case> {
        let mut cells = Vec::new();
        for inputs in [true, false] {
            for range in self.ranges(inputs) {
                let cell = if inputs { Cell::Input(range.register) } else { Cell::State(range.register) };
                cells.push((cell, range.ty, range.ends()));
            }
        }
        for range in &self.program.array_ranges {
            cells.extend(range.span().map(|word| (Cell::Word(word), range.ty, range.ends())));
        }
        let is_short = !cells.is_empty() && cells.len() <= VALUES;
        let drawn = cells.into_iter().map(|(cell, ty, ends)| (cell, ty, ends, draw(ty, ends, random)));
        is_short.then(|| Case(drawn.collect()))
    }

    /// Error of an output at the end of a period that begins so, after `.once` as `begun` holds it.
    fn error(&self, begun: (&Emulator, &Shadow), case: &Case, place: OutputPlace) -> Option<f64> {
        let (mut emulator, mut shadow) = (begun.0.clone(), begun.1.clone());
        for (cell, _, _, bits) in &case.0 {
            match *cell {
                Cell::Input(register) => emulator.set_input_bits(register, *bits).ok()?,
                Cell::State(register) => {
                    emulator.set_register(register, *bits);
                }
                Cell::Word(word) => emulator.memory_mut()[word as usize] = *bits,
            }
        }
        shadow.run_period(&mut emulator).ok()?;
        let output = shadow.outputs().iter().find(|output| output.place == place)?;
        Some(output.absolute?.error)
    }

    /// Looks for a period in which an output errs most: from the worst of random ones, by steps of all sizes in one or two values.
    fn search(&mut self, place: OutputPlace, periods: u64) {
        let mut random = Random::new(55);
        let (mut emulator, shadow) = (self.emulator(), Shadow::new(self.program).each_period_afresh());
        let Ok(true) = shadow.clone().run_period(&mut emulator) else { return };
        let begun = (&emulator, &shadow);
        let Some(mut best) = self.case(&mut random) else { return };
        let mut most = self.error(begun, &best, place).unwrap_or(0.0);
        for turn in 0..periods {
            let mut case = best.clone();
            if turn < periods / 8 {
                let Some(drawn) = self.case(&mut random) else { return };
                case = drawn;
            } else {
                for _ in 0..=random.below(2) {
                    let at = random.below(case.0.len() as u32) as usize;
                    let (_, ty, ends, bits) = &mut case.0[at];
                    *bits = match (*ty, random.below(8)) {
                        (Type::F, 1..) => {
                            let by = (ends.1 - ends.0) * 0.5f64.powi(random.below(30) as i32);
                            let by = if random.below(2) == 0 { by } else { -by };
                            let value = f64::from(f32::from_bits(*bits)) + by;
                            (value.clamp(ends.0, ends.1) as f32).to_bits()
                        }
                        _ => draw(*ty, *ends, &mut random),
                    };
                }
            }
            if let Some(error) = self.error(begun, &case, place).filter(|error| *error >= most) {
                (best, most) = (case, error);
            }
        }
        self.found.push((place, most));
    }

    /// Largest error of an output.
    fn of(&self, bound: &OutputBound) -> Option<f64> {
        let output = self.shadow.outputs().iter().find(|output| output.place == bound.place)?;
        let found = self.found.iter().filter(|(place, _)| *place == bound.place).map(|(_, error)| *error);
        Some(found.fold(output.absolute?.error, f64::max))
    }
}

fn measured<'p>(program: &'p Program, path: &str, operations: u64) -> Measured<'p> {
    let mut measured =
        Measured { program, shadow: Shadow::new(program).each_period_afresh(), found: Vec::new() };
    measured.at_random((OPERATIONS / operations.max(1)).clamp(PERIODS[0], PERIODS[1]));
    measured.recorded(path);
    measured
}

/// A number with three digits.
fn short(value: f64) -> String {
    if value == 0.0 { "0".to_owned() } else { format!("{value:.2e}") }
}

/// Output whose bound lies furthest above what was measured, with both.
fn loosest<'e>(enclosure: &'e Enclosure, measured: &Measured<'_>) -> Option<(&'e OutputBound, f64, f64)> {
    let all = enclosure.outputs.iter().filter_map(|bound| {
        let error = bound.error?;
        Some((bound, error, measured.of(bound)?))
    });
    let factor = |(_, error, run): &(&OutputBound, f64, f64)| if *run > 0.0 { error / run } else { 0.0 };
    all.max_by(|a, b| factor(a).total_cmp(&factor(b)))
}

/// The statements hold for the run, but for the rounding of binary64 itself.
fn holds(path: &str, enclosure: &Enclosure, measured: &Measured<'_>) {
    if enclosure.first().next().is_some() {
        return;
    }
    for bound in &enclosure.outputs {
        let (Some(error), Some(range), Some(run)) = (bound.error, bound.range, measured.of(bound)) else {
            continue;
        };
        let slack = 1e-6 * error + 1e-12 * range.magnitude() + 1e-40;
        assert!(run <= error + slack, "{path}: {} has an error of {run} beyond {error}", bound.name);
    }
}

/// The reason why an output of a program has no bound, at its place.
fn reason(program: &Program, enclosure: &Enclosure) -> String {
    let open = enclosure.outputs.iter().find(|output| output.range.is_none());
    let word = open.and_then(|output| output.open.first());
    let hazard = word.and_then(|word| enclosure.hazards.iter().find(|hazard| hazard.word == *word));
    let named = |problem: Problem, word: u32| format!("{}: {problem}", program.word_text(word as usize));
    match (open, hazard) {
        (Some(output), Some(hazard)) => format!("`{}`: {}", output.name, named(hazard.problem, hazard.word)),
        (Some(output), None) => format!("`{}` is open", output.name),
        (None, _) => {
            let state = enclosure.assumed.iter().find(|state| state.moment == Moment::First);
            state.map_or_else(String::new, |state| {
                format!("`{}` begins outside of its range", name(program, &state.range))
            })
        }
    }
}

fn name(program: &Program, range: &StateRange) -> String {
    range.name(program)
}

/// Seconds of processor time that this thread has taken, where the system says so.
fn seconds() -> f64 {
    let spent = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    spent
        .split(' ')
        .next()
        .and_then(|text| text.parse::<f64>().ok())
        .map_or(0.0, |nanoseconds| nanoseconds * 1e-9)
}

/// A row: all columns but the seconds, and these.
fn row(path: &str) -> (String, f64) {
    let begun = seconds();
    let program = assembled(path);
    let enclosure = enclose_in_boxes(&program, &Reals::default());
    let cells = match &enclosure {
        Err(error) => format!("| `{path}` | {} | 0 | {error} | | | |", program.outputs.len()),
        Ok(enclosure) => {
            let mut measured = measured(&program, path, enclosure.operations);
            for _ in 0..ROUNDS {
                let Some((bound, error, run)) = loosest(enclosure, &measured) else { break };
                if run == 0.0 || error <= LOOSE * run {
                    break;
                }
                measured.search(bound.place, SEARCHED / enclosure.operations.max(1));
            }
            holds(path, enclosure, &measured);
            let outputs = &enclosure.outputs;
            let finite = outputs.iter().filter(|output| output.range.is_some()).count();
            let is_whole = finite == outputs.len() && enclosure.first().next().is_none();
            let reason = if is_whole { String::new() } else { reason(&program, enclosure) };
            let worst = loosest(enclosure, &measured).map_or_else(
                || "| | |".to_owned(),
                |(bound, error, run)| {
                    let factor = if run > 0.0 { rounded(error / run) } else { String::new() };
                    format!("`{}` {} | {} | {factor} |", bound.name, short(error), short(run))
                },
            );
            format!("| `{path}` | {} | {finite} | {reason} | {worst}", outputs.len())
        }
    };
    (cells, seconds() - begun)
}

/// A factor with two digits.
fn rounded(factor: f64) -> String {
    if factor < 9.95 {
        format!("{factor:.1}")
    } else if factor < 1e5 {
        format!("{factor:.0}")
    } else {
        format!("{factor:.0e}")
    }
}

const BEGIN: &str = "<!-- table: shipped -->\n";
const END: &str = "<!-- end -->";
const HEAD: &str = "| program | outputs | bounded | why not all | largest bound over measured | measured | factor | s |\n|---|---|---|---|---|---|---|---|\n";

#[test]
fn documented_bounds_are_those_of_the_programs() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/accuracy.md");
    let mut document = std::fs::read_to_string(&path).expect("docs/accuracy.md");
    let start = document.find(BEGIN).expect("the table's beginning") + BEGIN.len();
    let stop = start + document[start..].find(END).expect("the table's end");
    if std::env::var_os("TAKT_BLESS").is_some() {
        let mut table = HEAD.to_owned();
        let (mut whole, mut all) = (0, 0);
        for path in paths() {
            let (cells, seconds) = row(&path);
            println!("{cells} {seconds:.1}");
            all += 1;
            whole += u32::from(cells.split('|').nth(4).is_some_and(|reason| reason.trim().is_empty()));
            writeln!(table, "{cells} {seconds:.1} |").unwrap();
        }
        write!(table, "\nOf {all} programs, {whole} have a bound for every output.\n").unwrap();
        document.replace_range(start..stop, &table);
        std::fs::write(path, document).expect("docs/accuracy.md");
        return;
    }
    let table = &document[start..stop];
    let rows: Vec<&str> = table.lines().filter(|line| line.starts_with("| `")).collect();
    let named: Vec<&str> = rows.iter().filter_map(|row| row.split('`').nth(1)).collect();
    assert_eq!(named, paths(), "TAKT_BLESS=1 writes the table");
    let full = std::env::var_os("TAKT_FULL").is_some();
    let mut made = 0;
    for (line, path) in rows.iter().zip(&named) {
        let fixed = line.trim_end_matches(" |");
        let (fixed, seconds) = fixed.rsplit_once("| ").expect("columns");
        if full || seconds.parse::<f64>().expect("seconds") <= QUICK {
            made += 1;
            assert_eq!(row(path).0, format!("{fixed}|"), "TAKT_BLESS=1 writes the table");
        }
    }
    assert!(5 * made > rows.len(), "{made} of {} rows are quick", rows.len());
}
