// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt board selftest`: the kit's files, its report from a simulated board with and without wires, and refusals.
#![cfg(unix)]

use crate::common::{Folder, RunOutput, SimulatedBoard};
use serde_json::Value;

const SIM: &str = "board sim --wiring selftest.toml --program selftest.s";
const WIRES: &str = "--wire pulse.high=pulses.in --wire words.out=words.in";

/// A folder with the kit of t1 for a board; the line is faster than a real one's, to simulate fewer cycles.
fn kit() -> Folder {
    let folder = Folder::new();
    let text = folder.line("board selftest --board ulx3s-85f --machine t1 -o . --sources").ok();
    assert!(text.contains("wire from gp0 to gn0, which may be left out: PWM\n"), "{text}");
    assert!(text.contains("the top level is takt_board.v"), "{text}");
    let wiring = folder.read_text("selftest.toml").replace("baud = 1000000", "baud = 5_000_000");
    folder.write("selftest.toml", wiring);
    folder
}

fn test(folder: &Folder, board: &SimulatedBoard, options: &str) -> RunOutput {
    folder.line(&format!("board selftest --port {} --rounds 128 {options}", board.port))
}

#[test]
fn a_simulated_board_passes_and_a_wrong_wire_is_named() {
    let folder = kit();
    let board = SimulatedBoard::start(&format!("{SIM} {WIRES}"), folder.path());
    let done = test(&folder, &board, "--report report.txt");
    assert_eq!(done.status, Some(0), "{done:?}");
    for line in [
        "board       ulx3s-85f: ",
        "machine     t1 at 25 MHz, circuit 0x",
        "recurrence  same: fdiv fsqrt\n",
        "sine        same: fsin fcos\n",
        "from tick to outputs, as expected; 0 deadlines missed\n",
        "line        0 errors, ",
        "words       14 of 14: SPI from gp1 to gn1\n",
        ": PWM from gp0 to gn0\n",
        "result      right, as far as it was run\n",
    ] {
        assert!(done.stdout.contains(line), "{line}: {}", done.stdout);
    }
    assert!(!done.stdout.contains("DIFFERENT") && !done.stdout.contains("not wired"), "{}", done.stdout);
    assert_eq!(folder.read_text("report.txt"), done.stdout);
    assert!(done.stderr.contains("send report.txt in as an issue of the project"), "{}", done.stderr);

    let done = test(&folder, &board, "--json");
    assert_eq!((done.status, done.stderr.as_str()), (Some(0), ""), "{done:?}");
    let report: Value = serde_json::from_str(&done.stdout).unwrap();
    let digests = report["digests"].as_array().unwrap();
    assert!(digests.len() > 20 && digests.iter().all(|digest| digest["same"] == true), "{report}");
    assert_eq!(
        (&report["right"], &report["wires"]["words"]["right"]),
        (&true.into(), &true.into()),
        "{report}"
    );

    // Another kit, program and port.
    let wiring = folder.read_text("selftest.toml");
    folder
        .write("selftest.toml", wiring.replace("half = 100", "half = 50").replace("period = ", "period = 1"));
    let refused = test(&folder, &board, "");
    let says = "the board does not carry this hardware kit: its register `period` has ";
    assert!(refused.status == Some(1) && refused.stderr.contains(says), "{refused:?}");
    folder.write("selftest.toml", wiring.replace("baud", "uart = false\nautostart = true\n#"));
    let refused = test(&folder, &board, "");
    assert!(refused.status == Some(1) && refused.stderr.contains("the wiring has no UART"), "{refused:?}");
    drop(board);
    folder.write("selftest.toml", wiring);

    let board = SimulatedBoard::start(SIM, folder.path());
    let done = test(&folder, &board, "");
    assert_eq!(done.status, Some(0), "{done:?}");
    assert!(done.stdout.contains("pulses      not wired: PWM from gp0 to gn0\n"), "{}", done.stdout);
    assert!(done.stdout.contains("words       not wired: SPI from gp1 to gn1\n"), "{}", done.stdout);
    drop(board);

    let board = SimulatedBoard::start(&format!("{SIM} --wire words.clock=pulses.in"), folder.path());
    let done = test(&folder, &board, "");
    assert_eq!((done.status, done.stderr.as_str()), (Some(1), ""), "{done:?}");
    let wrong = done.stdout.contains("pulses      DIFFERENT: ");
    assert!(wrong && done.stdout.ends_with("result      NOT RIGHT\n"), "{}", done.stdout);
}

#[test]
fn wrong_boards_ports_and_wires_are_refused() {
    let folder = kit();
    for (line, status, says) in [
        ("board selftest --board nothing -o other --sources", 1, "there is no board `nothing`"),
        ("board selftest", 2, "--board <BOARD>"),
        (
            "board selftest --port /dev/nothing -o other",
            1,
            "there is no other/selftest.toml: -o names the folder of the kit",
        ),
        ("board selftest --port /dev/nothing", 1, "cannot open /dev/nothing: is the board plugged in"),
        ("board selftest --port /dev/nothing --rounds 3", 2, "3 is not in 64..=1073741824"),
        ("board selftest --board ulx3s-85f --json", 2, "--port <PORT>"),
        ("board selftest --port /dev/nothing --sources", 2, "cannot be used with"),
    ] {
        let done = folder.line(line);
        assert_eq!(done.status, Some(status), "{line}: {done:?}");
        assert!(done.stderr.contains(says) && done.stdout.is_empty(), "{line}: {}", done.stderr);
    }
    for (wire, says) in [
        ("pulse.high", "`pulse.high` is not `output=input`"),
        ("pulse.hih=pulses.in", "no output pin `pulse.hih`; did you mean `pulse.high`?"),
        ("pulse.high=pulse.high", "`pulse.high` is an output pin"),
        ("pulse.high=pulses --wire words.out=pulses.in", "another wire leads to `pulses.in`"),
        ("pulse.high=pulses.in --set pulses.in=1", "no input pin `pulses.in`"),
    ] {
        let done = folder.line(&format!("{SIM} --wire {wire}"));
        assert!(done.status == Some(1) && done.stderr.contains(says), "{wire}: {done:?}");
    }
    // A port that nobody answers at.
    let terminal = takt_board::terminal::Terminal::new().unwrap();
    let done = folder.line(&format!("board selftest --port {}", terminal.path().display()));
    assert!(done.status == Some(1) && done.stderr.contains("no answer in 8 attempts"), "{done:?}");
}
