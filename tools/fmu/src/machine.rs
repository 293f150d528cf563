// SPDX-License-Identifier: MIT OR Apache-2.0
//! Machine of an instance: one emulated core with its program, a system of cores, or the circuit of a board.

use crate::circuit::Board;
use crate::model::{Application, Model};
use crate::variables::Source;
use takt_analysis::period::PERIOD_LIMIT;
use takt_emu::{Emulator, LoadError, PeriodError, Row, Stop, WaitingState};
use takt_isa::Program;
use takt_isa::timing::Cycle;
use takt_system::{Host, HostError, System, SystemFault};

/// Machine, between two periods.
pub(crate) enum Machine {
    Program(Box<Core>),
    System(Box<Cores>),
    Circuit(Box<Board>),
}

/// Counts of a core.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    /// Cycles of the last period.
    pub(crate) cycles: Cycle,
    /// Missed ticks so far.
    pub(crate) missed: u64,
}

/// Core with its program.
pub(crate) struct Core {
    emulator: Emulator,
    counts: Counts,
}

/// System with its host.
pub(crate) struct Cores {
    system: System,
    /// The system before its first cycle.
    fresh: System,
    host: Host,
    /// Values of the host's next write.
    row: Row,
    /// Values that the host read last.
    outputs: Vec<u32>,
    /// FIFOs to the host from which the last base tick took an entry.
    popped: Vec<bool>,
    counts: Vec<Counts>,
}

/// State of a machine between two periods.
#[derive(Clone)]
pub(crate) enum SavedMachine {
    Program(WaitingState),
    System(Box<System>),
}

/// Reason in words why a machine stopped.
pub(crate) type Reason = String;

fn period_error(error: &PeriodError, program: &Program) -> Reason {
    match error {
        PeriodError::Fault(fault) => fault.show(program).to_string(),
        other => other.to_string(),
    }
}

fn system_fault(fault: &SystemFault, system: &System) -> Reason {
    let program = &system.description().cores[fault.core].program;
    format!("core {}: {}", fault.name, fault.fault.show(program))
}

impl Machine {
    pub(crate) fn new(model: &Model) -> Result<Machine, LoadError> {
        match &model.application {
            Application::Circuit(circuit) => {
                // The model has checked that it fits.
                let period = u32::try_from(model.settings.tick).unwrap_or(u32::MAX);
                Ok(Machine::Circuit(Box::new(Board::new(circuit, period, &model.folder))))
            }
            Application::Program(program) => {
                let emulator = Emulator::new(program)?;
                Ok(Machine::Program(Box::new(Core { emulator, counts: Counts::default() })))
            }
            Application::System(description) => {
                let (system, host) = (System::new(description)?, Host::new(description));
                let row = host.columns(description).iter().map(|column| (column.register, 0)).collect();
                let (outputs, popped) = (vec![0; host.outputs.len()], vec![false; host.pops.len()]);
                let (fresh, counts) = (system.clone(), vec![Counts::default(); description.cores.len()]);
                Ok(Machine::System(Box::new(Cores { system, fresh, host, row, outputs, popped, counts })))
            }
        }
    }

    pub(crate) fn reset(&mut self) {
        match self {
            Machine::Program(core) => {
                core.emulator.reset();
                core.counts = Counts::default();
            }
            Machine::System(cores) => {
                cores.system = cores.fresh.clone();
                cores.outputs.fill(0);
                cores.popped.fill(false);
                cores.counts.fill(Counts::default());
            }
            Machine::Circuit(board) => board.reset(),
        }
    }

    /// Sets an input or a parameter.
    #[inline]
    pub(crate) fn set(&mut self, source: Source, bits: u32) {
        // The reader of images accepts no other registers as ports.
        let _ = match (self, source) {
            (Machine::Program(core), Source::Port { register, .. }) => {
                core.emulator.set_input_bits(register, bits)
            }
            (Machine::System(cores), Source::Port { core, register }) => {
                cores.system.core_mut(core).set_input_bits(register, bits)
            }
            (Machine::System(cores), Source::Column(column)) => {
                cores.row[column].1 = bits;
                return;
            }
            (Machine::Circuit(board), Source::Level(pin)) => return board.set_level(pin, bits != 0),
            (Machine::Circuit(board), Source::HostPort(port)) => return board.set_port(port, bits),
            (Machine::Circuit(board), Source::Count(encoder)) => {
                return board.set_count(encoder, bits.cast_signed());
            }
            _ => return,
        };
    }

    /// Present value of an output, as bits.
    #[inline]
    pub(crate) fn get(&self, source: Source) -> u32 {
        let count = |count: u64| count.min(i32::MAX as u64) as u32;
        match (self, source) {
            (Machine::Program(core), Source::Port { register, .. }) => {
                core.emulator.output_bits(register).unwrap_or(0)
            }
            (Machine::Program(core), Source::Cycles(_)) => count(core.counts.cycles),
            (Machine::Program(core), Source::Missed(_)) => count(core.counts.missed),
            (Machine::Program(core), Source::Flags(_)) => u32::from(core.emulator.flags().bits()),
            (Machine::System(cores), Source::Output(column)) => cores.outputs[column],
            (Machine::System(cores), Source::Popped(fifo)) => u32::from(cores.popped[fifo]),
            (Machine::System(cores), Source::Cycles(core)) => count(cores.counts[core].cycles),
            (Machine::System(cores), Source::Missed(core)) => count(cores.counts[core].missed),
            (Machine::System(cores), Source::Flags(core)) => {
                u32::from(cores.system.core(core).flags().bits())
            }
            (Machine::Circuit(board), Source::Part(pin)) => board.part(pin).to_bits(),
            _ => 0,
        }
    }

    /// Counts of each core.
    pub(crate) fn counts(&self) -> &[Counts] {
        match self {
            Machine::Program(core) => std::slice::from_ref(&core.counts),
            Machine::System(cores) => &cores.counts,
            Machine::Circuit(_) => &[],
        }
    }

    /// Runs the sections that run once.
    pub(crate) fn start(&mut self) -> Result<(), Reason> {
        match self {
            Machine::Program(core) => core.start(),
            Machine::System(cores) => cores.start(),
            Machine::Circuit(board) => board.start(),
        }
    }

    /// Waits until nothing of a program is in flight, so that its state can be saved: operations beside the `wait` may complete after it.
    /// The outputs of the period are those before.
    #[inline]
    pub(crate) fn settle(&mut self) -> Result<(), Reason> {
        match self {
            Machine::Program(core) => core.settle(),
            Machine::System(_) | Machine::Circuit(_) => Ok(()),
        }
    }

    /// Runs a period, or a system's base tick: `number` of those before it, `tick` cycles from one to the next. Adds warnings.
    #[inline]
    pub(crate) fn run(&mut self, number: u64, tick: u64, warnings: &mut Vec<String>) -> Result<(), Reason> {
        match self {
            Machine::Program(core) => core.run(number, tick, warnings),
            Machine::System(cores) => cores.run(number, warnings),
            Machine::Circuit(board) => board.run(number, warnings),
        }
    }

    /// State to return to; `None` if there is none, since the program has stopped or not begun.
    pub(crate) fn save(&self) -> Option<SavedMachine> {
        match self {
            Machine::Program(core) => core.emulator.waiting_state().map(SavedMachine::Program),
            Machine::System(cores) => {
                cores.system.start().map(|_| SavedMachine::System(Box::new(cores.system.clone())))
            }
            Machine::Circuit(_) => None,
        }
    }

    /// Returns to a state with its counts. Returns false, and changes nothing, if the program has no such state.
    pub(crate) fn restore(&mut self, saved: &SavedMachine, counts: &[Counts]) -> bool {
        match (self, saved) {
            (Machine::Program(core), SavedMachine::Program(state)) => {
                let ([counts], true) = (counts, core.emulator.resume(state)) else { return false };
                core.counts = *counts;
                true
            }
            (Machine::System(cores), SavedMachine::System(system)) => {
                if counts.len() != cores.counts.len() {
                    return false;
                }
                cores.system = (**system).clone();
                cores.counts.copy_from_slice(counts);
                true
            }
            _ => false,
        }
    }
}

impl Core {
    fn start(&mut self) -> Result<(), Reason> {
        self.emulator.set_cycle_limit(PERIOD_LIMIT);
        match self.emulator.run_to_wait() {
            Err(fault) => Err(fault.show(self.emulator.program()).to_string()),
            Ok(Stop::Halted) => Err(PeriodError::Halted.to_string()),
            Ok(_) => Ok(()),
        }
    }

    #[inline]
    fn settle(&mut self) -> Result<(), Reason> {
        let Some(last) = self.emulator.in_flight().map(|retire| retire.cycle).max() else { return Ok(()) };
        match self.emulator.run_until(last + 1) {
            Ok(_) => Ok(()),
            Err(fault) => Err(fault.show(self.emulator.program()).to_string()),
        }
    }

    #[inline]
    fn run(&mut self, number: u64, tick: u64, warnings: &mut Vec<String>) -> Result<(), Reason> {
        self.emulator.set_cycle_limit(self.emulator.now() + PERIOD_LIMIT);
        let report = self.emulator.run_period(&[]);
        let report = report.map_err(|error| period_error(&error, self.emulator.program()))?;
        if report.cycles >= tick {
            self.counts.missed += 1;
            warnings.push(format!(
                "period {number}: {} cycles, and the next tick comes after {tick}",
                report.cycles
            ));
        }
        if let Some(first) = report.nan_writes.first() {
            let name = self.emulator.program().register_text(first.register);
            warnings.push(format!("period {number}: NaN on the output `{name}`"));
        }
        self.counts.cycles = report.cycles;
        Ok(())
    }
}

impl Cores {
    /// Runs to the cycle in which the host writes for the first base tick.
    fn start(&mut self) -> Result<(), Reason> {
        let start = self.system.run_to_start(PERIOD_LIMIT);
        let start = start.map_err(|fault| system_fault(&fault, &self.system))?;
        let Some(start) = start else {
            return Err(match self.system.halted() {
                true => "every core has halted before the first tick".to_owned(),
                false => format!("a core has not waited within {PERIOD_LIMIT} cycles"),
            });
        };
        let first = start - self.system.description().lead();
        self.system.run_until(first).map_err(|fault| system_fault(&fault, &self.system))?;
        for (output, value) in self.host.outputs.iter().zip(&mut self.outputs) {
            let is_queue = self.host.pops.contains(&output.link);
            let bits = self.system.field_bits(output.link, output.field).unwrap_or(0);
            *value = if is_queue { 0 } else { bits };
        }
        Ok(())
    }

    /// Runs a base tick: the host writes its row before it, and reads before it would write the next.
    fn run(&mut self, number: u64, warnings: &mut Vec<String>) -> Result<(), Reason> {
        let Cores { system, host, row, outputs, popped, counts, .. } = self;
        let cores = 0..counts.len();
        let before: Vec<u64> = cores.map(|core| system.core(core).missed_ticks()).collect();
        // The row has a value for each column, so that no action fails.
        let reason = |error: HostError| error.to_string();
        if host.write(system, row).map_err(reason)? > 0 {
            warnings.push(format!("base tick {number}: a FIFO was full, and refused an entry"));
        }
        let until = system.now() + system.description().tick;
        system.run_until(until).map_err(|fault| system_fault(&fault, system))?;
        let read = host.read(system).map_err(reason)?;
        for (number, &link) in host.pops.iter().enumerate() {
            let mut fields = host.outputs.iter().zip(&read).filter(|(output, _)| output.link == link);
            popped[number] = fields.any(|(_, bits)| bits.is_some());
        }
        outputs.iter_mut().zip(read).for_each(|(value, bits)| *value = bits.unwrap_or(0));
        for (core, counts) in counts.iter_mut().enumerate() {
            let name = |system: &System| system.description().cores[core].name.clone();
            if let Some(report) = system.last_period(core) {
                counts.cycles = report.cycles;
            }
            let missed = system.core(core).missed_ticks() - before[core];
            counts.missed += missed;
            if missed > 0 {
                warnings.push(format!("base tick {number}: core {} missed a tick", name(system)));
            }
            if let Some(first) = system.core_mut(core).take_nan_writes().first() {
                let port = system.description().cores[core].program.register_text(first.register);
                warnings
                    .push(format!("base tick {number}: NaN on the output `{port}` of core {}", name(system)));
            }
        }
        Ok(())
    }
}
