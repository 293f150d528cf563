// SPDX-License-Identifier: MIT OR Apache-2.0
//! Symbol tables: the registers, constants, labels and arguments that names are bound to.

use crate::context::AstPlace;
use crate::context::loops::{Index, SourceLoop};
use crate::context::parameters::ParameterType;
use crate::context::scopes::{Binding, ScopeId};
use crate::ir::arrays;
use crate::ir::type_evidence::GivenTypes;
use crate::ir::{Label, LabelId, RegisterId, RegisterKind, VirtualRegister};
use foldhash::{HashMap, HashSet};
use smallvec::SmallVec;
use std::collections::{BTreeMap, BTreeSet};
use takt_diagnostics::source::Span;
use takt_isa::{Register, Type};
use takt_syntax::ast::{Operand, Section};
use takt_syntax::expr::Value;
use takt_syntax::name::NameId;

#[derive(Clone, Debug)]
pub(crate) struct NamedConstant {
    pub(crate) name: String,
    /// `None` if the expression has a mistake, which is reported.
    pub(crate) value: Option<Value>,
    pub(crate) span: Span,
    pub(crate) used: bool,
    /// Warn if the constant is never used.
    pub(crate) watched: bool,
}

/// An array of registers, which follow one another, the last index counting fastest.
#[derive(Clone, Debug)]
pub(crate) struct Array {
    pub(crate) name: String,
    /// First element; the others follow it.
    pub(crate) first: RegisterId,
    /// The number of elements in each dimension; indices count from 1.
    pub(crate) sizes: SmallVec<[u32; 2]>,
    pub(crate) span: Span,
}

impl Array {
    pub(crate) fn elements(&self) -> impl Iterator<Item = RegisterId> + use<> {
        let count = self.sizes.iter().product::<u32>() as usize;
        (self.first.index()..self.first.index() + count).map(RegisterId::new)
    }

    /// Sizes as the source writes them: `4,4`.
    pub(crate) fn shape(&self) -> String {
        shape(&self.sizes)
    }
}

/// An array in data memory.
#[derive(Clone, Debug)]
pub(crate) struct Table {
    pub(crate) array: arrays::Array,
    /// Label of the first word, with the table's name.
    pub(crate) label: LabelId,
    /// The source refers to the table.
    pub(crate) used: bool,
}

impl Table {
    /// Sizes as the source writes them: `4,4`.
    pub(crate) fn shape(&self) -> String {
        shape(&self.array.sizes)
    }
}

/// Sizes as the source writes them: `4,4`.
fn shape(sizes: &[u32]) -> String {
    let sizes: Vec<String> = sizes.iter().map(u32::to_string).collect();
    sizes.join(",")
}

/// An argument of a macro's use.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Argument {
    pub(crate) operand: Operand,
    pub(crate) at: AstPlace,
    /// Value, once computed: a parameter that macros pass on repeatedly is computed once.
    pub(crate) value: Option<Value>,
    /// The type that the parameter demands; for a parameter passed on through several macros, the first type demanded.
    pub(crate) asked: Option<ParameterType>,
    /// The use of the macro in which the argument is written, and whether this macro is a function in an equation.
    pub(crate) scope: ScopeId,
    pub(crate) is_function: bool,
    /// Number of the argument at the place where it is first written; passing it on keeps the number.
    pub(crate) origin: u32,
}

/// Everything that the source declares, by number.
pub(crate) struct Declarations {
    pub(crate) registers: Vec<VirtualRegister>,
    /// Registers with a given address.
    pub(crate) by_address: HashMap<Register, RegisterId>,
    /// Outputs with a given number.
    pub(crate) numbered: BTreeMap<u16, RegisterId>,
    /// Registers that no line declares: results of macros in equations.
    pub(crate) results: HashSet<RegisterId>,
    /// Registers that are declared with a type, rather than as floats by default.
    pub(crate) typed: HashSet<RegisterId>,
    /// The types that the source gives to operands whose type the instruction leaves open.
    pub(crate) given: GivenTypes,
    pub(crate) arrays: Vec<Array>,
    /// Real numbers in operands and data that binary32 does not have, as the bits of binary64.
    pub(crate) reals: BTreeSet<u64>,
    /// Elements of all arrays.
    pub(crate) elements: usize,
    /// Arrays in data memory.
    pub(crate) tables: Vec<Table>,
    /// Index variables of counted loops.
    pub(crate) indices: Vec<Index>,
    /// Counted loops as the source has them.
    pub(crate) loops: Vec<SourceLoop>,
    pub(crate) constants: Vec<NamedConstant>,
    pub(crate) arguments: Vec<Argument>,
    /// Parameters bound to registers that operations use, by the macro's use; may contain duplicates.
    pub(crate) parameters: Vec<(ScopeId, NameId, RegisterId)>,
    /// Labels. While the source is read a code label's position counts the statements of its section.
    pub(crate) labels: Vec<Label>,
    /// The section of each label.
    pub(crate) label_sections: Vec<Section>,
    /// The types of the words of data memory.
    pub(crate) data_types: Vec<Type>,
}

impl Declarations {
    /// The register `zero` only.
    pub(crate) fn new() -> Declarations {
        let zero = VirtualRegister {
            name: "zero".to_owned(),
            kind: RegisterKind::Zero,
            ty: Type::B,
            pinned: Some(Register::ZERO),
            preset: None,
            span: Span::default(),
        };
        Declarations {
            registers: vec![zero],
            by_address: [(Register::ZERO, RegisterId::ZERO)].into_iter().collect(),
            numbered: BTreeMap::new(),
            results: HashSet::default(),
            typed: HashSet::default(),
            given: GivenTypes::default(),
            arrays: Vec::new(),
            reals: BTreeSet::new(),
            elements: 0,
            tables: Vec::new(),
            indices: Vec::new(),
            loops: Vec::new(),
            constants: Vec::new(),
            arguments: Vec::new(),
            parameters: Vec::new(),
            labels: Vec::new(),
            label_sections: Vec::new(),
            data_types: Vec::new(),
        }
    }

    /// The declaration of a binding.
    pub(crate) fn declaration(&self, binding: Binding) -> Option<Span> {
        match binding {
            Binding::Register(id) => Some(self.registers[id.index()].span),
            Binding::Array(id) => Some(self.arrays[id as usize].span),
            Binding::Table(id) => Some(self.tables[id as usize].array.span),
            Binding::Index(id) => Some(self.indices[id as usize].span),
            Binding::Constant(id) => Some(self.constants[id as usize].span),
            Binding::Code(id) | Binding::Data(id) => Some(self.labels[id.0 as usize].span),
            Binding::Argument(id) => Some(self.arguments[id as usize].operand.span),
            Binding::None | Binding::Count(_) | Binding::Word(_) | Binding::Builtin(_) | Binding::Has(_) => {
                None
            }
        }
    }

    /// The kind of a binding, in words.
    pub(crate) fn kind_text(&self, binding: Binding) -> &'static str {
        match binding {
            Binding::Register(id) => match self.registers[id.index()].kind {
                RegisterKind::Input => "an input port",
                RegisterKind::Parameter => "a parameter that the host sets",
                RegisterKind::Output => "an output port",
                RegisterKind::Zero => "the register that always reads as zero",
                _ => "a register",
            },
            Binding::Constant(_) | Binding::Builtin(_) | Binding::Has(_) => "a constant",
            Binding::Array(_) => "an array of registers",
            Binding::Table(_) => "an array in data memory",
            Binding::Word(_) => "an element of an array in data memory",
            Binding::Index(_) => "the index of a counted loop",
            Binding::Code(_) => "a code label",
            Binding::Data(_) => "a data label",
            Binding::Argument(_) => "a parameter",
            Binding::Count(_) => "the count of a repetition",
            Binding::None => "unknown",
        }
    }
}
