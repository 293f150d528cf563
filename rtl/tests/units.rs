// SPDX-License-Identifier: MIT OR Apache-2.0
//! Compares every arithmetic circuit with the specification, bit for bit and cycle for cycle.
//!
//! `TAKT_FULL=1` runs 10⁷ random operands per operation instead of 10⁵, and the planted faults.

use crate::harness::{Simulation, circuit, elaborate, full, library, lint};
use takt_isa::{Function, UNITS, Unit};

/// The unit computes a value from operands; others are wired into the core.
fn is_arithmetic(unit: &Unit) -> bool {
    !unit
        .functions
        .iter()
        .any(|function| matches!(function, Function::Control | Function::Load | Function::Store))
}

/// The unit's row, with another latency and interval if `TAKT_TRY` names the unit, as in `TAKT_TRY=sine:17/13,convert:4/1`: a circuit can
/// be tested before its row changes.
fn unit(name: &str) -> Unit {
    let mut unit =
        *UNITS.iter().find(|unit| unit.name == name).unwrap_or_else(|| panic!("no unit is called `{name}`"));
    let trials = std::env::var("TAKT_TRY").unwrap_or_default();
    for trial in trials.split(',').filter(|trial| !trial.is_empty()) {
        let parsed = trial.split_once(':').and_then(|(name, times)| {
            let (latency, interval) = times.split_once('/')?;
            Some((name, latency.parse().ok()?, interval.parse().ok()?))
        });
        let (of, latency, interval) =
            parsed.unwrap_or_else(|| panic!("TAKT_TRY: `{trial}` is not <unit>:<latency>/<interval>"));
        if of == name {
            (unit.latency, unit.interval) = (latency, interval);
        }
    }
    unit
}

/// A circuit lints without a warning, rejects latencies that it does not support, and computes the meaning of its instructions.
fn check(name: &str) {
    let (library, unit) = (library(), unit(name));
    let circuit = circuit(&library, &unit).unwrap_or_else(|error| panic!("{error}"));
    let said = lint(&library, &circuit).unwrap_or_else(|said| panic!("verilator -Wall on `{name}`:\n{said}"));
    assert_eq!(said, "", "verilator -Wall on `{name}`");
    let said = elaborate(&library, &circuit).unwrap_or_else(|said| panic!("iverilog on `{name}`:\n{said}"));
    assert_eq!(said, "", "iverilog -Wall on `{name}`");
    for latency in [0, 1, 63] {
        let mut wrong = circuit.clone();
        wrong.unit.latency = latency;
        assert!(lint(&library, &wrong).is_err(), "verilator elaborates `{name}` with latency {latency}");
        assert!(elaborate(&library, &wrong).is_err(), "iverilog elaborates `{name}` with latency {latency}");
    }

    let mut simulation =
        Simulation::new(&library, &circuit).unwrap_or_else(|error| panic!("`{name}`: {error}"));
    let count = if full() { 10_000_000 } else { 100_000 };
    let [special, _, random] = simulation.check_all(count).unwrap_or_else(|error| panic!("{error}"));
    assert!(special > 0 && random >= count, "`{name}` was not tested");
}

macro_rules! units {
    ($($unit:ident)*) => {
        $(#[test] fn $unit() { check(stringify!($unit)); })*

        /// A new unit in the specification must get a circuit and a test.
        #[test]
        fn every_unit_is_tested() {
            let tested = [$(stringify!($unit)),*];
            for unit in UNITS.iter().filter(|unit| is_arithmetic(unit)) {
                assert!(tested.contains(&unit.name), "the unit `{0}` is not tested: add `{0}` to `units!` at the end of rtl/tests/units.rs", unit.name);
            }
        }
    };
}

units! { alu alu_late add addmul convert multiply fused divroot recurrence sine arctangent arccosine }
