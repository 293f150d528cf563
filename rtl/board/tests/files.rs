// SPDX-License-Identifier: MIT OR Apache-2.0
//! Boards and wirings as files: values read from valid files, and mistakes found in invalid ones.

use takt_asm::{MemoryLoader, Options, assemble};
use takt_board::kind::KINDS;
use takt_board::{Board, Mistake, VERILOG, Wiring, model};
use takt_isa::Program;

fn ulx3s() -> Board {
    Board::from_name("ulx3s-85f").expect("it is there").expect("its file is right")
}

/// The mistakes in a wiring, a line for each.
fn mistakes_in(text: &str) -> Vec<String> {
    let result = Wiring::read("robot.toml", text, &ulx3s());
    result.expect_err("a mistake").iter().map(Mistake::to_string).collect()
}

const RIGHT: &str = r#"
board = "ulx3s-85f"
clock = 50
period = 400.0
lead = 5
autostart = true
deadlines = 3
host = 100
baud = 1_000_000

[signals]
drive = "gp10"
stop = "gn10"

[peripheral.encoder]
kind = "quadrature"
pins = { a = "gp0", b = "gn0", index = "gp1" }
filter = 4
ports = { count = "n", errors = "bad" }

[peripheral.motor]
kind = "pwm"
pins = { high = "gp2", low = "gn2" }
half = 1000
dead = 25
ports = { duty = "force" }
scale = { duty = 8 }
"#;

const PROGRAM: &str = "
.input n:int bad:int
.output force
.period
period:
        itof    force, n
        wait period
";

fn program(source: &str) -> Program {
    let loader = MemoryLoader::new(&[("p.s", source)]);
    assemble("p.s", &loader, &Options::default()).expect("the program assembles").program
}

#[test]
fn builtin_boards_are_right() {
    let boards = Board::builtin().expect("their files are right");
    assert_eq!(boards.len(), Board::names().count());
    for (board, name) in boards.iter().zip(Board::names()) {
        assert_eq!(board.name, name);
        let pins = board.pins.len();
        assert!(!board.source.is_empty(), "{name}: expected a source");
        assert!(pins >= 16, "{name}: expected at least 16 pins, found {pins}");
    }
    // The files name the sources of these facts.
    let board = ulx3s();
    assert_eq!((board.clock.0.as_str(), board.clock.1, board.grade), ("G2", 25.0, 6));
    assert_eq!((board.send.as_str(), board.receive.as_str()), ("L4", "M1"));
    assert_eq!(
        (board.site("gp0"), board.site("gn3"), board.site("nothing")),
        (Some("B11"), Some("C10"), None)
    );
}

/// A wiring without a UART.
const ALONE: &str = r#"
period = 400.0
autostart = true
uart = false

[peripheral.encoder]
kind = "quadrature"
pins = { a = "gp0", b = "gn0" }
ports = { count = "n" }
"#;

#[test]
fn nothing_is_for_a_host_without_a_uart() {
    let wiring = Wiring::read("robot.toml", ALONE, &ulx3s()).expect("it is right");
    assert_eq!((wiring.uart, wiring.autostart, wiring.observe), (false, true, false));
    let starts = "without a UART nobody starts the program: `uart = false` needs `autostart = true`";
    for (what, by, place, says) in [
        ("autostart = true\n", "", "3:1", starts),
        ("autostart = true", "autostart = false", "3:13", starts),
        ("uart", "observe = true\nuart", "4:1", "`observe` is for a host"),
        ("uart", "baud = 1_000_000\nuart", "4:1", "`baud` is for a host"),
        ("uart", "host = 3\nuart", "4:1", "`host` is for a host"),
        ("[peripheral.encoder]", "[scope]\n[peripheral.encoder]", "6:", "`scope` is for a host"),
    ] {
        let said = mistakes_in(&ALONE.replacen(what, by, 1));
        let [said] = &said[..] else { panic!("{by}: {said:?}") };
        assert!(said.contains(says) && said.contains(&format!("robot.toml:{place}")), "{by}: {said}");
    }
}

#[test]
fn a_second_core_is_a_few_cycles_later() {
    let of = |more: &str| Wiring::read("robot.toml", &format!("{ALONE}\n{more}"), &ulx3s());
    let delay = |more: &str| of(more).unwrap_or_else(|mistakes| panic!("{mistakes:?}")).safety.second_core;
    assert_eq!(delay(""), None);
    assert_eq!(delay("[second_core]\n"), Some(2));
    assert_eq!(delay("[second_core]\ndelay = 4\n"), Some(4));
    for (more, place, says) in [
        ("[second_core]\ndelay = 0\n", "12:9", "`delay`"),
        ("[second_core]\ndelay = 5\n", "12:9", "`delay`"),
        ("[second_core]\nlater = 2\n", "12:1", "`later`"),
    ] {
        let said = of(more).expect_err(more);
        let [said] = &said[..] else { panic!("{more}: {said:?}") };
        let said = said.to_string();
        assert!(said.contains(says) && said.contains(&format!("robot.toml:{place}")), "{more}: {said}");
    }
}

#[test]
fn every_kind_has_a_module_and_a_model() {
    for kind in KINDS {
        let file = format!("{}.v", kind.module);
        assert!(
            VERILOG.iter().any(|(name, _)| *name == file),
            "{file} is missing: write it in rtl/board/verilog/, and list it in VERILOG, rtl/board/src/lib.rs"
        );
        let defaults = kind.parameters.iter().map(|parameter| parameter.default);
        // A kind on a carrier takes half the carrier's period, too.
        let parameters: Vec<u32> = defaults.chain([1000]).collect();
        assert!(
            model::of(kind, &parameters).is_some(),
            "`{}` has no model: write it in rtl/board/src/model/, and name it in `of`",
            kind.name
        );
    }
}

#[test]
fn system_is_read() {
    let wiring = Wiring::read("robot.toml", RIGHT, &ulx3s()).expect("it is right");
    assert_eq!((wiring.clock, wiring.period, wiring.lead, wiring.baud), (50.0, 20_000, 250, 1_000_000));
    assert_eq!((wiring.autostart, wiring.deadlines, wiring.host), (true, 3, 100));
    assert_eq!(wiring.peripherals[0].parameters, [4, 0]);
    assert_eq!(wiring.peripherals[1].parameters, [1000, 25, 1]);
    assert_eq!(
        wiring.peripherals[1].writes[0].as_ref().map(|w| (w.port.as_str(), w.scale)),
        Some(("force", Some(3)))
    );
    assert_eq!(wiring.at("gn2").as_deref(), Some("motor.low"));
    assert_eq!((wiring.at("gp10").as_deref(), wiring.at("gp9")), (Some("drive"), None));
    wiring.check("robot.toml", RIGHT, &program(PROGRAM)).expect("the program has its ports");
}

/// A system in place of a wiring is a single error, instead of an error for each of its keys.
#[test]
fn a_system_is_no_wiring() {
    let said = mistakes_in(include_str!("../../../programs/three/controller.toml"));
    assert_eq!(said.len(), 1, "{said:?}");
    assert!(said[0].contains("found a system of several cores"), "{said:?}");
}

/// Replacements, and the mistake that each replacement makes.
const WRONG: &[(&str, &str, &str)] = &[
    (
        "board = \"ulx3s-85f\"",
        "board = \"icepi-zero\"",
        "2:9: this wiring is for the board `icepi-zero`, not for `ulx3s-85f`",
    ),
    ("gn0", "gp0", "17:25: pin `gp0` is used twice: line 17 has it for `encoder`"),
    ("high = \"gp2\"", "high = \"gp10\"", "23:17: pin `gp10` is used twice: line 12 has it for `drive`"),
    (
        "gp2",
        "gp99",
        "23:17: `gp99` is not a pin of ulx3s-85f; it has gp0, gn0, gp1, gn1, gp2, gn2 … (59 in all: `takt board pins ulx3s-85f`)",
    ),
    (
        "\"pwm\"",
        "\"servo\"",
        "22:8: `servo` is not a kind of peripheral; there are quadrature, step, pwm, pwm3, trip, sigma-delta, spi, ssi, biss-c, sinc3, hall, digital-in, digital-out",
    ),
    ("half = 1000", "half = 0", "24:8: `half` must be a whole number from 1 to 65535, not 0"),
    (
        "dead = 25",
        "death = 25",
        "25:1: `death` is not a key of `motor`; there are dead, half, kind, pins, ports, scale, signed, trips",
    ),
    (
        "duty = 8",
        "duty = 10",
        "27:18: a scale is a power of two from 2^-60 to 2^60, as 0.5, 1 or 16, not 10: multiply by the rest in the program",
    ),
    ("scale = { duty", "scale = { force", "27:11: `force` is not a register of a pwm that a program writes"),
    ("high = \"gp2\", ", "", "23:8: `high` is missing in [pins]"),
    ("period = 400.0", "period = 0.1", "4:10: 0.1 µs are 5 cycles of 50 MHz; expected 64 to 1073741824"),
    ("lead = 5", "lead = 400", "5:8: `lead` must be shorter than the period"),
    (
        "1_000_000",
        "11_000_000",
        "9:8: 11000000 baud are 4.55 cycles of 50 MHz; that must be 4 to 65535, within 2 % of a whole number",
    ),
    ("period = 400.0", "", "1:1: `period` is missing in the file"),
    ("autostart = true", "autostart = 1", "6:13: `autostart` must be true or false, not 1"),
    ("clock = 50", "clock =", "3:8: "),
];

#[test]
fn mistakes_name_their_place() {
    for (what, by, expected) in WRONG {
        assert!(RIGHT.contains(what), "{what}");
        let said = mistakes_in(&RIGHT.replacen(what, by, 1));
        assert!(
            said.iter().any(|said| said.starts_with(&format!("robot.toml:{expected}"))),
            "{what}: {said:#?}"
        );
    }
    // All mistakes are reported at once, in order.
    let text = RIGHT.replace("half = 1000", "half = 0").replace("gn0", "gp0");
    assert_eq!(mistakes_in(&text).len(), 2);
}

/// The example of a wiring with a carrier.
const DRIVE: &str = include_str!("../../../programs/examples/board/drive.toml");

#[test]
fn carriers_are_read() {
    let wiring = Wiring::read("drive.toml", DRIVE, &ulx3s()).unwrap_or_else(|wrong| panic!("{wrong:?}"));
    assert_eq!((wiring.period, wiring.tick_positions(0)), (3000, Some(vec![102])));
    let text =
        DRIVE.replace("half = 1500 ", "frequency = 20 ").replace("tick = \"valley\"", "tick = \"both\"");
    let text = text + "\n[carrier.second]\nhalf = 1500\nphase = 0.25\n[carrier.third]\nhalf = 500\n";
    let wiring = Wiring::read("drive.toml", &text, &ulx3s()).unwrap_or_else(|wrong| panic!("{wrong:?}"));
    let positions = [0, 1, 2].map(|carrier| wiring.tick_positions(carrier));
    // A quarter of a period behind is three quarters ahead.
    let expected = [vec![102, 1602], vec![2352, 852], vec![102, 602]];
    assert_eq!((wiring.period, positions), (1500, expected.map(Some)));
}

#[test]
fn mistakes_about_carriers_name_their_place() {
    for (what, by, expected) in [
        ("half = 1500 ", "half = 7 ", "14:8: `half` must be a whole number from 8 to 65535, not 7"),
        (
            "half = 1500 ",
            "",
            "13:10: `main` has neither `half`, half a period in cycles, nor `frequency` in kHz",
        ),
        ("half = 1500 ", "frequency = 5000 ", "14:13: 5000 kHz are 6 cycles of 60 MHz for half a period"),
        ("half = 1500 ", "half = 1500\nfrequency = 20 ", "15:13: `half` already determines the period"),
        ("tick = \"valley\"", "tick = \"crest\"", "15:8: `tick` must be \"valley\", \"peak\" or \"both\""),
        ("tick = \"valley\" ", "", "16:9: `after` applies to ticks, but this carrier has no `tick`"),
        (
            "after = 1.7",
            "after = 50",
            "16:9: `after` is 3000 cycles; it must be less than 3000, the cycles between two places",
        ),
        (
            "tick = \"valley\" ",
            "every = 2\ntick = \"both\" ",
            "15:9: with `tick = \"both\"` each place has a tick: `every` must be 1, not 2",
        ),
        (
            "clock = 60 ",
            "clock = 60\nperiod = 50 ",
            "6:10: the carrier `main` gives a tick every 3000 cycles: leave out `period`",
        ),
        ("carrier = \"main\"", "carrier = \"mian\"", "20:11: `mian` is not a carrier; there are main"),
        ("carrier = \"main\"", "", "18:13: `carrier` is missing in `bridge`"),
        (
            "update = \"now\"",
            "update = \"soon\"",
            "24:10: `update` must be one of \"now\", \"valley\", \"peak\", \"either\", not \"soon\"",
        ),
        ("\"driver\"]", "\"pilot\"]", "26:25: `pilot` is not a trip; there are overcurrent, driver"),
        (
            "starts = \"main.valley\"",
            "starts = \"main.middle\"",
            "35:10: `main.middle` is not a place of a carrier; there are `main.valley` and `main.peak`",
        ),
        (
            "starts = \"main.valley\"",
            "starts = \"valley\"",
            "35:10: `starts` must be \"lead\", \"publish\", or a place of a carrier",
        ),
        (
            "starts = \"main.valley\"",
            "shift = 1",
            "35:9: `shift` moves a place of a carrier, and `starts` names no place",
        ),
    ] {
        assert!(DRIVE.contains(what), "{what}");
        let said = mistakes_in(&DRIVE.replacen(what, by, 1));
        let is_it = |said: &String| said.contains(expected);
        assert!(said.iter().any(is_it), "{what}: {said:#?}");
    }
}

#[test]
fn ports_must_be_the_programs() {
    let wiring = Wiring::read("robot.toml", RIGHT, &ulx3s()).expect("it is right");
    let report = |source: &str| {
        let mistakes = wiring.check("robot.toml", RIGHT, &program(source)).expect_err("a mistake");
        mistakes.iter().map(Mistake::to_string).collect::<Vec<_>>().join("\n")
    };
    assert_eq!(
        report(&PROGRAM.replace("bad", "worse")),
        "robot.toml:19:33: the program has no input port `bad`; there are n, worse"
    );
    let other = report(".input a\n.output b\n.period\np: mov b, a\n wait p\n");
    let first = "robot.toml:1:1: this wiring belongs to another program: of its 3 ports 3 are not those of this program";
    assert_eq!(other.lines().next(), Some(first), "{other}");
    let float = PROGRAM.replace("n:int", "n").replace("itof    force, n", "fadd force, n, n");
    assert!(report(&float).contains("19:19: input port `n` is a float"), "{}", report(&float));
    let integer = PROGRAM.replace("force\n", "force:int\n").replace("itof    force, n", "mov force, n");
    assert!(
        report(&integer).contains("26:18: output port `force` is an integer, which is not scaled"),
        "{}",
        report(&integer)
    );
    let unscaled = RIGHT.replace("scale = { duty = 8 }", "");
    let wiring = Wiring::read("robot.toml", &unscaled, &ulx3s()).expect("it is right");
    let mistakes = wiring.check("robot.toml", &unscaled, &program(PROGRAM)).expect_err("a mistake");
    assert!(mistakes[0].text.contains("`scale` says how many"), "{mistakes:?}");
}

#[test]
fn a_site_is_taken_once() {
    let text = include_str!("../boards/icepi-zero.toml");
    let mistakes = Board::read("mine.toml", &text.replace("gpio3 = \"R2\"", "gpio3 = \"M1\""))
        .expect_err("M1 is the clock");
    assert!(
        mistakes[0].to_string().ends_with("site M1 is taken: line 14 has it for the clock"),
        "{mistakes:?}"
    );
    let mistakes =
        Board::read("mine.toml", &text.replace("\"LFE5U-25F\"", "\"iCE40\"")).expect_err("no such part");
    assert!(
        mistakes[0].text.contains("there is no device `iCE40`; there are LFE5U-25F, LFE5U-45F, ")
            && mistakes[0].text.contains(", GW2A-18, "),
        "{mistakes:?}"
    );
}

/// The tables in the documents equal the tables in the code; `TAKT_BLESS=1` writes the tables in the documents.
#[test]
fn documents_have_the_tables() {
    for (name, heading, rows) in [
        ("board.md", "| kind | pins |", takt_board::kind::markdown()),
        ("protocol.md", "| address | register |", takt_board::protocol::markdown()),
    ] {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs").join(name);
        let text = std::fs::read_to_string(&path).expect("the document");
        let heading = text.find(heading).expect("the table's heading");
        let begin = heading + text[heading..].match_indices('\n').nth(1).expect("its two lines").0 + 1;
        let end = begin + text[begin..].find("\n\n").map_or(text.len() - begin, |end| end + 1);
        if std::env::var_os("TAKT_BLESS").is_some() {
            let text = format!("{}{rows}{}", &text[..begin], &text[end..]);
            std::fs::write(&path, text).expect("the document can be written");
        } else {
            assert_eq!(text[begin..end], rows, "{name}: TAKT_BLESS=1 writes the table");
        }
    }
}
