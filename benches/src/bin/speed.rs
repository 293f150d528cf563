//! How fast the tools are beside things that a reader has: ratios measured in one run, as a Markdown document on standard
//! output. `cargo xtask speed` runs it.
//!
//! What is compared takes turns, round after round, so that another load on the machine, or its clock, weighs on both sides.
//! Each round gives a ratio of the fastest samples; shown are the median round and the range of all.
#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::fmt::Write as _;
use std::hint::black_box;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;
use takt_asm::{MemoryLoader, Options};
use takt_benches::{DEEP, source};
use takt_cosim::{Lockstep, Model, cache_folder};
use takt_emu::{Batch, Emulator};
use takt_isa::{Program, Register, T3};
use takt_programs::hybrid::closed_loop::{ClosedLoop, Inputs};
use takt_programs::hybrid::{Controller, ports};
use takt_programs::trajectory::Trajectory;
use takt_programs::{AGH, SOURCES, gcode};
use takt_rtl::{Library, export};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Rounds of each comparison.
const ROUNDS: usize = 5;
/// Samples of each side in a round.
const SAMPLES: usize = 40;
/// Recorded periods, and those of a sample: short, so that some sample is not interrupted.
const PERIODS: usize = 4000;
const STRETCH: usize = 100;
/// Lines of the longest source.
const LINES: [usize; 3] = [10_000, 100_000, 1_000_000];
/// Periods in lockstep.
const LOCKSTEP: usize = 300;

/// The fastest of some samples of `work`, in seconds; `work` is given the number of the sample.
fn fastest(samples: usize, mut work: impl FnMut(usize)) -> f64 {
    let mut fastest = f64::INFINITY;
    for sample in 0..samples {
        let start = Instant::now();
        work(sample);
        fastest = fastest.min(start.elapsed().as_secs_f64());
    }
    fastest
}

/// Ratios of rounds.
#[derive(Default)]
struct Ratios(Vec<f64>);

impl Ratios {
    fn text(&self) -> String {
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        let digits = |value: f64| if value < 10.0 { format!("{value:.2}") } else { format!("{value:.1}") };
        match sorted[..] {
            [] => "-".to_owned(),
            [least, .., most] => {
                format!("{} | {} to {}", digits(sorted[sorted.len() / 2]), digits(least), digits(most))
            }
            [only] => format!("{} | one round", digits(only)),
        }
    }
}

/// Inputs recorded in closed loop with the binary64 controller.
fn recorded() -> Outcome<Vec<Inputs>> {
    let moves = gcode::read(AGH).map_err(|error| format!("line {}: {}", error.line, error.kind))?;
    let trajectory = Trajectory::plan(&moves)?;
    let records = ClosedLoop::new(&trajectory, Controller::<f64>::new()).take(PERIODS);
    records.map(|record| Ok(record?.inputs)).collect()
}

fn tracking() -> Outcome<(Program, Vec<Register>)> {
    let mut loader = MemoryLoader::default();
    for (path, text) in SOURCES {
        loader.add(*path, *text);
    }
    let options = Options { machine: &T3, ..Options::default() };
    let assembled = takt_asm::assemble("hybrid/tracking.s", &loader, &options);
    let program = assembled.map_err(|_| "the tracking program does not assemble")?.program;
    let register = |name: &str| {
        let port = program.inputs.iter().find(|port| port.name == name);
        port.map(|port| port.register).ok_or("the tracking program lacks a port")
    };
    let registers = ports::INPUTS.iter().map(|port| register(port.name)).collect::<Result<_, _>>()?;
    Ok((program, registers))
}

fn emulator(text: &mut String) -> Outcome<()> {
    let inputs = recorded()?;
    let (program, registers) = tracking()?;
    // Every lane somewhere else on the path.
    let lanes = Batch::WIDTH;
    let rows: Vec<Vec<Vec<u32>>> = (0..PERIODS)
        .map(|period| {
            let words: Vec<_> =
                (0..lanes).map(|lane| inputs[(period + 97 * lane) % PERIODS].to_words()).collect();
            (0..registers.len()).map(|port| words.iter().map(|words| words[port]).collect()).collect()
        })
        .collect();
    let mut controller = Controller::<f32>::new();
    let [mut single, mut interpreted] = [Emulator::new(&program)?, Emulator::new(&program)?];
    // The compiler's own time is not measured.
    single.set_compile_after(Some(1));
    interpreted.set_compile_after(None);
    let mut batch = Batch::new(&program, lanes)?;
    let [mut singles, mut interpreted_singles, mut batches, mut per_operation] =
        [(); 4].map(|()| Ratios::default());
    let mut operations = 0;
    for _ in 0..ROUNDS {
        let stretch = |sample: usize| {
            let first = sample * STRETCH % PERIODS;
            first..first + STRETCH
        };
        let native = fastest(SAMPLES, |sample| {
            for inputs in &inputs[stretch(sample)] {
                // All outputs are wanted, or the compiler leaves out what computes the others.
                black_box(controller.step(inputs.counts, &inputs.reference));
            }
        });
        let run = |emulator: &mut Emulator| {
            fastest(SAMPLES, |sample| {
                for inputs in &inputs[stretch(sample)] {
                    for (register, bits) in registers.iter().zip(inputs.to_words()) {
                        emulator.set_input_bits(*register, bits).expect("it is an input");
                    }
                    emulator.run_period(&[]).expect("it has no fault");
                }
            })
        };
        let before = single.statistics().total_operations();
        let emulated = run(&mut single);
        operations = (single.statistics().total_operations() - before) / (SAMPLES * STRETCH) as u64;
        let batched = fastest(SAMPLES, |sample| {
            for row in &rows[stretch(sample)] {
                for (register, words) in registers.iter().zip(row) {
                    batch.set_input_bits(*register, words).expect("it is an input");
                }
                batch.run_period();
            }
        }) / lanes as f64;
        singles.0.push(emulated / native);
        interpreted_singles.0.push(run(&mut interpreted) / native);
        batches.0.push(batched / native);
        per_operation.0.push(operations as f64 * STRETCH as f64 / batched / 1e9);
    }
    let apart = batch.periods_apart();
    let how = match Emulator::compiles() {
        true => {
            "One run is compiled to the host's instructions (feature `jit`) once its blocks have run often."
        }
        false => "One run is interpreted in both rows: this build has no compiler (feature `jit`).",
    };
    writeln!(
        text,
        "## Emulator\n\n\
         The hybrid robot's tracking program (`programs/hybrid/tracking.s`, {operations} operations a period on t3), beside the \
         same algorithm in Rust's binary32, compiled natively: time for a period of one robot, on one core, the inputs set \
         each time.\n\n\
         | | times native | rounds |\n|---|---|---|\n| one run | {} |\n| one run, interpreted | {} |\n\
         | in a batch of {lanes}, per robot | {} |\n\n{how}\n\n\
         In the batch a core executed {} thousand million operations a second (median, range of the rounds); {apart} \
         periods of a lane ran apart.\n",
        singles.text(),
        interpreted_singles.text(),
        batches.text(),
        per_operation.text().replace(" | ", ", "),
    )?;
    Ok(())
}

/// [`source`]'s mix of lines for GNU `as` on this host: comments, blank lines, labels, two constants, a macro's use.
fn native_source(lines: usize) -> String {
    let mut text = String::from(".set k, 502\n.macro scale to, by\n mulss \\by, \\to\n.endm\n.text\n");
    let mut line = text.lines().count();
    let mut label = 0;
    while line + 12 < lines {
        let constant = label % 64;
        let _ = write!(
            text,
            "# block {label}: a proportional controller\n\nstep{label}:\n        mulss   k(%rsi), %xmm1\n        \
             mulss   8(%rsi), %xmm2         # m\n        addss   %xmm1, %xmm2\n        scale   %xmm1, 2*k+{constant}(%rdi)\n\
             \x20       subss   %xmm1, %xmm3\n        movss   %xmm3, %xmm4\n        cvtsi2ss %eax, %xmm5\n        \
             sqrtss  %xmm6, %xmm1\n        addss   %xmm5, %xmm3\n"
        );
        label += 1;
        line += 12;
    }
    text.push_str(&"# rest\n".repeat(lines - line));
    text
}

fn assembler(text: &mut String) -> Outcome<()> {
    let folder = std::env::temp_dir().join(format!("takt-speed-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let result = assembler_in(&folder, text);
    std::fs::remove_dir_all(&folder)?;
    result
}

fn assembler_in(folder: &Path, text: &mut String) -> Outcome<()> {
    let gnu = |file: &Path| -> Outcome<()> {
        let status =
            Command::new("as").arg("-o").arg(folder.join("out.o")).arg(file).stdin(Stdio::null()).status()?;
        if status.success() { Ok(()) } else { Err("`as` failed".into()) }
    };
    let version = Command::new("as").arg("--version").output();
    let version = version.ok().filter(|version| version.status.success() && cfg!(target_arch = "x86_64"));
    let Some(version) = version else {
        writeln!(text, "## Assembler\n\nNot compared: there is no GNU `as` for x86-64 here.\n")?;
        return Ok(());
    };
    let version = String::from_utf8_lossy(&version.stdout).lines().next().unwrap_or("GNU as").to_owned();
    writeln!(
        text,
        "## Assembler\n\nLines a second beside {version}, which assembles as many lines of the same mix (comments, labels, \
         constants, expressions, a macro) of x86-64 code. Its start is measured on an empty file and taken off; Takt's \
         assembler is called in this process, its source in memory.\n\n| lines | times GNU `as` | rounds | cost of a line, times that of the \
         shortest source |\n|---|---|---|---|"
    )?;
    let empty = folder.join("empty.s");
    std::fs::write(&empty, "")?;
    let mut shortest = None;
    for lines in LINES {
        let file = folder.join("source.s");
        std::fs::write(&file, native_source(lines))?;
        let loader = MemoryLoader::of("source.s", source(lines));
        let options = Options { machine: &DEEP, ..Options::default() };
        let (mut ratios, mut best) = (Ratios::default(), f64::INFINITY);
        let samples = 1 + 100_000 / lines;
        for _ in 0..ROUNDS {
            let mut failed = None;
            let mut theirs = |file: &Path| fastest(samples, |_| failed = gnu(file).err().or(failed.take()));
            let start = theirs(&empty);
            let theirs = theirs(&file) - start;
            if let Some(error) = failed {
                return Err(error);
            }
            let mut mistakes = None;
            let ours = fastest(samples, |_| {
                let assembled = black_box(takt_asm::assemble("source.s", &loader, &options));
                mistakes = assembled.err().or(mistakes.take());
            });
            if let Some(mistakes) = mistakes {
                return Err(mistakes.render(false).into());
            }
            ratios.0.push(theirs / ours);
            best = best.min(ours / lines as f64);
        }
        let shortest = *shortest.get_or_insert(best);
        writeln!(text, "| {lines} | {} | {:.2} |", ratios.text(), best / shortest)?;
    }
    text.push('\n');
    Ok(())
}

fn lockstep(text: &mut String) -> Outcome<()> {
    if !Command::new("verilator").arg("--version").output().is_ok_and(|output| output.status.success()) {
        writeln!(text, "## Circuit\n\nNot measured: there is no Verilator here.")?;
        return Ok(());
    }
    let inputs = recorded()?;
    let (program, registers) = tracking()?;
    let row = |inputs: &Inputs| registers.iter().copied().zip(inputs.to_words()).collect::<Vec<_>>();
    let rows: Vec<_> = inputs[..LOCKSTEP].iter().map(row).collect();
    let design = export(program.machine, &Library::builtin())?.latching(program.latched_inputs())?;
    let model = Model::build(&design, &cache_folder(), false)?;
    let (mut ratios, mut rate) = (Ratios::default(), Ratios::default());
    for _ in 0..ROUNDS {
        let simulation = model.start(&[])?;
        let start = Instant::now();
        let mut lockstep = Lockstep::new(&program, simulation, &rows[0])?;
        for row in &rows {
            lockstep.run_period(row);
            lockstep.compare()?;
        }
        lockstep.finish()?;
        let both = start.elapsed().as_secs_f64();
        let cycles = lockstep.emulator().now();
        lockstep.into_simulation().finish();
        let mut alone = Emulator::new(&program)?;
        let start = Instant::now();
        for row in &rows {
            for &(register, bits) in row {
                alone.set_input_bits(register, bits)?;
            }
            alone.run_period(&[])?;
        }
        ratios.0.push(both / start.elapsed().as_secs_f64());
        rate.0.push(cycles as f64 / both / 1e3);
    }
    writeln!(
        text,
        "## Circuit\n\nThe tracking program on the circuit (Verilator) and on the emulator in lockstep, every event compared \
         (`takt cosim`), beside the emulator alone: {LOCKSTEP} periods, the circuit's model compiled before.\n\n\
         | | times the emulator alone | rounds |\n|---|---|---|\n| lockstep | {} |\n\n\
         That was {} thousand cycles a second (median, range of the rounds).",
        ratios.text(),
        rate.text().replace(" | ", ", "),
    )?;
    Ok(())
}

fn main() -> Outcome<()> {
    // Of the parts only these; all, if none is named.
    let wanted: Vec<String> = std::env::args().skip(1).collect();
    let mut text = format!(
        "# How fast the tools are\n\n\
         Written by `cargo xtask speed`. Absolute speeds depend on the machine, so each figure is a ratio to something that a \
         reader has, measured in the same run: both sides take turns for {ROUNDS} rounds, a round's ratio is that of the \
         fastest samples, and the table has the median round and the range of all. Larger is slower for times, faster for \
         lines a second.\n\n"
    );
    for (name, measure) in [
        ("emulator", emulator as fn(&mut String) -> Outcome<()>),
        ("assembler", assembler),
        ("lockstep", lockstep),
    ] {
        if wanted.is_empty() || wanted.iter().any(|wanted| wanted == name) {
            eprintln!("measuring: {name}");
            measure(&mut text)?;
        }
    }
    print!("{text}");
    Ok(())
}
