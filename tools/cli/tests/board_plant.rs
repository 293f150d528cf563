// SPDX-License-Identifier: MIT OR Apache-2.0
//! Plants at the pins of a simulated board: closed loops beside those of `takt run --plant`, trips and broken cables, mistakes in files.
#![cfg(unix)]

use crate::common::{Folder, RunOutput};
use std::process::{Command, Stdio};

fn example(name: &str) -> String {
    format!("{}/../../programs/examples/board/{name}", env!("CARGO_MANIFEST_DIR"))
}

fn text(name: &str) -> String {
    std::fs::read_to_string(example(name)).unwrap()
}

/// Runs a simulation; Verilator needs more memory than the limit of other tests allows.
fn sim(folder: &Folder, line: &str) -> RunOutput {
    let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
    command.args(["board", "sim"]).args(line.split_whitespace()).current_dir(folder.path());
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    RunOutput::from(command.spawn().unwrap().wait_with_output().unwrap())
}

/// Columns of a table, by name.
struct Table(Vec<String>, Vec<Vec<f64>>);

impl Table {
    fn of(folder: &Folder, name: &str) -> Table {
        let text = folder.read_text(name);
        let mut lines = text.lines();
        let titles = lines.next().unwrap().split(',').map(str::to_owned).collect();
        let number = |field: &str| field.parse().unwrap_or(f64::NAN);
        Table(titles, lines.map(|line| line.split(',').map(number).collect()).collect())
    }

    fn column(&self, name: &str) -> Vec<f64> {
        let at =
            self.0.iter().position(|title| title == name).unwrap_or_else(|| panic!("{name}: {:?}", self.0));
        self.1.iter().map(|row| row[at]).collect()
    }
}

/// Largest difference of a column in two tables.
fn difference(a: &Table, b: &Table, name: &str) -> f64 {
    let (a, b) = (a.column(name), b.column(name));
    assert_eq!(a.len(), b.len());
    a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Motor, inverter, converters, encoder and comparator of the example: steps of the current, a trip.
#[test]
fn a_motor_at_pins_moves_as_without_them() {
    let folder = Folder::new();
    folder.write("drive.s", text("drive.s"));
    folder.write("wiring.toml", text("drive.toml"));
    folder.write("motor.toml", text("plant/drive.toml"));
    let target = "--wiring wiring.toml --program drive.s";
    let done = sim(
        &folder,
        &format!("{target} --plant motor.toml --periods 160 --outputs pins.csv --plot pins.svg"),
    );
    assert_eq!(done.status, Some(0), "{done:?}");
    assert!(!done.stderr.contains("safe"), "{done:?}");
    assert!(done.stderr.contains("160 periods of `pmsm_switched` at the pins"), "{done:?}");
    folder.line("run drive.s --plant motor.toml --periods 160 --outputs alone.csv").ok();
    let (pins, alone) = (Table::of(&folder, "pins.csv"), Table::of(&folder, "alone.csv"));
    // Dead time and duties in whole cycles, samples a cycle after the valley: 0.4 % of the current, a step of converters or two.
    for (column, most) in [
        ("pmsm_switched.iq", 0.02),
        ("pmsm_switched.id", 0.02),
        ("pmsm_switched.w", 0.01),
        ("ca", 2.0),
        ("cb", 2.0),
        ("n", 1.0),
        ("iq_ref", 0.0),
    ] {
        let found = difference(&pins, &alone, column);
        assert!(found <= most, "{column}: {found}");
    }
    assert!(pins.column("pmsm_switched.iq").iter().any(|current| *current > 4.9));
    // Half bridges: what is neither high nor low is twice the dead time of 30 cycles in 3000.
    let (high, low) = (pins.column("bridge.high_a"), pins.column("bridge.low_a"));
    assert!(high[50..].iter().zip(&low[50..]).all(|(high, low)| (1.0 - high - low - 0.02).abs() < 1e-3));
    assert!(folder.read_text("pins.svg").contains("\niq_ref\n"));

    // A lower comparator: the trip brakes the motor by its windings, and the program sees it.
    folder.write("trip.toml", text("plant/drive.toml").replace("above = 15", "above = 3"));
    let done = sim(&folder, &format!("{target} --plant trip.toml --periods 60 --outputs trip.csv"));
    assert!(done.status == Some(0) && done.stderr.contains("the trip `overcurrent` is held"), "{done:?}");
    let trip = Table::of(&folder, "trip.csv");
    let (state, current) = (trip.column("tripped"), trip.column("pmsm_switched.iq"));
    let at = state.iter().position(|state| *state != 0.0).expect("a trip");
    assert!((20..40).contains(&at), "{at}");
    assert!(current.iter().all(|current| *current < 3.6), "{current:?}");
    // Shorted windings let the current decay with their time constant.
    let (from, periods) = (current[at + 2], (57 - at) as f64);
    let wanted = from * (-periods * 50e-6 * 0.35 / 1.1e-3).exp();
    assert!((current[59] / wanted - 1.0).abs() < 0.05, "{} of {wanted}", current[59]);
    assert!(trip.column("bridge.low_b")[at + 2..].iter().all(|part| *part == 1.0));
}

/// Currents by delta-sigma modulators: a step of the current; a cable that breaks trips by the filter's own limit.
#[test]
fn isolated_currents_close_the_loop_and_trip() {
    let folder = Folder::new();
    for name in ["drive.s", "isolated.s", "isolated.toml"] {
        folder.write(name, text(name));
    }
    folder.write("motor.toml", text("plant/isolated.toml"));
    let line =
        "--wiring isolated.toml --program isolated.s --plant motor.toml --periods 200 --outputs pins.csv";
    let done = sim(&folder, line);
    assert!(done.status == Some(0) && done.stderr.contains("the trip `current_a` is held"), "{done:?}");
    let pins = Table::of(&folder, "pins.csv");
    let (current, state) = (pins.column("pmsm_switched.iq"), pins.column("tripped"));
    assert!((current[118] - 5.0).abs() < 0.1 && (current[158] + 5.0).abs() < 0.6, "{current:?}");
    // Bits of 0 from 8 ms on are soon beyond the limit: the program sees the trip in the next period, and the windings brake.
    let at = state.iter().position(|state| *state != 0.0).expect("a trip");
    assert!((160..164).contains(&at), "{at}");
    assert!(pins.column("bridge.low_b")[at + 1..].iter().all(|part| *part == 1.0));
    // The filter measures the phase's current in the middle of the valley, 7.6 µs before the tick.
    let (along, angle) = (pins.column("pmsm_switched.id"), pins.column("pmsm_switched.angle"));
    let measured = pins.column("ca");
    for row in 0..160 {
        let (sin, cos) = (4.0 * angle[row]).sin_cos();
        let (phase, filtered) = (along[row] * cos - current[row] * sin, measured[row] * 20.0 / 125_000.0);
        assert!((phase - filtered).abs() < 0.3, "period {row}: {filtered} A of {phase} A");
    }
}

/// A servo drive on a board without a host: sixteen steps at its pins turn the motor by a sixteenth of a turn, with sines from a table.
#[test]
fn a_servo_without_a_host_follows_steps() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("machine")).unwrap();
    for name in ["drive.s", "small.s", "small.toml", "machine/foc.toml"] {
        folder.write(name, text(name));
    }
    let file = text("plant/small.toml");
    folder.write("motor.toml", &file);
    let target = "--wiring small.toml --program small.s";
    let done = sim(&folder, &format!("{target} --plant motor.toml --periods 1600 --outputs pins.csv"));
    assert!(done.status == Some(0) && done.stderr.contains("1600 periods"), "{done:?}");
    let pins = Table::of(&folder, "pins.csv");
    let (count, wanted) = (pins.column("n"), pins.column("steps"));
    assert_eq!((wanted[90], wanted[300]), (0.0, 16.0));
    assert!(count[90].abs() <= 1.0 && (count[1599] - 1024.0).abs() < 32.0, "{} counts", count[1599]);
    assert!(count.windows(2).all(|two| (two[1] - two[0]).abs() < 12.0), "no faster than VMAX");
    assert!(pins.column("pmsm_switched.id").iter().all(|current| current.abs() < 0.4));

    // Nobody could write what a host writes.
    folder.write("motor.toml", file.replace("[pins]", "[inputs]\nmore = 0\n\n[pins]"));
    let asks = text("small.s").replace(".input  steps:int", ".input  more, steps:int");
    folder.write("small.s", asks.replace("        id = 0\n", "        id = more\n"));
    let done = sim(&folder, &format!("{target} --plant motor.toml --periods 10"));
    assert!(
        done.status == Some(1) && done.stderr.contains("the host would write the port `more`"),
        "{done:?}"
    );
}

/// Six axes on one core at their pins: each moves as its goal says; a cable that is pulled stops its own axis; a comparator stops all without a clock.
#[test]
fn six_axes_at_pins_move_and_stop_alone() {
    let folder = Folder::new();
    let shipped = |name: &str| {
        let path = format!("{}/../../programs/servo/{name}", env!("CARGO_MANIFEST_DIR"));
        std::fs::read_to_string(path).unwrap()
    };
    for name in ["axis.s", "six_axes.s", "six_pins.s", "six_pins.toml"] {
        folder.write(name, shipped(name));
    }
    let text = shipped("six_plant.toml");
    let (begin, end) = (text.find("\"goal[1]\"").unwrap(), text.find("[pins]").unwrap());
    let goals = "goal = 0\n\"goal[1]\" = 0.002\n\"goal[2]\" = -0.002\n\n";
    let pins = text[end..].replace("[[0.022, 0]]", "[[0.004, 0]]");
    let (pins, _) = pins.split_once("overcurrent").unwrap();
    folder.write(
        "plant.toml",
        text[..begin].to_owned() + goals + pins + "overcurrent = [[0, 0], [0.005, 1], [0.00501, 0]]\n",
    );
    let files = "--wiring six_pins.toml --program six_pins.s --plant plant.toml";
    let done = sim(&folder, &format!("{files} --periods 520 --outputs six.csv --plot six.svg"));
    assert_eq!(done.status, Some(0), "{done:?}");
    assert!(done.stderr.contains("the trip `overcurrent` is held: `bridge1`, `bridge2`"), "{done:?}");
    let table = Table::of(&folder, "six.csv");
    let turns = |axis: u32, period: usize| {
        table.column(&format!("pmsm_switched.angle[{axis}]"))[period] / std::f64::consts::TAU
    };
    assert!(turns(1, 490) > 2e-3 && (turns(1, 490) + turns(2, 490)).abs() < 1e-4, "{}", turns(2, 490));
    assert!([3, 6].iter().all(|axis| turns(*axis, 490).abs() < 1e-4), "the others stay");
    // The cable is pulled in period 400; the others go on until the comparator trips.
    let high = |axis: u32, period: usize| table.column(&format!("bridge{axis}.high_a"))[period];
    let drives = |period: usize| (1..=6).filter(|axis| high(*axis, period) > 0.0).collect::<Vec<_>>();
    assert_eq!(drives(399), [1, 2, 3, 4, 5, 6]);
    assert_eq!(drives(402), [1, 2, 3, 4, 6]);
    assert_eq!(drives(502), [0_u32; 0]);
    assert!(folder.read_text("six.svg").contains("\nca\n"));
}

const WIRING: &str = r#"board = "ulx3s-85f"
clock = 60
baud = 1_000_000

[carrier.main]
half = 1500
tick = "valley"
after = 8

[peripheral.bridge]
kind = "pwm3"
carrier = "main"
pins = { high_a = "gp0", low_a = "gn0", high_b = "gp1", low_b = "gn1", high_c = "gp2", low_c = "gn2" }
dead = 30
minimum = 30
ports = { a = "da", b = "db" }
scale = { a = 2048, b = 2048 }

[peripheral.current]
kind = "sinc3"
pins = { data = "gp3", clock = "gn3" }
rate = 10
osr = 50
centre = "main.valley"
ports = { value = "ci" }

[peripheral.angle]
kind = "biss-c"
pins = { ma = "gp7", slo = "gn7" }
rate = 10
bits = 18
wait = 24
timeout = 600
starts = "main.valley"
ports = { position = "n", frames = "seen", errors = "wrong" }

[peripheral.clock]
kind = "step"
pins = { step = "gp8", direction = "gn8" }
ports = { count = "steps" }
"#;

const PROGRAM: &str = "\
.schedule on
.const  T    = 50e-6                    ; s
.const  FULL = 3000.0/2048
.input  ci:int, n:int, seen:int, wrong:int, steps:int
.input  i_ref
.output da, db, other:int
.state  s
.once
        mov     s, zero
        mov     da, 0.5*FULL
        mov     db, 0.5*FULL
        mov     other, zero
        wait    period
.period
period:
.reg    e u
        e = i_ref - itof(ci)*(25.0/125000)
        u = max(min(e*3 + s, 20), -20)
        s = max(min(s + e*(3000*T), 20), -20)
        da = u*(0.5*FULL/24) + 0.5*FULL
        db = u*(-0.5*FULL/24) + 0.5*FULL
        other = n + seen + wrong + steps
        wait    period
";

const PLANT: &str = r#"model = "dc_motor_switched"

[ports]
da = { port = "da", scale = 0.6826666666666666 }
db = { port = "db", scale = 0.6826666666666666 }
i = { port = "ci", scale = 5000 }
angle = { port = "n", scale = 41721.513401802 }

[inputs]
i_ref = [[0, 2], [0.002, 4]]
"#;

fn direct() -> Folder {
    let folder = Folder::new();
    folder.write("wiring.toml", WIRING);
    folder.write("loop.s", PROGRAM);
    folder.write("motor.toml", PLANT);
    folder
}

const TARGET: &str = "--wiring wiring.toml --program loop.s --machine t1";

/// A delta-sigma modulator and a BiSS C encoder; then the encoder's line, with noise and without its cable.
#[test]
fn modulators_and_encoders_close_a_loop() {
    let folder = direct();
    folder.write("noise.toml", format!("{PLANT}\n[pins]\nangle = [[0.001, \"noise\"], [0.003, 0]]\n"));
    let done = sim(&folder, &format!("{TARGET} --plant noise.toml --periods 100 --outputs pins.csv"));
    assert_eq!(done.status, Some(0), "{done:?}");
    folder.write("alone.toml", format!("{PLANT}seen = 0\nwrong = 0\nsteps = 0\n"));
    folder.line("run loop.s --machine t1 --plant alone.toml --periods 100 --outputs alone.csv").ok();
    let (pins, alone) = (Table::of(&folder, "pins.csv"), Table::of(&folder, "alone.csv"));
    // The filter's window sees the ripple that the valley hides, and the first period comes a duty later.
    let found = difference(&pins, &alone, "dc_motor_switched.i");
    assert!(found < 0.3, "{found}");
    let current = pins.column("dc_motor_switched.i");
    assert!((current[39] - 2.0).abs() < 0.06 && (current[99] - 4.0).abs() < 0.1, "{current:?}");
    // In 20 periods each frame comes; with noise most have a wrong CRC, without the line none comes.
    let (frames, wrong) = (pins.column("seen"), pins.column("wrong"));
    assert_eq!((frames[19] - frames[0], wrong[19]), (19.0, 0.0));
    assert!(wrong[60] - wrong[20] > 20.0 && frames[60] - frames[20] < 20.0, "{frames:?}, {wrong:?}");
    assert_eq!((frames[99], wrong[99]), (frames[62], wrong[62]));
}

#[test]
fn mistakes_are_found_before_the_circuit_is_compiled() {
    let folder = direct();
    let says = |from: &str, to: &str, text: &str| {
        let (file, other) = (PLANT.to_owned(), "\ni_ref = [[0, 2], [0.002, 4]]");
        assert!(file.contains(from), "{from}");
        // The host has one port, which has one source.
        let file = if to.contains("i_ref") { file.replace(other, "") } else { file };
        folder.write("wrong.toml", file.replace(from, to));
        let done = sim(&folder, &format!("{TARGET} --plant wrong.toml --periods 3"));
        assert!(done.status == Some(1) || done.status == Some(2), "{done:?}");
        // A message is folded to the terminal's width, and has the place on a line of its own.
        let shown = done.stderr.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(shown.contains(text), "{text}: {}", done.stderr);
    };
    says(
        "scale = 0.6826666666666666 }\ndb",
        "scale = 1 }\ndb",
        "write `da = { port = \"da\", scale = 0.6826667, offset = 0 }`",
    );
    says("da = { port = \"da\"", "da = { port = \"other\"", "`other`, which no peripheral of the wiring has");
    says("port = \"ci\"", "port = \"i_ref\"", "which is no register of a peripheral");
    says("port = \"n\"", "port = \"steps\"", "of the kind `step`, which has no device");
    says("port = \"n\"", "port = \"seen\"", "a signal feeds `position`");
    says("scale = 5000", "scale = 5000, offset = 200000", "its register `value` has -125000 to 125000");
    says(
        "scale = 5000",
        "scale = 5000, limits = [-2e5, 2e5]",
        "are beyond the register `value` of `current`",
    );
    says("i_ref = [[0, 2], [0.002, 4]]", "wrong = 0", "the input port `i_ref` has no source");
    let pins = |line: &str, text: &str| says("[inputs]", &format!("[pins]\n{line}\n[inputs]"), text);
    pins("angel = 1", "no input pin `angel`; did you mean `angle`?");
    pins("\"bridge.high_a\" = 1", "`bridge.high_a` is an output pin");
    pins("clock = 1", "no input pin `clock`");
    pins(
        "\"clock.step\" = { signals = [\"angel\"], above = 1 }",
        "the plant `dc_motor_switched` has no sensor `angel`; did you mean `angle`?",
    );
    for (more, text) in [
        ("--plant motor.toml --axis a,b,1", "cannot be used with"),
        ("--plant motor.toml --robot", "cannot be used with"),
        ("--plant motor.toml --inputs in.csv", "cannot be used with"),
        ("--periods 3", "--plant"),
        ("--plant motor.toml --set angle=1", "no input pin `angle`"),
        ("--plant motor.toml --connect x=n", "has no signal `x`"),
        ("--plant none.toml", "none.toml"),
    ] {
        let done = sim(&folder, &format!("{TARGET} {more}"));
        assert!(done.status != Some(0) && done.stderr.contains(text), "{more}: {done:?}");
    }
}
