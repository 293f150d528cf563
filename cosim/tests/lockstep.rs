//! The circuit of every machine against the emulator.

use std::path::Path;
use takt_cosim::{Lockstep, LockstepError, Model, random};
use takt_isa::{MACHINES, Machine};
use takt_programs::gcode;
use takt_programs::hybrid::closed_loop::{ClosedLoop, Inputs};
use takt_programs::hybrid::{Outputs, ports};
use takt_programs::trajectory::Trajectory;
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

/// The tracking programs in closed loop with the robot, a number of periods.
fn tracking(machine: &'static Machine, source: &str, periods: usize) {
    let options = takt_asm::Options { machine, ..takt_asm::Options::default() };
    let loader = takt_asm::MemoryLoader::new(takt_programs::SOURCES);
    let program = takt_asm::assemble(source, &loader, &options)
        .unwrap_or_else(|diagnostics| panic!("{}", diagnostics.render(false)))
        .program;
    let register = |name: &str| {
        let ports = program.inputs.iter().chain(&program.outputs);
        ports.clone().find(|port| port.name == name).map(|port| port.register).expect("a tracking program")
    };
    let inputs = ports::INPUTS.map(|port| register(port.name));
    let outputs = ports::OUTPUTS.map(|port| register(port.name));
    let simulation = model(machine).start(None).unwrap_or_else(|error| panic!("{error}"));
    let mut lockstep = Lockstep::new(&program, simulation, &[]).unwrap_or_else(|error| panic!("{error}"));
    let moves = gcode::read_bytes(takt_programs::AGH.as_bytes()).expect("the letters are G-code");
    let trajectory = Trajectory::plan(&moves).expect("the letters can be driven");
    let controller = |values: &Inputs| -> Result<Outputs<f64>, LockstepError> {
        let values: Vec<(u16, u32)> = inputs.into_iter().zip(values.to_words()).collect();
        assert!(lockstep.run_period(&values), "{:?}", lockstep.emulator().status());
        lockstep.compare()?;
        let value =
            |register| f32::from_bits(lockstep.emulator().register(register).expect("written")).into();
        Ok(Outputs::from_array(outputs.map(value)))
    };
    for record in ClosedLoop::new(&trajectory, controller).take(periods) {
        record.unwrap_or_else(|error| panic!("{}: {source}: {error}", machine.name));
    }
    lockstep.finish().unwrap_or_else(|error| panic!("{}: {source}: {error}", machine.name));
    assert!(lockstep.compared() > 300 * periods as u64, "only {} events", lockstep.compared());
}

#[test]
fn tracking_programs() {
    for machine in MACHINES {
        tracking(machine, "hybrid/tracking.s", 100);
        tracking(machine, "hybrid/tracking_literal.s", 20);
    }
}
