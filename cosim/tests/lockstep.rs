//! The circuit of every machine against the emulator.

use std::path::Path;
use takt_cosim::{Model, random};
use takt_isa::{MACHINES, Machine};
use takt_rtl::{Library, export};

fn model(machine: &'static Machine) -> Model {
    let design = export(machine, &Library::builtin()).expect("every machine has a circuit");
    Model::build(&design, Path::new(env!("CARGO_TARGET_TMPDIR")), false)
        .unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn random_programs() {
    let count: u64 = std::env::var("TAKT_PROGRAMS").map_or(100, |text| text.parse().expect("a number"));
    for machine in MACHINES {
        let mut simulation = model(machine).start(None).unwrap_or_else(|error| panic!("{error}"));
        let mut coverage = random::Coverage::default();
        for seed in 0..count {
            simulation = random::run(seed, machine, simulation, &mut coverage)
                .unwrap_or_else(|error| panic!("{} seed {seed}: {error}", machine.name));
        }
        println!("{}: {coverage:?}", machine.name);
    }
}
