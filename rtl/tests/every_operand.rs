// SPDX-License-Identifier: MIT OR Apache-2.0
//! Units with one operand, for all 2³² of it: hours for those that take an operation only every so many cycles, so not among
//! the usual tests.
//!
//! ```text
//! cargo test --release -p takt-rtl --test suite -- --ignored --nocapture every_operand::sine
//! TAKT_RANGE=0x39800000..0x43c90fdb cargo test …       # part of them
//! ```

use crate::harness::{Request, Simulation, circuit, library};
use std::ops::Range;
use takt_isa::{Op, UNITS};

/// The operands that `TAKT_RANGE` asks for; all if it does not.
fn range() -> Range<u64> {
    let Ok(text) = std::env::var("TAKT_RANGE") else { return 0..1 << 32 };
    let number = |text: &str| u64::from_str_radix(text.trim_start_matches("0x"), 16).ok();
    let parsed = text.split_once("..").and_then(|(start, end)| Some(number(start)?..number(end)?));
    parsed.filter(|range| range.start < range.end && range.end <= 1 << 32).unwrap_or_else(|| {
        panic!("TAKT_RANGE is {text:?}, not two hexadecimal numbers like 0x3f800000..0x40000000")
    })
}

fn every_operand(unit: &str, op: Op) {
    let row = UNITS.iter().find(|row| row.name == unit).expect("a unit of the table");
    let library = library();
    let circuit = circuit(&library, row).unwrap_or_else(|error| panic!("{error}"));
    let code =
        circuit.operations.iter().find(|operation| operation.op == op).expect("one of its operations").code;
    let check = |range: Range<u64>| {
        let mut simulation = Simulation::new(&library, &circuit).unwrap_or_else(|error| panic!("{error}"));
        let mut requests = Vec::new();
        for start in range.clone().step_by(1 << 20) {
            requests.clear();
            // The second operand does not matter.
            let request = |a| Request { op, code, sources: [a, !a, a], idle: 0 };
            requests.extend((start..range.end.min(start + (1 << 20))).map(|a| request(a as u32)));
            simulation.check(&requests).unwrap_or_else(|error| panic!("{error}"));
        }
    };
    let range = range();
    let middle = range.start.midpoint(range.end);
    std::thread::scope(|scope| {
        scope.spawn(|| check(range.start..middle));
        check(middle..range.end);
    });
}

macro_rules! tests {
    ($($name:ident: $unit:ident $op:ident, $time:literal;)*) => {
        $(
            #[test]
            #[ignore = $time]
            fn $name() {
                every_operand(stringify!($unit), Op::$op);
            }
        )*
    };
}

tests! {
    sine: sine fsin, "takes half an hour";
    cosine: sine fcos, "takes half an hour";
    arccosine: arccosine facos, "takes hours";
    root: recurrence fsqrt, "takes hours";
    divroot: divroot fsqrt, "takes half an hour";
    to_float: convert itof, "takes a quarter of an hour";
    to_integer: convert ftoi, "takes a quarter of an hour";
    to_float_small: addmul itof, "takes a quarter of an hour";
    to_integer_small: addmul ftoi, "takes a quarter of an hour";
}
