// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of random programs from a seed, for tests of the emulator, and of the circuit against it.
//!
//! Programs use few registers, so hazards are frequent: nearly every bundle stalls. A unit is drawn first, then one of its
//! instructions, so rare units occur as often as common ones. Instructions are taken from the specification's table; only the loop
//! counter's decrement is named.

use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};
use takt_isa::program::{LoopBound, Port, Section};
use takt_isa::shape::WORD_BITS;
use takt_isa::{
    BankIndex, BundleAddress, Effect, Field, Function, Instruction, Machine, Op, Operand, Program, ROWS,
    Register, Row, SlotIndex, Type,
};

/// Shape of a random program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Approximate number of the period's bundles.
    pub bundles: u32,
    /// Contains branches, loops and calls; otherwise the period is a straight line.
    pub control: bool,
    /// May contain code that no sane program has: illegal words, jumps and addresses anywhere, unwritten registers, unbalanced calls.
    /// Such a program may fault, or never wait.
    pub wild: bool,
    /// Prefers instructions with three sources: some machines have one among dozens.
    pub three: bool,
    /// Directs programs to rare cases: calls as deep as the return stack, and operands whose sums tie, cancel, or are decided by bits far
    /// below their last place.
    pub directed: bool,
}

impl Options {
    /// Programs that run without fault: `.once` part, `wait`, a period, `wait`, subroutines.
    pub const TAME: Options =
        Options { bundles: 40, control: true, wild: false, three: false, directed: false };
    /// Programs that may do anything.
    pub const WILD: Options =
        Options { bundles: 40, control: true, wild: true, three: false, directed: false };
}

/// Random numbers for programs and operands, from SplitMix64.
#[derive(Clone, Debug)]
pub struct Random(SplitMix64);

impl Random {
    /// Generator with this seed.
    pub fn new(seed: u64) -> Random {
        Random(SplitMix64::seed_from_u64(seed))
    }

    /// Next 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// Random number below `end`, which is not 0.
    pub fn below(&mut self, end: u32) -> u32 {
        (((self.bits() >> 32) * end as u64) >> 32) as u32
    }

    /// Returns true with a probability of 1 in `n`.
    pub fn once_in(&mut self, n: u32) -> bool {
        self.below(n) == 0
    }

    fn pick<'a, T>(&mut self, from: &'a [T]) -> &'a T {
        &from[self.below(from.len() as u32) as usize]
    }

    /// Random operand: often a special binary32 value or a small integer.
    pub fn word(&mut self) -> u32 {
        const SPECIAL: [u32; 16] = [
            0x0000_0000, // zeros
            0x8000_0000,
            0x3f80_0000, // one, minus one, two, half
            0xbf80_0000,
            0x4000_0000,
            0x3f00_0000,
            0x7f80_0000, // infinities
            0xff80_0000,
            0x7fc0_0000, // NaNs, the last signaling
            0x7f80_0001,
            0x0000_0001, // subnormals
            0x807f_ffff,
            0x7f7f_ffff, // largest
            0x4f00_0000, // 2^31
            0x4049_0fdb, // pi
            0x43c9_0fda, // the sine's last argument
        ];
        match self.below(8) {
            0 | 1 => *self.pick(&SPECIAL),
            2 => self.below(64),
            3 => self.bits() as u32,
            // Moderate size, so that sums and products stay finite for a while.
            _ => (self.bits() as u32) & 0x807f_ffff | (120 + self.below(14)) << 23,
        }
    }

    /// Operand with few ones or few zeros, and an exponent from a range of 3 or of 61: sums of two such operands tie, cancel, or are
    /// decided by bits far below their last place.
    pub fn addend(&mut self) -> u32 {
        let (bits, place, other) = (self.bits() as u32, self.below(23), self.below(23));
        let fraction = match self.below(4) {
            0 => 1 << place,
            1 => 1 << place | 1 << other,
            2 => u32::MAX << place,
            _ => bits & (u32::MAX >> (9 + place)),
        };
        let exponent = if self.once_in(3) { 127 + self.below(3) } else { 97 + self.below(61) };
        bits & 0x8000_0000 | exponent << 23 | fraction & 0x007f_ffff
    }
}

/// Limits on the registers of each bank that random operations read and write, and on its output ports.
const POOL: u32 = 8;
const OUTPUTS: usize = 2;
/// Limit on the data words in which programs of different seeds differ.
const OWN_DATA: u32 = 64;
/// Number of input ports that random programs read.
pub const INPUTS: usize = 4;
/// Registers at the start of the first slot's bank that hold word addresses and are never written.
const BASES: usize = 4;
/// Registers after the bases that hold iteration counts of loops and are never written.
const COUNTS: usize = 4;

/// Chains of calls: minimum bundles of a program with a chain, average number of programs per chain, maximum bundles of each subroutine.
const LONG: u32 = 20;
const CHAINS: u32 = 6;
const LEVEL: u32 = 4;
/// Approximate limit on the bundles of all other subroutines.
const SUBROUTINES: u32 = 60;

/// Random program of a seed: equal arguments give equal programs. The host must set its inputs before it runs.
pub fn random_program(seed: u64, machine: &'static Machine, options: Options) -> Program {
    Generator::new(seed, machine, options).program()
}

/// Loops around the next bundle.
#[derive(Clone, Copy)]
struct LoopNesting {
    /// Depth of sequencer-counted loops, callers' included.
    counted: u32,
    /// Depth of loops closed by branches.
    repeats: usize,
    /// Product of the loops' iterations, callers' included.
    turns: u32,
}

impl LoopNesting {
    const NONE: LoopNesting = LoopNesting { counted: 0, repeats: 0, turns: 1 };
}

/// Approximate limit on the product of nested loops' iterations.
const TURNS: u32 = 8;

struct Generator {
    random: Random,
    machine: &'static Machine,
    options: Options,
    /// Registers that operations may read.
    sources: Vec<Register>,
    /// Registers of each slot that operations may write.
    dests: Vec<Vec<BankIndex>>,
    bases: Vec<(Register, u32)>,
    counts: Vec<(Register, u32)>,
    constants: Vec<(Register, u32)>,
    bundles: Vec<Vec<u64>>,
    /// Calls to be patched with the address of a subroutine: bundle, slot, loops around it.
    calls: Vec<(usize, SlotIndex, LoopNesting)>,
    /// Places of `loop` operations, as bundle and slot.
    loops: Vec<(usize, SlotIndex)>,
    around: LoopNesting,
    loop_bounds: Vec<LoopBound>,
}

impl Options {
    /// Draws a random operand.
    fn word(self, random: &mut Random) -> u32 {
        if self.directed && random.once_in(4) { random.addend() } else { random.word() }
    }
}

impl Generator {
    fn new(seed: u64, machine: &'static Machine, options: Options) -> Generator {
        let mut random = Random::new(seed);
        let mut sources: Vec<Register> = input_ports(machine).chain([Register::ZERO]).collect();
        let mut constants = Vec::new();
        let mut dests = Vec::new();
        let pool = 1 + random.below(POOL) as usize;
        for slot in machine.slots {
            // Reserve the first registers for bases, counters and counts.
            let ordinary = slot.bank.registers().skip(2 * BASES + COUNTS).take(pool);
            let all: Vec<Register> = ordinary.chain(machine.output_registers(slot).take(OUTPUTS)).collect();
            constants.extend(all.iter().map(|&register| (register, options.word(&mut random))));
            sources.extend(&all);
            dests.push(all.iter().filter_map(|&register| slot.bank.index(register)).collect());
        }
        let words = if is_large(machine) { machine.data_depth } else { machine.data_depth.min(500) };
        let bases = machine.slots[0].bank.registers().take(BASES);
        let bases: Vec<(Register, u32)> =
            bases.map(|base| (base, random.below(words + 50).wrapping_sub(50))).collect();
        constants.extend(&bases);
        let counts = machine.slots[0].bank.registers().skip(2 * BASES).take(COUNTS);
        let count = |register| {
            let odd = [0, 1 << 16, u32::MAX, 300][random.below(4) as usize];
            (register, if options.wild && random.once_in(16) { odd } else { 1 + random.below(4) })
        };
        let counts: Vec<(Register, u32)> = counts.map(count).collect();
        constants.extend(&counts);
        Generator {
            random,
            machine,
            options,
            sources,
            dests,
            bases,
            counts,
            constants,
            bundles: Vec::new(),
            calls: Vec::new(),
            loops: Vec::new(),
            around: LoopNesting::NONE,
            loop_bounds: Vec::new(),
        }
    }

    fn program(mut self) -> Program {
        let machine = self.machine;
        for _ in 0..self.random.below(4) {
            self.plain();
        }
        let first_wait = self.bundles.len();
        self.plain();
        let period = self.bundles.len() as u32;
        self.control(first_wait, Effect::Wait, period, None);
        self.body(self.options.bundles);
        let chain = self.deep().map(|length| (self.bundles.len(), length));
        if chain.is_some() {
            self.plain();
        }
        let last = self.bundles.len();
        self.plain();
        let ending = if self.random.once_in(16) { Effect::Halt } else { Effect::Wait };
        self.control(last, ending, period, None);
        let end = self.bundles.len() as u32;
        // Subroutines call only later ones.
        let mut depth = 0;
        while !self.calls.is_empty() && depth < 3 {
            depth += 1;
            let callers = std::mem::take(&mut self.calls);
            let address = self.bundles.len() as u32;
            let outside = callers.iter().map(|(_, _, around)| around);
            self.around = LoopNesting {
                counted: outside.clone().map(|around| around.counted).max().unwrap_or(0),
                turns: outside.map(|around| around.turns).max().unwrap_or(1),
                repeats: 0,
            };
            for (bundle, slot, _) in callers {
                self.retarget(bundle, slot, address);
            }
            self.body(4);
            self.around = LoopNesting::NONE;
            let last = self.bundles.len();
            self.plain();
            self.control(last, Effect::Return, 0, None);
        }
        for (bundle, slot, _) in std::mem::take(&mut self.calls) {
            self.bundles[bundle][slot.index()] = filler();
        }
        if let Some((caller, length)) = chain {
            self.chain(caller, length);
        }
        if self.options.wild {
            self.derange();
        }
        let port = |name: String, register, ty| Port { name, register, ty };
        let inputs = input_ports(machine).enumerate();
        let inputs = inputs.map(|(i, register)| port(format!("in{i}"), register, Type::B)).collect();
        // A bank's second port carries integers: no NaN there.
        let outputs = machine.slots.iter().flat_map(|slot| {
            let ports = machine.output_registers(slot).take(OUTPUTS).zip([Type::F, Type::I]);
            ports.map(|(register, ty)| port(format!("out{register}"), register, ty))
        });
        let section = |name: &str, start, end| {
            let (start, end) = (BundleAddress::new(start), BundleAddress::new(end));
            Section { name: name.to_owned(), start, end }
        };
        // Data are nearly the same for every seed: a circuit that has run another program needs only the differences.
        let mut common = Random::new(0);
        let mut data: Vec<u32> = (0..machine.data_depth).map(|_| self.options.word(&mut common)).collect();
        for _ in 0..OWN_DATA.min(machine.data_depth) {
            data[self.random.below(machine.data_depth) as usize] = self.options.word(&mut self.random);
        }
        self.constants.sort_unstable();
        self.loop_bounds.sort_unstable_by_key(|bound| bound.address);
        Program {
            machine,
            lines: vec![None; self.bundles.len() * machine.slots.len()],
            data,
            inputs,
            outputs: outputs.collect(),
            constants: self.constants,
            registers: Vec::new(),
            symbols: Vec::new(),
            loop_bounds: self.loop_bounds,
            ranges: Vec::new(),
            array_ranges: Vec::new(),
            results: Vec::new(),
            assumptions: Vec::new(),
            parts: Vec::new(),
            origins: Vec::new(),
            parameters: Vec::new(),
            latched: false,
            sections: vec![section("once", 0, period), section("period", period, end)],
            files: Vec::new(),
            code: self.bundles.into_iter().flatten().collect(),
        }
    }

    /// Generates a single-entry, single-exit region.
    fn body(&mut self, bundles: u32) {
        let end = self.bundles.len() + bundles as usize;
        while self.bundles.len() < end {
            match self.random.below(if self.options.control { 15 } else { 8 }) {
                0..8 => self.plain(),
                8 | 9 => self.skip(),
                10 => self.repeat(),
                11 => self.call(),
                12 => self.publish(),
                _ => self.counted(),
            }
        }
    }

    /// Generates a bundle that publishes the outputs, beside other operations.
    fn publish(&mut self) {
        let at = self.bundles.len();
        self.plain();
        self.control(at, Effect::Publish, 0, None);
    }

    /// Generates a call of a subroutine that does not exist yet.
    fn call(&mut self) {
        let at = self.bundles.len();
        self.plain();
        if let Some(slot) = self.control(at, Effect::Call, 0, None) {
            self.calls.push((at, slot, self.around));
        }
    }

    /// Draws the length of a chain of calls; `None` for no chain. Many chains are as deep as the return stack, in wild programs deeper.
    fn deep(&mut self) -> Option<u32> {
        let Options { bundles, control, wild, .. } = self.options;
        if !self.options.directed || !control || bundles < LONG || !self.random.once_in(CHAINS) {
            return None;
        }
        let deepest = self.machine.stack_depth;
        let length = match self.random.below(4) {
            0 => 1 + self.random.below(deepest),
            1 if wild => deepest + 1 + self.random.below(2),
            _ => deepest,
        };
        let room = self.machine.most_bundles().saturating_sub(self.bundles.len() as u32 + SUBROUTINES);
        (length * LEVEL <= room).then_some(length)
    }

    /// Generates a chain of subroutines, in which each calls the next, and a call of the first.
    fn chain(&mut self, mut caller: usize, length: u32) {
        for _ in 0..length {
            self.control(caller, Effect::Call, self.bundles.len() as u32, None);
            if self.random.once_in(4) {
                self.plain();
            }
            // In the last subroutine, this bundle calls nothing.
            caller = self.bundles.len();
            self.plain();
            if self.random.once_in(2) {
                self.plain();
            }
            let last = self.bundles.len();
            self.plain();
            self.control(last, Effect::Return, 0, None);
        }
    }

    /// Generates a forward branch or jump over a few bundles.
    fn skip(&mut self) {
        let at = self.bundles.len();
        self.plain();
        let over = self.random.below(4);
        for _ in 0..over {
            self.plain();
        }
        let effect = *self.random.pick(&[Effect::BranchZero, Effect::BranchNonzero, Effect::Jump]);
        let source = *self.random.pick(&self.sources);
        self.control(at, effect, at as u32 + 1 + over, Some(source));
    }

    /// Registers of the slot that computes integers: the counters of the outer and the inner loop closed by branches, the number 1, a
    /// count.
    fn counters(&self) -> Option<(SlotIndex, [BankIndex; 4])> {
        let (slot, _) = self.machine.host(Op::isub.row().function)?;
        let [Some(outer), Some(one), Some(inner), Some(count)] =
            [0, 1, 2, 3].map(|place| BankIndex::new(BASES + place))
        else {
            return None;
        };
        Some((slot, [outer, inner, one, count]))
    }

    /// Generates a bundle that sets a register of a slot.
    fn set(&mut self, slot: SlotIndex, dest: BankIndex, constant: u32) {
        let mut bundle = self.nops();
        let set = Instruction { dest, constant, ..Instruction::bare(op_with(Effect::Immediate)) };
        bundle[slot.index()] = word(&set);
        self.bundles.push(bundle);
    }

    /// Generates a bundle that subtracts one register of a slot from another.
    fn decrement(&mut self, slot: SlotIndex, dest: BankIndex, by: BankIndex) {
        let bank = &self.machine.slot(slot).bank;
        let mut bundle = self.nops();
        let mut count = Instruction { dest, ..Instruction::bare(Op::isub) };
        for (source, index) in [dest, by].into_iter().enumerate() {
            count.sources[source] = bank.register(index).unwrap_or(Register::ZERO);
        }
        bundle[slot.index()] = word(&count);
        self.bundles.push(bundle);
    }

    /// Draws the iterations of a loop: at most `most`, fewer if the loops around it have many.
    fn rounds(&mut self, most: u32) -> u32 {
        let left = (TURNS / self.around.turns.max(1)).clamp(1, most);
        1 + self.random.below(left)
    }

    /// Generates a loop of a few iterations closed by a branch, with branches and perhaps other loops in it.
    fn repeat(&mut self) {
        let Some((slot, [outer, inner, one, _])) = self.counters() else { return };
        let Some(&counter) = [outer, inner].get(self.around.repeats) else { return self.plain() };
        let rounds = self.rounds(5);
        self.set(slot, counter, rounds);
        self.set(slot, one, 1);
        let start = self.bundles.len() as u32;
        // Wild programs may state too low a bound.
        let most = if self.options.wild { 1 + self.random.below(5) } else { rounds };
        self.loop_bounds.push(LoopBound { address: BundleAddress::new(start), most, total: None });
        let outside = self.around;
        self.around.repeats += 1;
        self.around.turns = self.around.turns.saturating_mul(rounds);
        for _ in 0..1 + self.random.below(4) {
            match self.random.below(8) {
                0 => self.skip(),
                1 => self.repeat(),
                2 => self.counted(),
                _ => self.plain(),
            }
        }
        self.around = outside;
        self.decrement(slot, counter, one);
        let at = self.bundles.len();
        self.plain();
        let counter = self.machine.slot(slot).bank.register(counter);
        self.control(at, Effect::BranchNonzero, start, counter);
    }

    /// Generates a loop that the sequencer counts. Its body has 1 to 12 bundles, nested code not counted.
    fn counted(&mut self) {
        // Wild programs may nest too deep.
        let deepest = self.machine.loop_depth + if self.options.wild { 2 } else { 0 };
        let Some((slot, [.., one, count])) = self.counters().filter(|_| self.around.counted < deepest) else {
            return self.plain();
        };
        let (register, rounds) = *self.random.pick(&self.counts);
        let few =
            self.around.turns.saturating_mul(rounds) <= TURNS || self.options.wild && self.random.once_in(8);
        // Loops of many iterations have one or two bundles.
        let many = self.around.turns == 1 && self.random.once_in(8);
        let (source, rounds) = if few && !many && self.random.once_in(2) {
            (register, rounds)
        } else {
            let rounds = if many { 14 + self.random.below(24) } else { self.rounds(4) };
            if self.random.once_in(2) {
                self.set(slot, count, rounds);
            } else {
                self.set(slot, one, 1);
                self.set(slot, count, rounds + 1);
                self.decrement(slot, count, one);
            }
            (self.machine.slot(slot).bank.register(count).unwrap_or(Register::ZERO), rounds)
        };
        let at = self.bundles.len();
        self.plain();
        let start = self.bundles.len();
        // A bound is required unless the count is a constant. Wild programs may state too low a bound.
        if self.random.once_in(4) || !self.counts.contains(&(source, rounds)) {
            let less = self.options.wild && self.random.once_in(4);
            let most = if less { 1 + self.random.below(5) } else { rounds };
            self.loop_bounds.push(LoopBound { address: BundleAddress::new(start as u32), most, total: None });
        }
        let outside = self.around;
        self.around.counted += 1;
        self.around.turns = self.around.turns.saturating_mul(rounds);
        if !many && self.random.once_in(3) {
            self.counted();
        }
        let last = start + self.random.below(if many { 2 } else { 12 }) as usize;
        while self.bundles.len() < last {
            match if many { 15 } else { self.random.below(16) } {
                0 | 1 => self.skip(),
                2 => self.counted(),
                3 => self.repeat(),
                // Subroutines use the counters themselves.
                4 if self.around.repeats == 0 => self.call(),
                5 => self.publish(),
                _ => self.plain(),
            }
        }
        self.around = outside;
        self.plain();
        let end = self.bundles.len() as u32;
        if let Some(slot) = self.control(at, Effect::Loop, end, Some(source)) {
            self.loops.push((at, slot));
        }
    }

    fn nops(&self) -> Vec<u64> {
        vec![filler(); self.machine.slots.len()]
    }

    /// Generates a bundle without control flow.
    fn plain(&mut self) {
        let mut bundle = self.nops();
        let fill = 1 + self.random.below(4);
        for (slot, place) in bundle.iter_mut().enumerate() {
            if self.random.below(4) < fill {
                *place = self.operation(slot);
            }
        }
        self.bundles.push(bundle);
    }

    /// Generates an operation for a slot.
    fn operation(&mut self, slot: usize) -> u64 {
        let hosted: Vec<Function> =
            self.machine.slots[slot].units.iter().flat_map(|unit| unit.functions.iter().copied()).collect();
        // A slot's loads and stores count as one function: otherwise all others would be rarer.
        let access = [Function::Load, Function::Store];
        let both = access.iter().all(|function| hosted.contains(function));
        let functions: Vec<Function> =
            hosted.into_iter().filter(|function| !both || *function != Function::Store).collect();
        let function = *self.random.pick(&functions);
        let is_meant = |row: &Row| {
            row.function == function || (both && access.contains(&function) && access.contains(&row.function))
        };
        let rows: Vec<&Row> = ROWS.iter().filter(|row| is_meant(row) && !row.effect.redirects()).collect();
        if rows.is_empty() {
            return filler();
        }
        // An operation that drains hides other stalls, so it is rarer.
        let mut row = *self.random.pick(&rows);
        if row.effect.drains() && !self.random.once_in(4) {
            row = *self.random.pick(&rows);
        }
        // Draining operations must not be too rare, so that reading and clearing flags is tested.
        let draining: Vec<&Row> = rows.iter().copied().filter(|row| row.effect.drains()).collect();
        if !draining.is_empty() && self.random.once_in(24) {
            row = *self.random.pick(&draining);
        }
        let of_three: Vec<&Row> = rows.iter().copied().filter(|row| row.shape.sources() == 3).collect();
        if self.options.three && !of_three.is_empty() && self.random.once_in(3) {
            row = *self.random.pick(&of_three);
        }
        let mut instruction = Instruction::bare(row.op);
        for operand in row.shape.operands() {
            match *operand {
                Operand::Dest => instruction.dest = *self.random.pick(&self.dests[slot]),
                Operand::Source(n) => instruction.sources[n] = *self.random.pick(&self.sources),
                Operand::Immediate => instruction.constant = self.options.word(&mut self.random),
                Operand::Target => {}
                Operand::Memory => {
                    let (base, value) = *self.random.pick(&self.bases);
                    // Few words, so that loads meet stores.
                    let mut word = 60 + self.random.below(8);
                    if is_large(self.machine) && self.random.once_in(2) {
                        word += self.machine.data_depth - 68;
                    }
                    let offset = word.wrapping_sub(value);
                    let near = offset <= Field::Offset.bits().max();
                    instruction.sources[0] = if near { base } else { Register::ZERO };
                    instruction.constant = if near { offset } else { word };
                }
            }
        }
        word(&instruction)
    }

    /// Puts an operation with this effect into a bundle; returns its slot.
    fn control(
        &mut self,
        bundle: usize,
        effect: Effect,
        target: u32,
        source: Option<Register>,
    ) -> Option<SlotIndex> {
        let op = op_with(effect);
        let (slot, _) = self.machine.host(op.row().function)?;
        let mut instruction = Instruction::bare(op);
        if op.row().shape.fields().contains(&Field::Target) {
            instruction.constant = target;
        }
        if op.row().shape.sources() > 0 {
            instruction.sources[0] = source.unwrap_or(Register::ZERO);
        }
        self.bundles[bundle][slot.index()] = word(&instruction);
        Some(slot)
    }

    fn retarget(&mut self, bundle: usize, slot: SlotIndex, target: u32) {
        let place = &mut self.bundles[bundle][slot.index()];
        if let Ok(mut instruction) = Instruction::decode(*place) {
            instruction.constant = target;
            *place = word(&instruction);
        }
    }

    /// Generates a load or store near the memory's end, beyond it, or anywhere.
    fn stray(&mut self) {
        let memory = |word: &&mut u64| {
            Instruction::decode(**word)
                .is_ok_and(|instruction| matches!(instruction.effect(), Effect::Load | Effect::Store))
        };
        let mut candidates: Vec<&mut u64> = self.bundles.iter_mut().flatten().filter(memory).collect();
        if candidates.is_empty() {
            return;
        }
        let which = self.random.below(candidates.len() as u32) as usize;
        if let Ok(mut instruction) = Instruction::decode(*candidates[which]) {
            instruction.constant = match self.random.below(3) {
                0 => self
                    .random
                    .below(self.machine.data_depth.saturating_mul(4).min(Field::Offset.bits().max() + 1)),
                _ => self.machine.data_depth.saturating_sub(2) + self.random.below(4),
            };
            instruction.sources[0] = match self.random.below(3) {
                0 => Register::ZERO,
                1 => self.random.pick(&self.bases).0,
                _ => *self.random.pick(&self.sources),
            };
            *candidates[which] = word(&instruction);
        }
    }

    /// Breaks a loop: changes its end or its count's register, or places an operation that redirects at its end.
    fn unloop(&mut self, target: u32) {
        if self.loops.is_empty() {
            return;
        }
        let (bundle, slot) = *self.random.pick(&self.loops);
        let Ok(mut instruction) = Instruction::decode(self.bundles[bundle][slot.index()]) else { return };
        match self.random.below(4) {
            0 => instruction.constant = target,
            1 => instruction.constant = (instruction.constant + self.random.below(9)).saturating_sub(4),
            2 => instruction.sources[0] = *self.random.pick(&self.sources),
            _ => {
                let last = instruction.constant.saturating_sub(1);
                let effect = *self.random.pick(&[
                    Effect::Jump,
                    Effect::BranchZero,
                    Effect::BranchNonzero,
                    Effect::Call,
                    Effect::Return,
                    Effect::Loop,
                    Effect::Publish,
                    Effect::Wait,
                    Effect::Halt,
                ]);
                let source = *self.random.pick(&self.sources);
                if (last as usize) < self.bundles.len() {
                    self.control(last as usize, effect, target, Some(source));
                }
                return;
            }
        }
        self.bundles[bundle][slot.index()] = word(&instruction);
    }

    /// Corrupts a few words.
    fn derange(&mut self) {
        let (bundles, slots) = (self.bundles.len() as u32, self.machine.slots.len() as u32);
        for _ in 0..1 + self.random.below(3) {
            let (bundle, slot) = (self.random.below(bundles) as usize, self.random.below(slots) as usize);
            let (mut target, register) =
                (self.random.below(bundles + 2), self.random.below(Register::COUNT as u32) as usize);
            if self.random.once_in(8) {
                // Targets beyond the memory: a program memory that ignored an address's upper bits would find a bundle there.
                target += self.machine.code_depth << self.random.below(4);
                target &= Field::Target.bits().max();
            }
            match self.random.below(22) {
                0 => self.bundles[bundle][slot] = 0,
                1 => self.bundles[bundle][slot] = self.random.bits() >> 16,
                2 => self.bundles[bundle][slot] = self.random.bits() >> 8,
                3 => _ = self.control(bundle, Effect::Return, 0, None),
                4 | 5 => _ = self.control(bundle, Effect::Call, target, None),
                6 => _ = self.control(bundle, Effect::Jump, target, None),
                7 => _ = self.control(bundle, Effect::Halt, 0, None),
                8 => _ = self.control(bundle, Effect::Wait, target, None),
                9 => {
                    let source = *self.random.pick(&self.sources);
                    self.control(bundle, Effect::BranchNonzero, target, Some(source));
                }
                10..=12 => self.stray(),
                13 => {
                    let source = self.random.pick(&self.counts).0;
                    self.control(bundle, Effect::Loop, target, Some(source));
                }
                14..=16 => self.unloop(target),
                17 | 18 => self.bundles[bundle][slot] ^= 1 << self.random.below(WORD_BITS),
                // Inverts a bit of a second or third operand, which many instructions do not have.
                19 | 20 => self.bundles[bundle][slot] ^= 1 << self.random.below(22),
                _ => {
                    // Replaces a source or base by another register: unwritten, or of any value.
                    let source = match Register::new(register).filter(|_| self.random.once_in(2)) {
                        Some(register) => register,
                        None => *self.random.pick(&self.sources),
                    };
                    let words = self.bundles.iter_mut().flatten();
                    let with_source = |word: &&mut u64| {
                        Instruction::decode(**word).is_ok_and(|instruction| !instruction.reads().is_empty())
                    };
                    let mut candidates: Vec<&mut u64> = words.filter(with_source).collect();
                    if !candidates.is_empty() {
                        let which = self.random.below(candidates.len() as u32) as usize;
                        if let Ok(mut instruction) = Instruction::decode(*candidates[which]) {
                            instruction.sources[0] = source;
                            *candidates[which] = word(&instruction);
                        }
                    }
                }
            }
        }
    }
}

/// Input ports that random programs read, and that the host must set: `in0`, ….
pub fn input_ports(machine: &Machine) -> impl Iterator<Item = Register> {
    machine.inputs.registers().take(INPUTS)
}

fn filler() -> u64 {
    word(&Instruction::NOP)
}

/// Data memory of more than 1024 words: programs then use both of its ends.
fn is_large(machine: &Machine) -> bool {
    machine.data_depth > 1024
}

/// Encodes an instruction. Generated instructions fit; any other would become 0, the word of unwritten memory, which faults.
fn word(instruction: &Instruction) -> u64 {
    instruction.encode().unwrap_or(0)
}

/// Instruction with an effect that is unique to it.
fn op_with(effect: Effect) -> Op {
    ROWS.iter().find(|row| row.effect == effect).map_or(Op::nop, |row| row.op)
}
