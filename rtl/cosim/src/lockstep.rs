// SPDX-License-Identifier: MIT OR Apache-2.0
//! Lockstep of a program on emulator and circuit.

use crate::compare::{Comparison, Difference};
use crate::event::{CircuitEvent, CoreEvent, EventKind, bare, circuit_stops, expect};
use crate::simulation::{ModelError, PinAction, Simulation};
use std::collections::BTreeMap;
use takt_emu::{Emulator, Event, Fault, LoadError, PortWrite, Status, Stop};
use takt_isa::spec::units::MAX_LATENCY;
use takt_isa::timing::Cycle;
use takt_isa::{Program, Register};
use takt_rtl::export::{INPUT_DELAY, LATCHED_INPUT_DELAY, TICK_DELAY};
use takt_system::HostError;
use thiserror::Error;

/// Limit on the cycles between an event and its report by the circuit.
pub(crate) const REPORT_DELAY: Cycle = 3;

/// Error that ends a lockstep run.
#[derive(Debug, Error)]
pub enum LockstepError {
    /// The emulator does not accept the program.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// The simulation does not run.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The circuit was built for other ports than the program's.
    #[error("the program needs {program} latched inputs, but the circuit was built with {circuit}")]
    Ports {
        /// Number of latched inputs that the program needs.
        program: u16,
        /// Number of latched inputs of the circuit.
        circuit: u16,
    },
    /// Invalid action of a system's host.
    #[error(transparent)]
    Host(#[from] HostError),
    /// Emulator and circuit differ.
    #[error(transparent)]
    Difference(#[from] Box<Difference>),
}

/// Pins of a core's circuit, numbered as in the driver; the first two are strobes.
enum Pin {
    Tick,
    InputWrite,
    InputIndex,
    InputValue,
}

/// A program running on the emulator and on the circuit.
///
/// The emulator runs ahead; [`Lockstep::compare`] lets the circuit follow. Inputs and ticks reach the circuit's pins earlier, by the
/// delay of the pins, so that both sides see them in the same cycle.
pub struct Lockstep {
    emulator: Emulator,
    simulation: Simulation,
    events: Comparison<CircuitEvent>,
    pins: Vec<PinAction>,
    /// First cycle in which the input pins are free.
    free_pin: Cycle,
    simulated: Cycle,
    stopped: Option<Fault>,
    /// Values written to output ports since they were last published, by number.
    written: BTreeMap<u16, u32>,
    /// Cycles from an input on its pins to the cycle in which the emulator gets it.
    input_delay: Cycle,
}

impl Lockstep {
    /// Loads a program and the initial values of input ports, by register.
    ///
    /// # Errors
    /// If the emulator or the circuit does not accept the program.
    pub fn new(
        program: &Program,
        mut simulation: Simulation,
        inputs: &[(Register, u32)],
    ) -> Result<Lockstep, LockstepError> {
        let (wanted, circuit) = (program.latched_inputs(), simulation.latched());
        if wanted > circuit || (wanted == 0) != (circuit == 0) {
            return Err(LockstepError::Ports { program: wanted, circuit });
        }
        let mut emulator = Emulator::new(program)?;
        for &(register, bits) in inputs {
            // Neither side accepts a register that is not an input port.
            let _ = emulator.set_input_bits(register, bits);
        }
        simulation.load(program, inputs)?;
        Ok(Lockstep {
            emulator,
            simulation,
            events: Comparison::default(),
            pins: Vec::new(),
            free_pin: 0,
            simulated: 0,
            stopped: None,
            written: BTreeMap::new(),
            input_delay: if program.latched { LATCHED_INPUT_DELAY } else { INPUT_DELAY },
        })
    }

    /// Emulator of the program.
    pub fn emulator(&self) -> &Emulator {
        &self.emulator
    }

    /// Fault at which the emulator stopped.
    pub fn fault(&self) -> Option<&Fault> {
        self.stopped.as_ref()
    }

    /// Number of equal events so far.
    pub fn compared(&self) -> u64 {
        self.events.compared
    }

    /// Simulation, for use with another program.
    pub fn into_simulation(self) -> Simulation {
        self.simulation
    }

    /// Schedules a tick for a future cycle.
    pub fn tick_at(&mut self, cycle: Cycle) {
        if cycle >= TICK_DELAY + self.simulated && self.emulator.tick_at(cycle) {
            self.pins.push((cycle - TICK_DELAY, Pin::Tick as usize, 1));
        }
    }

    /// Sets an input port, by its register. Bundles that issue from now on see the value; with latched ports, the bundles of the next
    /// period to begin. Inputs set at the same time reach the circuit one per cycle; returns the cycle in which this one does.
    pub fn set_input(&mut self, register: Register, bits: u32) -> Cycle {
        let pin = self.emulator.now().saturating_sub(self.input_delay).max(self.free_pin);
        let number = self.emulator.machine().input_number(register);
        if let Some(index) = number.filter(|_| self.emulator.set_input_bits(register, bits).is_ok()) {
            self.free_pin = pin + 1;
            self.pins.extend(
                [(Pin::InputWrite, 1), (Pin::InputIndex, index.into()), (Pin::InputValue, bits)]
                    .map(|(of, value)| (pin, of as usize, value)),
            );
        }
        pin + self.input_delay
    }

    /// Runs the emulator until `cycle` cycles have passed; false if it stops earlier.
    pub fn run_until(&mut self, cycle: Cycle) -> bool {
        self.drive(|observed| observed.run_until(cycle)) == Some(Stop::Reached)
    }

    /// Runs a period: sets inputs, ticks as soon as the circuit has them and the front end is refilled, and runs the emulator until the
    /// next `wait` issues; false if it stops earlier. The first call also runs the program up to its first `wait`.
    pub fn run_period(&mut self, inputs: &[(Register, u32)]) -> bool {
        let limit = self.emulator.now() + 1_000_000;
        self.emulator.set_cycle_limit(limit);
        if matches!(self.emulator.status(), Status::Running)
            && !matches!(self.drive(|observed| observed.run_to_wait()), Some(Stop::Wait { .. }))
        {
            return false;
        }
        let Status::Waiting { since, .. } = *self.emulator.status() else { return false };
        let mut tick = since + 1 + Cycle::from(self.emulator.machine().refill);
        for &(register, bits) in inputs {
            tick = tick.max(self.set_input(register, bits));
        }
        self.tick_at(tick);
        matches!(self.drive(|observed| observed.run_to_wait()), Some(Stop::Wait { .. }))
    }

    fn drive(
        &mut self,
        run: impl FnOnce(&mut takt_emu::ObservedEmulator<'_>) -> Result<Stop, Fault>,
    ) -> Option<Stop> {
        let machine = self.emulator.machine();
        let (expected, written) = (&mut self.events.expected, &mut self.written);
        let mut sink = |event: &Event| {
            expected.extend(expect(event).map(alone));
            match *event {
                Event::PortWrite(write) => {
                    written.extend(machine.output_number(write.register).map(|number| (number, write.value)));
                }
                Event::Publish { cycle, .. } | Event::Wait { cycle, .. } => {
                    let published = std::mem::take(written).into_iter().map(|(register, value)| CoreEvent {
                        register,
                        value,
                        ..bare(EventKind::Publish, cycle)
                    });
                    expected.extend(published.map(alone));
                }
                _ => {}
            }
        };
        match run(&mut self.emulator.observed(&mut sink)) {
            Ok(stop) => Some(stop),
            Err(fault) => {
                self.stopped = Some(fault);
                None
            }
        }
    }

    /// Runs the circuit up to the emulator, as far as future inputs allow, and compares.
    ///
    /// # Errors
    /// A difference, or the end of the simulation.
    pub fn compare(&mut self) -> Result<(), LockstepError> {
        // An action of the host may still reach the pins INPUT_DELAY cycles before now.
        let now = self.emulator.now().saturating_sub(INPUT_DELAY + 1);
        if now > self.simulated {
            self.simulate(now)?;
        }
        let horizon = self.simulated.saturating_sub(REPORT_DELAY);
        self.check(|event| event.cycle < horizon)
    }

    /// Runs the circuit to the end and compares the rest.
    ///
    /// # Errors
    /// See [`Lockstep::compare`].
    pub fn finish(&mut self) -> Result<(), LockstepError> {
        let now = self.emulator.now();
        self.simulate((now + Cycle::from(MAX_LATENCY)).max(self.simulated) + REPORT_DELAY)?;
        match (&self.stopped, self.emulator.status()) {
            // The emulator reports no ticks after the halt.
            (None, &Status::Halted { cycle, .. }) => self.check(|event| {
                event.cycle <= cycle || !matches!(event.kind, EventKind::Missed | EventKind::Lost)
            }),
            (None, _) => self.check(|event| event.cycle < now),
            // Bundles that issued before the fault still write, and no others; the emulator leaves their results in flight.
            (Some(fault), _) if circuit_stops(fault) => {
                let cycle = fault.cycle;
                let machine = self.emulator.machine();
                for &retire in self.emulator.in_flight() {
                    self.events.expected.extend(expect(&Event::Retire(retire)).map(alone));
                    if let Some(register) = retire.register.filter(|&register| machine.is_output(register)) {
                        let (cycle, slot, address, value) =
                            (retire.cycle, retire.slot, retire.address, retire.value);
                        let write = PortWrite { cycle, slot, address, register, value, nan: false };
                        self.events.expected.extend(expect(&Event::PortWrite(write)).map(alone));
                    }
                }
                self.check(|event| {
                    event.cycle <= cycle || !matches!(event.kind, EventKind::Missed | EventKind::Lost)
                })
            }
            // The circuit does not detect this fault and continues.
            (Some(fault), _) => {
                let cycle = fault.cycle;
                self.check(|event| event.cycle < cycle)
            }
        }
    }

    fn simulate(&mut self, until: Cycle) -> Result<(), LockstepError> {
        self.pins.sort_by_key(|&(cycle, ..)| cycle);
        let due = self.pins.partition_point(|&(cycle, ..)| cycle < until);
        let pins: Vec<_> = self.pins.drain(..due).collect();
        self.events.found.extend(self.simulation.run(until, &pins)?.0);
        self.simulated = until;
        Ok(())
    }

    /// Compares the events whose counterparts are known, in order.
    fn check(&mut self, known: impl Fn(&CoreEvent) -> bool) -> Result<(), LockstepError> {
        let known = |event: &CircuitEvent| matches!(event, CircuitEvent::Core { event, .. } if known(event));
        Ok(self.events.check_events(known, &[("", self.emulator.program())], |_| String::new())?)
    }
}

/// Event of a single core.
fn alone(event: CoreEvent) -> CircuitEvent {
    CircuitEvent::Core { core: 0, event }
}
