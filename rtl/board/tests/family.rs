// SPDX-License-Identifier: MIT OR Apache-2.0
//! Fictitious family: other memories, no memory in look-up tables, no PLL, no tools. A board with it exports and simulates like any
//! other, and missing features are reported before a tool starts.

use std::fmt::Write as _;
use std::path::Path;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_board::build::{self, BuildError};
use takt_board::simulation::Simulation;
use takt_board::top::{self, Circuit, TopError};
use takt_board::{Board, Wiring};
use takt_family::{Cells, Constraints, Family, Part, Pinout, Resources, Sites};
use takt_isa::memory::{BlockRam, Memories, Shape};
use takt_isa::{Program, T1};
use takt_rtl::export::on_family;

const BLINK: &str = include_str!("../../../programs/examples/blink.s");

const BOARD: &str = r#"
name = "breadboard"
text = "A board that nobody sells"
source = "this test"
part = "MU-200"
package = "DIP40"
grade = 3
standard = "5V"
[clock]
site = "1"
mhz = 25.0
[uart]
send = "2"
receive = "3"
[pins]
lamp = "17"
drive = "18"
"#;

/// Wiring with 25 cycles per microsecond and periods of 500 cycles.
const WIRING: &str = r#"
board = "breadboard"
clock = 25
period = 20
baud = 1_000_000
host = 0
autostart = true
[signals]
drive = "drive"
[peripheral.lamp]
kind = "digital-out"
pins = { out = "lamp" }
ports = { level = "lamp" }
"#;

const fn room(flip_flops: u64, block_rams: u64) -> Option<Resources> {
    Some(Resources { luts: 20_000, carries: None, flip_flops, multipliers: 16, block_rams })
}

const MADE_UP: Family = Family {
    name: "made_up",
    text: "Made-up fabric",
    parts: &[
        Part { name: "MU-50", tool: "", room: room(20_000, 50) },
        Part { name: "MU-100", tool: "", room: room(1_000, 200) },
        Part { name: "MU-200", tool: "", room: room(20_000, 200) },
    ],
    grades: (1, 3),
    // The general module under the family's name: it must replace the other, and the circuit still run.
    modules: &[("takt_bank.v", include_str!("../../core/takt_bank.v"))],
    memories: Memories {
        block: BlockRam {
            shapes: &[Shape { words: 128, bits: 32 }, Shape { words: 512, bits: 8 }],
            is_initial: true,
        },
        logic: None,
    },
    lut: "LUT3",
    cells_per_flip_flop: None,
    multiplier: [9, 9],
    carry: None,
    initial_registers: true,
    oscillator: None,
    flash_clock: None,
    cells: Cells { luts: &[], carries: &[], flip_flops: &[], multipliers: &[], block_rams: &[] },
    pll: None,
    synthesis: None,
    place: None,
    pack: None,
    models: None,
    bank: None,
    board: Some(Pinout {
        packages: &["DIP40"],
        standards: &["5V"],
        sites: Sites { form: "a number from 1 to 40", is_site },
        file: "pins.txt",
        constraints,
    }),
    flow: None,
};

static FAMILY: Family = MADE_UP;
static FAMILIES: &[&Family] = &[&FAMILY];

fn is_site(site: &str) -> bool {
    site.parse().is_ok_and(|number: u8| (1..=40).contains(&number))
}

fn constraints(of: &Constraints<'_>) -> String {
    let mut text = format!("{} {} MHz\n", of.clock.0, of.clock.1);
    for pin in &of.pins {
        let _ = writeln!(text, "{} {} {:?} {}", pin.site, pin.port, pin.pull, of.standard);
    }
    text
}

fn blink() -> Program {
    let loader = MemoryLoader::new(&[("blink.s", BLINK)]);
    let options = Options { machine: &T1, ..Options::default() };
    assemble("blink.s", &loader, &options).unwrap_or_else(|errors| panic!("{}", errors.render(false))).program
}

fn board(text: &str) -> Board {
    Board::read_among("breadboard.toml", text, FAMILIES).unwrap_or_else(|mistakes| panic!("{mistakes:?}"))
}

fn wiring(text: &str, board: &Board) -> Wiring {
    Wiring::read("wiring.toml", text, board).unwrap_or_else(|mistakes| panic!("{mistakes:?}"))
}

fn circuit(board: &Board, clock: &str) -> Result<Circuit, TopError> {
    top::circuit(board, &wiring(&WIRING.replace("clock = 25", clock), board), &blink())
}

#[test]
fn a_board_of_a_new_family_blinks() {
    let board = board(BOARD);
    let wiring = wiring(WIRING, &board);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("family");
    let files = circuit(&board, "clock = 25").unwrap_or_else(|error| panic!("{error}")).files;
    let mut simulation = Simulation::of(&on_family(&files, board.family), &board, &wiring, &folder)
        .unwrap_or_else(|error| panic!("{error}"));
    // From edge to edge of the lamp, 500 periods of 500 cycles.
    let mut next_edge = |was: bool| {
        for _ in 0..40 {
            let before = simulation.cycles;
            simulation.run(10_000, &[]).expect("it runs");
            let (level, high) = simulation.output("lamp_out").expect("a pin");
            if level != was {
                return before + u64::from(if was { high } else { 10_000 - high });
            }
        }
        panic!("the lamp stays {was}");
    };
    let edges = [next_edge(false), next_edge(true), next_edge(false)];
    assert_eq!([edges[1] - edges[0], edges[2] - edges[1]], [250_000; 2]);
}

#[test]
fn the_export_has_the_familys_modules_and_pins() {
    let board = board(BOARD);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("family-export");
    let circuit = build::write(&board, &wiring(WIRING, &board), &blink(), &folder)
        .unwrap_or_else(|error| panic!("{error}"));
    let names: Vec<&str> = circuit.files.iter().map(|file| file.name.as_str()).collect();
    assert!(names.contains(&"made_up/takt_bank.v") && !names.contains(&"core/takt_bank.v"), "{names:?}");
    let text = std::fs::read_to_string(folder.join("pins.txt")).expect("the constraints");
    let expected = "clk_in 25 MHz\n1 clk_in None 5V\n2 uart_send None 5V\n3 uart_receive Up 5V\n18 signal_drive None 5V\n17 lamp_out None 5V\n";
    assert_eq!(text, expected);
}

#[test]
fn a_family_without_tools_makes_no_bitstream() {
    let error = build::packages(&board(BOARD)).expect_err("no tools");
    assert!(matches!(error, BuildError::NoTools(family) if family.text == "Made-up fabric"), "{error}");
    assert!(
        error.to_string().contains("Takt knows no open-source tools for Made-up fabric: write the Verilog"),
        "{error}"
    );
}

#[test]
fn reports_missing_device_features_first() {
    let refused =
        |board: &Board, clock: &str| circuit(board, clock).expect_err("it lacks something").to_string();
    let small = |part: &str| board(&BOARD.replace("MU-200", part));
    // Block RAMs of 4 kbit in place of 18: program 6 of 2048 words, data 8, and so on.
    let said = refused(&small("MU-50"), "clock = 25");
    assert!(said.starts_with("the program needs ") && said.ends_with("; the MU-50 has 50"), "{said}");
    let said = refused(&small("MU-100"), "clock = 25");
    let expected = "the program needs 1280 flip-flops at least for output ports and return stacks, as Made-up fabric has no memory in look-up tables; the MU-100 has 1000";
    assert_eq!(said, expected);
    let said = refused(&board(BOARD), "clock = 50");
    assert_eq!(
        said,
        "no PLL of Made-up fabric is known to Takt: the clock is that of the board, `clock = 25`, and not 50 MHz"
    );
}

/// A family is rejected if its block RAM has no initial contents, or its registers have no initial values.
#[test]
fn a_family_that_starts_empty_is_refused() {
    static EMPTY: Family = Family {
        memories: Memories { block: BlockRam { is_initial: false, ..MADE_UP.memories.block }, logic: None },
        ..MADE_UP
    };
    static ANY: Family = Family { initial_registers: false, ..MADE_UP };
    let of = |family: &'static Family| Board { family, ..board(BOARD) };
    let said = |board: &Board| circuit(board, "clock = 25").expect_err("it cannot start").to_string();
    assert!(said(&of(&EMPTY)).starts_with("block RAM of Made-up fabric starts without contents"));
    assert!(said(&of(&ANY)).contains("the board needs a reset button"));
    let reset = format!("{BOARD}[reset]\nsite = \"40\"\nlevel = 1\n");
    circuit(&Board { family: &ANY, ..board(&reset) }, "clock = 25").expect("a reset button is enough");
}

#[test]
fn a_boards_file_is_checked_against_its_family() {
    let mistakes = |text: &str| {
        let mistakes = Board::read_among("b.toml", text, FAMILIES).expect_err("it is wrong");
        mistakes.iter().map(|mistake| mistake.text.clone()).collect::<Vec<_>>()
    };
    let wrong = BOARD.replace("DIP40", "BGA9").replace("grade = 3", "grade = 4").replace("\"17\"", "\"A17\"");
    assert_eq!(
        mistakes(&wrong),
        [
            "there is no package `BGA9`; there are DIP40",
            "`grade` must be a whole number from 1 to 3, not 4",
            "`A17` is not a site; a site is a number from 1 to 40",
        ]
    );
    // The rest of a file with an unknown device is still read.
    let unknown = BOARD.replace("MU-200", "MU-9").replace("mhz = 25.0", "mhz = 1");
    let found = mistakes(&unknown);
    assert_eq!(found[0], "there is no device `MU-9`; there are MU-50, MU-100, MU-200");
    assert_eq!(found.len(), 2, "{found:?}");
}
