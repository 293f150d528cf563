// SPDX-License-Identifier: MIT OR Apache-2.0
//! Translation cache: straight-line code is decoded and timed once, as a block.
//!
//! Since timing does not depend on data, the same bundles take the same cycles whenever they are entered in the same timing
//! state. That state is the list of recently issued bundles that can still stall others, each with its age in cycles; it is
//! nearly always empty. [`Cache`] is keyed by entry address and that list. [`compile`] runs the bundles through the scoreboard
//! once and keeps the outcome: offsets, stalls, counts, and the operations as a flat list of [`crate::micro`]s.

use crate::code::{Code, DecodedBundle};
use crate::jit;
use crate::machine::RegisterSet;
use crate::micro::{Check, Emitter, LateResult, Micro};
use crate::statistics::Tally;
use std::collections::HashMap;
use takt_isa::spec::units::MAX_LATENCY;
use takt_isa::timing::{self, Cause, Cycle, Scoreboard};
use takt_isa::{BundleAddress, Flow, Op, ROWS, Register};

/// Limit on the bundles of a block: longer straight-line code is cut.
const MAX_BUNDLES: usize = 1024;
/// Limit on the micros of all blocks, of 16 bytes each; the cache is emptied when it is reached.
const MAX_MICROS: usize = 1 << 20;
/// Limit on the number of blocks; the cache is emptied when it is reached.
const MAX_BLOCKS: usize = 1 << 14;
/// Limit on the successors that a block remembers; others are looked up every time.
const MAX_EDGES: usize = 8;

/// Limit on the runs that a block's compiled code may leave to the interpreter, whatever their share of all runs.
const MAX_LEFT: u64 = 16;

/// Remembered successor: the block for `target`, delivered `distance` cycles after the last issue of this one.
#[derive(Clone, Copy, Debug)]
struct Edge {
    target: BundleAddress,
    distance: u8,
    extent: Extent,
    id: u32,
}

/// Extent of a block with respect to breakpoints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Extent {
    /// Across breakpoints, while runs do not pause. After a bundle that enables breakpoints again ([`DecodedBundle::acts`]), up to the next
    /// breakpoint.
    Whole,
    /// Up to the first breakpoint.
    ToPause,
}

/// Code from which blocks are made, and their extent.
#[derive(Clone, Copy)]
pub(crate) struct BlockSource<'a> {
    pub(crate) code: &'a Code,
    /// Breakpoints by ascending address.
    pub(crate) pauses: &'a [BundleAddress],
    pub(crate) extent: Extent,
}

/// Recently issued bundles, in order, each with its age: the cycles since its issue.
pub(crate) type Ages = Box<[(BundleAddress, u8)]>;

/// State of a block's compilation to the host's instructions.
#[derive(Debug)]
pub(crate) enum CompilationState<Code> {
    /// The block has run too seldom to be compiled.
    NotYet,
    /// Compiled code, and the number of runs that it has left to the interpreter.
    Code(Code, u64),
    /// Never compiled: the compiler does not support the block, or its code left too many runs to the interpreter.
    Never,
}

impl<Code> CompilationState<Code> {
    fn from_code(code: Option<Code>) -> CompilationState<Code> {
        code.map_or(CompilationState::Never, |code| CompilationState::Code(code, 0))
    }

    /// Counts a run that the code has left to the interpreter, of `runs` in all. Code that leaves too many costs more than it saves, and is
    /// dropped.
    pub(crate) fn count_exits(&mut self, runs: u64) {
        if let CompilationState::Code(_, times) = self {
            *times += 1;
            if *times > MAX_LEFT && *times > runs / 4 {
                *self = CompilationState::Never;
            }
        }
    }
}

/// Block: straight-line code with its timing. Offsets are in cycles from the entry, which is the first cycle in which the first bundle may
/// issue.
#[derive(Debug)]
pub(crate) struct Block {
    pub(crate) entry: BundleAddress,
    /// Number of bundles, at consecutive addresses from `entry` on.
    pub(crate) bundles: u32,
    pub(crate) micros: Box<[Micro]>,
    /// Index of the first micro with a late result: a result written back after the block's last issue.
    pub(crate) split: usize,
    /// Offset of the first bundle's issue.
    pub(crate) first: u32,
    /// Offset of the last bundle's issue.
    pub(crate) last: u32,
    /// Issue offset of the last bundle with a breakpoint; `None` without breakpoints.
    pub(crate) pause: Option<u32>,
    /// A bundle enables breakpoints again ([`DecodedBundle::acts`]).
    pub(crate) acts: bool,
    /// Control flow of the last bundle; [`Flow::Next`] if the code was cut, or the next bundle is illegal. The results of the last bundle
    /// are late, so a branch's register still has its old value when the micros have run.
    pub(crate) flow: Flow,
    /// A loop may end with the last bundle.
    pub(crate) ends_loop: bool,
    /// Registers read before they are written: they must have been written before the block runs.
    pub(crate) required: RegisterSet,
    /// Registers written, without the destinations of late results.
    pub(crate) writes: RegisterSet,
    /// Set by the first run: then all registers that the block requires or writes have been written, and a register never becomes unwritten
    /// again.
    pub(crate) verified: bool,
    /// Registers to restore after a fault, if the block can fault in the middle.
    pub(crate) restore: Option<Box<[Register]>>,
    pub(crate) late: Box<[LateResult]>,
    pub(crate) checks: Box<[Check]>,
    /// Recent bundles at the cycle of the last issue.
    recent: Ages,
    edges: Vec<Edge>,

    /// Number of runs so far.
    pub(crate) runs: u64,
    pub(crate) compiled: CompilationState<jit::Code>,
    /// Compilation for the lanes of a batch.
    pub(crate) compiled_lanes: CompilationState<jit::LaneCode>,
    /// Stalls that each run adds to the statistics.
    stalls: Box<[(BundleAddress, Cause, u32)]>,
    operations: Box<[(Op, u32)]>,
    /// Cycles of waiting for the front end before the entry, by the bundle that redirected (`None`: reset).
    entered: Vec<(Option<BundleAddress>, u64)>,
}

impl Block {
    /// Charges cycles before the entry to the front end, refilling after bundle `from`, or filling after reset.
    #[inline]
    pub(crate) fn enter(&mut self, from: Option<BundleAddress>, cycles: u64) {
        if cycles == 0 {
            return;
        }
        match self.entered.iter_mut().find(|(address, _)| *address == from) {
            Some((_, sum)) => *sum += cycles,
            None => self.entered.push((from, cycles)),
        }
    }

    /// Address after the last bundle.
    #[inline]
    pub(crate) fn end(&self) -> BundleAddress {
        self.entry.offset(self.bundles)
    }

    /// Compiles the block once it has run `after` times.
    #[inline]
    pub(crate) fn compile_after(&mut self, after: u64, depth: u32) {
        if self.runs >= after && matches!(self.compiled, CompilationState::NotYet) {
            self.compiled = CompilationState::from_code(jit::compile(&self.micros, &self.late, depth));
        }
    }

    /// Compiles the block for the lanes of a batch once it has run `after` times.
    #[inline]
    pub(crate) fn compile_lanes_after(&mut self, after: u64, depth: u32) {
        if self.runs >= after && matches!(self.compiled_lanes, CompilationState::NotYet) {
            self.compiled_lanes =
                CompilationState::from_code(jit::compile_lanes(&self.micros, &self.late, depth));
        }
    }

    fn count(&self, tally: &mut Tally) {
        tally.bundles += self.runs * u64::from(self.bundles);
        for address in self.entry.until(self.end()) {
            tally.visits[address.index()] += self.runs;
        }
        for &(address, cause, cycles) in &self.stalls {
            tally.stall(address, cause, self.runs * u64::from(cycles));
        }
        for &(op, number) in &self.operations {
            tally.operations[op as usize] += self.runs * u64::from(number);
        }
        for &(from, cycles) in &self.entered {
            tally.stall(self.entry, Cause::Branch { from }, cycles);
        }
    }
}

/// Blocks compiled so far, by entry, recent bundles and extent.
#[derive(Default)]
pub(crate) struct Cache {
    pub(crate) blocks: Vec<Block>,
    ids: HashMap<(BundleAddress, Ages, Extent), u32>,
    micros: usize,
}

impl Cache {
    /// Recent bundles at the issue of a block's last bundle.
    pub(crate) fn recent(&self, id: u32) -> &[(BundleAddress, u8)] {
        &self.blocks[id as usize].recent
    }

    /// Adds the statistics of all blocks to a tally.
    pub(crate) fn count(&self, tally: &mut Tally) {
        self.blocks.iter().for_each(|block| block.count(tally));
    }

    /// A limit of the cache is reached: it must be emptied.
    pub(crate) fn is_full(&self) -> bool {
        self.micros >= MAX_MICROS || self.blocks.len() >= MAX_BLOCKS
    }

    /// Successor of block `id`, whose last bundle issued in cycle `last`.
    #[inline]
    pub(crate) fn successor(
        &mut self,
        of: BlockSource<'_>,
        id: u32,
        last: Cycle,
        entry: BundleAddress,
        at: Cycle,
    ) -> Option<u32> {
        // Beyond the longest latency nothing is in flight, so all greater distances are equivalent.
        let distance = (at - last).min(Cycle::from(MAX_LATENCY)) as u8;
        let edges = &self.blocks[id as usize].edges;
        let known = edges
            .iter()
            .find(|edge| edge.target == entry && edge.distance == distance && edge.extent == of.extent);
        if let Some(edge) = known {
            return Some(edge.id);
        }
        let recent = self.recent(id).iter().map(|&(address, age)| (address, age.saturating_add(distance)));
        let next = self.find(of, entry, ages(of.code, recent))?;
        let edges = &mut self.blocks[id as usize].edges;
        if edges.len() < MAX_EDGES {
            edges.push(Edge { target: entry, distance, extent: of.extent, id: next });
        }
        Some(next)
    }

    /// Block that begins at `entry`, to be entered in cycle `at` after the bundles `recent`.
    pub(crate) fn after(
        &mut self,
        of: BlockSource<'_>,
        recent: &[(BundleAddress, Cycle)],
        entry: BundleAddress,
        at: Cycle,
    ) -> Option<u32> {
        let recent = recent.iter().map(|&(address, cycle)| (address, (at - cycle).min(u8::MAX.into()) as u8));
        self.find(of, entry, ages(of.code, recent))
    }

    fn find(&mut self, of: BlockSource<'_>, entry: BundleAddress, recent: Ages) -> Option<u32> {
        // No block begins at a breakpoint: there the stepper has to find the cycle in which to pause.
        if of.extent == Extent::ToPause && of.pauses.binary_search(&entry).is_ok() {
            return None;
        }
        let key = (entry, recent, of.extent);
        if let Some(&id) = self.ids.get(&key) {
            return Some(id);
        }
        let block = compile(of, entry, &key.1)?;
        let id = self.blocks.len() as u32;
        self.micros += block.micros.len() + block.bundles as usize;
        self.blocks.push(block);
        self.ids.insert(key, id);
        Some(id)
    }
}

/// Selects the bundles that can still stall a bundle that issues now.
pub(crate) fn ages(code: &Code, recent: impl Iterator<Item = (BundleAddress, u8)>) -> Ages {
    recent
        .filter(|&(address, age)| code.legal(address).is_some_and(|decoded| decoded.reach > age.into()))
        .collect()
}

/// Bundle of a block with its offset.
struct BlockBundle<'a> {
    address: BundleAddress,
    offset: u32,
    decoded: &'a DecodedBundle,
}

/// Compiles the block that begins at `entry`, entered after the bundles `recent`; `None` if the first bundle is illegal.
fn compile(of: BlockSource<'_>, entry: BundleAddress, recent: &Ages) -> Option<Block> {
    let BlockSource { code, pauses, extent } = of;
    // Cycle of the scoreboard for offset 0, late enough that bundles in flight can have issued before it.
    const BASE: Cycle = MAX_LATENCY as Cycle;
    let mut scoreboard = Scoreboard::new(code.machine);
    for &(address, age) in recent {
        scoreboard.issue(&code.legal(address)?.timing, address, BASE.saturating_sub(age.into()));
    }
    let mut placed = Vec::new();
    let mut stalls = Vec::new();
    let mut earliest = BASE;
    let mut address = entry;
    let may_pause = |address| pauses.binary_search(&address).is_ok();
    // The head of a counted loop always begins a block, since its iterations are counted between blocks.
    let ends = |address, bundles, acts| {
        bundles >= MAX_BUNDLES
            || ((acts || extent == Extent::ToPause) && may_pause(address))
            || (bundles > 0 && code.head(address).is_some())
    };
    let mut acts = false;
    while let Some(decoded) = code.legal(address).filter(|_| !ends(address, placed.len(), acts)) {
        // A loop's count is checked before its block runs, so the block must not compute it.
        let counts =
            |register| placed.iter().any(|earlier: &BlockBundle<'_>| earlier.decoded.writes(register));
        if matches!(decoded.flow, Flow::Loop { count, .. } if counts(count)) {
            break;
        }
        acts |= decoded.acts;
        let issue = scoreboard.issue(&decoded.timing, address, earliest);
        stalls.extend(issue.stalls().iter().map(|&(cause, cycles)| (address, cause, cycles)));
        placed.push(BlockBundle { address, offset: (issue.cycle - BASE) as u32, decoded });
        if decoded.flow != Flow::Next {
            break;
        }
        earliest = timing::after_sequential(issue.cycle);
        address = address.next();
    }
    let (first, last) = (placed.first()?.offset, placed.last()?.offset);
    let pause = placed.iter().rev().find(|bundle| may_pause(bundle.address)).map(|bundle| bundle.offset);

    let mut required = RegisterSet::default();
    let mut defined = RegisterSet::default();
    let mut counts = [0; ROWS.len()];
    for BlockBundle { decoded, .. } in &placed {
        for operation in &decoded.operations {
            operation.reads().iter().filter(|&&r| !defined.contains(r)).for_each(|&r| required.insert(r));
            counts[operation.op as usize] += 1;
        }
        decoded.operations.iter().filter_map(|operation| operation.dest).for_each(|r| defined.insert(r));
    }

    let mut emitter = Emitter::new(last, code.machine.data_depth);
    for BlockBundle { address, offset, decoded } in &placed {
        emitter.bundle(*address, *offset, &decoded.operations);
    }
    let DecodedBundle { flow, ends_loop, .. } = *placed.last()?.decoded;
    let Emitter { micros, late, checks, split, writes, can_fault, .. } = emitter;

    let age = |offset: u32| u8::try_from(last - offset).unwrap_or(u8::MAX);
    let inherited = recent.iter().map(|&(address, before)| (address, before.saturating_add(age(0))));
    let own = placed.iter().map(|bundle| (bundle.address, age(bundle.offset)));
    Some(Block {
        entry,
        bundles: placed.len() as u32,
        split: split.unwrap_or(micros.len()),
        first,
        last,
        pause,
        acts,
        flow,
        ends_loop,
        required,
        restore: can_fault.then(|| Register::all().filter(|&r| writes.contains(r)).collect()),
        writes,
        verified: false,
        late: late.into(),
        checks: checks.into(),
        micros: micros.into(),
        recent: ages(code, inherited.chain(own)),
        edges: Vec::new(),
        runs: 0,
        compiled: CompilationState::NotYet,
        compiled_lanes: CompilationState::NotYet,
        stalls: stalls.into(),
        operations: ROWS
            .iter()
            .map(|row| (row.op, counts[row.op as usize]))
            .filter(|&(_, number)| number > 0)
            .collect(),
        entered: Vec::new(),
    })
}
