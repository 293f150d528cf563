// SPDX-License-Identifier: MIT OR Apache-2.0
//! LinuxCNC's component, `tools/linuxcnc/hal_takt.c`, without LinuxCNC: compiled with a program that calls it as the servo thread does, at an
//! emulated board with the hybrid robot. With LinuxCNC: `cargo xtask linuxcnc`.
#![cfg(unix)]

use crate::common::{Folder, SimulatedBoard, source};
use std::process::Command;
use std::time::{Duration, Instant};

/// The component in a program of its own.
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

/// What the component says, on both of its outputs.
fn drive(folder: &Folder, port: &str, timeout: u32) -> (String, String) {
    let mut harness = Command::new(folder.path().join("harness"));
    let done = harness.args([port, "3000000", &timeout.to_string()]).output().expect("it is compiled");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&done.stdout), text(&done.stderr))
}

fn number(said: &str, name: &str) -> f64 {
    let mut words = said.split_whitespace().skip_while(|word| *word != name);
    words.nth(1).and_then(|word| word.parse().ok()).unwrap_or_else(|| panic!("no {name}: {said}"))
}

/// Periods that a board records after the drive has ended; then it writes the file.
const AFTER: usize = 100;
/// The time that it may take for this, after its host has ended.
const PATIENCE: Duration = Duration::from_secs(60);

/// Rows of what the board has recorded: whether it drove, and whether a motor's pin was 1.
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
    // 5 mm in 0.2 s, with the errors of a robot that accelerates.
    assert!((number(&said, "moved") - 5.0).abs() < 1e-3, "{said}");
    let error = number(&said, "error");
    assert!(error > 1e-4 && error < 0.02, "{said}");
    assert_eq!(number(&said, "knots"), 220.0);
    // A second time, from where it stands.
    let (said, errors) = drive(&folder, &board.port, 30_000);
    assert_eq!((errors.as_str(), number(&said, "code")), ("", 0.0), "{said}");
    assert!((number(&said, "moved") - 5.0).abs() < 1e-3, "{said}");
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
        // At once, or after the 300 periods for which the wiring waits for the host, less those since its last request.
        let after = last + 1 - rows.iter().position(|(drives, _)| *drives).expect("it drove");
        let expected = if code == 1.0 { 1250..=1300 } else { 999..=1000 };
        assert!(expected.contains(&after), "{option}: it drove for {after} periods");
        assert!(rows.len() > last + 90, "{option}: {} of {}", last, rows.len());
        assert!(rows[last + 2..].iter().all(|(_, is_lit)| !is_lit), "{option}: pins are 0");
    }
}

#[test]
fn what_cannot_be_served_is_refused() {
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
    refused(&alone, 1, "emulated is one with a system of several cores");
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
