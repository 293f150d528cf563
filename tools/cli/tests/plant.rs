// SPDX-License-Identifier: MIT OR Apache-2.0
//! Plants: those of `takt run --plant`, and a user's, connected by two pipes to `takt run` as the controller.

use crate::common::{Folder, RunOutput};
use std::f64::consts::TAU;
use std::io::{BufRead, BufReader, Read, Write};
use std::num::NonZeroU64;
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;
use takt_asm::{FileLoader, Options};
use takt_emu::{Emulator, Number};

fn example() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../programs/examples/plant"))
}

/// The motor model of `plant.py`.
#[derive(Default)]
struct Motor {
    angle: f64,
    speed: f64,
}

impl Motor {
    fn run(&mut self, current: f64, time: f64) {
        let (torque, inertia, viscous, dry) = (0.05, 2e-5, 1e-5, 2e-3);
        let torque = torque * current - viscous * self.speed;
        if self.speed == 0.0 && torque.abs() <= dry {
            return;
        }
        let forward = self.speed > 0.0 || (self.speed == 0.0 && torque > 0.0);
        let torque = torque - if forward { dry } else { -dry };
        let speed = self.speed + torque / inertia * time;
        self.speed = if speed * self.speed < 0.0 { 0.0 } else { speed };
        self.angle += self.speed * time;
    }
}

/// Controller in this process: current from encoder count.
fn controller() -> impl FnMut(i32) -> f64 {
    let options = Options::default();
    let assembled = takt_asm::assemble("servo.s", &FileLoader::new(example()), &options).unwrap();
    let mut emulator = Emulator::new(&assembled.program).unwrap();
    emulator.set_tick_period(NonZeroU64::new(125_000));
    move |counts| {
        let inputs = [("n", Number::Integer(counts)), ("ref", Number::Float(2.0))];
        let report = emulator.run_period(&inputs).unwrap();
        assert!(!report.missed);
        let Some(Number::Float(current)) = emulator.output("current").unwrap() else { panic!("no current") };
        // Convert through text, as in the pipe: the shortest decimal of a binary32, read as binary64, is a different number.
        format!("{current:?}").parse().unwrap()
    }
}

#[test]
fn the_example_converges_and_equals_a_loop_without_pipes() {
    // Ends the test if both sides deadlock.
    let mut command = Command::new("timeout");
    command
        .args([&PATIENCE.as_secs().to_string(), "python3"])
        .arg(example().join("plant.py"))
        .arg(env!("CARGO_BIN_EXE_takt"));
    let text = RunOutput::of(command).ok();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("time,angle,current"));
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 600);
    let (mut motor, mut control) = (Motor::default(), controller());
    for (period, row) in rows.iter().enumerate() {
        let current = control((motor.angle * (4096.0 / TAU)).floor() as i32);
        assert_eq!((row[1], row[2]), (motor.angle, current), "period {period}");
        for _ in 0..20 {
            motor.run(current, 1e-3 / 20.0);
        }
    }
    let count = TAU / 4096.0;
    assert!(rows.iter().any(|row| (row[1] - 2.0).abs() > 1.0), "it has to move");
    assert!(rows[500..].iter().all(|row| (row[1] - 2.0).abs() < 2.0 * count), "within two counts of 2 rad");
    assert!(rows.iter().any(|row| row[2] == 2.0) && rows.iter().all(|row| row[2].abs() <= 2.0), "limited");
}

const ECHO: &str = "\
.input a, n:int
.output F, k:int
.once
        wait period
.period
period: fdiv F, 1.0, a
        iadd k, n, 1
        wait period
";

/// Time after which a process is considered hung.
const PATIENCE: Duration = Duration::from_secs(60);

/// A running `takt run` process.
struct RunningProcess {
    child: Child,
    stdin: Option<ChildStdin>,
    stdout: Option<BufReader<ChildStdout>>,
}

impl RunningProcess {
    fn new(folder: &Folder, options: &str) -> RunningProcess {
        folder.write("echo.s", ECHO);
        RunningProcess::of(folder, "echo.s", &format!("-m f3 {options}"))
    }

    /// Starts a program or a system.
    fn of(folder: &Folder, file: &str, options: &str) -> RunningProcess {
        let line = format!("run {file} --inputs - --outputs - {options}");
        let mut command = folder.command(&line.split_whitespace().collect::<Vec<_>>());
        let mut child = command.stdin(Stdio::piped()).spawn().unwrap();
        let (stdin, stdout) = (child.stdin.take(), child.stdout.take().map(BufReader::new));
        RunningProcess { child, stdin, stdout }
    }

    fn send(&mut self, text: &str) {
        self.stdin.as_mut().unwrap().write_all(text.as_bytes()).unwrap();
    }

    /// Next line, which must arrive without further input.
    fn line(&mut self) -> String {
        let mut stdout = self.stdout.take().unwrap();
        let (sender, answer) = mpsc::channel();
        thread::spawn(move || {
            let mut line = String::new();
            stdout.read_line(&mut line).unwrap();
            sender.send((line, stdout))
        });
        let Ok((line, stdout)) = answer.recv_timeout(PATIENCE) else {
            self.child.kill().unwrap();
            panic!("there is no answer")
        };
        self.stdout = Some(stdout);
        line
    }

    /// Exit status, remaining standard output, standard error.
    fn end(mut self) -> (Option<i32>, String, String) {
        drop(self.stdin.take());
        let mut rest = String::new();
        self.stdout.take().map(|mut stdout| stdout.read_to_string(&mut rest));
        let done = RunOutput::from(self.child.wait_with_output().unwrap());
        (done.status, rest, done.stderr)
    }
}

#[test]
fn answers_each_row_at_once() {
    let folder = Folder::new();
    for end in ["\n", "\r\n"] {
        let mut running = RunningProcess::new(&folder, "");
        // Titles come before any input; columns may be in any order, with additional ones.
        assert_eq!(running.line(), "F,k,cycles\n");
        running.send(&format!("n,time,a{end}"));
        for n in 0..5 {
            running.send(&format!("{n},now,4{end}"));
            assert_eq!(running.line(), format!("0.25,{},12\n", n + 1));
        }
        // Send rows in pieces, and several at once.
        running.send("5,no");
        running.send(&format!("w,4{end}6,now,4{end}7,now,4{end}"));
        for n in 5..8 {
            assert_eq!(running.line(), format!("0.25,{},12\n", n + 1));
        }
        assert_eq!(running.end(), (Some(0), String::new(), String::new()));
    }
}

/// A system behaves like a program: it does not block a reader that waits for the titles first.
#[test]
fn a_system_answers_a_plant_too() {
    let folder = Folder::new();
    let system = concat!(env!("CARGO_MANIFEST_DIR"), "/../../programs/systems/speed");
    let mut running = RunningProcess::of(&folder, &format!("{system}.toml"), "");
    // Titles come before any input.
    let mut answers = running.line();
    assert_eq!(answers, "u,seen.peak,seen.values\n");
    let rows = std::fs::read_to_string(format!("{system}.csv")).unwrap();
    let mut rows = rows.lines();
    running.send(&format!("{}\n", rows.next().unwrap()));
    for row in rows {
        running.send(&format!("{row}\n"));
        answers += &running.line();
    }
    assert_eq!(running.end(), (Some(0), String::new(), String::new()));
    let alone = folder.line(&format!("run {system}.toml --inputs {system}.csv --outputs -")).ok();
    assert_eq!(answers, alone);
}

#[test]
fn a_wrong_row_ends_the_run() {
    let folder = Folder::new();
    let mut running = RunningProcess::new(&folder, "");
    running.send("a,n\n4,1\n4,x\n4,2\n");
    assert_eq!((running.line(), running.line()), ("F,k,cycles\n".to_owned(), "0.25,2,12\n".to_owned()));
    let error =
        "error: standard input:3: column n: `x` is not an integer between -2147483648 and 2147483647\n";
    assert_eq!(running.end(), (Some(1), String::new(), error.to_owned()));
    // A plant that sends nothing.
    let running = RunningProcess::new(&folder, "");
    let error = "error: standard input is empty: it needs a header with a column for each input port\n";
    assert_eq!(running.end(), (Some(1), "F,k,cycles\n".to_owned(), error.to_owned()));
}

#[test]
fn a_plant_that_stops_reading_ends_the_run() {
    let folder = Folder::new();
    for (options, status) in [("", 0), ("--tick 10 --deny missed", 3), ("--tick 100 --deny missed", 0)] {
        let mut running = RunningProcess::new(&folder, options);
        running.send("a,n\n4,1\n");
        assert_eq!((running.line(), running.line().is_empty()), ("F,k,cycles\n".to_owned(), false));
        drop(running.stdout.take());
        // The closed pipe is noticed at the next answer.
        running.send("4,2\n");
        let (ended, _, stderr) = running.end();
        assert_eq!(
            (ended, stderr.contains("denied: deadline missed")),
            (Some(status), status == 3),
            "{stderr}"
        );
    }
}

/// Warnings and statistics are not written to standard output.
#[test]
fn standard_output_has_rows_only() {
    let folder = Folder::new();
    folder.write("nan.s", ECHO.replace("1.0, a", "zero, a"));
    let done = folder.fed("run nan.s -m f3 --inputs - --outputs - --stats", b"a,n\n0,1\n");
    assert_eq!((done.status, done.stdout.as_str()), (Some(0), "F,k,cycles\nNaN,2,12\n"));
    assert!(done.stderr.contains("warning: NaN written to F"), "{}", done.stderr);
    assert!(done.stderr.contains("1 period on f3") && done.stderr.contains("operations:"), "{}", done.stderr);
}

/// Inputs and outputs of the examples' closed loops, in CSV; the playground's tests compare with the same files.
#[test]
fn loops_have_the_bits_of_the_playground() {
    let folder = Folder::new();
    let programs = concat!(env!("CARGO_MANIFEST_DIR"), "/../../programs");
    let loops = [
        ("pi", "dc_motor", "400"),
        ("foc", "pmsm", "320"),
        ("foc_early", "pmsm", "320"),
        ("pendulum", "cart_pendulum", "400"),
    ];
    for (name, plant, periods) in loops {
        let program = format!("{programs}/examples/{name}.s");
        let plant = format!("{programs}/examples/plant/{plant}.toml");
        let told =
            folder.takt(&["run", &program, "--plant", &plant, "--periods", periods, "--outputs", "-"]).ok();
        let rows: Vec<Vec<&str>> = told.lines().map(|line| line.split(',').collect()).collect();
        let keep = |title: &&str| !title.contains('.') && *title != "cycles";
        let kept: Vec<usize> = (0..rows[0].len()).filter(|at| keep(&rows[0][*at])).collect();
        let line = |row: &Vec<&str>| kept.iter().map(|at| row[*at]).collect::<Vec<_>>().join(",") + "\n";
        let table: String = rows.iter().map(line).collect();
        let path = format!("{programs}/tests/loops/{name}.csv");
        if std::env::var_os("TAKT_BLESS").is_some() {
            std::fs::write(&path, &table).unwrap();
        }
        assert!(std::fs::read_to_string(&path).unwrap() == table, "{path} is stale: TAKT_BLESS=1 writes it");
    }
}

/// The message about a program without inputs names the plant beside it that fits, and the table.
#[test]
fn a_program_without_inputs_is_told_its_plant() {
    let folder = Folder::new();
    let file = |name: &str| format!("{}/../{name}", example().display());
    let [run, other] = ["pi.s", "biquads.s"].map(|name| folder.line(&format!("run {}", file(name))).stderr);
    let plant = format!(
        "such as `--plant {} --periods 400` or `--inputs {}`",
        file("plant/dc_motor.toml"),
        file("pi.csv")
    );
    assert!(run.contains(&plant), "{run}");
    assert!(other.contains(&format!("such as `--inputs {}`", file("biquads.csv"))), "{other}");
    // The command that it names works.
    let done = folder
        .line(&format!("run {} --plant {} --periods 400", file("pi.s"), file("plant/dc_motor.toml")))
        .ok();
    assert!(done.starts_with("400 periods on t3"), "{done}");
}

/// A table beside a plant needs no column for what the plant or its file gives; one that belongs to no port may be a misspelt name.
#[test]
fn a_misspelt_column_beside_a_plant_is_told() {
    let folder = Folder::new();
    let (program, plant) =
        (format!("{}/../pi.s", example().display()), format!("{}/dc_motor.toml", example().display()));
    let note = |title: &str| {
        folder.write("inputs.csv", format!("{title}\n1\n1\n"));
        folder.line(&format!("run {program} --plant {plant} --inputs inputs.csv")).stderr
    };
    let passed = "note: inputs.csv: the column";
    assert_eq!(note("w_ref"), "");
    assert!(note("w_rf").starts_with(&format!("{passed} `w_rf` belongs to no input port")));
    assert!(note("w_rf").contains("did you mean `w_ref`?"));
    // A signal of the recording that no port has.
    assert!(note("u").starts_with(&format!("{passed} `u` belongs to no input port")));
    assert!(!note("u").contains("did you mean"));
}

/// The picture of a run from a table has its inputs, too, and the output table has not.
#[test]
fn a_picture_from_a_table_shows_its_inputs() {
    let folder = Folder::new();
    let [program, table] =
        ["biquads.s", "biquads.csv"].map(|name| format!("{}/../{name}", example().display()));
    folder.line(&format!("run {program} --inputs {table} --plot filter.svg --outputs out.csv"));
    let svg = folder.read_text("filter.svg");
    let missing: Vec<_> =
        ["x", "y", "V"].iter().filter(|text| !svg.contains(&format!("\n{text}\n"))).collect();
    assert!(missing.is_empty(), "{missing:?}");
    assert!(folder.read_text("out.csv").starts_with("y,cycles\n"));
}

/// Pictures in docs/examples.md are of the examples as they are: TAKT_BLESS=1 draws them.
#[test]
fn the_pictures_of_the_examples_are_fresh() {
    let folder = Folder::new();
    let programs = example().join("..");
    let mut stale = Vec::new();
    for (name, picture, rest) in [
        ("pi", "pi", "--plant plant/dc_motor.toml --periods 400"),
        ("pendulum", "cart", "--plant plant/cart_pendulum.toml --periods 6000"),
        ("biquads", "biquads", "--inputs biquads.csv"),
        ("table", "table", "--inputs table.csv"),
    ] {
        let out = folder.path().join(format!("{picture}.svg"));
        let line = format!("run {name}.s {rest} --plot {}", out.display());
        let mut command = folder.command(&line.split_whitespace().collect::<Vec<_>>());
        command.current_dir(&programs);
        assert_eq!(RunOutput::of(command).status, Some(0), "{name}");
        let drawn = std::fs::read_to_string(out).unwrap();
        let path = format!("{}/../../docs/pictures/{picture}.svg", env!("CARGO_MANIFEST_DIR"));
        if std::env::var_os("TAKT_BLESS").is_some() {
            std::fs::write(&path, &drawn).unwrap();
        }
        if !std::fs::read_to_string(&path).is_ok_and(|old| old == drawn) {
            stale.push(path);
        }
    }
    assert!(stale.is_empty(), "{stale:?} are stale: TAKT_BLESS=1 draws them");
}

/// The picture of a loop names its file, has units, and shows a sensor's state once.
#[test]
fn the_picture_of_a_loop_has_units() {
    let folder = Folder::new();
    let [program, plant] = ["../pi.s", "dc_motor.toml"].map(|name| format!("{}/{name}", example().display()));
    let done = folder.line(&format!("run {program} --plant {plant} --periods 400 --plot loop.svg"));
    assert!(done.stderr.contains("the curves are in loop.svg"), "{done:?}");
    let svg = folder.read_text("loop.svg");
    let has = |text: &str| svg.contains(&format!("\n{text}\n"));
    assert!(["rad/s", "V", "A", "rad", "time, ms", "w_ref", "w", "dc_motor.i"].into_iter().all(has), "{svg}");
    assert!(!has("dc_motor.w"), "{svg}");
}
