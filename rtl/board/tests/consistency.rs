// SPDX-License-Identifier: MIT OR Apache-2.0
//! Numbers of a wiring that are each in range, but do not fit each other: the report gives each number's place and figures, and a fix.

use takt_asm::{MemoryLoader, Options, assemble};
use takt_board::{Board, Findings, Mistake, Wiring};
use takt_isa::Program;

const WIRING: &str = r#"
board = "ulx3s-85f"
clock = 50
period = 100
lead = 10
host = 10
baud = 1_000_000

[peripheral.adc]
kind = "spi"
pins = { clock = "gp0", select = "gn0", in = "gp1", out = "gn1" }
half = 4
bits = 16
ports = { received = "x", send = "z" }
scale = { send = 16 }

[peripheral.encoder]
kind = "quadrature"
pins = { a = "gp2", b = "gn2", index = "gp3" }
ports = { at_index = "n" }

[peripheral.motor]
kind = "pwm"
pins = { high = "gp4", low = "gn4" }
half = 1250
dead = 25
ports = { duty = "y" }
scale = { duty = 2048 }
"#;

fn program(source: &str) -> Program {
    let loader = MemoryLoader::new(&[("p.s", source)]);
    assemble("p.s", &loader, &Options::default())
        .unwrap_or_else(|errors| panic!("{}", errors.render(false)))
        .program
}

/// A program whose period takes a few cycles, besides a loop of `turns` turns.
fn source(turns: u32) -> String {
    format!(
        ".input x:int, n:int\n.output y, z\n.reg f g\n.period\np: itof f, x\n .for i, 1, {turns}\n fadd f, f, f\n .endfor\n itof g, n\n fmul y, f, g\n mov z, y\n wait p\n"
    )
}

fn findings(text: &str, source: &str) -> Findings {
    findings_of(text, &program(source))
}

fn findings_of(text: &str, program: &Program) -> Findings {
    let board = Board::from_name("ulx3s-85f").unwrap().unwrap();
    let wiring = Wiring::read("w.toml", text, &board).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
    wiring.check("w.toml", text, program).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
    wiring.findings("w.toml", text, program, &[takt_analysis::bound(program).ok()])
}

fn lines(mistakes: &[Mistake]) -> Vec<String> {
    mistakes.iter().map(Mistake::to_string).collect()
}

#[test]
fn consistent_wirings_have_no_report() {
    assert_eq!(findings(WIRING, &source(10)), Findings::default());
}

/// Each replacement makes a single error, whose beginning is in the table.
#[test]
fn impossible_combinations_are_errors() {
    for (what, by, expected) in [
        (
            "half = 4\n",
            "half = 160\n",
            "w.toml:12:1: starts of frames are lost: a frame of `adc` takes 5280 cycles: half · (2 · bits + 1), and one starts every 5000 cycles: `half = 151` at most",
        ),
        ("dead = 25", "dead = 250\nsigned = 0", ""),
        (
            "half = 1250\ndead = 25\nports = { duty = \"y\" }\nscale = { duty = 2048 }",
            "half = 100\ndead = 200\nports = { duty = \"y\" }\nscale = { duty = 64 }",
            "w.toml:26:1: no pulse is longer than the dead time",
        ),
        (
            "duty = 2048",
            "duty = 4096",
            "w.toml:28:11: with a scale of 4096, all above 3.052e-1 is beyond what `duty` holds, 1250, and is cut off: 2048 at most",
        ),
        ("send = 16 }", "send = 131072 }", "w.toml:15:11: with a scale of 131072"),
        (", in = \"gp1\"", "", "w.toml:14:11: `received` needs the pin `in` of `adc`"),
        (", out = \"gn1\"", "", "w.toml:14:27: `send` needs the pin `out` of `adc`"),
        (", index = \"gp3\"", "", "w.toml:20:11: `at_index` needs the pin `index` of `encoder`"),
        (
            "host = 10\nbaud = 1_000_000",
            "host = 1\nbaud = 500_000",
            "w.toml:6:1: no host is fast enough: 1 periods are 100.00 µs, and a request takes 160.00 µs at 500000 baud: `host = 2` or more",
        ),
    ] {
        assert!(WIRING.contains(what), "{what}");
        let found = findings(&WIRING.replacen(what, by, 1), &source(10));
        let errors = lines(&found.mistakes);
        if expected.is_empty() {
            assert_eq!(errors, Vec::<String>::new(), "{by}");
        } else {
            assert!(errors.len() == 1 && errors[0].starts_with(expected), "{by}: {errors:#?}");
        }
        assert!(found.late.is_empty(), "{found:?}");
    }
}

#[test]
fn lossy_combinations_are_warnings() {
    for (what, by, expected) in [
        (
            "lead = 10\n",
            "lead = 2\n",
            "w.toml:5:1: `received` is a period old at each tick: a frame of `adc` takes 132 cycles: half · (2 · bits + 1), and starts 100 cycles before the tick: `lead = 2.66` or more",
        ),
        ("lead = 10\n", "", "w.toml:11:1: `received` is a period old"),
        ("half = 4\n", "half = 16\n", "w.toml:5:1: `received` is a period old"),
        ("half = 4\n", "half = 150\nstarts = \"publish\"\n", "w.toml:12:1: `received` is a period old"),
        (
            "half = 1250",
            "half = 2501",
            "w.toml:25:1: duties are lost: a period of `motor` takes 2 · half = 5002 cycles, and the program writes one every 5000: `half = 2500` at most, or `period = 100.04` or more",
        ),
    ] {
        assert!(WIRING.contains(what), "{what}");
        let found = findings(&WIRING.replacen(what, by, 1), &source(10));
        let warnings = lines(&found.warnings);
        assert!(warnings.len() == 1 && warnings[0].starts_with(expected), "{by}: {warnings:#?}");
        assert!(found.mistakes.is_empty() && found.late.is_empty(), "{found:?}");
    }
    // A wiring whose numbers are just short enough has no findings.
    let text = WIRING.replace("lead = 10", "lead = 2.66");
    assert_eq!(findings(&text, &source(10)), Findings::default());
    assert_eq!(findings(&WIRING.replace("half = 1250", "half = 2500"), &source(10)), Findings::default());
}

#[test]
fn a_program_that_misses_its_ticks_is_named() {
    let found = findings(WIRING, &source(2000));
    let late = lines(&found.late);
    assert!(late.len() == 1 && late[0].starts_with("w.toml:4:1: every tick is missed"), "{found:#?}");
    // The longer of two paths through the period misses the tick, the shorter does not.
    let source = ".input x:int, n:int\n.output y, z\n.reg f g c:int\n.period\np: itof f, x\n itof g, n\n ilt c, x, n\n bnz c, short\n .for i, 1, 2000\n fadd f, f, f\n .endfor\nshort: fmul y, f, g\n mov z, y\n wait p\n";
    let found = findings(WIRING, source);
    let warnings = lines(&found.warnings);
    assert!(found.late.is_empty(), "{found:#?}");
    assert!(warnings.len() == 1 && warnings[0].starts_with("w.toml:4:1: a tick can be missed"), "{found:#?}");
}

#[test]
fn the_shipped_wirings_fit() {
    let text = include_str!("../../../programs/examples/board/position.toml");
    let source = include_str!("../../../programs/examples/board/position.s");
    assert_eq!(findings(text, source), Findings::default());
}

#[test]
fn a_direct_trip_is_for_half_bridges() {
    let text = WIRING.replace("dead = 25", "dead = 25\ntrips = [\"comparator\"]")
        + "[peripheral.comparator]\nkind = \"trip\"\npins = { in = \"gp5\" }\nfilter = 0\ndirect = 1\n";
    let found = findings(&text.replace("lead = 10", "lead = 2.66"), &source(10));
    let expected = "w.toml:34:1: `direct` acts on half bridges of a `pwm3`: `motor` is safe 3 cycles after the pin's edge";
    assert_eq!(lines(&found.warnings), [expected]);
    assert!(found.mistakes.is_empty() && found.late.is_empty(), "{found:?}");
}

/// The example of a drive, and replacements in its wiring, each with the error that it makes.
#[test]
fn what_does_not_fit_a_carrier_is_an_error() {
    let text = include_str!("../../../programs/examples/board/drive.toml");
    let drive = program(include_str!("../../../programs/examples/board/drive.s"));
    assert_eq!(findings_of(text, &drive), Findings::default());
    for (what, by, expected) in [
        (
            "half = 3 ",
            "half = 4 ",
            "33:1: `received` is a period old at each tick: a frame of `current_a` takes 132 cycles: half · (2 · bits + 1), and starts 102 cycles before the tick: `after` greater by 0.52 µs or more, or a smaller `half`",
        ),
        (
            "half = 3 ",
            "half = 91 ",
            "33:1: starts of frames are lost: a frame of `current_a` takes 3003 cycles",
        ),
        ("half = 1500 ", "half = 60 ", "13:10: every tick is missed"),
        (
            "dead = 30               # cycles: 0.5 µs\nminimum = 30",
            "dead = 800\nminimum = 701",
            "22:1: no pulse is left: `dead` and `minimum` leave out all below 1501 cycles",
        ),
        (
            "filter = 6",
            "filter = 6\ndirect = 1",
            "55:1: `overcurrent` takes switches off without a clock, so no filter of 6 cycles: `filter = 0`, or no `direct`",
        ),
        (
            "scale = { a = 2048",
            "scale = { a = 8192",
            "28:11: with a scale of 8192, all above 3.662e-1 is beyond what `a` holds, 3000, and is cut off: 4096 at most",
        ),
        (
            "[peripheral.bridge]",
            "[carrier.other]\nhalf = 700\n[peripheral.bridge]",
            "18:10: `other` does not divide the tick: its period is 1400 cycles, and that of `main`, which gives the ticks, is 3000",
        ),
        (
            "latch = \"main.valley\"",
            "latch = \"main.valley\"\nshift = 1.75",
            "49:1: `encoder` captures its registers 3 cycles after the tick, while they are copied to input ports, up to 5 cycles after it",
        ),
    ] {
        assert!(text.contains(what), "{what}");
        let found = findings_of(&text.replacen(what, by, 1), &drive);
        let errors = lines(&[found.mistakes.clone(), found.late.clone()].concat());
        assert!(
            errors.iter().any(|error| error.starts_with(&format!("w.toml:{expected}"))),
            "{by}: {errors:#?}"
        );
        assert!(found.warnings.is_empty(), "{found:#?}");
    }
    // An update at the peak, where the period's length just decides: the shorter path reaches it, the longer one does not.
    let source = ".input ca:int, cb:int, n:int, tripped:int\n.output da, db, dc\n.reg f c:int\n.period\np: itof f, ca\n ilt c, ca, cb\n bnz c, short\n .for i, 1, 4\n fadd f, f, f\n .endfor\nshort: mov da, f\n mov db, f\n mov dc, f\n wait p\n";
    let bounds = takt_analysis::bound(&program(source)).expect("bounds");
    let span = bounds.sections.iter().find(|section| !section.once).expect("a period").cycles;
    assert!(span.best + 2 < span.worst, "{span:?}");
    let after = 1500 - 2 - (span.best + span.worst) / 2 - 26;
    let text = text
        .replace("after = 1.7 ", &format!("after = {} ", after as f64 / 60.0))
        .replace("update = \"now\"", "update = \"peak\"");
    let errors = lines(&findings(&text, source).mistakes);
    assert!(
        errors.len() == 1 && errors[0].contains(": an update can be missed: the duties come "),
        "{errors:#?}"
    );
    let text = text.replace("update = \"peak\"", "update = \"now\"");
    assert_eq!(findings(&text, source), Findings::default());
}
