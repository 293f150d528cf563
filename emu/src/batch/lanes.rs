// SPDX-License-Identifier: MIT OR Apache-2.0
//! Values of a group's lanes, and vector execution of operations on all of them.

use crate::block::Block;
use crate::event::PortWrite;
use crate::execute::data_address;
use crate::jit;
use crate::lane::{LANES, Mask, Row};
use crate::machine::{NanWrites, State, WORDS, Word};
use crate::micro::{Kind, Micro};
use pulp::{Arch, NullaryFnOnce};
use takt_isa::fp::{Flags, Host, ScreenedFloat, Value, is_nan};
use takt_isa::timing::Cycle;
use takt_isa::{Effect, Register, compute, compute_lanes};

/// Values of a result in flight, for all lanes. Its other properties are in the timeline's list, at the same index.
#[derive(Clone, Debug)]
pub(crate) struct InFlight {
    pub(crate) values: Row,
    pub(crate) flags: [Flags; LANES],
    /// Addresses of the data words from which a load took the values.
    pub(crate) memory: Option<Row>,
}

/// Latched ports of all lanes, by register.
#[derive(Clone, Debug)]
pub(crate) struct LatchedRows {
    pub(crate) inputs: Box<[Row]>,
    pub(crate) outputs: Box<[Row]>,
}

/// State that operations read and write, for all lanes.
#[derive(Clone, Debug)]
pub(crate) struct Lanes {
    pub(crate) registers: Box<[Row; WORDS]>,
    pub(crate) memory: Vec<Row>,
    pub(crate) flags: [Flags; LANES],
    pub(crate) in_flight: Vec<InFlight>,
    pub(crate) nan_writes: Vec<NanWrites>,
    pub(crate) latches: Option<LatchedRows>,
    late: Vec<InFlight>,
    rows: jit::Rows,
    nans: Vec<(u32, usize, u32)>,
    undo: Undo,
}

/// Undo log of a block that may fault.
#[derive(Clone, Debug, Default)]
struct Undo {
    registers: Vec<(Register, Row)>,
    /// The log is kept, because the block may fault.
    kept: bool,
    /// Rows of memory before a store.
    stored: Vec<(usize, Row)>,
    in_flight: Vec<InFlight>,
    flags: [Flags; LANES],
    nans: Vec<(usize, u64)>,
}

/// Arguments of [`Lanes::run`], whose code is compiled once for each vector width that the host may have.
struct Run<'a> {
    lanes: &'a mut Lanes,
    block: &'a Block,
    present: &'a Mask,
}

impl NullaryFnOnce for Run<'_> {
    type Output = Result<(), Mask>;

    #[inline(always)]
    fn call(self) -> Result<(), Mask> {
        for micro in &self.block.micros {
            self.lanes.micro(micro, self.present)?;
        }
        Ok(())
    }
}

/// Finds a NaN in any lane; without branches, so that it compiles to one comparison of vectors.
#[inline(always)]
fn any_nan(row: &Row) -> bool {
    row.iter().fold(false, |any, &bits| any | is_nan(bits))
}

impl Lanes {
    /// Sets all lanes to one state.
    pub(crate) fn new(state: &State) -> Lanes {
        let rows: Vec<Row> = state.registers.iter().map(|&word| [word; LANES]).collect();
        let spread = |words: &[u32]| words.iter().map(|&word| [word; LANES]).collect();
        let latches = state.latches.as_ref().map(|latches| LatchedRows {
            inputs: spread(&latches.inputs),
            outputs: spread(&latches.outputs),
        });
        Lanes {
            registers: rows.try_into().unwrap_or_else(|_| Box::new([[0; LANES]; WORDS])),
            memory: state.memory.iter().map(|&word| [word; LANES]).collect(),
            flags: [state.flags; LANES],
            in_flight: Vec::new(),
            nan_writes: vec![NanWrites::default(); LANES],
            latches,
            late: Vec::new(),
            rows: jit::Rows::default(),
            nans: Vec::new(),
            undo: Undo::default(),
        }
    }

    /// Gives an absent lane the registers and the memory of a present one. The lane is computed along with the rest, and with ordinary
    /// values it causes no special cases, which would slow down the others. Its results are not used.
    pub(crate) fn imitate(&mut self, lane: usize, model: usize) {
        self.registers.iter_mut().for_each(|row| row[lane] = row[model]);
        self.memory.iter_mut().for_each(|row| row[lane] = row[model]);
        self.in_flight.iter_mut().for_each(|in_flight| in_flight.values[lane] = in_flight.values[model]);
    }

    /// Copies the values of lane `lane` to a state.
    pub(crate) fn gather(&mut self, lane: usize, state: &mut State) {
        for (word, row) in state.registers.iter_mut().zip(&self.registers[..]) {
            *word = row[lane];
        }
        for (word, row) in state.memory.iter_mut().zip(&self.memory) {
            *word = row[lane];
        }
        state.flags = self.flags[lane];
        for (pending, in_flight) in state.pending.iter_mut().zip(&self.in_flight) {
            pending.retire.value = in_flight.values[lane];
            pending.retire.flags = in_flight.flags[lane];
            pending.retire.memory = in_flight.memory.map(|words| words[lane]);
        }
        state.nan_writes = std::mem::take(&mut self.nan_writes[lane]);
        if let (Some(latches), Some(rows)) = (&mut state.latches, &self.latches) {
            latches.inputs.iter_mut().zip(&rows.inputs).for_each(|(word, row)| *word = row[lane]);
            latches.outputs.iter_mut().zip(&rows.outputs).for_each(|(word, row)| *word = row[lane]);
        }
    }

    /// Copies the values of a state to lane `lane`.
    pub(crate) fn scatter(&mut self, lane: usize, state: &mut State) {
        for (row, &word) in self.registers.iter_mut().zip(&state.registers[..]) {
            row[lane] = word;
        }
        for (row, &word) in self.memory.iter_mut().zip(&state.memory) {
            row[lane] = word;
        }
        self.flags[lane] = state.flags;
        for (in_flight, pending) in self.in_flight.iter_mut().zip(&state.pending) {
            in_flight.values[lane] = pending.retire.value;
            in_flight.flags[lane] = pending.retire.flags;
            if let (Some(words), Some(word)) = (&mut in_flight.memory, pending.retire.memory) {
                words[lane] = word;
            }
        }
        self.nan_writes[lane] = std::mem::take(&mut state.nan_writes);
        if let (Some(latches), Some(rows)) = (&state.latches, &mut self.latches) {
            rows.inputs.iter_mut().zip(&latches.inputs).for_each(|(row, &word)| row[lane] = word);
            rows.outputs.iter_mut().zip(&latches.outputs).for_each(|(row, &word)| row[lane] = word);
        }
    }

    /// Latches the inputs, if latching is due for `state`.
    pub(crate) fn take_inputs(&mut self, state: &mut State) {
        let (Some(latches), Some(rows)) = (&mut state.latches, &self.latches) else { return };
        latches.take = false;
        for register in latches.changed.drain(..) {
            self.registers[register.index()] = rows.inputs[register.index()];
            state.written.insert(register);
        }
    }

    /// Publishes the outputs in these registers.
    pub(crate) fn publish_outputs(&mut self, registers: impl Iterator<Item = Register>) {
        if let Some(rows) = &mut self.latches {
            registers.for_each(|r| rows.outputs[r.index()] = self.registers[r.index()]);
        }
    }

    /// Writes back every result of the timeline that is on its bus in cycle `last` or before. `present` selects the lanes; each is
    /// `offsets` later.
    pub(crate) fn write_back_until(
        &mut self,
        state: &mut State,
        last: Cycle,
        present: &Mask,
        offsets: &[i64; LANES],
    ) {
        let mut kept = 0;
        for i in 0..state.pending.len() {
            let pending = state.pending[i];
            if pending.retire.cycle > last {
                state.pending.swap(kept, i);
                self.in_flight.swap(kept, i);
                kept += 1;
                continue;
            }
            let InFlight { values, flags, .. } = &self.in_flight[i];
            self.registers[pending.register.index()] = *values;
            state.written.insert(pending.register);
            self.flags.iter_mut().zip(flags).for_each(|(all, &flags)| *all |= flags);
            if pending.output && pending.float && any_nan(values) {
                let takt = pending.retire;
                for lane in (0..LANES).filter(|&lane| present[lane] && is_nan(values[lane])) {
                    self.nan_writes[lane].record(PortWrite {
                        cycle: takt.cycle.wrapping_add_signed(offsets[lane]),
                        slot: takt.slot,
                        address: takt.address,
                        register: pending.register,
                        value: values[lane],
                        nan: true,
                    });
                }
            }
        }
        state.pending.truncate(kept);
        self.in_flight.truncate(kept);
    }

    /// Saves the state that `block` may change before it faults; its last bundle issues in cycle `last`.
    pub(crate) fn begin(&mut self, state: &State, block: &Block, last: Cycle) {
        self.undo.stored.clear();
        self.nans.clear();
        self.late.clear();
        if !block.late.is_empty() {
            let none = InFlight { values: [0; LANES], flags: [Flags::NONE; LANES], memory: None };
            self.late.resize(block.late.len(), none);
        }
        self.undo.kept = block.restore.is_some();
        let Some(restore) = &block.restore else { return };
        let registers = state.due(last).chain(restore.iter().copied());
        self.undo.registers.clear();
        self.undo.registers.extend(registers.map(|register| (register, self.registers[register.index()])));
        self.undo.in_flight.clone_from(&self.in_flight);
        self.undo.flags = self.flags;
        self.undo.nans.clear();
        self.undo.nans.extend(self.nan_writes.iter().map(|writes| (writes.kept.len(), writes.count)));
    }

    /// Undoes a block from the saved state.
    pub(crate) fn undo(&mut self) {
        for &(register, row) in &self.undo.registers {
            self.registers[register.index()] = row;
        }
        for &(address, row) in self.undo.stored.iter().rev() {
            self.memory[address] = row;
        }
        self.in_flight.clone_from(&self.undo.in_flight);
        self.flags = self.undo.flags;
        for (writes, &(kept, count)) in self.nan_writes.iter_mut().zip(&self.undo.nans) {
            writes.kept.truncate(kept);
            writes.count = count;
        }
    }

    /// Runs the compiled code of a block. Returns false if the block's micros must run instead; the state that the block reads is then
    /// unchanged.
    pub(crate) fn run_code(&mut self, block: &Block, code: &jit::LaneCode) -> bool {
        if !code.run(&mut self.registers, &mut self.memory, &mut self.flags, &mut self.rows) {
            return false;
        }
        for (number, (late, from)) in self.late.iter_mut().zip(&block.late).enumerate() {
            let is_load = from.operation.effect == Effect::Load;
            *late = InFlight {
                values: self.registers[Word::late(number).index()],
                flags: [Flags::NONE; LANES],
                memory: is_load.then(|| self.rows.late(code, number)),
            };
        }
        true
    }

    /// Runs the micros of a block. If some present lanes address words outside the data memory, the error is the set of these lanes, and
    /// the caller must undo the block.
    pub(crate) fn run(&mut self, block: &Block, present: &Mask) -> Result<(), Mask> {
        Arch::new().dispatch(Run { lanes: self, block, present })
    }

    #[inline(always)]
    fn micro(&mut self, micro: &Micro, present: &Mask) -> Result<(), Mask> {
        let registers = &mut *self.registers;
        let dest = micro.dest.index();
        match micro.kind {
            Kind::Compute => {
                let sources = [micro.a, micro.b, micro.c].map(|word| &registers[word.index()]);
                // A separate destination, so that the compiler knows that it does not alias a source.
                let mut results = [0; LANES];
                let raised = compute_lanes::<ScreenedFloat, LANES>(micro.op, sources, &mut results);
                if raised {
                    return self.exactly(micro);
                }
                registers[dest] = results;
            }
            Kind::Immediate => registers[dest] = [micro.constant; LANES],
            Kind::Move => registers[dest] = registers[micro.a.index()],
            Kind::Load => return self.load(micro, present),
            Kind::Store => return self.store(micro, present),
            Kind::ReadFlags => registers[dest] = self.flags.map(|flags| flags.bits().into()),
            Kind::ClearFlags => self.flags = [Flags::NONE; LANES],
            // Ports of a batch are never watched.
            Kind::Watch => return Ok(()),
            Kind::Check => {
                let row = &registers[micro.a.index()];
                if any_nan(row) {
                    let nans = (0..LANES).filter(|&lane| present[lane] && is_nan(row[lane]));
                    self.nans.extend(nans.map(|lane| (micro.constant, lane, row[lane])));
                }
                return Ok(());
            }
        }
        if let Some(number) = micro.dest.late_number() {
            self.finish_late(number, [Flags::NONE; LANES], None);
        }
        Ok(())
    }

    /// Executes an operation lane by lane, with the flags that it raises.
    #[cold]
    #[inline(never)]
    fn exactly(&mut self, micro: &Micro) -> Result<(), Mask> {
        let mut raised = [Flags::NONE; LANES];
        for (lane, raised) in raised.iter_mut().enumerate() {
            let [a, b, c] = [micro.a, micro.b, micro.c].map(|word| self.registers[word.index()][lane]);
            let Value { bits, flags } = compute::<Host>(micro.op, a, b, c);
            self.registers[micro.dest.index()][lane] = bits;
            *raised = flags;
        }
        match micro.dest.late_number() {
            Some(number) => self.finish_late(number, raised, None),
            None => self.flags.iter_mut().zip(raised).for_each(|(all, flags)| *all |= flags),
        }
        Ok(())
    }

    #[inline(never)]
    fn finish_late(&mut self, number: usize, flags: [Flags; LANES], memory: Option<Row>) {
        if let Some(late) = self.late.get_mut(number) {
            *late = InFlight { values: self.registers[Word::late(number).index()], flags, memory };
        }
    }

    /// Data words that a load or store addresses in each lane; the error is the set of present lanes whose address is outside the data
    /// memory. (Absent lanes address no word.)
    fn addresses(&self, micro: &Micro, present: &Mask) -> Result<[Option<usize>; LANES], Mask> {
        let bases = &self.registers[micro.a.index()];
        let words = bases.map(|base| {
            Some(data_address(micro.constant, base)).filter(|&address| address < self.memory.len())
        });
        let outside = std::array::from_fn(|lane| present[lane] && words[lane].is_none());
        if outside == [false; LANES] { Ok(words) } else { Err(outside) }
    }

    /// Address of a load or store, if it is the same in every lane and inside the data memory.
    fn common_address(&self, micro: &Micro) -> Option<usize> {
        let bases = &self.registers[micro.a.index()];
        let address = data_address(micro.constant, bases[0]);
        (*bases == [bases[0]; LANES] && address < self.memory.len()).then_some(address)
    }

    fn load(&mut self, micro: &Micro, present: &Mask) -> Result<(), Mask> {
        let mut from = None;
        let row = if let Some(address) = self.common_address(micro) {
            if micro.dest.late_number().is_some() {
                from = Some([address as u32; LANES]);
            }
            self.memory[address]
        } else {
            let words = self.addresses(micro, present)?;
            from = Some(words.map(|word| word.unwrap_or(0) as u32));
            std::array::from_fn(|lane| words[lane].map_or(0, |word| self.memory[word][lane]))
        };
        self.registers[micro.dest.index()] = row;
        if let Some(number) = micro.dest.late_number() {
            self.finish_late(number, [Flags::NONE; LANES], from);
        }
        Ok(())
    }

    fn store(&mut self, micro: &Micro, present: &Mask) -> Result<(), Mask> {
        let row = self.registers[micro.b.index()];
        if let Some(address) = self.common_address(micro) {
            if self.undo.kept {
                self.undo.stored.push((address, self.memory[address]));
            }
            self.memory[address] = row;
            return Ok(());
        }
        for (lane, word) in self.addresses(micro, present)?.into_iter().enumerate() {
            if let Some(word) = word {
                if self.undo.kept {
                    self.undo.stored.push((word, self.memory[word]));
                }
                self.memory[word][lane] = row[lane];
            }
        }
        Ok(())
    }

    /// Completes a block entered in cycle `entered`: puts its late results in flight and records its NaNs.
    pub(crate) fn end(&mut self, block: &Block, entered: Cycle, offsets: &[i64; LANES]) {
        self.in_flight.append(&mut self.late);
        for &(check, lane, bits) in &self.nans {
            let entered = entered.wrapping_add_signed(offsets[lane]);
            self.nan_writes[lane].record(block.checks[check as usize].write(entered, bits));
        }
    }
}
