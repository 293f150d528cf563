// SPDX-License-Identifier: MIT OR Apache-2.0
//! Test support: random systems from a seed, and a reference model that steps cycle by cycle, with every register of a link in its place.
//! Tests compare the emulator and the circuit with it.

use crate::fifo::{Change, Store};
use crate::{ProgramError, ReadError, read};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::convert::Infallible;
use std::fmt::Write as _;
use std::sync::Arc;
use takt_emu::testing::{Options, Random, random_program};
use takt_emu::{Emulator, Event, Fault, LoadError};
use takt_isa::system::{Description, End, Link, LinkKind, Side, Source, Status};
use takt_isa::timing::{Cycle, ENDED_DELAY};
use takt_isa::{MACHINES, Machine, Program, Register};

/// Random system of a seed, as a file, with its programs by path.
pub fn random_system(seed: u64, machines: &[&'static Machine]) -> (String, BTreeMap<String, Program>) {
    let mut random = Random::new(seed.wrapping_mul(0x9e37_79b9) ^ 0x5157);
    let count = 2 + random.below(3) as usize;
    let text = format!("tick = {}\n", 40 + random.below(500));
    let mut writer = Writer { random, text, inputs: Vec::new(), outputs: Vec::new(), links: 0 };
    let mut programs = BTreeMap::new();
    for core in 0..count {
        let machine = machines[writer.random.below(machines.len() as u32) as usize];
        let path = format!("core{core}.s");
        let program = writer.core(core, machine, &path);
        programs.insert(path, program);
    }
    for core in 0..count {
        while let Some(input) = writer.inputs[core].pop() {
            writer.link(core, &input);
        }
    }
    for _ in 0..2 {
        writer.host_link();
    }
    (writer.text, programs)
}

/// Writer of a random system's file.
struct Writer {
    random: Random,
    text: String,
    /// Names of each core's input ports that no link drives yet.
    inputs: Vec<Vec<String>>,
    /// Names of each core's output ports.
    outputs: Vec<Vec<String>>,
    /// Number of links so far.
    links: usize,
}

impl Writer {
    /// Writes a core with a random program.
    fn core(&mut self, core: usize, machine: &'static Machine, path: &str) -> Program {
        let Writer { random, text, .. } = self;
        let options = Options { bundles: 20 + random.below(30), ..Options::TAME };
        let program = random_program(random.bits(), machine, options);
        let program = Program { latched: random.once_in(3), ..program };
        self.inputs.push(program.inputs.iter().map(|port| port.name.clone()).collect());
        self.outputs.push(program.outputs.iter().map(|port| port.name.clone()).collect());
        let _ = writeln!(text, "\n[[core]]\nname = \"c{core}\"\nprogram = \"{path}\"");
        // Machines made by tests have no name that a file could use: their programs bring them.
        if Machine::from_name(machine.name).is_ok() {
            let _ = writeln!(text, "machine = \"{}\"", machine.name);
        }
        if random.once_in(2) {
            let _ = writeln!(text, "tick = {}\noffset = {}", 1 + random.below(3), random.below(40));
        }
        program
    }

    /// Random output port of a core; a new value of the host for the number after the last core's.
    fn output(&mut self, sender: usize) -> String {
        match self.outputs.get(sender) {
            Some(ports) => ports[self.random.below(ports.len() as u32) as usize].clone(),
            None => format!("h{}", self.random.bits() % 1_000_000),
        }
    }

    fn latency(&mut self) {
        let random = &mut self.random;
        let _ = match random.below(3) {
            0 => Ok(()),
            1 => writeln!(self.text, "latency = {}", 4 + random.below(4)),
            _ => writeln!(self.text, "latency = {}", 4 + random.below(80)),
        };
    }

    /// Writes a link that drives an input port of a core.
    fn link(&mut self, core: usize, input: &str) {
        self.links += 1;
        let count = self.outputs.len();
        let sender = self.random.below(count as u32 + 1) as usize;
        let host = sender == count;
        let from = if host { "host".to_owned() } else { format!("c{sender}") };
        let kind = self.random.below(3);
        if kind == 0 {
            let output = self.output(sender);
            let _ = write!(self.text, "\n[[wire]]\nfrom = \"{from}.{output}\"\nto = \"c{core}.{input}\"\n");
            self.latency();
            return;
        }
        let mut ports = vec![format!("\"{} -> {input}\"", self.output(sender))];
        if self.random.once_in(2)
            && let Some(more) = self.inputs[core].pop()
        {
            ports.push(format!("\"{} -> {more}\"", self.output(sender)));
        }
        let (number, table) = (self.links, if kind == 1 { "snapshot" } else { "fifo" });
        let _ = write!(
            self.text,
            "\n[[{table}]]\nname = \"l{number}\"\nfrom = \"{from}\"\nto = \"c{core}\"\nports = [{}]\n",
            ports.join(", ")
        );
        self.latency();
        if kind == 1 {
            if !host && self.random.once_in(2) {
                let strobe = self.output(sender);
                let _ = writeln!(self.text, "strobe = \"{strobe}\"");
            }
            return;
        }
        self.fifo(core, sender);
    }

    /// Writes the depth and the ports of a FIFO, the last link.
    fn fifo(&mut self, core: usize, sender: usize) {
        let count = self.outputs.len();
        // Depths beyond the circuit's limit for FIFOs outside of block RAM.
        let depth = [1, 2, 3, 4, 5, 6, 33, 40][self.random.below(8) as usize];
        let pop = self.output(core);
        let _ = writeln!(self.text, "depth = {depth}\npop = \"{pop}\"");
        if sender < count {
            let push = self.output(sender);
            let _ = writeln!(self.text, "push = \"{push}\"");
        }
        for (key, core) in [("receiver", core), ("sender", sender)] {
            if core < count
                && self.random.once_in(2)
                && let Some(port) = self.inputs[core].pop()
            {
                let status = Status::ALL[self.random.below(5) as usize].name();
                let _ = writeln!(self.text, "{key} = {{ {status} = \"{port}\" }}");
            }
        }
    }

    /// Writes a link from a core to the host.
    fn host_link(&mut self) {
        self.links += 1;
        let (number, random, text) = (self.links, &mut self.random, &mut self.text);
        let all: Vec<(usize, &String)> = self
            .outputs
            .iter()
            .enumerate()
            .flat_map(|(core, ports)| ports.iter().map(move |port| (core, port)))
            .collect();
        let (core, port) = all[random.below(all.len() as u32) as usize];
        let _ = match random.below(3) {
            0 => write!(text, "\n[[wire]]\nfrom = \"c{core}.{port}\"\nto = \"host.o{number}\"\n"),
            1 => write!(
                text,
                "\n[[snapshot]]\nname = \"l{number}\"\nfrom = \"c{core}\"\nto = \"host\"\nports = [\"{port}\"]\n"
            ),
            _ => write!(
                text,
                "\n[[fifo]]\nname = \"l{number}\"\nfrom = \"c{core}\"\nto = \"host\"\nports = [\"{port}\"]\ndepth = 3\npush = \"{port}\"\n"
            ),
        };
        self.latency();
    }
}

/// Description of a system from its file and programs.
///
/// # Errors
/// The mistakes in the file.
pub fn describe(
    text: &str,
    programs: &BTreeMap<String, Program>,
) -> Result<Description, ReadError<Infallible>> {
    read("system.toml", text, |request| {
        programs.get(request.path).cloned().ok_or_else(|| ProgramError::Missing {
            message: format!("there is no program {}", request.path),
            help: None,
        })
    })
}

/// Random system of a seed. A seed whose file is invalid (its tick is too short) is replaced by the next one.
pub fn random_description(seed: u64, machines: &[&'static Machine]) -> Description {
    let seeds = (0..).map(|i: u64| seed.wrapping_add(i << 32));
    let tries = seeds.map(|seed| random_system(seed, machines));
    tries.filter_map(|(text, programs)| describe(&text, &programs).ok()).next().unwrap_or(Description {
        tick: 1,
        cores: Vec::new(),
        links: Vec::new(),
    })
}

/// Machines of the tables, for [`random_description`].
pub fn all_machines() -> Vec<&'static Machine> {
    MACHINES.to_vec()
}

/// Delay line: outputs each input after `length` steps.
#[derive(Clone)]
struct DelayLine<T> {
    stages: VecDeque<Option<T>>,
}

impl<T> DelayLine<T> {
    fn new(length: Cycle) -> DelayLine<T> {
        DelayLine { stages: (0..length).map(|_| None).collect() }
    }

    fn step(&mut self, input: Option<T>) -> Option<T> {
        self.stages.push_back(input);
        self.stages.pop_front().flatten()
    }
}

struct ReferenceCore {
    emulator: Emulator,
    mailboxes: Vec<crate::Mailbox>,
    /// Values that wait before the pins, by mailbox.
    gate: BTreeMap<usize, u32>,
    /// Delay from the pins to the cycle in which the value counts.
    pins: DelayLine<(Register, u32)>,
    /// Writes to output ports whose cycle has not come.
    writes: Vec<(Cycle, Register, u32)>,
    waits: BTreeSet<Cycle>,
    /// Cycle of the last publication.
    published: Option<Cycle>,
    waited: Option<Cycle>,
    /// Arrivals of this cycle, by mailbox.
    arrived: Vec<(usize, u32)>,
    halted: bool,
}

/// Changes of a FIFO in a cycle: the new head, if it changed, and the status.
type FifoChange = (Option<Vec<u32>>, Vec<(Status, u32)>);

struct ReferenceLink {
    /// Values under way on a wire.
    wire: DelayLine<u32>,
    /// Writes of a snapshot in each cycle; the flag marks a publication.
    writes: DelayLine<(Vec<(usize, u32)>, bool)>,
    working: Vec<u32>,
    published: Vec<u32>,
    /// Entries under way to a FIFO; its status is under way in `back`.
    pushes: DelayLine<Vec<u32>>,
    store: Store,
    back: DelayLine<Vec<(Status, u32)>>,
    /// Changes of the previous cycle.
    change: Option<FifoChange>,
    /// Value to be sent at the `wait`, for latched ports.
    changed: Option<u32>,
    /// Actions of the host in this cycle.
    host_value: Option<u32>,
    host_publish: Option<Vec<u32>>,
    host_push: Option<Vec<u32>>,
    host_pop: bool,
    /// Value of the wire that the host sees.
    shown: u32,
}

/// Reference model of a system: all cores and links in lockstep, cycle by cycle.
pub struct Reference {
    description: Arc<Description>,
    cores: Vec<ReferenceCore>,
    links: Vec<ReferenceLink>,
    now: Cycle,
    start: Option<Cycle>,
}

impl Reference {
    /// Model after reset, like [`crate::System::new`].
    ///
    /// # Errors
    /// If a core's memories cannot hold its program.
    pub fn new(description: &Description) -> Result<Reference, LoadError> {
        let mut cores = Vec::new();
        for (number, core) in description.cores.iter().enumerate() {
            let mut emulator = Emulator::new(&core.program)?;
            emulator.set_blocks(false);
            let mailboxes = description.mailboxes(number);
            for mailbox in &mailboxes {
                let _ = emulator.set_input_bits(mailbox.register, description.initial(mailbox.source));
            }
            cores.push(ReferenceCore {
                emulator,
                mailboxes,
                gate: BTreeMap::new(),
                pins: DelayLine::new(core.input_delay()),
                writes: Vec::new(),
                waits: BTreeSet::new(),
                published: None,
                waited: None,
                arrived: Vec::new(),
                halted: false,
            });
        }
        let links = description.links.iter().map(|link| {
            let late = description.core(link.from).is_some_and(|core| core.program.latched);
            let extra = if late { ENDED_DELAY } else { 0 };
            let initial: Vec<u32> = link.fields.iter().map(|field| field.initial).collect();
            let depth = if let LinkKind::Fifo { depth, .. } = link.kind { depth } else { 0 };
            // The host publishes without a core's `wait`, which would add two cycles.
            let told = if link.from == End::Host { 0 } else { ENDED_DELAY };
            ReferenceLink {
                wire: DelayLine::new(link.transit() + extra),
                writes: DelayLine::new(link.transit() + told),
                working: initial.clone(),
                published: initial.clone(),
                pushes: DelayLine::new(link.transit()),
                store: Store::new(depth),
                back: DelayLine::new(link.transit()),
                change: None,
                changed: None,
                host_value: None,
                host_publish: None,
                host_push: None,
                host_pop: false,
                shown: initial.first().copied().unwrap_or(0),
            }
        });
        let links = links.collect();
        Ok(Reference { description: Arc::new(description.clone()), cores, links, now: 0, start: None })
    }

    /// Cycles that have passed since reset.
    pub fn now(&self) -> Cycle {
        self.now
    }

    /// Cycle of the first base tick.
    pub fn start(&self) -> Option<Cycle> {
        self.start
    }

    /// Emulator of a core.
    pub fn core(&self, core: usize) -> &Emulator {
        &self.cores[core].emulator
    }

    /// Value that the host sees of a wire, of a snapshot, or of a FIFO's head.
    pub fn output(&self, link: usize, field: usize) -> u32 {
        let state = &self.links[link];
        match self.description.links[link].kind {
            LinkKind::Wire => state.shown,
            LinkKind::Snapshot { .. } => state.published[field],
            LinkKind::Fifo { .. } => state.store.entries.front().map_or(0, |entry| entry[field]),
        }
    }

    /// Entries of a FIFO, the head first.
    pub fn fifo_entries(&self, link: usize) -> Vec<Vec<u32>> {
        self.links[link].store.entries.iter().cloned().collect()
    }

    /// Writes all fields of a link for the host in the coming cycle: publishes a snapshot, pushes into a FIFO.
    pub fn write(&mut self, link: usize, values: &[u32]) {
        let state = &mut self.links[link];
        match self.description.links[link].kind {
            LinkKind::Wire => state.host_value = Some(values[0]),
            LinkKind::Snapshot { .. } => state.host_publish = Some(values.to_vec()),
            LinkKind::Fifo { .. } => state.host_push = Some(values.to_vec()),
        }
    }

    /// Pops the head of a FIFO for the host in the coming cycle.
    pub fn pop(&mut self, link: usize) {
        self.links[link].host_pop = true;
    }

    /// Steps every core and every link by one cycle.
    ///
    /// # Errors
    /// Index and fault of the core that faults.
    pub fn step(&mut self) -> Result<(), (usize, Fault)> {
        let now = self.now;
        let description = Arc::clone(&self.description);
        self.begin();
        let mut fault = None;
        for (number, core) in self.cores.iter_mut().enumerate() {
            if let Some(start) = self.start {
                let known = &description.cores[number];
                let (first, period) = (start + known.offset, known.period(description.tick));
                if now >= first && (now - first).is_multiple_of(period) {
                    core.emulator.tick_at(now);
                }
            }
            let (writes, waits, published) = (&mut core.writes, &mut core.waits, &mut core.published);
            let mut sink = |event: &Event| match event {
                Event::PortWrite(write) => writes.push((write.cycle, write.register, write.value)),
                Event::Wait { cycle, .. } => {
                    waits.insert(*cycle);
                    *published = Some(*cycle);
                }
                Event::Publish { cycle, .. } => *published = Some(*cycle),
                Event::Halt { .. } => {
                    core.waited.get_or_insert(now);
                    core.halted = true;
                }
                _ => {}
            };
            if let Err(found) = core.emulator.observed(&mut sink).step_cycle() {
                fault.get_or_insert((number, found));
            }
            if core.waits.contains(&now) {
                core.waited.get_or_insert(now);
            }
        }
        for (number, link) in description.links.iter().enumerate() {
            self.link(&description, number, link, now);
        }
        self.end(&description, now);
        self.now += 1;
        match fault {
            Some(fault) => Err(fault),
            None => Ok(()),
        }
    }

    /// Moves waiting values to the pins, and the values that leave the pins' delay into the cores.
    fn begin(&mut self) {
        for core in &mut self.cores {
            let pin = core.gate.pop_first().map(|(mailbox, value)| (core.mailboxes[mailbox].register, value));
            if let Some((register, value)) = core.pins.step(pin) {
                let _ = core.emulator.set_input_bits(register, value);
            }
        }
    }

    fn arrive(&mut self, core: usize, source: Source, value: u32) {
        let core = &mut self.cores[core];
        if let Some(mailbox) = core.mailboxes.iter().position(|mailbox| mailbox.source == source) {
            core.arrived.push((mailbox, value));
        }
    }

    fn written(&self, end: End, register: Option<Register>, now: Cycle) -> Option<u32> {
        let End::Core(core) = end else { return None };
        let writes = &self.cores[core].writes;
        let found = writes.iter().find(|(cycle, written, _)| *cycle == now && Some(*written) == register);
        found.map(|(_, _, value)| *value)
    }

    /// The core at this end publishes its outputs in this cycle.
    fn publishes(&self, end: End, now: Cycle) -> bool {
        match end {
            End::Core(core) => self.cores[core].published == Some(now),
            End::Host => false,
        }
    }

    fn link(&mut self, description: &Description, number: usize, link: &Link, now: Cycle) {
        match &link.kind {
            LinkKind::Wire => self.wire(description, number, link, now),
            LinkKind::Snapshot { strobe } => {
                self.take_snapshot(description, number, link, now);
                self.publish_snapshot(number, link, *strobe, now);
            }
            LinkKind::Fifo { push, pop, sender, receiver, .. } => {
                self.deliver_fifo(number, link, sender, receiver);
                self.step_fifo(number, link, *push, *pop, now);
            }
        }
    }

    fn wire(&mut self, description: &Description, number: usize, link: &Link, now: Cycle) {
        let written = self.written(link.from, link.fields[0].output, now);
        let latched = description.core(link.from).is_some_and(|core| core.program.latched);
        let publishes = self.publishes(link.from, now);
        let state = &mut self.links[number];
        let sent = if latched {
            state.changed = written.or(state.changed);
            if publishes { state.changed.take() } else { None }
        } else {
            written.or(state.host_value.take())
        };
        if let Some(value) = state.wire.step(sent) {
            match link.to {
                End::Core(core) => self.arrive(core, Source::Field { link: number, field: 0 }, value),
                End::Host => state.shown = value,
            }
        }
    }

    /// Takes the published values at the start of the receiving core's period.
    fn take_snapshot(&mut self, description: &Description, number: usize, link: &Link, now: Cycle) {
        // A snapshot takes values that were published before this cycle.
        if let (End::Core(core), Some(start)) = (link.to, self.start) {
            let known = &description.cores[core];
            let (first, period) =
                (start + known.offset - description.taking(core), known.period(description.tick));
            let waits = self.cores[core].waits.last().is_some_and(|since| since + ENDED_DELAY <= now)
                && matches!(self.cores[core].emulator.status(), takt_emu::Status::Waiting { .. });
            if now >= first && (now - first).is_multiple_of(period) && waits {
                for (field, value) in self.links[number].published.clone().into_iter().enumerate() {
                    self.arrive(core, Source::Field { link: number, field }, value);
                }
            }
        }
    }

    /// Writes fields of a snapshot; publishes them with a write of the strobe, or when the sender publishes its outputs.
    fn publish_snapshot(&mut self, number: usize, link: &Link, strobe: Option<Register>, now: Cycle) {
        let fields = link.fields.iter().enumerate();
        let mut writes: Vec<(usize, u32)> =
            fields.filter_map(|(i, field)| Some((i, self.written(link.from, field.output, now)?))).collect();
        let publish = match strobe {
            Some(strobe) => self.written(link.from, Some(strobe), now).is_some(),
            None => self.publishes(link.from, now),
        };
        let state = &mut self.links[number];
        let host = state.host_publish.take();
        let published = publish || host.is_some();
        writes.extend(host.into_iter().flatten().enumerate());
        let input = if writes.is_empty() && !published { None } else { Some((writes, published)) };
        if let Some((writes, published)) = state.writes.step(input) {
            writes.into_iter().for_each(|(field, value)| state.working[field] = value);
            if published {
                state.published.clone_from(&state.working);
            }
        }
    }

    /// Brings the head and the status of a FIFO to its ends.
    fn deliver_fifo(
        &mut self,
        number: usize,
        link: &Link,
        sender: &[(Status, Register)],
        receiver: &[(Status, Register)],
    ) {
        // Changes of the previous cycle arrive in this one.
        let change = self.links[number].change.take();
        let (head, status) = change.unzip();
        if let End::Core(core) = link.to {
            for (field, value) in head.flatten().into_iter().flatten().enumerate() {
                self.arrive(core, Source::Field { link: number, field }, value);
            }
            for &(status, value) in status.iter().flatten() {
                if receiver.iter().any(|(wanted, _)| *wanted == status) {
                    self.arrive(core, Source::Status { link: number, side: Side::Receiver, status }, value);
                }
            }
        }
        let back = self.links[number].back.step(status);
        if let End::Core(core) = link.from {
            for (status, value) in back.into_iter().flatten() {
                if sender.iter().any(|(wanted, _)| *wanted == status) {
                    self.arrive(core, Source::Status { link: number, side: Side::Sender, status }, value);
                }
            }
        }
    }

    /// Pushes an entry into a FIFO, and pops its head.
    fn step_fifo(
        &mut self,
        number: usize,
        link: &Link,
        push: Option<Register>,
        pop: Option<Register>,
        now: Cycle,
    ) {
        for (i, field) in link.fields.iter().enumerate() {
            if let Some(value) = self.written(link.from, field.output, now) {
                self.links[number].working[i] = value;
            }
        }
        let pushed = push.is_some_and(|push| self.written(link.from, Some(push), now).is_some());
        let popped = pop.is_some_and(|pop| self.written(link.to, Some(pop), now).is_some());
        let state = &mut self.links[number];
        let entry = match state.host_push.take() {
            Some(entry) => Some(entry),
            None => pushed.then(|| state.working.clone()),
        };
        let entry = state.pushes.step(entry);
        let popped = popped || std::mem::take(&mut state.host_pop);
        if popped || entry.is_some() {
            let Change { head, .. } = state.store.cycle(popped, entry);
            let first = state.store.entries.front().filter(|_| head).cloned();
            let status = Status::ALL.map(|status| (status, state.store.status(status))).to_vec();
            state.change = Some((first, status));
        }
    }

    /// Puts arrived values before the pins; starts the ticks once they may start.
    fn end(&mut self, description: &Description, now: Cycle) {
        for core in &mut self.cores {
            core.gate.extend(core.arrived.drain(..));
            core.writes.retain(|(cycle, ..)| *cycle > now);
        }
        let all = self.cores.iter().all(|core| core.waited.is_some());
        if self.start.is_none() && all && self.cores.iter().any(|core| !core.halted) {
            let last = self.cores.iter().filter_map(|core| core.waited).max();
            let tick = description.tick;
            self.start =
                last.map(|last| (last + crate::MIN_LATENCY + description.lead()).div_ceil(tick) * tick);
        }
    }
}
