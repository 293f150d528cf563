// SPDX-License-Identifier: MIT OR Apache-2.0
//! Boards whose cores have error correction: no pin changes, wrong bits are corrected and counted, and a wrong word that cannot be corrected
//! makes the outputs safe.

use crate::second_core::is_safe_before_a_pin_is_wrong;
use crate::system::ulx3s;
use crate::top::{WIRING, have_the_same_pins, runs_talks_and_fails_safe, safe, target};
use std::path::Path;
use takt_board::simulation::Simulation;
use takt_board::{Board, Host, Wiring, top};
use takt_isa::Program;

/// The wiring of [`top`](crate::top) with error correction.
fn wiring() -> Wiring {
    let text = WIRING.replace("[signals]", "ecc = true\n\n[signals]");
    Wiring::read("wiring.toml", &text, &ulx3s()).expect("a right wiring")
}

/// The board with a change in a module of its core.
fn changed(
    board: &Board,
    program: &Program,
    folder: &Path,
    module: &str,
    from: &str,
    to: &str,
) -> Simulation {
    let wiring = wiring();
    let mut files = top::circuit(board, &wiring, program).expect("a circuit").files;
    let file = files.iter_mut().find(|file| file.base() == module).expect("a module");
    assert_eq!(file.text.matches(from).count(), 1, "{from}");
    file.text = file.text.replace(from, to);
    Simulation::of(&files, board, &wiring, folder).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_board_runs_talks_and_fails_safe_with_error_correction() {
    let (board, _, program, folder) = target("board-ecc");
    let wiring = wiring();
    let sim = Simulation::new(&board, &wiring, &program, &folder).unwrap_or_else(|error| panic!("{error}"));
    runs_talks_and_fails_safe(sim, &wiring, &program);
}

/// Cycle by cycle, all pins are those of the board without, also if each word of the program memory has a wrong bit; the host reads
/// that words were corrected.
#[test]
fn words_are_corrected_and_counted() {
    let (board, alone, program, folder) = target("board-ecc-pins");
    let start = |wiring: &Wiring, name: &str| {
        let sim = Simulation::new(&board, wiring, &program, &folder.join(name));
        sim.unwrap_or_else(|error| panic!("{error}"))
    };
    let mut right = [start(&alone, "without"), start(&wiring(), "with")];
    have_the_same_pins(&mut right);
    let [without, with] = right;
    let (from, to) = ("{stored_check, stored}", "{stored_check, stored} ^ 1");
    let wrong = changed(&board, &program, &folder.join("wrong"), "takt_ecc_program.v", from, to);
    let mut both = [start(&alone, "without"), wrong];
    have_the_same_pins(&mut both);
    let [_, wrong] = both;
    for (sim, expected) in [(without, 0), (with, 0), (wrong, 255)] {
        let mut host = Host::connect(sim, 3).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(host.status().expect("status").corrections(), expected);
    }
}

/// A value with a wrong parity makes the outputs safe before a pin shows what the program computes from it; the host reads the cause.
#[test]
fn a_wrong_word_makes_outputs_safe() {
    let (board, _, program, folder) = target("board-ecc-wrong");
    let (from, to) =
        ("{^input_write_value[31:24],", "{^input_write_value[31:24] ^ (input_write_value == 32'd6),");
    let right = Simulation::new(&board, &wiring(), &program, &folder.join("right")).expect("it starts");
    let mut both = [right, changed(&board, &program, &folder.join("wrong"), "takt_source.v", from, to)];
    is_safe_before_a_pin_is_wrong(&mut both, "a wrong parity");
    let [_, mut wrong] = both;
    assert!(safe(&mut wrong));
    let mut host = Host::connect(wrong, 3).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(host.status().expect("status").causes().collect::<Vec<_>>(), ["memory error"]);
    let reasons = host.safe_reasons(None).expect("it answers");
    assert_eq!(reasons, ["memory error: a word of a memory was wrong and could not be corrected"]);
}
