// SPDX-License-Identifier: MIT OR Apache-2.0
//! Speed of the emulator on the tracking program, compared with the same algorithm as native Rust in binary32.
#![allow(missing_docs, clippy::print_stdout)]

use criterion::Criterion;
use takt_asm::{MemoryLoader, Options};
use takt_benches::FastestTimes;
use takt_emu::Emulator;
use takt_isa::{MACHINES, Register};
use takt_programs::hybrid::closed_loop::{ClosedLoop, Inputs};
use takt_programs::hybrid::{Controller, ports};
use takt_programs::trajectory::Trajectory;
use takt_programs::{AGH, SOURCES, gcode};

/// Periods in a sample.
const PERIODS: usize = 4000;

/// Inputs recorded in closed loop with the binary64 controller.
fn recorded() -> Vec<Inputs> {
    let moves = gcode::read(AGH).expect("the path is ours");
    let trajectory = Trajectory::plan(&moves).expect("the path is ours");
    ClosedLoop::new(&trajectory, Controller::<f64>::new())
        .take(PERIODS)
        .map(|record| record.expect("the binary64 controller holds the robot").inputs)
        .collect()
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let inputs = recorded();
    let mut group = FastestTimes::new(&mut criterion, "tracking");

    let native = group.seconds("native binary32", PERIODS as u64, || {
        let mut controller = Controller::<f32>::new();
        for inputs in &inputs {
            // Use all outputs; otherwise the compiler removes their computation.
            std::hint::black_box(controller.step(inputs.counts, &inputs.reference));
        }
    });

    let mut rows = Vec::new();
    for program in ["tracking", "tracking_literal"] {
        for machine in MACHINES {
            let mut loader = MemoryLoader::default();
            for (path, text) in SOURCES {
                loader.add(*path, *text);
            }
            let options = Options { machine, ..Options::default() };
            let path = format!("hybrid/{program}.s");
            let assembled = takt_asm::assemble(&path, &loader, &options).expect("the program is ours");
            let mut emulator = Emulator::new(&assembled.program).expect("it fits the machine");
            let registers: Vec<Register> = ports::INPUTS
                .iter()
                .map(|port| emulator.input_port(port.name).expect("it has the ports").register)
                .collect();
            emulator.run_to_wait().expect("it reaches its first wait");
            let mut run = || {
                for inputs in &inputs {
                    for (register, bits) in registers.iter().zip(inputs.to_words()) {
                        emulator.set_input_bits(*register, bits).expect("it is an input");
                    }
                    emulator.run_period(&[]).expect("it has no fault");
                }
                emulator.statistics().total_operations()
            };
            let before = run();
            let operations = run() - before;
            let seconds = group.seconds(&format!("{program} on {}", machine.name), operations, &mut run);
            rows.push((format!("{program} on {}", machine.name), operations, seconds));
        }
    }
    println!(
        "\n{:<28}{:>16}{:>18}{:>26}",
        "emulated", "M operations/s", "ns per period", "times native binary32"
    );
    println!("{:<28}{:>16}{:>18.1}{:>26.1}", "native binary32", "-", native / PERIODS as f64 * 1e9, 1.0);
    for (name, operations, seconds) in rows {
        println!(
            "{name:<28}{:>16.0}{:>18.1}{:>26.1}",
            operations as f64 / seconds / 1e6,
            seconds / PERIODS as f64 * 1e9,
            seconds / native
        );
    }
}
