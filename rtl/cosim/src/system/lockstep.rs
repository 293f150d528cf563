// SPDX-License-Identifier: MIT OR Apache-2.0
//! Lockstep of a system on emulator and circuit.

use crate::compare::{Comparison, Core, Difference};
use crate::event::{CircuitEvent, CoreEvent, EventKind, bare, circuit_stops, expect};
use crate::lockstep::{LockstepError, REPORT_DELAY};
use crate::simulation::{PinAction, Simulation};
use std::collections::BTreeMap;
use takt_emu::Status;
use takt_isa::timing::{Cycle, INPUT_DELAY};
use takt_rtl::system::{Pin, PinKind, SystemPlan};
use takt_rtl::verilog::Direction;
use takt_system::{
    Description, HostAction, HostError, HostSide, LinkEventKind, LinkKind, System, SystemFault,
};

/// A system running on the emulator and on the circuit.
///
/// The emulator runs ahead; the circuit follows to the same cycle, with the actions of the emulator's host on its pins in the same cycles.
pub struct SystemLockstep {
    system: System,
    simulation: Simulation,
    pins: Vec<Pin>,
    events: Comparison<CircuitEvent>,
    actions: Vec<PinAction>,
    simulated: Cycle,
    /// For each link: values that the host has written to a FIFO's fields, by pin; and the first cycles in which the FIFO can accept, or
    /// deliver, the host's next entry.
    working: Vec<BTreeMap<usize, u32>>,
    free: Vec<[Cycle; 2]>,
}

impl HostSide for SystemLockstep {
    type Error = LockstepError;

    fn act(&mut self, action: &HostAction) -> Result<bool, LockstepError> {
        SystemLockstep::act(self, action)
    }

    fn system(&self) -> &System {
        &self.system
    }
}

impl SystemLockstep {
    /// Resets emulator and circuit.
    ///
    /// # Errors
    /// If the emulator does not accept a program.
    pub fn new(
        description: &Description,
        plan: &SystemPlan,
        simulation: Simulation,
    ) -> Result<SystemLockstep, LockstepError> {
        let mut system = System::new(description)?;
        system.keep_events();
        system.keep_core_events();
        Ok(SystemLockstep {
            system,
            simulation,
            pins: plan.pins(),
            events: Comparison::default(),
            actions: Vec::new(),
            simulated: 0,
            working: vec![BTreeMap::new(); description.links.len()],
            free: vec![[0; 2]; description.links.len()],
        })
    }

    /// Emulator of the system.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// Number of equal events and pins so far.
    pub fn compared(&self) -> u64 {
        self.events.compared
    }

    /// Sets an input of the host, like [`System::set_input`].
    ///
    /// # Errors
    /// See [`System::set_input`].
    pub fn set_input(&mut self, name: &str, bits: u32) -> Result<(), LockstepError> {
        self.system.set_input(name, bits)?;
        let description = self.system.description();
        let own = |pin: &&Pin| {
            let link = &description.links[pin.link];
            let PinKind::Field(field) = pin.kind else { return false };
            pin.direction == Direction::Input
                && match link.kind {
                    LinkKind::Wire => link.fields[field].from == name,
                    _ => name
                        .strip_prefix(&link.name)
                        .and_then(|rest| rest.strip_prefix('.'))
                        .is_some_and(|name| name == link.fields[field].from),
                }
        };
        let Some(link) = self.pins.iter().find(own).map(|pin| pin.link) else { return Ok(()) };
        let Some(pin) = self.pins.iter().position(|pin| own(&pin)) else { return Ok(()) };
        let now = self.system.now();
        match description.links[link].kind {
            LinkKind::Wire => {
                self.actions.push((now, pin, bits));
                self.strobe(now, link, PinKind::Send);
            }
            LinkKind::Snapshot { .. } => self.actions.push((now, pin, bits)),
            // The values are on the pins in the cycle of the push.
            LinkKind::Fifo { .. } => drop(self.working[link].insert(pin, bits)),
        }
        Ok(())
    }

    /// Publishes a snapshot of the host, like [`System::publish`].
    ///
    /// # Errors
    /// See [`System::publish`].
    pub fn publish(&mut self, link: usize) -> Result<(), LockstepError> {
        self.system.publish(link)?;
        self.strobe(self.system.now(), link, PinKind::Send);
        Ok(())
    }

    /// Pushes an entry of the host, like [`System::push`]. Several pushes at the same time enter the circuit in successive cycles.
    ///
    /// # Errors
    /// See [`System::push`].
    pub fn push(&mut self, link: usize) -> Result<bool, LockstepError> {
        let room = self.system.push(link)?;
        let cycle = self.turn(link, 0);
        self.actions.extend(self.working[link].iter().map(|(&pin, &bits)| (cycle, pin, bits)));
        self.strobe(cycle, link, PinKind::Send);
        Ok(room)
    }

    fn strobe(&mut self, cycle: Cycle, link: usize, kind: PinKind) {
        let pin = self.pins.iter().position(|pin| pin.link == link && pin.kind == kind);
        self.actions.extend(pin.map(|pin| (cycle, pin, 1)));
    }

    /// Cycle in which a FIFO accepts the host's next entry, or delivers one: one entry per cycle.
    fn turn(&mut self, link: usize, way: usize) -> Cycle {
        let cycle = self.system.now().max(self.free[link][way]);
        self.free[link][way] = cycle + 1;
        cycle
    }

    /// Performs an action of the host, like [`System::act`].
    ///
    /// # Errors
    /// See [`System::act`].
    pub fn act(&mut self, action: &HostAction) -> Result<bool, LockstepError> {
        match action {
            HostAction::Input { name, bits } => self.set_input(name, *bits).map(|()| true),
            HostAction::Publish(link) => self.publish(*link).map(|()| true),
            HostAction::Push(link) => self.push(*link),
            HostAction::Pop(link) => self.pop(*link).map(|entry| entry.is_some()),
        }
    }

    /// Writes all fields of a link that the host drives: sets the value of a wire, publishes a snapshot, or pushes an entry. Returns
    /// false if a FIFO is full, as far as the host can know.
    ///
    /// # Errors
    /// If the host drives no such link.
    pub fn write(&mut self, link: usize, values: &[u32]) -> Result<bool, LockstepError> {
        let unknown = || HostError::Unknown { what: "link from the host", name: link.to_string() };
        let known = self.system.description().links.get(link).cloned().ok_or_else(unknown)?;
        for (field, &value) in known.fields.iter().zip(values) {
            match known.kind {
                LinkKind::Wire => self.set_input(&field.from, value)?,
                _ => self.set_input(&format!("{}.{}", known.name, field.from), value)?,
            }
        }
        match known.kind {
            LinkKind::Wire => Ok(true),
            LinkKind::Snapshot { .. } => self.publish(link).map(|()| true),
            LinkKind::Fifo { .. } => self.push(link),
        }
    }

    /// Pops the head of a FIFO for the host; `None` if the FIFO is empty. Several pops at the same time reach the circuit in successive
    /// cycles.
    ///
    /// # Errors
    /// If there is no such FIFO.
    pub fn pop(&mut self, link: usize) -> Result<Option<Vec<u32>>, LockstepError> {
        let head = self.system.pop(link)?;
        if head.is_some() {
            let cycle = self.turn(link, 1);
            self.strobe(cycle, link, PinKind::Pop);
        }
        Ok(head)
    }

    /// Runs both sides until ticks have started, every core has halted, or `limit` cycles have passed. Returns the cycle of the first base
    /// tick, if it is known by then.
    ///
    /// # Errors
    /// A difference, or the end of the simulation.
    pub fn run_to_start(&mut self, limit: Cycle) -> Result<Option<Cycle>, LockstepError> {
        let start = self.system.run_to_start(limit);
        self.follow()?;
        Ok(start.unwrap_or_default())
    }

    /// Runs both sides until `cycle` cycles have passed; false if a fault has stopped the system.
    ///
    /// # Errors
    /// A difference, or the end of the simulation.
    pub fn run_until(&mut self, cycle: Cycle) -> Result<bool, LockstepError> {
        let result = self.system.run_until(cycle);
        self.follow()?;
        Ok(result.is_ok())
    }

    /// Fault at which the emulator stopped.
    pub fn fault(&self) -> Option<&SystemFault> {
        self.system.fault()
    }

    /// Runs the circuit up to the emulator, and compares.
    fn follow(&mut self) -> Result<(), LockstepError> {
        let now = self.system.now();
        let cores = self.system.take_core_events().into_iter();
        self.events.expected.extend(
            cores.filter_map(|(core, event)| Some(CircuitEvent::Core { core, event: expect(&event)? })),
        );
        let inputs = self.system.take_input_events().into_iter().map(|input| {
            let register = input.register.get();
            let event = CoreEvent { register, value: input.value, ..bare(EventKind::Input, input.cycle) };
            CircuitEvent::Core { core: input.core, event }
        });
        self.events.expected.extend(inputs);
        self.events.expected.extend(self.system.take_events().into_iter().map(CircuitEvent::Link));
        if now > self.simulated {
            self.actions.sort_by_key(|&(cycle, ..)| cycle);
            let due = self.actions.partition_point(|&(cycle, ..)| cycle < now);
            let actions: Vec<_> = self.actions.drain(..due).collect();
            let (found, pins) = self.simulation.run(now, &actions)?;
            self.events.found.extend(found);
            self.simulated = now;
            let known = now.saturating_sub(REPORT_DELAY);
            self.check(known)?;
            if self.system.fault().is_none() {
                self.check_pins(now, &pins)?;
            }
        }
        Ok(())
    }

    /// Collects the circuit's reports of the last cycles, and compares them. No action of the host may follow.
    ///
    /// # Errors
    /// A difference, or the end of the simulation.
    pub fn finish(&mut self) -> Result<(), LockstepError> {
        let now = self.system.now();
        let (found, _) = self.simulation.run(now + REPORT_DELAY, &[])?;
        self.events.found.extend(found);
        self.simulated = now + REPORT_DELAY;
        // Faults that the circuit does not detect are not events, and its behaviour in that cycle is undefined.
        let end = match self.system.fault() {
            Some(fault) if circuit_stops(&fault.fault) => fault.fault.cycle + 1,
            Some(fault) => fault.fault.cycle,
            None => now,
        };
        self.check(end)
    }

    /// Compares the value on each of the host's pins.
    fn check_pins(&mut self, now: Cycle, values: &[u32]) -> Result<(), LockstepError> {
        for (pin, &found) in self.pins.iter().zip(values) {
            if pin.direction != Direction::Output {
                continue;
            }
            let link = &self.system.description().links[pin.link];
            let expected = match (pin.kind, &link.kind) {
                (PinKind::Status(status), _) => self.system.fifo_status(pin.link, status),
                // An empty queue has no head.
                (_, LinkKind::Fifo { .. }) if self.system.fifo_entries(pin.link).is_empty() => None,
                (PinKind::Field(field), kind) => {
                    let name = &link.fields[field].to;
                    let name = match kind {
                        LinkKind::Wire => name.clone(),
                        _ => format!("{}.{name}", link.name),
                    };
                    Some(self.system.output(&name)?)
                }
                _ => None,
            };
            let Some(expected) = expected else { continue };
            if expected != found {
                let difference = Difference {
                    cycle: now,
                    place: format!("pin {}", pin.net),
                    instruction: String::new(),
                    emulator: format!("0x{expected:08x}"),
                    circuit: format!("0x{found:08x}"),
                };
                return Err(Box::new(difference).into());
            }
            self.events.compared += 1;
        }
        Ok(())
    }

    /// Compares the events before a cycle, in order.
    fn check(&mut self, end: Cycle) -> Result<(), LockstepError> {
        // A halted core still gets ticks, which the emulator does not report.
        let description = self.system.description();
        let halts: Vec<Option<Cycle>> = (0..description.cores.len())
            .map(|core| match *self.system.core(core).status() {
                Status::Halted { cycle, .. } => Some(cycle),
                _ => None,
            })
            .collect();
        let after_halt = |event: &CircuitEvent| match event {
            CircuitEvent::Core { core, event }
                if matches!(event.kind, EventKind::Missed | EventKind::Lost) =>
            {
                halts[*core].is_some_and(|halt| event.cycle > halt)
            }
            CircuitEvent::Link(event) if event.kind == LinkEventKind::Skipped => {
                let to = description.links[event.link].to;
                let takt_system::End::Core(core) = to else { return false };
                halts[core].is_some_and(|halt| event.cycle > halt)
            }
            _ => false,
        };
        // The emulator reports a value on the pins only when bundles can read it, INPUT_DELAY cycles later.
        let known = |event: &CircuitEvent| match event {
            CircuitEvent::Core { event, .. } if event.kind == EventKind::Input => {
                event.cycle + INPUT_DELAY < end
            }
            event => event.cycle() < end,
        };
        for events in [&mut self.events.expected, &mut self.events.found] {
            events.retain(|event| !after_halt(event));
        }
        let cores: Vec<Core<'_>> =
            description.cores.iter().map(|core| (core.name.as_str(), &*core.program)).collect();
        Ok(self.events.check_events(known, &cores, |link| description.links[link].name.clone())?)
    }
}
