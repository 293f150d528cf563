// SPDX-License-Identifier: MIT OR Apache-2.0
//! A program with ports and parameters of every type, and a system with links of every kind.

use std::sync::Arc;
use takt_asm::{MemoryLoader, Options};
use takt_fmu::{Instance, Model, Settings};
use takt_isa::Program;
use takt_isa::system::Description;
use takt_system::{ProgramError, Request};

pub(crate) const SETTINGS: Settings = Settings { period: 1e-3, tick: 125_000 };

const LAW: &str = "\
.param  kp = 2.0 range 0..50           ; V/rad: gain
.param  bias:int = 3 range -100..100
.input  n:int, x, mask:bits             ; mm, rad/s, mm: distance, speed, bits
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
    let sources = [("law.s".to_owned(), LAW.to_owned())];
    Model::new(&assemble(LAW), SETTINGS).unwrap().with_units(&[&sources])
}

/// Two cores: `sum` adds entries of a FIFO in every base tick, `twice` doubles what it sees of that in every second, and returns the
/// entries to the host.
const SYSTEM: &str = r#"
tick = 1000
[[core]]
name = "sum"
program = "sum.s"
machine = "t1"
[[core]]
name = "twice"
program = "twice.s"
tick = 2
offset = 990
[[wire]]
from = "host.x"
to = "sum.x"
[[wire]]
from = "host.x"
to = "twice.x"
[[wire]]
from = "sum.total"
to = "host.total"
[[snapshot]]
name = "seen"
from = "sum"
to = "twice"
ports = ["total"]
latency = 8
[[fifo]]
name = "in"
from = "host"
to = "sum"
depth = 2
ports = ["entry"]
pop = "done"
receiver = { empty = "empty" }
[[fifo]]
name = "out"
from = "twice"
to = "host"
depth = 4
ports = ["double", "count"]
push = "count"
"#;
const SUM: &str = "\
.param  gain = 1.0 range 0..10          ; 1/s, which is no unit
.input  x, entry                        ; V, A
.input  empty:int
.output total                           ; V
.output done:int
.state  s
.range  x = -1, 8
.once
        mov     s, gain
        mov     total, gain
        wait    period
.period
period:
        s = s + gain*x
        mov     total, s
        bnz     empty, idle
        s = s + entry
        mov     total, s
        mov     done, zero
idle:   wait    period
";
const TWICE: &str = "\
.schedule on
.param  cycles:int = 5
.input  total, x                        ; V
.output double                          ; V
.output count:int
.state  n:int
.range  x = -4, 5
.once
        mov     n, zero
        wait    period
.period
.order  double, count
period: double = 2*total + x
        n = n + cycles
        count = n
        wait    period
";

/// The system, on machines that the programs name.
pub(crate) fn description() -> Description {
    described(TWICE)
}

/// The system with another program of the core `twice`.
pub(crate) fn described(twice: &str) -> Description {
    let read = takt_system::read::<()>("system.toml", SYSTEM, |request: &Request<'_>| {
        let source = if request.path == "sum.s" { SUM } else { twice };
        let options = Options { machine: request.machine.unwrap_or(&takt_isa::T3), ..Options::default() };
        let assembled = takt_asm::assemble(request.path, &MemoryLoader::of(request.path, source), &options);
        assembled
            .map(|assembled| assembled.program)
            .map_err(|mistakes| ProgramError::Missing { message: mistakes.render(false), help: None })
    });
    read.unwrap_or_else(|error| match error {
        takt_system::ReadError::Mistakes(mistakes) => panic!("{}", mistakes.render(false)),
        takt_system::ReadError::Program(()) => unreachable!(),
    })
}

/// Settings of the system.
pub(crate) const BASE_TICK: Settings = Settings { period: 8e-6, tick: 1000 };

pub(crate) fn system_model() -> Model {
    let sources =
        [("sum.s", SUM), ("twice.s", TWICE)].map(|(name, text)| [(name.to_owned(), text.to_owned())]);
    let model = Model::of_system(&description(), BASE_TICK).unwrap();
    model.with_units(&[&sources[0], &sources[1]])
}

pub(crate) fn instance() -> Instance {
    Instance::new(Arc::new(model())).unwrap()
}

/// Value reference of a variable.
pub(crate) fn reference(model: &Model, name: &str) -> u32 {
    let index = model.variables().iter().position(|variable| variable.name == name);
    1 + index.unwrap_or_else(|| panic!("no variable {name}")) as u32
}
