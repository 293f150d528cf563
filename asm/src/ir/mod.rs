// SPDX-License-Identifier: MIT OR Apache-2.0
//! The program between names and words: bundles of operations on virtual registers.
//!
//! [`resolve`](crate::resolve) builds it, the scheduler may rearrange it, [`allocate`](crate::emit::allocate) gives its registers
//! addresses, and `emit` encodes it. Invariants at every stage:
//!
//! * a bundle has at least one operation and no two that claim one slot; on a machine with one slot it has exactly one;
//! * all operations of a bundle read before any writes; bundles execute in the order of [`Ir::bundles`], and
//!   [`Operation::redirects`] says where that order ends;
//! * every register that is written is written from one slot only; which slot executes an operation that several may
//!   ([`Operation::slots`]) is chosen first by [`assign`](crate::banks::slots::assign), and again by the scheduler;
//! * bundles of `once` precede those of `period`; a label stands before the bundle at its position, or at the end.
//!
//! A stage that moves bundles must move [`Label::position`]s, [`LoopBound::position`]s, [`Loop::head`]s and [`Ir::period`] along, and leave
//! alone, as fences, bundles that hold a raw word ([`Bundle::is_opaque`]). Targets that the source wrote as numbers stay as they are.

pub(crate) mod arrays;
pub(crate) mod calls;
pub(crate) mod flow;
pub(crate) mod matching;
pub(crate) mod position;
pub(crate) mod runs;
pub(crate) mod type_evidence;

use crate::ir::arrays::{AccessId, Array, ArrayAccess, Loop};
use smallvec::SmallVec;
use std::collections::BTreeMap;
use std::num::NonZeroU32;
use takt_diagnostics::source::Span;
use takt_isa::program::{ArrayRange, ArrayResult, Columns, Location, Space};
use takt_isa::{Effect, Machine, Op, Operand, ROWS, Register, Row, SlotIndex, Slots, Type};

/// A register of [`Ir::registers`].
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, PartialOrd, Ord)]
pub struct RegisterId(NonZeroU32);

impl RegisterId {
    /// The register that always reads as zero: the first of every program.
    pub const ZERO: RegisterId = RegisterId(NonZeroU32::MIN);

    /// The register with an index. Indices are below 2³² - 1.
    #[inline]
    pub const fn new(index: usize) -> RegisterId {
        match NonZeroU32::new(index as u32 + 1) {
            Some(id) => RegisterId(id),
            None => RegisterId::ZERO,
        }
    }

    /// Index of the register in [`Ir::registers`].
    #[inline]
    pub const fn index(self) -> usize {
        self.0.get() as usize - 1
    }
}

/// A label of [`Ir::labels`].
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, PartialOrd, Ord)]
pub struct LabelId(pub u32);

/// The role of a register.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum RegisterKind {
    /// Declared by `.reg`, or named by its place alone.
    Plain,
    /// Declared by `.state`: its value outlives the period.
    State,
    /// An input port: written from outside, at the tick.
    Input,
    /// A parameter: an input port that changes only between two periods.
    Parameter,
    /// An output port: read from outside.
    Output,
    /// Holds these bits from the start; nothing writes it.
    Constant(u32),
    /// Always reads as zero.
    Zero,
}

impl RegisterKind {
    /// The host writes the register, and the program does not.
    pub const fn is_from_outside(self) -> bool {
        matches!(self, RegisterKind::Input | RegisterKind::Parameter)
    }
}

/// A register of the source, before it has a place in the machine.
#[derive(Clone, Debug)]
pub struct VirtualRegister {
    /// Name in the source; empty for constants, and for registers that the source names by their place alone.
    pub name: String,
    /// Role of the register.
    pub kind: RegisterKind,
    /// Type by which debuggers show the bits.
    pub ty: Type,
    /// Address that the source gives the register.
    pub pinned: Option<Register>,
    /// Bits that the loader writes, if the source has a preset. A constant's bits are in its kind.
    pub preset: Option<u32>,
    /// Place of the declaration, or of a constant's first use.
    pub span: Span,
}

/// A name with a suffix, which precedes an element's indices: `t.1`, `P.1[2,3]`.
pub(crate) fn numbered(name: &str, number: &str) -> String {
    let (head, indices) = name.split_at(name.find('[').unwrap_or(name.len()));
    format!("{head}{number}{indices}")
}

/// The constant operand of an operation.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Constant {
    /// Operation without a constant operand.
    None,
    /// An immediate, an offset, or a bundle address that the source gives as a number.
    Value(u32),
    /// The address of a code label.
    Code(LabelId),
    /// A word given bit by bit: an index into [`Ir::raw`]. Its reads and writes are not known.
    Raw(u32),
}

/// The source line that an operation is attributed to, and the part of the line if `.loc` states it. Eight bytes, since every
/// operation has one. [`Ir::location`] and [`Ir::columns`] read it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Attribution {
    /// Index of the file, or [`Attribution::NO_FILE`], or [`Attribution::PART`].
    file: u32,
    /// Line number; for [`Attribution::PART`], an index into [`Ir::parts`].
    line: u32,
}

impl Attribution {
    const NO_FILE: u32 = u32::MAX;
    const PART: u32 = u32::MAX - 1;

    /// Attribution to no line.
    pub(crate) const NONE: Attribution = Attribution { file: Attribution::NO_FILE, line: 0 };

    /// Attribution to a whole line.
    #[inline]
    pub(crate) const fn to(Location { file, line }: Location) -> Attribution {
        Attribution { file, line }
    }
}

/// An assumption of [`Ir::assumptions`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct AssumptionId(NonZeroU32);

impl AssumptionId {
    /// The assumption with an index; `None` beyond 2³² of them.
    pub(crate) fn new(index: usize) -> Option<AssumptionId> {
        NonZeroU32::new(u32::try_from(index).ok()?.checked_add(1)?).map(AssumptionId)
    }

    /// Index of the assumption in [`Ir::assumptions`].
    pub(crate) const fn index(self) -> usize {
        self.0.get() as usize - 1
    }
}

/// Range of a value that an operation writes, as `.assume` states it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Assumed {
    /// Type of the ends: binary32, or a signed integer.
    pub ty: Type,
    /// Least and largest value.
    pub ends: [u32; 2],
}

/// An operation on virtual registers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Operation {
    /// Instruction; `nop` where the word is given bit by bit.
    pub op: Op,
    /// Slots that may execute the operation: hosts of its function, as far as the source leaves a choice. Empty if any can, as
    /// for `nop`.
    pub slots: Slots,
    /// Slot that executes the operation, as assigned so far; `None` if any can.
    pub slot: Option<SlotIndex>,
    /// Register that the operation writes.
    pub dest: Option<RegisterId>,
    /// Registers that the operation reads: as many as the instruction's shape has sources, the rest zero.
    pub sources: [RegisterId; 3],
    /// Immediate, target or offset.
    pub constant: Constant,
    /// Array element that the operation accesses: [`Ir::access`].
    pub access: Option<AccessId>,
    /// Source line that the operation is attributed to.
    pub(crate) attribution: Attribution,
    /// Assumption about the value that the operation writes: [`Ir::assumptions`].
    pub(crate) assumed: Option<AssumptionId>,
    /// Place in the source.
    pub span: Span,
    /// The use of a macro, or iteration of a repetition, that made the operation; 0 if the source contains it directly.
    pub expansion: u32,
    /// The assembler made the operation, for the source's operation at the same place.
    pub made: bool,
    /// Position in source order: the index of the bundle before any was moved.
    pub order: u32,
    /// Origin in the source: the tree, and the operation of the tree; [`Operation::COMPUTED`] for a part of an equation. For
    /// messages that point at an operand.
    pub(crate) written: (u32, u32),
}

impl Operation {
    /// Value of [`Operation::written`] for an operation outside of every tree: it computes the part of an equation at its span.
    pub(crate) const COMPUTED: u32 = u32::MAX;
    /// Lowest number of computed operations that need distinct numbers, because type evidence refers to them.
    pub(crate) const FIRST_COMPUTED: u32 = 1 << 31;

    /// An operation without operands; it executes in the first of the slots unless another is chosen.
    pub(crate) fn new(
        op: Op,
        slots: Slots,
        span: Span,
        attribution: Attribution,
        expansion: u32,
        written: (u32, u32),
    ) -> Operation {
        Operation {
            op,
            slots,
            slot: slots.first(),
            dest: None,
            sources: [RegisterId::ZERO; 3],
            constant: Constant::None,
            access: None,
            attribution,
            assumed: None,
            span,
            expansion,
            made: false,
            order: 0,
            written,
        }
    }

    /// The operation computes a part of an equation.
    pub(crate) fn is_computed(&self) -> bool {
        self.written.1 >= Operation::FIRST_COMPUTED
    }

    /// Row of the instruction table.
    #[inline]
    pub fn row(&self) -> &'static Row {
        self.op.row()
    }

    /// Registers that the operation reads.
    #[inline]
    pub fn reads(&self) -> &[RegisterId] {
        &self.sources[..self.row().shape.sources()]
    }

    /// Target bundle of a redirection: a label, or else a number.
    pub(crate) fn target(&self) -> Option<Result<LabelId, u32>> {
        if matches!(self.constant, Constant::None) {
            return None;
        }
        let has_target = self.row().shape.operands().contains(&Operand::Target);
        match self.constant {
            Constant::Code(label) if has_target => Some(Ok(label)),
            Constant::Value(number) if has_target => Some(Err(number)),
            _ => None,
        }
    }

    /// Target bundle of a redirection, if the source gives it as a number.
    pub(crate) fn target_number(&self) -> Option<u32> {
        self.target()?.err()
    }

    /// An idle operation in place of this one.
    pub(crate) fn idle(&self) -> Operation {
        Operation {
            op: Op::nop,
            slots: Slots::default(),
            slot: None,
            dest: None,
            sources: [RegisterId::ZERO; 3],
            constant: Constant::None,
            access: None,
            attribution: Attribution::NONE,
            assumed: None,
            expansion: 0,
            ..*self
        }
    }

    /// Execution may continue elsewhere than at the next bundle.
    #[inline]
    pub fn redirects(&self) -> bool {
        self.row().effect.redirects()
    }
}

/// The first instruction with an effect.
pub(crate) fn with_effect(effect: Effect) -> Option<Op> {
    ROWS.iter().find(|row| row.effect == effect).map(|row| row.op)
}

/// An instruction that a machine has, by its form in equations and the common type of its result and its sources. Also returns, for
/// each operand of the form, the index of its source.
pub(crate) fn with_form<const N: usize>(
    machine: &Machine,
    symbol: &str,
    ty: Type,
) -> Option<(Op, [usize; N])> {
    let is_able =
        |row: &&Row| row.types.iter().all(|own| *own == ty) && !machine.hosts(row.function).is_empty();
    let mut forms = ROWS.iter().filter(is_able).flat_map(|row| row.forms().map(|form| (row.op, form)));
    forms.find_map(|(op, form)| {
        (form.symbol == symbol).then(|| form.sources.try_into().ok())?.map(|of| (op, of))
    })
}

/// Operations that issue together.
#[derive(Clone, Debug)]
pub struct Bundle {
    /// The operations, in the order of the source.
    pub operations: SmallVec<[Operation; 1]>,
    /// The source wrote the bundle with `||`.
    pub explicit: bool,
    /// The scheduler may move the bundle.
    pub scheduled: bool,
}

impl Bundle {
    /// An idle bundle, there because a loop must end in it: the scheduler would remove it.
    pub(crate) fn holds_place(&self) -> bool {
        let holds =
            |operation: &Operation| operation.is_computed() && operation.row().effect == Effect::Nothing;
        self.operations.iter().all(|operation| holds(operation) && !operation.made)
    }

    /// The bundle contains a raw word, whose effect is not known.
    pub fn is_opaque(&self) -> bool {
        self.operations.iter().any(|operation| matches!(operation.constant, Constant::Raw(_)))
    }
}

/// A label of code or data.
#[derive(Clone, Debug)]
pub struct Label {
    /// Name of the label; locals of a macro are prefixed with the macro's name and the use's number.
    pub name: String,
    /// Memory that the label points into.
    pub space: Space,
    /// Index of the next bundle, or of the word of data memory.
    pub position: u32,
    /// Place of the declaration.
    pub span: Span,
}

impl Label {
    /// The label begins a table of data memory. A label whose name begins with `_` stands within the table before it.
    pub(crate) fn is_table(&self) -> bool {
        let name = self.name.rsplit('.').next().unwrap_or(&self.name);
        self.space == Space::Data && !name.starts_with('_')
    }
}

/// The bound of a loop's iterations.
#[derive(Clone, Copy, Debug)]
pub struct LoopBound {
    /// Index of the bundle that heads the loop.
    pub position: u32,
    /// Maximum number of iterations each time the loop is entered.
    pub most: u32,
    /// Maximum number of iterations in one section, from reset or a tick to the next `wait`; `None` if the source does not state it.
    pub total: Option<u32>,
}

/// A timing demand of the source on ports.
#[derive(Clone, Debug)]
pub struct Demand {
    /// Kind of the demand.
    pub kind: DemandKind,
    /// Ports in the order of the directive, with their places in it.
    pub ports: Vec<(RegisterId, Span)>,
    /// The demand is on `.period`; otherwise on `.once`.
    pub period: bool,
    /// Place of the directive.
    pub span: Span,
}

/// The kind of a [`Demand`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum DemandKind {
    /// Each output is written for the last time in this cycle or before; the section's first bundle issues in cycle 1.
    Deadline(u32),
    /// Every read or write of a port comes before every read or write of the next port.
    Order,
    /// The inputs are read as late as possible, in a schedule at most this many cycles longer than the shortest found.
    Late(u32),
}

/// A value of a name with a virtual register of its own ([`webs`](crate::banks::webs)).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Version {
    /// The register that the source names.
    pub(crate) name: RegisterId,
    /// The value's own register.
    pub(crate) register: RegisterId,
    /// Order of the operation that writes the value: operations after it read the value.
    pub(crate) after: u32,
    /// Order of the last operations that may read the value: where the name is next written.
    pub(crate) through: u32,
}

/// A program before registers have addresses.
#[derive(Clone, Debug)]
pub struct Ir {
    /// Machine that the program is for.
    pub machine: &'static Machine,
    /// Registers; the first is `zero`. Unused ones get no address.
    pub registers: Vec<VirtualRegister>,
    /// Bundles of `once`, then of `period`.
    pub bundles: Vec<Bundle>,
    /// Index of the first bundle of `period`.
    pub period: u32,
    /// Labels in source order.
    pub labels: Vec<Label>,
    /// Bounds of loops, by ascending position.
    pub loop_bounds: Vec<LoopBound>,
    /// Counted loops of the source.
    pub loops: Vec<Loop>,
    /// Arrays of data memory, by ascending base.
    pub arrays: Vec<Array>,
    /// Accesses of arrays' elements: [`Ir::access`].
    pub accesses: Vec<ArrayAccess>,
    /// Ranges of registers when a period begins, least and largest value, in source order.
    pub ranges: Vec<(RegisterId, [u32; 2])>,
    /// Ranges of arrays in data memory when a period begins, by ascending word.
    pub array_ranges: Vec<ArrayRange>,
    /// Arrays in data memory whose words are results when a period ends, by ascending word.
    pub results: Vec<ArrayResult>,
    /// Assumptions about values that operations write: [`Operation::assumed`].
    pub assumptions: Vec<Assumed>,
    /// Timing demands on ports, in source order.
    pub demands: Vec<Demand>,
    /// Inputs are latched together at the tick, and outputs published together at `wait`.
    pub latched: bool,
    /// Outputs with a number in the source, by number: `@ 3`, or the number of the named register.
    pub numbers: BTreeMap<u16, RegisterId>,
    /// The scheduler may move at least one bundle.
    pub scheduled: bool,
    /// Several slots may execute at least one operation, or could before operations changed.
    pub(crate) has_choices: bool,
    /// Initial words of data memory.
    pub data: Vec<u32>,
    /// Words given bit by bit.
    pub raw: Vec<u64>,
    /// By bundle of the source: whether `.contract on` is in force; `None` where it has no effect.
    pub contracted: Vec<Option<bool>>,
    /// Source files that [`Ir::location`] names.
    pub files: Vec<String>,
    /// Parts of lines to which operations are attributed.
    pub(crate) parts: Vec<(Location, Columns)>,
    /// Values with registers of their own; those of one name ascend by [`Version::after`].
    pub(crate) versions: Vec<Version>,
}

impl Ir {
    #[inline]
    pub fn register(&self, id: RegisterId) -> &VirtualRegister {
        &self.registers[id.index()]
    }

    /// Assumption about the value that an operation writes.
    pub(crate) fn assumed(&self, operation: &Operation) -> Option<&Assumed> {
        self.assumptions.get(operation.assumed?.index())
    }

    /// Attribution to a line, or to a part of it.
    pub(crate) fn attribute(&mut self, location: Location, columns: Option<Columns>) -> Attribution {
        let Some(columns) = columns else { return Attribution::to(location) };
        self.parts.push((location, columns));
        Attribution { file: Attribution::PART, line: self.parts.len() as u32 - 1 }
    }

    /// Source line that an operation is attributed to.
    #[inline]
    pub fn location(&self, operation: &Operation) -> Option<Location> {
        let Attribution { file, line } = operation.attribution;
        match file {
            Attribution::NO_FILE => None,
            Attribution::PART => Some(self.parts[line as usize].0),
            file => Some(Location { file, line }),
        }
    }

    /// Part of the source line, if `.loc` states it.
    #[inline]
    pub fn columns(&self, operation: &Operation) -> Option<Columns> {
        let Attribution { file, line } = operation.attribution;
        (file == Attribution::PART).then(|| self.parts[line as usize].1)
    }

    /// Replaces the bundles, and moves labels, bounds and loops along: `moved` maps a bundle's old number to its new one.
    pub(crate) fn replace_bundles(&mut self, bundles: Vec<Bundle>, moved: impl Fn(u32) -> u32) {
        self.period = moved(self.period);
        for label in self.labels.iter_mut().filter(|label| label.space == Space::Code) {
            label.position = moved(label.position);
        }
        for bound in &mut self.loop_bounds {
            bound.position = moved(bound.position);
        }
        for counted in &mut self.loops {
            counted.head = moved(counted.head);
        }
        self.bundles = bundles;
    }

    /// The program contains a raw word, whose effect is not known.
    pub(crate) fn is_opaque(&self) -> bool {
        !self.raw.is_empty() && self.bundles.iter().any(Bundle::is_opaque)
    }

    /// The program memory cannot hold the program, however its bundles are packed.
    pub(crate) fn is_too_long(&self) -> bool {
        let depth = self.machine.most_bundles() as usize;
        // A bundle has at most as many operations that need a slot as there are slots.
        if self.bundles.len() <= depth {
            return false;
        }
        let words = depth.saturating_mul(self.machine.slots.len());
        self.operations().filter(|operation| operation.slot.is_some()).count() > words
    }

    /// Iterates over the operations of all bundles, in order.
    pub fn operations(&self) -> impl Iterator<Item = &Operation> {
        self.bundles.iter().flat_map(|bundle| &bundle.operations)
    }
}
