// SPDX-License-Identifier: MIT OR Apache-2.0
//! Group of lanes that execute the program in lockstep, and the lanes that have diverged from it.
//!
//! The state that all lanes share is held once, in an ordinary [`Emulator`] (the timeline): cycles, fetch, ticks, recently issued bundles,
//! the set of written registers, the return stack, the list of results in flight. The values, which differ, are rows of [`Lanes`]. A lane
//! that branches differently from the majority, or is about to fault, leaves the group: with its values and a copy of the timeline it
//! becomes an ordinary emulator, which runs alone to the end of the period. At the tick it joins the group again, if its timeline then
//! equals the common one.

use super::lanes::{InFlight, Lanes};
use crate::block::{Ages, CompilationState, ages};
use crate::emulator::{CompiledRuns, Emulator, MAX_CYCLE, Recent, Status};
use crate::event::{PortWrite, Retire};
use crate::execute::flow_fault;
use crate::fast_path::has_required;
use crate::fault::LoadError;
use crate::io::{PeriodError, PeriodReport};
use crate::lane::{LANES, Mask, Row};
use crate::machine::{PendingResult, RegisterSet, State};
use takt_isa::fp::{Flags, Value};
use takt_isa::timing::{self, Cycle};
use takt_isa::{BundleAddress, Flow, Program, Register};

/// Cost of one run of all lanes, in runs of a single emulator.
const RUN: u64 = 4;

/// Presence of a lane in the group.
enum Presence {
    /// Runs in the group.
    Present,
    /// Runs alone, in an emulator of its own. The second field is the outcome of its last period.
    Away(Box<Emulator>, Option<Result<PeriodReport, PeriodError>>),
    /// Unused, since the batch has fewer lanes.
    Empty,
}

/// Group of lanes that run together.
pub(crate) struct Group {
    /// Timeline shared by the present lanes.
    lead: Emulator,
    lanes: Lanes,
    presences: Vec<Presence>,
    present: Mask,
    /// Cycles by which each lane is later than the timeline.
    offsets: [i64; LANES],
    /// Registers that each lane had written before it joined.
    written: Vec<RegisterSet>,
    published: Vec<RegisterSet>,
    /// Emulators for reuse by lanes that leave.
    #[allow(clippy::vec_box, reason = "they come from lanes, and go to lanes again, in their boxes")]
    spare: Vec<Box<Emulator>>,
    report: Option<PeriodReport>,
    nan_writes: Vec<Vec<PortWrite>>,
    /// Limit on the cycles of a period.
    limit: Cycle,
    /// Limit on the cycles of all periods together.
    most: Cycle,
    /// Cycle before which these limits end each lane's current period.
    limits: [Cycle; LANES],
    /// Number of periods in which a lane ran alone, at least in part, summed over all lanes.
    pub(crate) apart: u64,
}

/// Continuation after a step of the common run.
enum GroupContinuation {
    More,
    /// The period has ended, or no lane is present any more.
    End,
}

impl Group {
    /// Group with a program loaded; its first `count` lanes are used.
    pub(crate) fn new(program: &Program, count: usize) -> Result<Group, LoadError> {
        let lead = Emulator::new(program)?;
        let written = vec![lead.state.written; LANES];
        let published =
            lead.state.latches.as_ref().map_or(RegisterSet::default(), |latches| latches.published);
        let presences = (0..LANES).map(|lane| if lane < count { Presence::Present } else { Presence::Empty });
        Ok(Group {
            lanes: Lanes::new(&lead.state),
            presences: presences.collect(),
            present: std::array::from_fn(|lane| lane < count),
            offsets: [0; LANES],
            written,
            published: vec![published; LANES],
            spare: Vec::new(),
            report: None,
            nan_writes: vec![Vec::new(); LANES],
            limit: MAX_CYCLE,
            most: MAX_CYCLE,
            limits: [MAX_CYCLE; LANES],
            apart: 0,
            lead,
        })
    }

    // ---- Settings and inputs.

    pub(crate) fn each_emulator(&mut self, mut set: impl FnMut(&mut Emulator)) {
        set(&mut self.lead);
        for presence in &mut self.presences {
            if let Presence::Away(emulator, _) = presence {
                set(emulator);
            }
        }
    }

    /// Number of runs of compiled blocks.
    pub(crate) fn compiled_runs(&self) -> CompiledRuns {
        self.lead.compiled_runs
    }

    /// Limits the cycles of a period.
    pub(crate) fn set_period_limit(&mut self, cycles: Cycle) {
        self.limit = cycles;
    }

    /// Limits the cycles since reset, over all periods.
    pub(crate) fn set_cycle_limit(&mut self, limit: Cycle) {
        self.most = limit.min(MAX_CYCLE);
    }

    /// Sets an input port, which the machine must have. `values` belong to the first lanes.
    pub(crate) fn set_input(&mut self, register: Register, values: &[u32]) {
        let row = match Row::try_from(values) {
            Ok(row) if self.present == [true; LANES] => row,
            _ => self.row_of(register, values),
        };
        self.lead.state.set_input(register, row[0]);
        match &mut self.lanes.latches {
            Some(latches) => latches.inputs[register.index()] = row,
            None => self.lanes.registers[register.index()] = row,
        }
    }

    /// Row of an input port's values if some lanes are absent: absent lanes get the value of a present one, and lanes that run alone get
    /// their own in their emulators.
    fn row_of(&mut self, register: Register, values: &[u32]) -> Row {
        for (presence, &value) in self.presences.iter_mut().zip(values) {
            if let Presence::Away(emulator, _) = presence {
                emulator.state.set_input(register, value);
            }
        }
        let mut row: Row = std::array::from_fn(|lane| values.get(lane).copied().unwrap_or(0));
        if let Some(model) = self.model() {
            let value = row[model];
            let absent = row.iter_mut().zip(self.present).filter(|(_, present)| !present);
            absent.for_each(|(word, _)| *word = value);
        }
        row
    }

    // ---- Inspection.

    /// Outcome of a lane's last period; `None` before the first.
    pub(crate) fn outcome(&self, lane: usize) -> Option<Result<PeriodReport, PeriodError>> {
        match &self.presences[lane] {
            Presence::Away(_, outcome) => outcome.clone(),
            _ => self
                .report
                .as_ref()
                .map(|report| Ok(report.shifted(self.offsets[lane], &self.nan_writes[lane]))),
        }
    }

    /// Cycles of a lane's last period; `None` after a fault.
    pub(crate) fn cycles(&self, lane: usize) -> Option<Cycle> {
        match &self.presences[lane] {
            Presence::Away(_, outcome) => Some(outcome.as_ref()?.as_ref().ok()?.cycles),
            _ => Some(self.report.as_ref()?.cycles),
        }
    }

    pub(crate) fn output(&self, lane: usize, register: Register) -> Option<u32> {
        let state = &self.lead.state;
        match (&self.presences[lane], &state.latches, &self.lanes.latches) {
            (Presence::Away(emulator, _), ..) => emulator.state.output(register),
            (_, Some(latches), Some(rows)) => {
                let published =
                    latches.published.contains(register) || self.published[lane].contains(register);
                published.then(|| rows.outputs[register.index()][lane])
            }
            _ => self.register(lane, register),
        }
    }

    pub(crate) fn register(&self, lane: usize, register: Register) -> Option<u32> {
        match &self.presences[lane] {
            Presence::Away(emulator, _) => emulator.register(register),
            _ => {
                let written =
                    self.lead.state.written.contains(register) || self.written[lane].contains(register);
                written.then(|| self.lanes.registers[register.index()][lane])
            }
        }
    }

    pub(crate) fn memory(&self, lane: usize) -> Vec<u32> {
        match &self.presences[lane] {
            Presence::Away(emulator, _) => emulator.memory().to_vec(),
            _ => self.lanes.memory.iter().map(|row| row[lane]).collect(),
        }
    }

    pub(crate) fn flags(&self, lane: usize) -> Flags {
        match &self.presences[lane] {
            Presence::Away(emulator, _) => emulator.flags(),
            _ => self.lanes.flags[lane],
        }
    }

    pub(crate) fn now(&self, lane: usize) -> Cycle {
        match &self.presences[lane] {
            Presence::Away(emulator, _) => emulator.now(),
            _ => self.lead.now.wrapping_add_signed(self.offsets[lane]),
        }
    }

    // ---- A period.

    /// Runs every lane to the end of its period.
    pub(crate) fn run_period(&mut self) {
        self.limits = std::array::from_fn(|lane| self.now(lane).saturating_add(self.limit).min(self.most));
        self.rejoin();
        self.report = None;
        self.lead.report = None;
        let present = (0..LANES).filter(|&lane| self.present[lane]);
        let limits = present.map(|lane| self.limits[lane].saturating_add_signed(-self.offsets[lane]));
        self.lead.set_cycle_limit(limits.min().unwrap_or(MAX_CYCLE));
        for (presence, limit) in self.presences.iter_mut().zip(self.limits) {
            if let Presence::Away(emulator, _) = presence {
                emulator.set_cycle_limit(limit);
            }
        }
        while self.model().is_some() {
            if let GroupContinuation::End = self.stretch() {
                break;
            }
        }
        for (lane, presence) in self.presences.iter_mut().enumerate() {
            match presence {
                Presence::Away(emulator, outcome) => {
                    self.apart += 1;
                    *outcome = Some(emulator.run_period(&[]));
                }
                Presence::Present if !self.lanes.nan_writes[lane].kept.is_empty() => {
                    self.nan_writes[lane] = std::mem::take(&mut self.lanes.nan_writes[lane].kept);
                    self.nan_writes[lane].sort_unstable();
                }
                Presence::Present => self.nan_writes[lane].clear(),
                Presence::Empty => {}
            }
        }
    }

    /// First present lane.
    fn model(&self) -> Option<usize> {
        self.present.iter().position(|&present| present)
    }

    /// Executes a wait or a block.
    fn stretch(&mut self) -> GroupContinuation {
        match self.lead.status {
            Status::Waiting { address, .. } => self.wait_for_tick(address),
            Status::Running => self.run_block(),
            // The timeline itself neither halts nor faults: such lanes have left the group before.
            Status::Halted { .. } | Status::Faulted(_) => self.leave_all(),
        }
    }

    fn wait_for_tick(&mut self, address: BundleAddress) -> GroupContinuation {
        if self.lead.ticks.next().is_none()
            && let Some(tick) = self.lead.due_tick()
        {
            self.lead.tick_at(tick);
        }
        let Some(tick) = self.lead.ticks.next().filter(|&tick| tick < self.lead.cycle_limit) else {
            return self.leave_all();
        };
        self.take_inputs();
        self.lead.ticks.take(tick);
        self.lanes.take_inputs(&mut self.lead.state);
        self.lead.see_tick(tick, &mut None);
        self.lanes.write_back_until(&mut self.lead.state, tick, &self.present, &self.offsets);
        self.lead.tally.wait(address, tick + 1 - self.lead.now);
        self.lead.now = tick + 1;
        GroupContinuation::More
    }

    /// Latches the inputs, if latching is due before the next cycle.
    fn take_inputs(&mut self) {
        if self.lead.state.latches.as_ref().is_some_and(|latches| latches.take) {
            self.lanes.take_inputs(&mut self.lead.state);
        }
    }

    /// Executes the next block in every present lane.
    fn run_block(&mut self) -> GroupContinuation {
        let entered = self.lead.front.delivered;
        let Some(id) = self.lead.next_block() else { return self.leave_all() };
        let block = &self.lead.cache.blocks[id as usize];
        let (flow, last, ends_loop) = (block.flow, entered + Cycle::from(block.last), block.ends_loop);
        let end = block.end().previous();
        if let Flow::Loop { count, .. } = flow
            && !self.agree_on(count)
        {
            return self.leave_all();
        }
        let lead = &self.lead;
        if last >= lead.cycle_limit
            || flow == Flow::Halt
            || lead.beyond_bound().is_some()
            || flow_fault(flow, ends_loop, &lead.state, lead.code.machine, end).is_some()
        {
            return self.leave_all();
        }
        self.take_inputs();
        let block = &mut self.lead.cache.blocks[id as usize];
        if !block.verified && !has_required(&self.lead.state, block, last) {
            return self.leave_all();
        }
        if let Some(after) = self.lead.compile_after {
            block.compile_lanes_after(after / RUN, self.lead.code.machine.data_depth);
        }
        while let Err(outside) = self.try_block(id, last) {
            (0..LANES).filter(|&lane| outside[lane]).for_each(|lane| self.leave(lane));
            if self.model().is_none() {
                return GroupContinuation::End;
            }
        }
        let address = self.after_block(id, last);
        self.go_on(flow, address, last)
    }

    /// Copies a register's value to the timeline. Returns false if the lanes differ, or if a result for it is in flight.
    fn agree_on(&mut self, register: Register) -> bool {
        let row = &self.lanes.registers[register.index()];
        let mut values = (0..LANES).filter(|&lane| self.present[lane]).map(|lane| row[lane]);
        let Some(first) = values.next() else { return false };
        let agree = values.all(|value| value == first) && !self.lead.state.is_pending(register);
        self.lead.state.registers[register.index()] = first;
        agree
    }

    /// Runs a block's operations. If some lanes address words outside the data memory, the error is the set of these lanes, and all
    /// effects are undone.
    fn try_block(&mut self, id: u32, last: Cycle) -> Result<(), Mask> {
        let Group { lead, lanes, present, offsets, .. } = self;
        let Emulator { cache, state, compiled_runs, .. } = lead;
        let block = &mut cache.blocks[id as usize];
        lanes.begin(state, block, last);
        let before = block.restore.as_ref().map(|_| (state.pending.clone(), state.written));
        lanes.write_back_until(state, last, present, offsets);
        if let CompilationState::Code(code, _) = &block.compiled_lanes {
            if lanes.run_code(block, code) {
                compiled_runs.done += 1;
                return Ok(());
            }
            compiled_runs.left += 1;
            block.compiled_lanes.count_exits(block.runs);
        }
        lanes.run(block, present).inspect_err(|_| {
            lanes.undo();
            if let Some((pending, written)) = before {
                (state.pending, state.written) = (pending, written);
            }
        })
    }

    /// Completes a block that has run; returns its last bundle.
    fn after_block(&mut self, id: u32, last: Cycle) -> BundleAddress {
        let Group { lead, lanes, offsets, .. } = self;
        let entered = lead.front.delivered;
        let block = &lead.cache.blocks[id as usize];
        // The lanes hold the values, hence 0 here.
        let late = block.late.iter().map(|late| late.pending(entered, Value::exact(0), None));
        lead.state.pending.extend(late);
        lanes.end(block, entered, offsets);
        lead.after_block(id, last)
    }

    /// Follows the control flow of the bundle at `address`, which issued in cycle `last`. At a branch, the majority of lanes stays.
    fn go_on(&mut self, flow: Flow, address: BundleAddress, last: Cycle) -> GroupContinuation {
        if let Flow::Branch { register, .. } = flow {
            let row = self.lanes.registers[register.index()];
            let is_zero = |lane: usize| row[lane] == 0;
            let zeros = (0..LANES).filter(|&lane| self.present[lane] && is_zero(lane)).count();
            let all = self.present.iter().filter(|&&present| present).count();
            let most = 2 * zeros > all;
            if zeros != 0 && zeros != all {
                for lane in 0..LANES {
                    if self.present[lane] && is_zero(lane) != most {
                        self.leave(lane);
                        if let Presence::Away(emulator, _) = &mut self.presences[lane] {
                            let last = last.wrapping_add_signed(self.offsets[lane]);
                            emulator.follow(flow, address, last, &mut None);
                        }
                    }
                }
            }
            // Sets the register that the timeline's branch tests.
            self.lead.state.registers[register.index()] = u32::from(!most);
        }
        self.lead.follow(flow, address, last, &mut None);
        if !matches!(flow, Flow::Publish | Flow::Wait(_)) {
            return GroupContinuation::More;
        }
        let Emulator { state, code, .. } = &self.lead;
        if state.latches.is_some() {
            let outputs = code.machine.slots.iter().flat_map(|slot| code.machine.output_registers(slot));
            let all_written = &self.written;
            let present = self.present;
            // A lane may have written more ports than the timeline knows; it publishes these, too.
            let outputs: Vec<Register> = outputs.collect();
            for lane in (0..LANES).filter(|&lane| present[lane]) {
                for &register in outputs.iter().filter(|&&register| all_written[lane].contains(register)) {
                    self.published[lane].insert(register);
                }
            }
            self.lanes.publish_outputs(outputs.into_iter());
        }
        self.report = self.lead.report.take();
        if self.report.is_some() { GroupContinuation::End } else { GroupContinuation::More }
    }

    // ---- Leaving and joining.

    fn leave_all(&mut self) -> GroupContinuation {
        for lane in 0..LANES {
            if self.present[lane] {
                self.leave(lane);
            }
        }
        GroupContinuation::End
    }

    /// Moves a lane out of the group, into an emulator with exactly its state.
    fn leave(&mut self, lane: usize) {
        let by = self.offsets[lane];
        let shift = |cycle: Cycle| cycle.wrapping_add_signed(by);
        self.lead.list_recent();
        let mut emulator = self.spare.pop().unwrap_or_else(|| Box::new(self.lead.clone()));
        // Blocks may have been verified for a lane that had written more registers.
        emulator.cache.blocks.iter_mut().for_each(|block| block.verified = false);
        let lead = &self.lead;
        emulator.now = shift(lead.now);
        emulator.status = match lead.status {
            Status::Waiting { since, address } => Status::Waiting { since: shift(since), address },
            ref status => status.clone(),
        };
        emulator.front = lead.front;
        emulator.front.delivered = shift(lead.front.delivered);
        emulator.turns.clone_from(&lead.turns);
        emulator.recent = match &lead.recent {
            Recent::List(recent) => {
                Recent::List(recent.iter().map(|&(address, cycle)| (address, shift(cycle))).collect())
            }
            recent => recent.clone(),
        };
        (emulator.scoreboard, emulator.planned, emulator.report) = (None, None, None);
        emulator.ticks = lead.ticks.shifted(by);
        emulator.period = lead.period.map(|period| period.shifted(by));
        emulator.set_cycle_limit(self.limits[lane]);
        let state = &mut emulator.state;
        state.written = lead.state.written;
        state.written.insert_all(&self.written[lane]);
        state.stack.clone_from(&lead.state.stack);
        state.loops.clone_from(&lead.state.loops);
        state.pending.clone_from(&lead.state.pending);
        for pending in &mut state.pending {
            pending.retire.cycle = shift(pending.retire.cycle);
            pending.retire.issued = shift(pending.retire.issued);
        }
        state.latches.clone_from(&lead.state.latches);
        if let Some(latches) = &mut state.latches {
            latches.published.insert_all(&self.published[lane]);
        }
        self.lanes.gather(lane, state);
        self.presences[lane] = Presence::Away(emulator, None);
        self.present[lane] = false;
        if let Some(model) = self.model() {
            self.lanes.imitate(lane, model);
        }
    }

    /// Lets lanes that run alone join at the beginning of a period, if their timeline equals the common one.
    fn rejoin(&mut self) {
        if !self.presences.iter().any(|presence| matches!(presence, Presence::Away(..))) {
            return;
        }
        if self.model().is_none() && !self.adopt() {
            return;
        }
        for lane in 0..LANES {
            let presence = std::mem::replace(&mut self.presences[lane], Presence::Empty);
            self.presences[lane] = match presence {
                Presence::Away(emulator, outcome) => match self.join(lane, emulator) {
                    Ok(()) => Presence::Present,
                    Err(emulator) => Presence::Away(emulator, outcome),
                },
                presence => presence,
            };
        }
    }

    /// Makes a lane's timeline the common one, if no lane is present: chooses a waiting lane with the fewest written registers, so that
    /// others can join.
    fn adopt(&mut self) -> bool {
        let waiting = self.presences.iter_mut().filter_map(|presence| match presence {
            Presence::Away(emulator, _) if matches!(emulator.status, Status::Waiting { .. }) => {
                Some(emulator)
            }
            _ => None,
        });
        let Some(first) = waiting.min_by_key(|emulator| emulator.state.written.len()) else { return false };
        first.list_recent();
        let lead = &mut self.lead;
        (lead.now, lead.front) = (first.now, first.front);
        lead.status.clone_from(&first.status);
        lead.turns.clone_from(&first.turns);
        lead.recent.clone_from(&first.recent);
        (lead.scoreboard, lead.planned, lead.report) = (None, None, None);
        lead.ticks.clone_from(&first.ticks);
        lead.period = first.period;
        lead.state.clone_from(&first.state);
        // Blocks may have been verified when more registers had been written.
        lead.cache.blocks.iter_mut().for_each(|block| block.verified = false);
        let in_flight = lead.state.pending.iter().map(|pending| InFlight {
            values: [pending.retire.value; LANES],
            flags: [pending.retire.flags; LANES],
            memory: pending.retire.memory.map(|word| [word; LANES]),
        });
        self.lanes.in_flight = in_flight.collect();
        true
    }

    /// Joins a lane, if it waits for the same tick and its state is equal except for values.
    fn join(&mut self, lane: usize, mut emulator: Box<Emulator>) -> Result<(), Box<Emulator>> {
        let Some(by) = self.distance(&mut emulator) else { return Err(emulator) };
        self.offsets[lane] = by;
        self.written[lane] = emulator.state.written;
        self.published[lane] =
            emulator.state.latches.as_ref().map_or(RegisterSet::default(), |latches| latches.published);
        self.lanes.scatter(lane, &mut emulator.state);
        self.present[lane] = true;
        self.spare.push(emulator);
        Ok(())
    }

    /// Cycles by which another timeline is later than the common one; `None` if they differ in any other respect.
    fn distance(&mut self, other: &mut Emulator) -> Option<i64> {
        let lead = &mut self.lead;
        let (Status::Waiting { since, .. }, Status::Waiting { since: others_since, .. }) =
            (&lead.status, &other.status)
        else {
            return None;
        };
        let (since, others_since) = (*since, *others_since);
        let (tick, others_tick) = (lead.due_tick()?, other.due_tick()?);
        let by = others_tick.wrapping_sub(tick).cast_signed();
        let machine = lead.code.machine;
        let delivered = timing::after_tick(machine, since, tick);
        let others_delivered = timing::after_tick(machine, others_since, others_tick);
        lead.list_recent();
        other.list_recent();
        let same = lead.front.next == other.front.next
            && delivered.wrapping_add_signed(by) == others_delivered
            && lead.ticks.shifted(by).agree(&other.ticks)
            && lead.turns == other.turns
            && lead.state.stack == other.state.stack
            && lead.state.loops == other.state.loops
            && other.state.written.contains_all(&lead.state.written)
            && same_latches(&lead.state, &other.state)
            && same_pending(&lead.state.pending, &other.state.pending, by)
            && recent_at(lead, delivered) == recent_at(other, others_delivered);
        same.then_some(by)
    }
}

/// Recent bundles that can still stall the next one when it is delivered.
fn recent_at(emulator: &Emulator, delivered: Cycle) -> Ages {
    let Recent::List(recent) = &emulator.recent else { return Box::new([]) };
    let age = |cycle: Cycle| (delivered - cycle).min(u8::MAX.into()) as u8;
    ages(&emulator.code, recent.iter().map(|&(address, cycle)| (address, age(cycle))))
}

fn same_latches(common: &State, other: &State) -> bool {
    match (&common.latches, &other.latches) {
        (Some(common), Some(other)) => {
            common.take == other.take
                && common.changed == other.changed
                && other.published.contains_all(&common.published)
        }
        (None, None) => true,
        _ => false,
    }
}

fn same_pending(common: &[PendingResult], others: &[PendingResult], by: i64) -> bool {
    let key = |pending: &PendingResult, by: i64| {
        let Retire { cycle, address, slot, op, .. } = pending.retire;
        (cycle.wrapping_add_signed(by), address, slot, op, pending.register)
    };
    common.iter().map(|pending| key(pending, by)).eq(others.iter().map(|pending| key(pending, 0)))
}
