// SPDX-License-Identifier: MIT OR Apache-2.0
//! LinuxCNC's component `tools/linuxcnc/hal_takt.c`, compiled without LinuxCNC into a program that calls it like the servo thread, on an
//! emulated board with the hybrid robot. With LinuxCNC itself: `cargo evidence linuxcnc`.
#![cfg(unix)]

use crate::common::{Folder, SimulatedBoard, source};
use std::process::Command;
use std::time::{Duration, Instant};

/// Compiles the component into a test program.
fn harness(folder: &Folder) {
    let sources = format!("{}/tests/clients/linuxcnc", env!("CARGO_MANIFEST_DIR"));
    let done = Command::new("cc")
        .args(["-std=gnu11", "-O1", "-Wall", "-Wextra", "-Werror", "-I", &sources])
        .args([&format!("{sources}/harness.c"), "-lm", "-o", "harness"])
        .current_dir(folder.path())
        .output()
        .expect("there is a C compiler");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
}

fn board(more: &str) -> String {
    let (wiring, system) = (source("followed_board.toml"), source("followed.toml"));
    format!("board sim --robot --serve --wiring {wiring} --program {system} {more}")
}

/// Runs the component; returns its messages from standard output and standard error.
fn drive(folder: &Folder, port: &str, timeout: u32) -> (String, String) {
    drive_with(folder, port, timeout, &[])
}

/// Runs the component with parameters, in the form that `loadrt` passes.
fn drive_with(folder: &Folder, port: &str, timeout: u32, parameters: &[&str]) -> (String, String) {
    let mut harness = Command::new(folder.path().join("harness"));
    let harness = harness.args([port, "3000000", &timeout.to_string()]).args(parameters);
    let done = harness.output().expect("it is compiled");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&done.stdout), text(&done.stderr))
}

fn number(said: &str, name: &str) -> f64 {
    let mut words = said.split_whitespace().skip_while(|word| *word != name);
    words.nth(1).and_then(|word| word.parse().ok()).unwrap_or_else(|| panic!("no {name}: {said}"))
}

/// Number of periods that a board records after the drive, before it writes the file.
const AFTER: usize = 100;
/// Time limit for the recording after the host has ended.
const PATIENCE: Duration = Duration::from_secs(60);

/// Recorded rows: whether the outputs drove, and whether a motor's pin was 1.
fn recorded(folder: &Folder) -> Vec<(bool, bool)> {
    let begin = Instant::now();
    loop {
        let rows = rows(&folder.read_text("sim.csv"));
        let last = rows.iter().rposition(|(drives, _)| *drives);
        if last.is_some_and(|last| rows.len() >= last + AFTER) || begin.elapsed() > PATIENCE {
            return rows;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn rows(text: &str) -> Vec<(bool, bool)> {
    let row = |line: &str| {
        let words: Vec<&str> = line.split(',').collect();
        (words[1] == "1", words[words.len() - 1] == "1")
    };
    text.lines().skip(1).filter(|line| line.split(',').count() == 13).map(row).collect()
}

#[test]
fn the_component_drives_the_robot() {
    let folder = Folder::new();
    harness(&folder);
    let board = SimulatedBoard::start(&board("--emulated"), folder.path());
    let (said, errors) = drive(&folder, &board.port, 30_000);
    assert_eq!(errors, "");
    for name in ["code", "starved", "skipped", "misses"] {
        assert_eq!(number(&said, name), 0.0, "{said}");
    }
    // 5 mm in 0.2 s, with the errors of an accelerating robot.
    assert!((number(&said, "moved") - 5.0).abs() < 1e-3, "{said}");
    let error = number(&said, "error");
    assert!(error > 1e-4 && error < 0.02, "{said}");
    assert_eq!(number(&said, "knots"), 220.0);
    // A second drive, which starts at the current position.
    let (said, errors) = drive(&folder, &board.port, 30_000);
    assert_eq!((errors.as_str(), number(&said, "code")), ("", 0.0), "{said}");
    assert!((number(&said, "moved") - 5.0).abs() < 1e-3, "{said}");
}

const HYBRID: &str = "--joints LLLRR --geometry hybrid \
    --counts 2.5e-7,2.5e-7,2.5e-7,2.3968449810713143e-5,2.3968449810713143e-5";

#[test]
fn the_robots_hal_file_is_written_by_a_command() {
    let (wiring, system) = (source("followed_board.toml"), source("followed.toml"));
    let line = format!("board hal --wiring {wiring} --program {system} {HYBRID}");
    let file = format!("{}/../linuxcnc/takt.hal", env!("CARGO_MANIFEST_DIR"));
    let written = Folder::new().line(&line).ok();
    assert_eq!(
        std::fs::read_to_string(file).unwrap(),
        written,
        "tools/linuxcnc/takt.hal is stale: takt {line}"
    );
}

/// The same component drives a system with other addresses at the host, given the parameters that `takt board hal` writes.
#[test]
fn another_system_needs_no_c() {
    let folder = Folder::new();
    harness(&folder);
    let text = std::fs::read_to_string(source("followed.toml")).unwrap();
    let program = |name: &str| format!("program = \"{}\"", source(name));
    let text = text.replace("program = \"interpolation.s\"", &program("interpolation.s"));
    let text = text.replace("program = \"tracking.s\"", &program("tracking.s"));
    let first = "[[wire]]\nfrom = \"host.n1\"\nto = \"interpolation.n1\"";
    assert!(text.contains(first));
    // Place one more host value before the snapshot.
    let more = "[[wire]]\nfrom = \"interpolation.pop\"\nto = \"host.taken\"\n\n";
    folder.write("other.toml", text.replace(first, &format!("{more}{first}")));
    let wiring = source("followed_board.toml");
    let hal = folder.line(&format!("board hal --wiring {wiring} --program other.toml {HYBRID}")).ok();
    let load = hal.lines().find(|line| line.starts_with("loadrt hal_takt")).expect("it loads the component");
    let parameters: Vec<&str> = load.split(' ').skip(2).filter(|word| !word.contains("=[TAKT]")).collect();
    assert!(parameters.contains(&"measured=0x3406"), "{load}");
    let line = format!("board sim --robot --serve --emulated --wiring {wiring} --program other.toml");
    let board = SimulatedBoard::start(&line, folder.path());
    let (said, errors) = drive_with(&folder, &board.port, 30_000, &parameters);
    assert_eq!((errors.as_str(), number(&said, "code")), ("", 0.0), "{said}");
    assert!((number(&said, "moved") - 5.0).abs() < 1e-3, "{said}");
    // Encoders without conversion: arms of 893 mm, and two angles.
    let direct = ["joints=LLLRR", "geometry=direct", "counts=2.5e-7:2.5e-7:2.5e-7:1e-5:1e-5"];
    let (said, errors) = drive_with(&folder, &board.port, 30_000, &direct);
    assert_eq!(errors, "");
    assert_eq!(number(&said, "starts").round(), 893.0, "{said}");
}

#[test]
fn parameters_that_do_not_fit_are_refused() {
    let folder = Folder::new();
    harness(&folder);
    for (parameter, says) in [
        ("joints=LLX", "takt: `joints` has 1 to 7 letters, L or R\n"),
        ("counts=1:2", "takt: `counts` has a number for each joint, with colons between them\n"),
        ("every=0", "takt: `every` is 1 to 4095 periods, `servo` us\n"),
        ("geometry=delta", "takt: `geometry` is `direct` or `hybrid`\n"),
        ("joints=RLLRR", "takt: the geometry `hybrid` has joints LLL, and others behind them\n"),
    ] {
        let said = drive_with(&folder, "/dev/null", 100, &[parameter]);
        assert_eq!(said, (String::new(), says.to_owned()), "{parameter}");
    }
    let (wiring, system) = (source("followed_board.toml"), source("followed.toml"));
    for (arguments, says) in [
        ("--joints LLX --counts 1,1,1", "L for a linear joint and R for a rotary one"),
        ("--joints LL --counts 1", "--counts has 1 sizes, but --joints has 2 letters"),
        ("--joints LL --counts 1,0", "expected a finite size other than 0 in m or rad, found 0"),
        ("--joints LR --counts 1,1 --geometry hybrid", "the first three joints must be linear"),
        (
            "--joints LLLR --counts 1,1,1,1",
            "the value that must follow `measured.m4` at the host is not next to it",
        ),
        ("--joints LLLRRR --counts 1,1,1,1,1,1", "the system has no value `n6` at the host"),
        (
            "--joints LLLRR --counts 1,1,1,1,1 --servo 950",
            "is 1 to 4095 periods of the board, and one of these takes 100 µs",
        ),
    ] {
        let line = format!("board hal --wiring {wiring} --program {system} {arguments}");
        let done = folder.line(&line);
        assert!(done.stderr.contains(says), "{arguments}: {}", done.stderr);
    }
}

#[test]
fn faults_end_in_safe_outputs_and_a_message() {
    for (option, timeout, code, says) in [
        ("--unplug-at 1000", 400, 1.0, "takt: the board does not answer: nothing for 400 ms at /dev/pts/"),
        ("--stop-at 1000", 30_000, 3.0, "takt: the board has stopped its outputs: stop; outputs are safe"),
    ] {
        let folder = Folder::new();
        harness(&folder);
        let board =
            SimulatedBoard::start(&board(&format!("--emulated --record sim.csv {option}")), folder.path());
        let (said, errors) = drive(&folder, &board.port, timeout);
        assert_eq!(number(&said, "code"), code, "{option}: {said}{errors}");
        assert!(errors.starts_with(says), "{option}: {errors}");
        let rows = recorded(&folder);
        assert!(rows.len() > 1000, "{option}: {}", rows.len());
        let last = rows.iter().rposition(|(drives, _)| *drives).expect("it drove");
        // The outputs become safe at once, or after the wiring's timeout of 300 periods, less those since the host's last request.
        let after = last + 1 - rows.iter().position(|(drives, _)| *drives).expect("it drove");
        let expected = if code == 1.0 { 1250..=1300 } else { 999..=1000 };
        assert!(expected.contains(&after), "{option}: it drove for {after} periods");
        assert!(rows.len() > last + 90, "{option}: {} of {}", last, rows.len());
        assert!(rows[last + 2..].iter().all(|(_, is_lit)| !is_lit), "{option}: pins are 0");
    }
}

#[test]
fn rejects_unsupported_configurations() {
    let folder = Folder::new();
    harness(&folder);
    for (port, says) in [
        ("/dev/null", "takt: cannot open /dev/null at 3000000 baud: Inappropriate ioctl for device\n"),
        ("/dev/none", "takt: cannot open /dev/none at 3000000 baud: No such file or directory\n"),
    ] {
        assert_eq!(drive(&folder, port, 100), (String::new(), says.to_owned()));
    }
    let refused = |line: &str, status: i32, says: &str| {
        let done = folder.line(line);
        assert!(done.status == Some(status) && done.stderr.contains(says), "{line}: {done:?}");
    };
    let alone = format!(
        "board sim --robot --serve --emulated --wiring {} --program {}",
        source("board.toml"),
        source("tracking.s")
    );
    refused(&alone, 1, "--emulated is for systems of several cores");
    refused(&board("--record sim.csv --emulated").replace(" --serve", ""), 2, "--serve");
    refused(&board("--emulated --unplug-at x"), 2, "--unplug-at");
    refused(&board("--emulated --record none/sim.csv"), 1, "cannot write none/sim.csv");
    let wiring = std::fs::read_to_string(source("followed_board.toml")).unwrap();
    folder.write("wiring.toml", wiring.replace("stop = \"gn20\"", ""));
    let system = source("followed.toml");
    let line =
        format!("board sim --robot --serve --emulated --stop-at 5 --wiring wiring.toml --program {system}");
    refused(&line, 1, "--stop-at: the wiring has no pin for the signal `stop`, under [signals]");
}
