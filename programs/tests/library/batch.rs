// SPDX-License-Identifier: MIT OR Apache-2.0
//! Period of a straight-line program over many operands at once: each operation in the order of its bundles, by the machine's arithmetic.
//! The interlocks make a machine's results independent of timing, so this is the emulator's result, many times faster; `functions.rs`
//! compares the two.

use std::collections::HashMap;
use takt_isa::fp::{Flags, Host};
use takt_isa::spec::check::MAX_SLOTS;
use takt_isa::{Effect, Program, ROWS, Register, compute};

/// Operands per run: as many as the first-level cache holds for a few dozen registers.
pub(crate) const LANES: usize = 128;

type Column = [u32; LANES];
type Kernel = fn(&Column, &Column, &Column, &mut Column, &mut [Flags; LANES]);

/// Operation of one row over all lanes; the row is a compile-time constant, so the loop contains its arithmetic only.
fn kernel<const ROW: usize>(a: &Column, b: &Column, c: &Column, d: &mut Column, flags: &mut [Flags; LANES]) {
    if ROW >= ROWS.len() {
        return;
    }
    for i in 0..LANES {
        let value = compute::<Host>(ROWS[ROW].op, a[i], b[i], c[i]);
        d[i] = value.bits;
        flags[i] |= value.flags;
    }
}

macro_rules! kernels {
    ($($row:literal)*) => { [$(kernel::<$row> as Kernel),*] };
}

const KERNELS: [Kernel; 64] = kernels!(
    0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31
    32 33 34 35 36 37 38 39 40 41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63
);
const _: () = assert!(ROWS.len() <= KERNELS.len());

/// Operation on columns of registers.
#[derive(Clone, Copy)]
struct Step {
    kernel: Kernel,
    dest: usize,
    sources: [usize; 3],
}

/// Period of a program on columns of registers.
#[derive(Clone)]
pub(crate) struct Batch {
    /// Operations of each bundle.
    bundles: Vec<Vec<Step>>,
    columns: Vec<Column>,
    inputs: Vec<usize>,
    output: usize,
    /// Flags that each lane has raised.
    pub(crate) flags: [Flags; LANES],
}

impl Batch {
    /// Period of a program with one output, without branches and loads.
    pub(crate) fn new(program: &Program) -> Batch {
        let mut columns = vec![[0; LANES]];
        let mut places = HashMap::from([(Register::ZERO, 0)]);
        for &(register, bits) in &program.constants {
            places.insert(register, columns.len());
            columns.push([bits; LANES]);
        }
        let mut place = |register: Register| {
            *places.entry(register).or_insert_with(|| {
                columns.push([0; LANES]);
                columns.len() - 1
            })
        };
        let inputs = program.inputs.iter().map(|port| place(port.register)).collect();
        let output = place(program.outputs[0].register);
        let section = program.sections.iter().find(|section| section.name == "period").expect("it has one");
        let mut bundles = Vec::new();
        for address in section.start.until(section.end) {
            let mut steps = Vec::new();
            let bundle = program.bundle(address).expect("it is there").expect("it is legal");
            for (slot, instruction) in program.machine.slots.iter().zip(&bundle) {
                match instruction.effect() {
                    Effect::Nothing | Effect::ClearFlags | Effect::Publish | Effect::Wait => {}
                    Effect::Compute => {
                        let mut sources = [0; 3];
                        for (source, &register) in sources.iter_mut().zip(instruction.reads()) {
                            *source = place(register);
                        }
                        let row = ROWS.iter().position(|row| row.op == instruction.op).expect("it has a row");
                        let dest = place(instruction.writes(slot).expect("it computes"));
                        steps.push(Step { kernel: KERNELS[row], dest, sources });
                    }
                    effect => panic!("{effect:?} is nothing that columns can do"),
                }
            }
            bundles.push(steps);
        }
        Batch { bundles, columns, inputs, output, flags: [Flags::NONE; LANES] }
    }

    /// Results for columns of operands, one per port.
    pub(crate) fn run(&mut self, operands: &[Column]) -> &Column {
        self.flags = [Flags::NONE; LANES];
        for (&input, operand) in self.inputs.iter().zip(operands) {
            self.columns[input] = *operand;
        }
        let mut results = [[0; LANES]; MAX_SLOTS];
        for bundle in &self.bundles {
            // All operations of a bundle read before any writes.
            for (step, result) in bundle.iter().zip(&mut results) {
                let [a, b, c] = step.sources.map(|source| &self.columns[source]);
                (step.kernel)(a, b, c, result, &mut self.flags);
            }
            for (step, result) in bundle.iter().zip(&results) {
                self.columns[step.dest] = *result;
            }
        }
        &self.columns[self.output]
    }
}
