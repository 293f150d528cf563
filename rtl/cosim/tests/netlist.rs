// SPDX-License-Identifier: MIT OR Apache-2.0
//! Netlists that yosys has made of a core, in lockstep with the emulator: with mutants planted, and as mapped to the cells of an FPGA.
//!
//! `TAKT_NETLIST` names a folder with `machine.txt` (its name), `netlist.v`, and of mutants `mutants.txt`, the numbers of those to be
//! tried. `cargo xtask mutants` and `cargo xtask netlist` call this.
#![allow(clippy::print_stdout)]

use crate::common::{assemble, folder};
use crate::lockstep::{runs_long_loops, track};
use std::fs;
use std::path::PathBuf;
use takt_cosim::{LockstepError, Model, random};
use takt_isa::Machine;
use takt_rtl::export::DesignFile;
use takt_rtl::{Design, Library, export};

/// Programs that a mutant may pass before it counts as not found: random ones, and short ones.
const PROGRAMS: u64 = 300;
const SHORT: u64 = 6000;

/// A netlist's machine, compiled.
fn netlist() -> (&'static Machine, Model, PathBuf) {
    let place = PathBuf::from(std::env::var_os("TAKT_NETLIST").expect("TAKT_NETLIST names a folder"));
    let read =
        |name: &str| fs::read_to_string(place.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
    let machine = takt_asm::machine(read("machine.txt").trim()).unwrap_or_else(|error| panic!("{error}"));
    let design = export(machine, &Library::builtin()).expect("every machine has a circuit");
    // The mapped netlist has cells that yosys' library has no behaviour of.
    let names = ["netlist.v", "cells.v"].into_iter().filter(|name| place.join(name).exists());
    let files = names.map(|name| DesignFile { name: name.to_owned(), text: read(name) }).collect();
    let model = Model::build(&Design { files, ..design }, &folder(), false);
    (machine, model.unwrap_or_else(|error| panic!("{error}")), place)
}

/// The program that shows a difference, of so many random and short ones.
fn difference(
    machine: &'static Machine,
    model: &Model,
    number: u32,
    programs: u64,
    short: u64,
) -> Option<(String, String)> {
    let argument = format!("+fault={number}");
    let mut simulation = model.start(&[argument.as_ref()]).unwrap_or_else(|error| panic!("{error}"));
    let coverage = &mut random::Coverage::default();
    for i in 0..programs + short + 1 {
        let (name, outcome) = if i < programs {
            (format!("random program {i}"), random::run(i, machine, simulation, coverage))
        } else if i == programs {
            ("long loops".to_owned(), runs_long_loops(machine, simulation))
        } else {
            let seed = i - programs - 1;
            (format!("short program {seed}"), random::run_short(seed, machine, simulation, coverage))
        };
        match outcome {
            Ok(again) => simulation = again,
            Err(LockstepError::Difference(difference)) => return Some((name, difference.to_string())),
            Err(error) => panic!("{name}: {error}"),
        }
    }
    None
}

#[test]
#[ignore = "of netlists that `cargo xtask mutants` makes"]
fn mutants() {
    let (machine, model, place) = netlist();
    let numbers = fs::read_to_string(place.join("mutants.txt")).expect("there are numbers");
    if let Some((name, difference)) = difference(machine, &model, 0, 20, 100) {
        panic!("without a mutant, {name}: {difference}");
    }
    for number in numbers.lines().map(|line| line.parse().expect("a number")) {
        match difference(machine, &model, number, PROGRAMS, SHORT) {
            None => println!("mutant core {number} survived"),
            Some((name, _)) => println!("mutant core {number} found lockstep, {name}"),
        }
    }
}

/// The mapped netlist does what the emulator does: random programs (`TAKT_PROGRAMS`, 100), and the robot along the letters.
#[test]
#[ignore = "of netlists that `cargo xtask netlist` makes"]
fn mapped() {
    let (machine, model, _) = netlist();
    let programs =
        std::env::var("TAKT_PROGRAMS").map_or(100, |text| text.parse().expect("TAKT_PROGRAMS is a number"));
    if let Some((name, difference)) = difference(machine, &model, 0, programs, programs) {
        panic!("{name}: {difference}");
    }
    let simulation = model.start(&[]).unwrap_or_else(|error| panic!("{error}"));
    track(&assemble(machine, "hybrid/tracking.s"), simulation, 20);
    println!("{programs} random programs and 20 periods of tracking");
}
