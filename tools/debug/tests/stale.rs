// SPDX-License-Identifier: MIT OR Apache-2.0
//! Stale values: every display of a value older than the current line would read carries a note.

use std::sync::Arc;
use takt_asm::{AssembledProgram, MemoryLoader, Options as AsmOptions, assemble};
use takt_debug::console::Console;
use takt_debug::session::{Options, Session};
use takt_isa::{F3, Register};

/// `b` is in flight while the following lines are current, and `c` is computed late.
const STALE: &str = "\
.schedule on
.input a
.output y
.array M[2,3] = 11, 12, 13, 21, 22, 23
.reg b c
.once
   y = 0
   wait p
.period
p: b = a*2.0
   c = b*b
   y = c + b
   wait p
";

fn assembled(source: &str) -> AssembledProgram {
    let options = AsmOptions { machine: &F3, ..AsmOptions::default() };
    assemble("a.s", &MemoryLoader::new(&[("a.s", source)]), &options)
        .unwrap_or_else(|errors| panic!("{}", errors.render(false)))
}

fn console(source: &str) -> Console {
    let assembled = assembled(source);
    let debug = assembled.debug_info();
    let row = |value: f32| vec![(assembled.program.inputs[0].register, value.to_bits())];
    let rows: Vec<Vec<(Register, u32)>> = [1.0, 10.0, 3.0, 4.0].map(row).to_vec();
    let options = Options {
        inputs: Some(Arc::new(rows)),
        constants: debug.constants,
        sources: debug.sources,
        names: debug.names,
        ..Options::default()
    };
    Console::new(Session::new(&assembled.program, options).unwrap())
}

/// Calls `visit` with a console in each cycle of the second period in which `b` is in flight.
fn in_flight(mut visit: impl FnMut(&mut Console)) {
    let mut console = console(STALE);
    console.execute("goto period 2").unwrap();
    let mut seen = 0;
    for _ in 0..12 {
        console.execute("step cycle").unwrap();
        let text = console.execute("print b").unwrap_or_default();
        if text.contains("a new value is in flight") {
            seen += 1;
            visit(&mut console);
        }
    }
    assert!(seen > 0, "`b` was never in flight");
}

#[test]
fn expression_over_a_value_in_flight_has_a_note() {
    in_flight(|console| {
        for expression in ["b*1", "a + b", "b + b", "-b", "sqrt(b)", "M[1,1] + b", "(b)"] {
            let text = console.execute(&format!("print {expression}")).unwrap();
            assert!(text.contains("b: a new value is in flight, "), "{expression}: {text}");
            assert_eq!(text.matches("in flight").count(), 1, "{text}");
        }
        // Current values have no note.
        for expression in ["a", "a*2", "M[1,1]", "cycle", "3"] {
            assert!(!console.execute(&format!("print {expression}")).unwrap().contains("in flight"));
        }
    });
}

#[test]
fn every_command_that_shows_a_value_has_the_note() {
    in_flight(|console| {
        for (line, expected) in [
            ("display b*1", true),
            ("display a", false),
            ("check b*0 == 0", true),
            ("watch b*1", true),
            ("ulp b, a", true),
            ("registers b", true),
            ("registers y", false),
        ] {
            let text = console.execute(line).unwrap();
            assert_eq!(text.contains("a new value is in flight"), expected, "{line}: {text}");
        }
        console.execute("delete").unwrap();
        let text = console.execute("check b*0 == 1").unwrap_err();
        assert!(text.contains("a new value is in flight"), "{text}");
        let panes = console.panes();
        assert!(panes.displays.iter().any(|(name, value)| name == "b*1" && value.contains("in flight")));
        let row = panes.registers.iter().find(|row| row.name == "b").unwrap();
        assert!(row.value().starts_with('~') && row.every_way().contains("in flight"), "{row:?}");
        let row = panes.inputs.iter().find(|row| row.name == "a").unwrap();
        assert!(!row.value().starts_with('~') && row.note.is_none(), "{row:?}");
        console.execute("display").unwrap();
    });
}

/// A condition reads results in flight, just as its line does.
#[test]
fn a_condition_reads_results_in_flight() {
    // `d` needs neither operand of the condition, and issues before they arrive.
    let source =
        STALE.replace("   y = c + b\n", "   y = c + b\n   d = a + 1.0\n").replace(".reg b c", ".reg b c d");
    for (condition, period) in [("b == 20.0", 2), ("b == 6.0", 3), ("b == 8.0", 4)] {
        let mut console = console(&source);
        console.execute("goto period 1").unwrap();
        console.execute(&format!("break :14 if {condition}")).unwrap();
        let text = console.execute("continue").unwrap();
        // Over several periods, the session stops in the right one or reports that the condition could not be evaluated.
        let stopped = text.contains("stop 1: break :14") && console.session().period() == period - 1;
        assert!(stopped || text.contains("stop 1 was passed, its condition reads an old value"), "{text}");
    }
}

#[test]
fn an_array_is_printed_whole() {
    let mut console = console(STALE);
    let text = console.execute("print M").unwrap();
    let names: Vec<&str> = text.lines().map(|line| line.split(" = ").next().unwrap()).collect();
    assert_eq!(names, ["M[1,1]", "M[1,2]", "M[1,3]", "M[2,1]", "M[2,2]", "M[2,3]"]);
    assert!(text.lines().last().unwrap().starts_with("M[2,3] = 23"), "{text}");
}
