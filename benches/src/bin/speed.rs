//! tmp
#![allow(missing_docs, clippy::print_stdout)]
use std::time::Instant;
use takt_asm::{MemoryLoader, Options};
use takt_emu::{Batch, Emulator};
use takt_isa::{MACHINES, Register};
use takt_programs::hybrid::closed_loop::{ClosedLoop, Inputs};
use takt_programs::hybrid::{Controller, ports};
use takt_programs::trajectory::Trajectory;
use takt_programs::{AGH, SOURCES, gcode};
const PERIODS: usize = 4000;
fn recorded() -> Vec<Inputs> {
    let moves = gcode::read(AGH).expect("the path is ours");
    let trajectory = Trajectory::plan(&moves).expect("the path is ours");
    ClosedLoop::new(&trajectory, Controller::<f64>::new())
        .take(PERIODS)
        .map(|record| record.expect("the binary64 controller holds the robot").inputs)
        .collect()
}
fn main() {
    let inputs = recorded();
    let machine = MACHINES[0];
    let mut loader = MemoryLoader::default();
    for (path, text) in SOURCES {
        loader.add(*path, *text);
    }
    let options = Options { machine, ..Options::default() };
    let program = takt_asm::assemble("hybrid/tracking.s", &loader, &options).unwrap().program;
    let registers: Vec<Register> = ports::INPUTS
        .iter()
        .map(|port| program.inputs.iter().find(|p| p.name == port.name).unwrap().register)
        .collect();
    let lanes = Batch::WIDTH;
    let rows: Vec<Vec<Vec<u32>>> = (0..PERIODS)
        .map(|k| {
            let w: Vec<_> = (0..lanes).map(|l| inputs[(k + l * 37) % PERIODS].to_words()).collect();
            (0..20).map(|i| w.iter().map(|w| w[i]).collect()).collect()
        })
        .collect();
    let best = |work: &mut dyn FnMut(std::ops::Range<usize>)| {
        let mut best = f64::INFINITY;
        for _ in 0..20 {
            for k in (0..PERIODS).step_by(100) {
                let start = Instant::now();
                work(k..k + 100);
                best = best.min(start.elapsed().as_secs_f64() / 100.0);
            }
        }
        best
    };
    let mut controller = Controller::<f32>::new();
    let native = best(&mut |r| {
        for inputs in &inputs[r] {
            std::hint::black_box(controller.step(inputs.counts, &inputs.reference));
        }
    });
    let mut emulator = Emulator::new(&program).unwrap();
    let single = best(&mut |r| {
        for inputs in &inputs[r] {
            for (register, bits) in registers.iter().zip(inputs.to_words()) {
                emulator.set_input_bits(*register, bits).unwrap();
            }
            emulator.run_period(&[]).unwrap();
        }
    });
    let mut batch = Batch::new(&program, lanes).unwrap();
    let b = best(&mut |r| {
        for row in &rows[r] {
            for (r, v) in registers.iter().zip(row) {
                batch.set_input_bits(*r, v).unwrap();
            }
            batch.run_period();
        }
    }) / lanes as f64;
    let ops = 289.0;
    println!(
        "native {:.1} ns, single {:.1} ns ({:.1}x), batch {:.1} ns ({:.2}x), {:.0} Mop/s batch; apart {}",
        native * 1e9,
        single * 1e9,
        single / native,
        b * 1e9,
        b / native,
        ops / b / 1e6,
        batch.periods_apart()
    );
}
