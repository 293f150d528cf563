// SPDX-License-Identifier: MIT OR Apache-2.0
//! A program with ports and parameters of every type.

use std::sync::Arc;
use takt_asm::{MemoryLoader, Options};
use takt_fmu::{Instance, Model, Settings};
use takt_isa::Program;

pub(crate) const SETTINGS: Settings = Settings { period: 1e-3, tick: 125_000 };

const LAW: &str = "\
.param  kp = 2.0 range 0..50
.param  bias:int = 3 range -100..100
.input  n:int, x, mask:bits
.output sum, error:int, masked:bits, missed
.state  s
.range  x = 0.5, 4
.once
        mov     s, x
        mov     sum, zero
        mov     error, bias
        wait    period
.period
period: error = n + bias
        masked = xor(mask, 255)
        s = s + kp*x
        sum = s
        missed = x/kp
        wait    period
";

pub(crate) fn assemble(source: &str) -> Program {
    let files = [("law.s", source)];
    let assembled = takt_asm::assemble("law.s", &MemoryLoader::new(&files), &Options::default());
    assembled.unwrap_or_else(|mistakes| panic!("{}", mistakes.render(false))).program
}

pub(crate) fn model() -> Model {
    Model::new(&assemble(LAW), SETTINGS).unwrap()
}

pub(crate) fn instance() -> Instance {
    Instance::new(Arc::new(model())).unwrap()
}

/// Value reference of a variable.
pub(crate) fn reference(model: &Model, name: &str) -> u32 {
    let index = model.variables().iter().position(|variable| variable.name == name);
    1 + index.unwrap_or_else(|| panic!("no variable {name}")) as u32
}
