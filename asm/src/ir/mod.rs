// SPDX-License-Identifier: MIT OR Apache-2.0
//! The program between names and words: bundles of operations on virtual registers.
//!
//! [`resolve`](crate::resolve) makes it, a scheduler may rearrange it, [`allocate`](crate::emit::allocate) gives its registers
//! addresses and `emit` its words. What holds at every stage:
//!
//! * a bundle has at least one operation and no two that claim one slot; on a machine with one slot it has exactly one;
//! * all operations of a bundle read before any writes; bundles execute in the order of [`Ir::bundles`], and
//!   [`Operation::redirects`] says where that order ends;
//! * every register that is written is written from one slot only; which slot executes an operation that several may
//!   ([`Operation::slots`]) is chosen first by [`assign`](crate::banks::slots::assign), and again by the scheduler;
//! * bundles of `once` precede those of `period`; a label stands before the bundle at its position, or at the end.
//!
//! Whoever moves bundles must move [`Label::position`]s, [`LoopBound::position`]s, [`Loop::head`]s and [`Ir::period`] along, and leave alone, as
//! fences, bundles that hold a raw word ([`Bundle::is_opaque`]). Targets that the source wrote as numbers stay as they are.

pub(crate) mod arrays;
pub(crate) mod flow;
pub(crate) mod given;
pub(crate) mod matching;
pub(crate) mod position;
pub(crate) mod runs;

use crate::ir::arrays::{AccessId, Array, ArrayAccess, Loop};
use crate::report::source::Span;
use smallvec::SmallVec;
use std::collections::BTreeMap;
use std::num::NonZeroU32;
use takt_isa::program::{Columns, Location, Space};
use takt_isa::{Effect, Machine, Op, Operand, ROWS, Register, Row, SlotIndex, Slots, Type};

/// A register of [`Ir::registers`].
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, PartialOrd, Ord)]
pub struct RegisterId(NonZeroU32);

impl RegisterId {
    /// The register that always reads as zero: the first of every program.
    pub const ZERO: RegisterId = RegisterId(NonZeroU32::MIN);

    /// The register of an index. Indices are below 2³² - 1.
    #[inline]
    pub const fn new(index: usize) -> RegisterId {
        match NonZeroU32::new(index as u32 + 1) {
            Some(id) => RegisterId(id),
            None => RegisterId::ZERO,
        }
    }

    /// Its index in [`Ir::registers`].
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
    /// An output port.
    Output,
    /// Holds these bits from the start; nothing writes it.
    Constant(u32),
    /// Always reads as zero.
    Zero,
}

/// A register of the source, before it has a place in the machine.
#[derive(Clone, Debug)]
pub struct VirtualRegister {
    /// Its name; empty for a constant's and for one that the source names by its place alone.
    pub name: String,
    /// Its role.
    pub kind: RegisterKind,
    /// The type as which its bits are shown.
    pub ty: Type,
    /// The address that the source gives it.
    pub pinned: Option<Register>,
    /// The bits that the loader writes there, if the source says so. A constant's bits are in its kind.
    pub preset: Option<u32>,
    /// The place of its declaration, or for a constant of its first use.
    pub span: Span,
}

/// A name with something behind it, and that before the indices if it is an element's: `t.1`, `P.1[2,3]`.
pub(crate) fn numbered(name: &str, number: &str) -> String {
    let (head, indices) = name.split_at(name.find('[').unwrap_or(name.len()));
    format!("{head}{number}{indices}")
}

/// The constant operand of an operation.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Constant {
    /// Nothing.
    None,
    /// An immediate, an offset, or a bundle address that the source gives as a number.
    Value(u32),
    /// The address of a code label.
    Code(LabelId),
    /// A word given bit by bit: its index in [`Ir::raw`]. What it reads and writes is not known.
    Raw(u32),
}

/// The source line that an operation is attributed to, and the part of it where the source says it (`.loc`), in eight bytes: there
/// is one for each operation of a program. [`Ir::location`] and [`Ir::columns`] read it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Attribution {
    /// The file, or [`Attribution::NO_FILE`], or [`Attribution::PART`].
    file: u32,
    /// The line; of a part of one, an index into [`Ir::parts`].
    line: u32,
}

impl Attribution {
    const NO_FILE: u32 = u32::MAX;
    const PART: u32 = u32::MAX - 1;

    /// No line.
    pub(crate) const NONE: Attribution = Attribution { file: Attribution::NO_FILE, line: 0 };

    /// A line.
    #[inline]
    pub(crate) const fn to(Location { file, line }: Location) -> Attribution {
        Attribution { file, line }
    }
}

/// An operation.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Operation {
    /// The instruction; `nop` where the word is given bit by bit.
    pub op: Op,
    /// The slots that may execute it: those that host its function, as far as the source leaves a choice. None if any can, as a `nop`.
    pub slots: Slots,
    /// The slot that executes it, as assigned so far; `None` if any can.
    pub slot: Option<SlotIndex>,
    /// The register that it writes.
    pub dest: Option<RegisterId>,
    /// The registers that it reads: as many as the instruction's shape has sources, the rest zero.
    pub sources: [RegisterId; 3],
    /// Immediate, target or offset.
    pub constant: Constant,
    /// The element of an array that it accesses: [`Ir::access`].
    pub access: Option<AccessId>,
    /// The source line that it is attributed to.
    pub(crate) attribution: Attribution,
    /// Its place in the source.
    pub span: Span,
    /// The use of a macro, or iteration of a repetition, that made it; 0 if it stands in the source itself.
    pub expansion: u32,
    /// True if the assembler made it, for the operation at its place in the source.
    pub made: bool,
    /// Its place in the order of the source: the index of its bundle before any was moved.
    pub order: u32,
    /// Its source: the tree, and the operation of the tree; [`Operation::COMPUTED`] if it is a part of an equation.
    /// For messages that point at an operand.
    pub(crate) written: (u32, u32),
}

impl Operation {
    /// In [`Operation::written`] the operation that no tree has: one that computes a part of an equation, where its span is.
    pub(crate) const COMPUTED: u32 = u32::MAX;

    /// One that reads and writes nothing yet; it executes in the first of the slots unless another is chosen.
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
            span,
            expansion,
            made: false,
            order: 0,
            written,
        }
    }

    /// True if it computes a part of an equation.
    pub(crate) fn is_computed(&self) -> bool {
        self.written.1 == Operation::COMPUTED
    }

    /// The instruction's row.
    #[inline]
    pub fn row(&self) -> &'static Row {
        self.op.row()
    }

    /// The registers that it reads.
    #[inline]
    pub fn reads(&self) -> &[RegisterId] {
        &self.sources[..self.row().shape.sources()]
    }

    /// The bundle that it may continue at: by its label, or else by number.
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

    /// The bundle that it may continue at, if the source gives it as a number.
    pub(crate) fn target_number(&self) -> Option<u32> {
        self.target()?.err()
    }

    /// One that does nothing, in its place.
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
            expansion: 0,
            ..*self
        }
    }

    /// True if execution may continue elsewhere than at the next bundle.
    #[inline]
    pub fn redirects(&self) -> bool {
        self.row().effect.redirects()
    }
}

/// The instruction of an effect.
pub(crate) fn with_effect(effect: Effect) -> Option<Op> {
    ROWS.iter().find(|row| row.effect == effect).map(|row| row.op)
}

/// An instruction that a machine has, by its form in equations and the one type of its result and its sources; with it, for each operand
/// of the form, the source that it is.
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
    /// True if the source wrote it with `||`.
    pub explicit: bool,
    /// True if the scheduler may move it.
    pub scheduled: bool,
}

impl Bundle {
    /// True if it does nothing and is there because a loop must end in it: the scheduler would leave nothing of it.
    pub(crate) fn holds_place(&self) -> bool {
        let holds =
            |operation: &Operation| operation.is_computed() && operation.row().effect == Effect::Nothing;
        self.operations.iter().all(|operation| holds(operation) && !operation.made)
    }

    /// True if it contains a word given bit by bit, whose effect is not known.
    pub fn is_opaque(&self) -> bool {
        self.operations.iter().any(|operation| matches!(operation.constant, Constant::Raw(_)))
    }
}

/// A label.
#[derive(Clone, Debug)]
pub struct Label {
    /// Its name; one that is local to a macro's use has the macro's name and the use's number before it.
    pub name: String,
    /// Which memory it points into.
    pub space: Space,
    /// Index of the bundle that it stands before, or word of data memory.
    pub position: u32,
    /// The place of its declaration.
    pub span: Span,
}

impl Label {
    /// True if it begins a table of data memory. A label whose name begins with `_` stands within the table before it.
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
    /// Iterations at most each time that it is entered.
    pub most: u32,
    /// Iterations at most in one section, from reset or a tick to the next `wait`; `None` if the source does not say.
    pub total: Option<u32>,
}

/// A timing demand of the source on ports.
#[derive(Clone, Debug)]
pub struct Demand {
    /// Its kind.
    pub kind: DemandKind,
    /// The ports, in the order of the directive, and where they stand in it.
    pub ports: Vec<(RegisterId, Span)>,
    /// True if it is about `.period`, else about `.once`.
    pub period: bool,
    /// The directive.
    pub span: Span,
}

/// The kind of a [`Demand`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum DemandKind {
    /// Each output is written for the last time in this cycle or before; the section's first bundle issues in cycle 1.
    Deadline(u32),
    /// Whatever is read from or written to a port comes before what is read from or written to the next.
    Order,
    /// The inputs are read as late as a schedule allows that is at most so many cycles longer than the shortest found.
    Late(u32),
}

/// A value of a name with a virtual register of its own ([`webs`](crate::banks::webs)).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Version {
    /// The register that the source names.
    pub(crate) name: RegisterId,
    /// The value's own.
    pub(crate) register: RegisterId,
    /// The order of the operation that writes it: operations behind that one read it.
    pub(crate) after: u32,
    /// The order of the last operations that may read it: where the name is next written.
    pub(crate) through: u32,
}

/// A program before registers have addresses.
#[derive(Clone, Debug)]
pub struct Ir {
    /// The machine that it is for.
    pub machine: &'static Machine,
    /// The registers; the first is `zero`. Those that nothing uses get no address.
    pub registers: Vec<VirtualRegister>,
    /// The bundles: those of `once`, then those of `period`.
    pub bundles: Vec<Bundle>,
    /// Index of the first bundle of `period`.
    pub period: u32,
    /// The labels, in the order of the source.
    pub labels: Vec<Label>,
    /// Bounds of loops, by ascending position.
    pub loop_bounds: Vec<LoopBound>,
    /// The counted loops.
    pub loops: Vec<Loop>,
    /// The arrays of data memory, by ascending base.
    pub arrays: Vec<Array>,
    /// Accesses of arrays' elements: [`Ir::access`].
    pub accesses: Vec<ArrayAccess>,
    /// Between which values registers lie when a period begins, least and largest, in the order of the source.
    pub ranges: Vec<(RegisterId, [u32; 2])>,
    /// The timing demands on ports, in source order.
    pub demands: Vec<Demand>,
    /// True if inputs are latched together at the tick, and outputs published together at `wait`.
    pub latched: bool,
    /// Outputs whose number the source gives, by number: `@ 3`, or that of the register it names.
    pub numbers: BTreeMap<u16, RegisterId>,
    /// True if the scheduler may move any bundle.
    pub scheduled: bool,
    /// True if several slots may execute an operation; perhaps of one that has changed since.
    pub(crate) has_choices: bool,
    /// Data memory.
    pub data: Vec<u32>,
    /// Words given bit by bit.
    pub raw: Vec<u64>,
    /// By bundle, as the source has them: whether `.contract on` is in force there; none where it has no effect.
    pub contracted: Vec<Option<bool>>,
    /// Source files that [`Ir::location`] names.
    pub files: Vec<String>,
    /// Parts of lines that operations are attributed to.
    pub(crate) parts: Vec<(Location, Columns)>,
    /// Values with registers of their own, by [`Version::after`] for each name.
    pub(crate) versions: Vec<Version>,
}

impl Ir {
    /// A register.
    #[inline]
    pub fn register(&self, id: RegisterId) -> &VirtualRegister {
        &self.registers[id.index()]
    }

    /// The attribution to a line, or to a part of it.
    pub(crate) fn attribute(&mut self, location: Location, columns: Option<Columns>) -> Attribution {
        let Some(columns) = columns else { return Attribution::to(location) };
        self.parts.push((location, columns));
        Attribution { file: Attribution::PART, line: self.parts.len() as u32 - 1 }
    }

    /// The source line that an operation is attributed to.
    #[inline]
    pub fn location(&self, operation: &Operation) -> Option<Location> {
        let Attribution { file, line } = operation.attribution;
        match file {
            Attribution::NO_FILE => None,
            Attribution::PART => Some(self.parts[line as usize].0),
            file => Some(Location { file, line }),
        }
    }

    /// The part of that line, where the source says it (`.loc`).
    #[inline]
    pub fn columns(&self, operation: &Operation) -> Option<Columns> {
        let Attribution { file, line } = operation.attribution;
        (file == Attribution::PART).then(|| self.parts[line as usize].1)
    }

    /// Replaces the bundles, and moves what stands between them by `moved`: from a bundle's old number to its new one.
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

    /// True if it contains a word given bit by bit, whose effect is not known.
    pub(crate) fn is_opaque(&self) -> bool {
        !self.raw.is_empty() && self.bundles.iter().any(Bundle::is_opaque)
    }

    /// Every operation, in order.
    pub fn operations(&self) -> impl Iterator<Item = &Operation> {
        self.bundles.iter().flat_map(|bundle| &bundle.operations)
    }
}
