// SPDX-License-Identifier: MIT OR Apache-2.0
//! Netlists that yosys has made of a core, in lockstep with the emulator: with mutants planted, and as mapped to the cells of an FPGA.
//!
//! `TAKT_NETLIST` names a folder with `machine.txt` (its name), `netlist.v`, and of mutants `mutants.txt`, the numbers of those to be
//! tried. `cargo xtask mutants` and `cargo xtask netlist` call this.
#![allow(clippy::print_stdout)]

use crate::common::{assemble, folder};
use crate::lockstep::track;
use std::fs;
use std::path::PathBuf;
use takt_cosim::{LockstepError, Model, random};
use takt_isa::Machine;
use takt_rtl::export::DesignFile;
use takt_rtl::{Design, Library, export};

/// Random programs that a mutant may pass before it counts as not found.
const PROGRAMS: u64 = 300;

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

/// The random program that shows a difference.
fn difference(machine: &'static Machine, model: &Model, number: u32, programs: u64) -> Option<(u64, String)> {
    let argument = format!("+fault={number}");
    let mut simulation = model.start(&[argument.as_ref()]).unwrap_or_else(|error| panic!("{error}"));
    for seed in 0..programs {
        match random::run(seed, machine, simulation, &mut random::Coverage::default()) {
            Ok(again) => simulation = again,
            Err(LockstepError::Difference(difference)) => return Some((seed, difference.to_string())),
            Err(error) => panic!("{error}"),
        }
    }
    None
}

#[test]
#[ignore = "of netlists that `cargo xtask mutants` makes"]
fn mutants() {
    let (machine, model, place) = netlist();
    let numbers = fs::read_to_string(place.join("mutants.txt")).expect("there are numbers");
    if let Some((seed, difference)) = difference(machine, &model, 0, 20) {
        panic!("without a mutant, seed {seed}: {difference}");
    }
    for number in numbers.lines().map(|line| line.parse().expect("a number")) {
        match difference(machine, &model, number, PROGRAMS) {
            None => println!("mutant core {number} survived"),
            Some((seed, _)) => println!("mutant core {number} found lockstep, random program {seed}"),
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
    if let Some((seed, difference)) = difference(machine, &model, 0, programs) {
        panic!("seed {seed}: {difference}");
    }
    let simulation = model.start(&[]).unwrap_or_else(|error| panic!("{error}"));
    track(&assemble(machine, "hybrid/tracking.s"), simulation, 20);
    println!("{programs} random programs and 20 periods of tracking");
}
