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
    for (path, text) in SOURCES { loader.add(*path, *text); }
    let options = Options { machine, ..Options::default() };
    let program = takt_asm::assemble("hybrid/tracking.s", &loader, &options).unwrap().program;
    let registers: Vec<Register> = ports::INPUTS.iter().map(|port| program.inputs.iter().find(|p| p.name == port.name).unwrap().register).collect();
    let lanes = 16;
    let rows: Vec<Vec<Vec<u32>>> = (0..PERIODS).map(|k| { let w: Vec<_> = (0..lanes).map(|l| inputs[(k + l * 37) % PERIODS].to_words()).collect(); (0..20).map(|i| w.iter().map(|w| w[i]).collect()).collect() }).collect();
    for _ in 0..3 {
        let start = Instant::now();
        let mut controller = Controller::<f32>::new();
        for inputs in &inputs { std::hint::black_box(controller.step(inputs.counts, &inputs.reference)); }
        let native = start.elapsed().as_secs_f64() / PERIODS as f64;
        let mut emulator = Emulator::new(&program).unwrap();
        emulator.run_to_wait().unwrap();
        let start = Instant::now();
        for inputs in &inputs {
            for (register, bits) in registers.iter().zip(inputs.to_words()) { emulator.set_input_bits(*register, bits).unwrap(); }
            emulator.run_period(&[]).unwrap();
        }
        let single = start.elapsed().as_secs_f64() / PERIODS as f64;
        let ops = emulator.statistics().total_operations() as f64 / PERIODS as f64;
        let mut batch = Batch::new(&program, lanes).unwrap();
        for (r, v) in registers.iter().zip(&rows[0]) { batch.set_input_bits(*r, v).unwrap(); }
        batch.run_period();
        let start = Instant::now();
        for row in &rows {
            for (r, v) in registers.iter().zip(row) { batch.set_input_bits(*r, v).unwrap(); }
            batch.run_period();
        }
        let b = start.elapsed().as_secs_f64() / PERIODS as f64 / lanes as f64;
        println!("native {:.1} ns, single {:.1} ns ({:.1}x), batch {:.1} ns ({:.2}x), {:.0} Mop/s batch; ops {ops}; apart {}", native*1e9, single*1e9, single/native, b*1e9, b/native, ops/b/1e6, batch.periods_apart());
    }
}
