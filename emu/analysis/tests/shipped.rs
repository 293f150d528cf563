// SPDX-License-Identifier: MIT OR Apache-2.0
//! Enclosures of every program in `programs/`, and of generated bodies of robots' equations, beside what runs measure: the tables in
//! `docs/accuracy.md`.
//!
//! `TAKT_BLESS=1 cargo test --release -p takt-analysis --test suite shipped::` writes the tables. Otherwise the bounds of rows that took up to
//! [`QUICK`] are computed again and compared, with TAKT_FULL all; a few random periods must keep them.
#![allow(clippy::print_stdout)]

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use takt_analysis::accuracy::{
    Enclosure, Moment, OutputBound, OutputPlace, Problem, Reals, Shadow, StateRange, certify,
    enclose_in_boxes,
};
use takt_asm::{FileLoader, MemoryLoader, Options, Search};
use takt_emu::Emulator;
use takt_emu::testing::Random;
use takt_front::graph::{Delays, Rewrites};
use takt_front::robot::functions::{Options as Derived, RobotFunction, derive};
use takt_front::robot::urdf;
use takt_front::sink::{self, Layout};
use takt_isa::program::Range;
use takt_isa::{Program, Register, T3, Type};

/// Seconds that a row may have taken when the table was written, to be made again by the quick test.
const QUICK: f64 = 0.5;
/// Periods of random runs, unless they have more operations than this.
const PERIODS: u64 = 100_000;
const OPERATIONS: u64 = 2_000_000;
/// The same for the quick test.
const OPERATIONS_QUICK: u64 = 50_000;
/// Operations of the directed search for large errors of one program.
const SEARCHED: u64 = 2_000_000;
/// Outputs that the search takes, one after the other, always the loosest; and the factor from which it does.
const ROUNDS: usize = 4;
const LOOSE: f64 = 10.0;
/// Cycles after which a period counts as endless: it waits for inputs that do not come.
const ENDLESS: u64 = 1 << 20;
/// Draws of inputs with which the first period may begin.
const DRAWS: u32 = 16;
/// Fewest periods of random runs.
const LEAST: u64 = 8;
/// Folders of the programs.
const FOLDERS: [&str; 7] = ["examples", "hybrid", "arm", "servo", "systems", "kernels", "taclebench"];

fn programs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../programs")
}

/// Files of its own folder that a source includes.
fn included(path: &Path) -> Vec<PathBuf> {
    let text = std::fs::read_to_string(path).expect("a source");
    let names = text.lines().filter_map(|line| line.strip_prefix(".include \"")?.strip_suffix('"'));
    names.map(|name| path.with_file_name(name)).collect()
}

/// The source has a period: in itself, or in a file of its folder that it includes.
fn has_period(path: &Path) -> bool {
    let text = std::fs::read_to_string(path).expect("a source");
    text.lines().any(|line| line.starts_with(".period")) || included(path).iter().any(|file| has_period(file))
}

/// Paths of the programs, relative to `programs/`: sources with a period, but for those that are a part of another. Those of `three/` are for
/// machines that a system names.
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
        let parts: Vec<PathBuf> = found.iter().flat_map(|name| included(&programs().join(name))).collect();
        found.retain(|name| !parts.contains(&programs().join(name)) || assemble(name).is_ok());
        paths.append(&mut found);
    }
    paths
}

fn assemble(path: &str) -> Result<Program, String> {
    let (folder, file) = path.rsplit_once('/').unwrap();
    let loader = Search::new(FileLoader::new(programs().join(folder))).library(takt_programs::LIBRARY);
    let assembled = takt_asm::assemble(file, &loader, &Options::default());
    assembled.map(|assembled| assembled.program).map_err(|mistakes| mistakes.render(false))
}

fn assembled(path: &str) -> Program {
    assemble(path).unwrap_or_else(|mistakes| panic!("{path}: {mistakes}"))
}

/// Generated bodies: a robot's file, the link at its end, and the name in the table.
const ROBOTS: [(&str, &str, &str); 2] = [
    ("asm/front/tests/data/ur5.urdf", "tool0", "UR5"),
    ("programs/examples/panda/panda.urdf", "panda_link8", "Panda"),
];
/// Largest magnitudes of joints' positions, velocities, accelerations and forces, by the beginning of the inputs' names.
const JOINTS: [(&str, f64); 4] = [("qdd", 10.0), ("qd", 2.0), ("q", 3.2), ("tau", 100.0)];

/// The body of a robot's function, as `takt model` writes it, with ranges of its inputs.
fn body((file, end, _): (&str, &str, &str), what: RobotFunction) -> Result<Program, String> {
    let text = std::fs::read_to_string(programs().join("..").join(file)).expect("a robot's file");
    let tree = urdf::read(&text, urdf::SNAP).expect("URDF");
    let robot = tree.robot(None, None).expect("a robot");
    let options =
        Derived { rewrites: Rewrites::ALL, delays: Delays::of(&T3), tip: Some(end), kp: 100.0, kd: 20.0 };
    let mut function = derive(&robot, what, &options).expect("equations");
    for port in &mut function.inputs {
        let of = JOINTS.iter().find(|(name, _)| port.name.starts_with(name));
        let most = of.map_or_else(|| panic!("{}", port.name), |(_, most)| *most);
        port.range = Some((-most, most));
    }
    let layout = Layout::program(&function, &T3).map_err(|error| error.to_string())?;
    let loader = Search::new(MemoryLoader::default()).library(takt_programs::LIBRARY);
    let options = Options { machine: &T3, effort: 0, ..Options::default() };
    let source = sink::source(&function, &layout).into_bytes();
    let assembled = takt_asm::assemble_bytes("model.s", source, &loader, &options);
    assembled.map(|assembled| assembled.program).map_err(|errors| errors.render(false))
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

/// Inputs, states and words of arrays at a period's beginning.
#[derive(Clone)]
struct Case(Vec<Drawn>);

/// A value of a case, with its range.
#[derive(Clone)]
struct Drawn {
    cell: Cell,
    ty: Type,
    ends: (f64, f64),
    /// Number of the array, or of the register.
    group: usize,
    bits: u32,
}

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
        let (mut period, mut drawn) = (0, 0);
        while period <= periods {
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
            if self.period(&mut emulator) {
                period += 1;
            } else if period == 0 && drawn < DRAWS {
                (emulator, drawn) = (self.emulator(), drawn + 1);
            } else {
                return;
            }
        }
    }

    /// Runs a period. Returns false if it is the last: it halts, faults, or does not end.
    fn period(&mut self, emulator: &mut Emulator) -> bool {
        emulator.set_cycle_limit(emulator.now() + ENDLESS);
        self.shadow.run_period(emulator).unwrap_or(false)
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
                if !self.period(&mut emulator) {
                    return;
                }
            }
            if self.ranges(false).any(|range| !range.holds(emulator.register(range.register).unwrap_or(0))) {
                return;
            }
        }
    }

    /// A case with random values: each of its own, each an end of its range, the same for all words of an array, each near its upper end, or
    /// near the upper end in the first half of each array and near the lower one in the second. The errors of long sums are large where all
    /// terms have one sign, and those of what follows where such sums cancel.
    fn case(&self, random: &mut Random) -> Case {
        let mut cells = Vec::new();
        let mut groups = 0;
        let mut group = || {
            groups += 1;
            groups
        };
        for inputs in [true, false] {
            for range in self.ranges(inputs) {
                let cell = if inputs { Cell::Input(range.register) } else { Cell::State(range.register) };
                cells.push((cell, range.ty, range.ends(), group()));
            }
        }
        for range in &self.program.array_ranges {
            let group = group();
            cells.extend(range.span().map(|word| (Cell::Word(word), range.ty, range.ends(), group)));
        }
        let way = random.below(6);
        let mut last = (0, 0);
        let mut sizes: BTreeMap<usize, usize> = BTreeMap::new();
        cells.iter().for_each(|(.., group)| *sizes.entry(*group).or_default() += 1);
        let mut seen: BTreeMap<usize, usize> = BTreeMap::new();
        let drawn = cells.into_iter().map(|(cell, ty, ends, group)| {
            let place = seen.entry(group).or_default();
            *place += 1;
            let is_low = way == 5 && sizes[&group] > 1 && 2 * *place > sizes[&group];
            let near = (ends.1 - ends.0) / 16.0;
            let bits = match way {
                0 | 1 => draw(ty, ends, random),
                2 => draw(ty, if random.below(2) == 0 { (ends.0, ends.0) } else { (ends.1, ends.1) }, random),
                3 if last.0 == group => last.1,
                4 | 5 if is_low => draw(ty, (ends.0, ends.0 + near), random),
                4 | 5 => draw(ty, (ends.1 - near, ends.1), random),
                _ => draw(ty, ends, random),
            };
            last = (group, bits);
            Drawn { cell, ty, ends, group, bits }
        });
        Case(drawn.collect())
    }

    /// Error of an output at the end of a period that begins so, after `.once` as `begun` holds it.
    fn error(&self, begun: (&Emulator, &Shadow), case: &Case, place: OutputPlace) -> Option<f64> {
        let (mut emulator, mut shadow) = (begun.0.clone(), begun.1.clone());
        emulator.set_cycle_limit(emulator.now() + ENDLESS);
        for Drawn { cell, bits, .. } in &case.0 {
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
        let (mut emulator, shadow) = (self.emulator(), shadow(self.program));
        emulator.set_cycle_limit(emulator.now() + ENDLESS);
        let Ok(true) = shadow.clone().run_period(&mut emulator) else { return };
        let begun = (&emulator, &shadow);
        let mut best = self.case(&mut random);
        if best.0.is_empty() {
            return;
        }
        let mut most = self.error(begun, &best, place).unwrap_or(0.0);
        for turn in 0..periods {
            let mut case = best.clone();
            if turn < periods / 8 {
                case = self.case(&mut random);
            } else {
                for _ in 0..=random.below(2) {
                    let at = random.below(case.0.len() as u32) as usize;
                    let Drawn { ty, ends, group, bits, .. } = case.0[at];
                    let drawn = match (ty, random.below(8)) {
                        (Type::F, 1..) => {
                            let by = (ends.1 - ends.0) * 0.5f64.powi(random.below(30) as i32);
                            let by = if random.below(2) == 0 { by } else { -by };
                            let value = f64::from(f32::from_bits(bits)) + by;
                            (value.clamp(ends.0, ends.1) as f32).to_bits()
                        }
                        _ => draw(ty, ends, &mut random),
                    };
                    // One value, or all of an array from there on.
                    let some = random.below(4) == 0;
                    let of = |(place, other): &(usize, &mut Drawn)| {
                        *place == at || some && *place > at && other.group == group
                    };
                    case.0.iter_mut().enumerate().filter(of).for_each(|(_, other)| other.bits = drawn);
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

/// Shadow of periods that keep the assumptions of the source, each of which begins with exact values.
fn shadow(program: &Program) -> Shadow {
    Shadow::new(program).each_period_afresh().keeping_assumptions()
}

fn measured<'p>(program: &'p Program, path: Option<&str>, periods: u64) -> Measured<'p> {
    let mut measured = Measured { program, shadow: shadow(program), found: Vec::new() };
    measured.at_random(periods.clamp(LEAST, PERIODS));
    path.inspect(|path| measured.recorded(path));
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

/// A program of the tables.
struct Entry {
    /// Name in the table.
    name: String,
    /// Path relative to `programs/`, for its recorded inputs.
    path: Option<String>,
    program: Box<dyn Fn() -> Result<Program, String> + Send + Sync>,
}

/// Columns of a row that need no run: outputs, bounded ones, the reason, and what certificates prove.
struct Proved {
    program: Program,
    enclosure: Enclosure,
    columns: [String; 4],
    seconds: f64,
}

/// Bounds of a program; an error is the row's reason.
fn proved(entry: &Entry) -> Result<Proved, String> {
    let begun = seconds();
    let program = (entry.program)()?;
    let enclosure = enclose_in_boxes(&program, &Reals::default());
    let spent = seconds() - begun;
    let enclosure = enclosure.map_err(|error| error.to_string())?;
    let outputs = &enclosure.outputs;
    let finite = outputs.iter().filter(|output| output.range.is_some()).count();
    let is_whole = finite == outputs.len() && enclosure.first().next().is_none();
    let reason = if is_whole { String::new() } else { reason(&program, &enclosure) };
    let certified = match certify(&program) {
        Ok(Ok(certificate)) if !certificate.outputs.is_empty() => certificate.outputs.len().to_string(),
        _ => String::new(),
    };
    let columns = [outputs.len().to_string(), finite.to_string(), reason, certified];
    Ok(Proved { program, enclosure, columns, seconds: spent })
}

/// A row, with runs and searches.
fn row(entry: &Entry) -> String {
    let name = &entry.name;
    let found = match proved(entry) {
        Err(error) => return format!("| {name} | | 0 | {error} | | | | | |"),
        Ok(found) => found,
    };
    let Proved { program, enclosure, columns: [outputs, finite, reason, certified], seconds } = &found;
    let operations = enclosure.operations.max(1);
    let mut measured = measured(program, entry.path.as_deref(), OPERATIONS / operations);
    for _ in 0..ROUNDS {
        let Some((bound, error, run)) = loosest(enclosure, &measured) else { break };
        if run == 0.0 || error <= LOOSE * run {
            break;
        }
        measured.search(bound.place, SEARCHED / operations);
    }
    holds(name, enclosure, &measured);
    let worst = loosest(enclosure, &measured).map_or_else(
        || "| | |".to_owned(),
        |(bound, error, run)| {
            let factor = if run > 0.0 { rounded(error / run) } else { String::new() };
            format!("`{}` {} | {} | {factor} |", bound.name, short(error), short(run))
        },
    );
    format!("| {name} | {outputs} | {finite} | {reason} | {worst} {certified} | {seconds:.1} |")
}

/// Rows of all entries, made in parallel.
fn rows(entries: &[Entry]) -> Vec<String> {
    let next = AtomicUsize::new(0);
    let rows = Mutex::new(vec![String::new(); entries.len()]);
    let worker = || {
        while let Some((at, entry)) =
            Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|at| Some((at, entries.get(at)?)))
        {
            let row = row(entry);
            println!("{row}");
            rows.lock().unwrap()[at] = row;
        }
    };
    std::thread::scope(|scope| {
        let workers = std::thread::available_parallelism().map_or(1, usize::from);
        (0..workers).for_each(|_| _ = scope.spawn(worker));
    });
    rows.into_inner().unwrap()
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

const HEAD: &str = "| program | outputs | bounded | why not all | largest bound over measured | measured | factor | certified | s |\n|---|---|---|---|---|---|---|---|---|\n";

/// Entries of both tables, by the tables' names.
fn tables() -> [(&'static str, Vec<Entry>); 2] {
    let shipped = |path: String| {
        let of = path.clone();
        Entry { name: format!("`{path}`"), program: Box::new(move || Ok(assembled(&of))), path: Some(path) }
    };
    let generated = |robot: (&'static str, &'static str, &'static str), what: RobotFunction| Entry {
        name: format!("{}, {}", robot.2, what.name()),
        path: None,
        program: Box::new(move || body(robot, what)),
    };
    let functions = RobotFunction::ALL.map(|(what, ..)| what);
    let bodies = ROBOTS.into_iter().flat_map(|robot| functions.map(|what| generated(robot, what)));
    [("shipped", paths().into_iter().map(shipped).collect()), ("bodies", bodies.collect())]
}

/// Part of the document that holds a table.
fn span(document: &str, table: &str) -> std::ops::Range<usize> {
    let begin = format!("<!-- table: {table} -->\n");
    let start = document.find(&begin).expect("the table's beginning") + begin.len();
    start..start + document[start..].find("<!-- end -->").expect("the table's end")
}

#[test]
fn documented_bounds_are_those_of_the_programs() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/accuracy.md");
    let mut document = std::fs::read_to_string(&path).expect("docs/accuracy.md");
    if std::env::var_os("TAKT_BLESS").is_some() {
        for (table, entries) in tables() {
            let mut text = HEAD.to_owned();
            let mut whole = 0;
            for row in rows(&entries) {
                whole += u32::from(row.split('|').nth(4).is_some_and(|reason| reason.trim().is_empty()));
                writeln!(text, "{row}").unwrap();
            }
            let all = entries.len();
            write!(text, "\nOf {all} programs, {whole} have a bound for every output.\n").unwrap();
            document.replace_range(span(&document, table), &text);
        }
        std::fs::write(path, document).expect("docs/accuracy.md");
        return;
    }
    let full = std::env::var_os("TAKT_FULL").is_some();
    for (table, entries) in tables() {
        let text = &document[span(&document, table)];
        let rows = text.lines().filter(|line| line.starts_with("| ")).skip(1);
        let rows: Vec<Vec<&str>> =
            rows.map(|line| line.trim_matches('|').split('|').map(str::trim).collect()).collect();
        let named: Vec<&str> = rows.iter().map(|cells| cells[0]).collect();
        let names: Vec<&str> = entries.iter().map(|entry| entry.name.as_str()).collect();
        assert_eq!(named, names, "TAKT_BLESS=1 writes the table");
        let mut made = 0;
        for (cells, entry) in rows.iter().zip(&entries) {
            if !full && cells[8].parse::<f64>().is_ok_and(|seconds| seconds > QUICK) {
                continue;
            }
            made += 1;
            let name = &entry.name;
            let (columns, found) = match proved(entry) {
                Ok(found) => (found.columns.clone(), Some(found)),
                Err(error) => ([String::new(), "0".to_owned(), error, String::new()], None),
            };
            let documented = [1, 2, 3, 7].map(|column| cells[column]);
            assert_eq!(
                documented,
                columns.each_ref().map(|text| text.trim()),
                "{name}: TAKT_BLESS=1 writes the table"
            );
            let Some(Proved { program, enclosure, .. }) = found else { continue };
            let bound =
                |output: &OutputBound| format!("`{}` {}", output.name, short(output.error.unwrap_or(0.0)));
            let is_known =
                cells[4].is_empty() || enclosure.outputs.iter().any(|output| bound(output) == cells[4]);
            assert!(is_known, "{name}: {} is not among its bounds: TAKT_BLESS=1 writes the table", cells[4]);
            holds(
                name,
                &enclosure,
                &measured(&program, None, OPERATIONS_QUICK / enclosure.operations.max(1)),
            );
        }
        assert!(5 * made > rows.len(), "{made} of {} rows are quick", rows.len());
    }
}
