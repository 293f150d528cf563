// SPDX-License-Identifier: MIT OR Apache-2.0
//! Boards of families that cores are not measured on: their circuits, constraints and clocks, without tools.

use takt_asm::{MemoryLoader, Options, assemble};
use takt_board::top::{self, Circuit, TopError};
use takt_board::{Board, Wiring};
use takt_isa::{Program, T1};

const BLINK: &str = include_str!("../../../programs/examples/blink.s");

fn blink() -> Program {
    let loader = MemoryLoader::new(&[("blink.s", BLINK)]);
    let options = Options { machine: &T1, ..Options::default() };
    assemble("blink.s", &loader, &options).unwrap_or_else(|errors| panic!("{}", errors.render(false))).program
}

fn board(name: &str) -> Board {
    Board::from_name(name).expect("a board").unwrap_or_else(|mistakes| panic!("{mistakes:?}"))
}

/// Circuit of a lamp at a board's first pin, at a clock in MHz.
fn circuit(name: &str, clock: f64) -> Result<Circuit, TopError> {
    let board = board(name);
    let (pin, _) = &board.pins[0];
    let text = format!(
        "board = \"{name}\"\nclock = {clock}\nperiod = 100\n[peripheral.lamp]\nkind = \"digital-out\"\npins = {{ out = \"{pin}\" }}\nports = {{ level = \"lamp\" }}\n"
    );
    let wiring = Wiring::read("wiring.toml", &text, &board).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
    top::circuit(&board, &wiring, &blink())
}

/// Each board with a clock that its PLL makes: the PLL's cell, and the lamp's line in the constraints.
const CIRCUITS: [(&str, f64, &str, &str); 6] = [
    ("tang-primer-20k", 54.0, "rPLL", "IO_LOC \"lamp_out\" T6;"),
    ("tang-nano-20k", 81.0, "rPLL", "IO_LOC \"lamp_out\" 27;"),
    ("tang-primer-25k", 80.0, "PLLA", "IO_LOC \"lamp_out\" G11;"),
    ("gatemate-evb", 25.0, "CC_PLL", "NET \"lamp_out\" Loc = \"IO_NB_A4\";"),
    ("olimex-gatemate", 20.0, "CC_PLL", "NET \"lamp_out\" Loc = \"IO_EA_A4\";"),
    (
        "crosslink-nx-evn",
        12.0,
        "assign clk    = clk_in;",
        "ldc_set_location -site {D10} [get_ports lamp_out]",
    ),
];

#[test]
fn boards_of_other_families_have_circuits() {
    for (name, clock, pll, place) in CIRCUITS {
        let circuit = circuit(name, clock).unwrap_or_else(|error| panic!("{name}: {error}"));
        let top = circuit.files.iter().find(|file| file.name == "takt_board.v").expect("a top");
        assert!(top.text.contains(pll), "{name}: no {pll} in\n{}", top.text);
        let (_, pins) = &circuit.pins;
        assert!(pins.lines().any(|line| line == place), "{name}: no {place} in\n{pins}");
    }
}

#[test]
fn impossible_clocks_and_designs_are_refused_before_a_tool_starts() {
    let refused = |name: &str, clock: f64| circuit(name, clock).expect_err("it is impossible").to_string();
    assert_eq!(
        refused("tang-nano-20k", 100.0),
        "the PLL cannot make 100 MHz from 27; the nearest are 99 and 100.2857"
    );
    assert!(refused("crosslink-nx-evn", 24.0).starts_with("no PLL of Lattice CrossLink-NX is known to Takt"));
    // Blocks of 4 kbit: t1 is for larger devices.
    let said = refused("icebreaker", 12.0);
    assert!(said.starts_with("the program needs ") && said.ends_with("; the iCE40UP5K has 30"), "{said}");
}

/// The example for small devices: source, machine, and the boards' wirings with the PLL's cell and a line of the constraints.
const SERVO: &str = include_str!("../../../programs/examples/board/step/servo.s");
const SMALL: &str = include_str!("../../../programs/examples/board/step/machine.toml");
const SMALL_BOARDS: [(&str, &str, &str, &str); 2] = [
    (
        "icebreaker",
        include_str!("../../../programs/examples/board/step/icebreaker.toml"),
        "SB_PLL40_PAD",
        "set_io motor_high 47",
    ),
    (
        "tang-nano-9k",
        include_str!("../../../programs/examples/board/step/tang-nano-9k.toml"),
        "assign clk    = clk_in;",
        "IO_LOC \"motor_high\" 29;",
    ),
];

/// A board without a host has no UART, and an image that has just the room for the program.
#[test]
fn small_devices_have_circuits_without_a_host() {
    let loader = MemoryLoader::new(&[("servo.s", SERVO), ("machine.toml", SMALL)]);
    let servo = assemble("servo.s", &loader, &Options::default())
        .unwrap_or_else(|errors| panic!("{}", errors.render(false)))
        .program;
    for (name, text, pll, place) in SMALL_BOARDS {
        let board = board(name);
        let wiring = Wiring::read("w.toml", text, &board).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
        wiring.check("w.toml", text, &servo).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
        let circuit = top::circuit(&board, &wiring, &servo).unwrap_or_else(|error| panic!("{name}: {error}"));
        let top = circuit.files.iter().find(|file| file.name == "takt_board.v").expect("a top");
        assert!(top.text.contains(pll), "{name}: no {pll} in\n{}", top.text);
        let (_, pins) = &circuit.pins;
        assert!(pins.lines().any(|line| line == place), "{name}: no {place} in\n{pins}");
        assert!(!pins.contains("uart") && !top.text.contains("uart"), "{name}");
        assert!(
            circuit.files.iter().all(|file| !file.name.contains("uart") && !file.name.contains("bridge"))
        );
        assert!(circuit.records <= circuit.room && circuit.room < 2 * circuit.records, "{name}");
    }
}
