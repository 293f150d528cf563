// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cost of links and of interleaving cores: a whole system (the three-processor controller at the start of a motion) compared with each
//! core run alone on the same inputs in the same cycles.
#![allow(missing_docs, clippy::print_stdout)]

use criterion::Criterion;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use takt_benches::FastestTimes;
use takt_emu::Emulator;
use takt_isa::Register;
use takt_isa::timing::Cycle;
use takt_robot::controller::{Controller, standard};
use takt_robot::level::{NoFiles, Session};
use takt_robot::plant::Plant;
use takt_system::{Description, HostAction, System};

/// Host commands: a motion of the joints and back.
const MOTION: &str = "via move joints(12, 82, 4, 4, -40, 4)\nmove joints(0, 90, 0, 0, -45, 0)\nwait 0.05\n";

/// Inputs of a core: cycle of effect, port, value.
type Inputs = Vec<(Cycle, Register, u32)>;

fn system(description: &Description, actions: &[(Cycle, HostAction)], end: Cycle) -> System {
    let mut system = System::new(description).expect("it fits the machines");
    drive(&mut system, actions, end);
    system
}

fn drive(system: &mut System, actions: &[(Cycle, HostAction)], end: Cycle) {
    for (cycle, action) in actions {
        system.run_until(*cycle).expect("it has no fault");
        system.act(action).expect("it is this system's host");
    }
    system.run_until(end).expect("it has no fault");
}

/// Runs a core alone, with its inputs and ticks from the system.
fn alone(description: &Description, core: usize, inputs: &Inputs, start: Cycle, end: Cycle) -> Emulator {
    let known = &description.cores[core];
    let mut emulator = Emulator::new(&known.program).expect("it fits the machine");
    for mailbox in description.mailboxes(core) {
        emulator
            .set_input_bits(mailbox.register, description.initial(mailbox.source))
            .expect("it is an input");
    }
    for tick in (start + known.offset..end).step_by(known.period(description.tick) as usize) {
        emulator.tick_at(tick);
    }
    for &(cycle, register, value) in inputs {
        emulator.run_until(cycle).expect("it has no fault");
        emulator.set_input_bits(register, value).expect("it is an input");
    }
    emulator.run_until(end).expect("it has no fault");
    emulator
}

fn main() {
    let description = standard().expect("it comes with Takt");
    let mut controller = Controller::new(&description, Plant::standard()).expect("a controller");
    controller.keep_host_actions();
    let mut session =
        Session::new(controller, Arc::new(NoFiles), Arc::new(AtomicBool::new(false))).expect("it gets ready");
    if let Err(mistakes) = session.run("motion", MOTION) {
        panic!("{}", mistakes.render(false));
    }
    let ran = session.host().robot().system();
    let (actions, end) = (ran.host_actions().to_vec(), ran.now());

    // A second run records the inputs of each core.
    let mut recorded = System::new(&description).expect("it fits the machines");
    recorded.keep_core_events();
    let mut inputs = vec![Inputs::new(); description.cores.len()];
    drive(&mut recorded, &actions, end);
    for event in recorded.take_input_events() {
        let counts = event.cycle + description.cores[event.core].input_delay();
        inputs[event.core].push((counts, event.register, event.value));
    }
    let start = recorded.start().expect("ticks have started");
    for (core, inputs) in inputs.iter().enumerate() {
        let (one, same) = (alone(&description, core, inputs, start, end), recorded.core(core));
        assert_eq!(one.statistics().bundles, same.statistics().bundles, "core {core} does the same alone");
    }

    let mut criterion = Criterion::default().configure_from_args();
    let mut group = FastestTimes::new(&mut criterion, "system");
    let together = group.seconds("three cores in a system", end, || system(&description, &actions, end));
    let cores: Vec<f64> = (0..description.cores.len())
        .map(|core| {
            let name = format!("{} alone", description.cores[core].name);
            group.seconds(&name, end, || alone(&description, core, &inputs[core], start, end))
        })
        .collect();
    let sum: f64 = cores.iter().sum();
    println!(
        "\n{} cycles, {} inputs: the system takes {:.2} times as long as its {} cores alone",
        end,
        inputs.iter().map(Vec::len).sum::<usize>(),
        together / sum,
        cores.len()
    );
}
