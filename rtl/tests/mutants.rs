// SPDX-License-Identifier: MIT OR Apache-2.0
//! Runs the units' test on mutants that yosys has planted in a unit's netlist. `cargo evidence mutants` runs this test.
//!
//! `TAKT_MUTANTS` names a folder with a netlist for each unit, whose plusarg `fault` selects a mutant, and with a file of the mutants'
//! numbers to try, one per line.
#![allow(clippy::print_stdout)]

use crate::harness::{Simulation, circuit, compile, library};
use std::fs;
use std::path::PathBuf;
use takt_isa::UNITS;

#[test]
#[ignore = "of netlists that `cargo evidence mutants` makes"]
fn units() {
    let folder = PathBuf::from(std::env::var_os("TAKT_MUTANTS").expect("TAKT_MUTANTS names a folder"));
    for unit in UNITS {
        let Ok(numbers) = fs::read_to_string(folder.join(format!("{}.txt", unit.name))) else { continue };
        let netlist =
            fs::read_to_string(folder.join(format!("{}.v", unit.name))).expect("there is its netlist");
        let mut library = library();
        let mut circuit = circuit(&library, unit).expect("the unit has a circuit");
        library.put("netlist.v", netlist);
        circuit.files = vec!["netlist.v".to_owned()];
        let program = compile(&library, &circuit).unwrap_or_else(|error| panic!("{error}"));
        for number in
            [0].into_iter().chain(numbers.lines().map(|line| line.parse::<u32>().expect("a number")))
        {
            let mut simulation = Simulation::start(&circuit, program.clone(), &[format!("+fault={number}")])
                .unwrap_or_else(|error| panic!("{error}"));
            let outcome = simulation.check_all(100_000);
            match outcome {
                Ok(_) if number == 0 => {}
                Ok(_) => println!("mutant {} {number} survived", unit.name),
                Err(error) if number == 0 => panic!("{} without a mutant: {error}", unit.name),
                Err(error) => {
                    let error = error.lines().next().unwrap_or_default();
                    println!("mutant {} {number} found {error}", unit.name);
                }
            }
        }
        // This netlist's program will not be needed again.
        let _ = fs::remove_file(program);
    }
}
