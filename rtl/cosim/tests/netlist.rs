// SPDX-License-Identifier: MIT OR Apache-2.0
//! Netlists that yosys made of a core, in lockstep with the emulator: with planted mutants, and mapped to the cells of an FPGA.
//!
//! `TAKT_NETLIST` names a folder with `machine.txt` (the machine's name), `netlist.v` and, for mutants, `mutants.txt`, the numbers of the
//! mutants to try. `cargo evidence mutants` and `cargo evidence netlist` run this test.
#![allow(clippy::print_stdout)]

use crate::common::{assemble, folder};
use crate::lockstep::{early_ends, runs_early_end, runs_long_loops, track};
use std::fs;
use std::path::PathBuf;
use takt_cosim::corners::{Corner, corners};
use takt_cosim::{LockstepError, Model, random};
use takt_isa::{Machine, Program};
use takt_rtl::export::DesignFile;
use takt_rtl::{Design, Library, export};

/// Numbers of random and of short programs that a mutant may survive before it counts as not found.
const PROGRAMS: u64 = 300;
const SHORT: u64 = 6000;

/// Machine and compiled circuit of the netlist, and its folder.
fn netlist() -> (&'static Machine, Model, PathBuf) {
    let place = PathBuf::from(std::env::var_os("TAKT_NETLIST").expect("TAKT_NETLIST names a folder"));
    let read =
        |name: &str| fs::read_to_string(place.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
    let machine = takt_asm::machine(read("machine.txt").trim()).unwrap_or_else(|error| panic!("{error}"));
    let design = export(machine, &Library::builtin()).expect("every machine has a circuit");
    // The mapped netlist comes with models of cells that yosys' library lacks.
    let names = ["netlist.v", "cells.v"].into_iter().filter(|name| place.join(name).exists());
    let files = names.map(|name| DesignFile { name: name.to_owned(), text: read(name) }).collect();
    let model = Model::build(&Design { files, ..design }, &folder(), false);
    (machine, model.unwrap_or_else(|error| panic!("{error}")), place)
}

/// Program that a netlist runs in lockstep with the emulator.
enum Case {
    Random(u64),
    Short(u64),
    Directed(Program),
    Corner(Corner),
    Loop(Program),
    LongLoops,
}

/// Random and short programs of the given numbers, and all directed programs.
fn cases(machine: &'static Machine, random: u64, short: u64) -> Vec<(String, Case)> {
    let numbered = |name: &str, i| format!("{name} {i}");
    let loops = early_ends(machine).into_iter().enumerate();
    let words = random::words(machine).into_iter().enumerate();
    let distances = random::distances(machine).into_iter().enumerate();
    (0..random)
        .map(|seed| (numbered("random program", seed), Case::Random(seed)))
        .chain(corners(machine).into_iter().map(|corner| (corner.name.clone(), Case::Corner(corner))))
        .chain(loops.map(|(i, program)| (numbered("loop", i as u64), Case::Loop(program))))
        .chain(distances.map(|(i, program)| (numbered("distances", i as u64), Case::Directed(program))))
        .chain(words.map(|(i, program)| (numbered("word", i as u64), Case::Directed(program))))
        .chain((0..short).map(|seed| (numbered("short program", seed), Case::Short(seed))))
        .chain([("long loops".to_owned(), Case::LongLoops)])
        .collect()
}

/// First case that shows a difference, and the difference.
fn difference<'a>(
    machine: &'static Machine,
    model: &Model,
    number: u32,
    cases: &'a [(String, Case)],
) -> Option<(&'a str, String)> {
    let argument = format!("+fault={number}");
    let mut simulation = model.start(&[argument.as_ref()]).unwrap_or_else(|error| panic!("{error}"));
    let coverage = &mut random::Coverage::default();
    for (name, case) in cases {
        let outcome = match case {
            Case::Random(seed) => random::run(*seed, machine, simulation, coverage),
            Case::Short(seed) => random::run_short(*seed, machine, simulation, coverage),
            Case::Directed(program) => random::run_directed(program, simulation, coverage),
            Case::Corner(corner) => random::run_corner(corner, simulation, coverage),
            Case::Loop(program) => runs_early_end(program, simulation),
            Case::LongLoops => runs_long_loops(machine, simulation),
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
#[ignore = "of netlists that `cargo evidence mutants` makes"]
fn mutants() {
    let (machine, model, place) = netlist();
    let numbers = fs::read_to_string(place.join("mutants.txt")).expect("there are numbers");
    if let Some((name, difference)) = difference(machine, &model, 0, &cases(machine, 20, 100)) {
        panic!("without a mutant, {name}: {difference}");
    }
    let cases = cases(machine, PROGRAMS, SHORT);
    for number in numbers.lines().map(|line| line.parse().expect("a number")) {
        match difference(machine, &model, number, &cases) {
            None => println!("mutant core {number} survived"),
            Some((name, _)) => println!("mutant core {number} found lockstep, {name}"),
        }
    }
}

/// The mapped netlist agrees with the emulator on random programs (`TAKT_PROGRAMS`, by default 100) and on the robot's tracking.
#[test]
#[ignore = "of netlists that `cargo evidence netlist` makes"]
fn mapped() {
    let (machine, model, _) = netlist();
    let programs =
        std::env::var("TAKT_PROGRAMS").map_or(100, |text| text.parse().expect("TAKT_PROGRAMS is a number"));
    if let Some((name, difference)) = difference(machine, &model, 0, &cases(machine, programs, programs)) {
        panic!("{name}: {difference}");
    }
    let simulation = model.start(&[]).unwrap_or_else(|error| panic!("{error}"));
    track(&assemble(machine, "hybrid/tracking.s"), simulation, 20);
    println!("{programs} random programs and 20 periods of tracking");
}
