// SPDX-License-Identifier: MIT OR Apache-2.0
//! Intermediate representation: nodes, each a value of 32 bits that is computed once, and ordered statements around them.
//!
//! A node is pure, except that a load has its place among the stores. Registers that change (states, values that a loop carries, results
//! of branches) are variables: `Set` writes one, a node [`Node::Var`] is its value until the next `Set`.

use std::collections::HashMap;

/// Index of a node.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, PartialOrd, Ord)]
pub(super) struct Id(pub(super) u32);

/// Type of a register.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(super) enum Kind {
    Float,
    Int,
}

macro_rules! operations {
    ($($(#[doc = $text:literal])? $name:ident $result:ident;)*) => {
        /// An operation; its name implies the types of its operands.
        #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
        pub(super) enum Op {
            $($(#[doc = $text])? $name,)*
        }

        impl Op {
            /// Type of the result; a choice has the type of its alternatives.
            pub(super) fn kind(self) -> Kind {
                match self {
                    $(Op::$name => Kind::$result,)*
                }
            }
        }
    };
}

operations! {
    Add Float; Sub Float; Mul Float; Div Float; Neg Float; Abs Float;
    Sqrt Float; Sin Float; Cos Float; Tan Float; Asin Float; Acos Float; Atan Float; Atan2 Float;
    Exp Float; Expm1 Float; Log Float; Log1p Float; Pow Float; Tanh Float; Erf Float;
    Fmod Float; Floor Float; Ceil Float; Trunc Float; Round Float; Rint Float;
    Equal Int; Less Int; LessEqual Int;
    IntAdd Int; IntSub Int; IntMul Int;
    #[doc = "High word of the product of unsigned integers."]
    ProductHigh Int;
    #[doc = "Quotient of signed integers, truncated."]
    IntDiv Int;
    #[doc = "Quotient of unsigned integers by one that is no power of two."]
    UnsignedDiv Int;
    #[doc = "Remainder by a power of two, as in C."]
    IntRem Int;
    And Int; Or Int; Xor Int;
    ShiftLeft Int;
    #[doc = "The sign shifted in."]
    ShiftRight Int;
    #[doc = "Zeros shifted in."]
    ShiftRightLogical Int;
    IntEqual Int; IntLess Int;
    #[doc = "Comparison of unsigned integers."]
    Below Int;
    #[doc = "1 for zero, otherwise 0."]
    Not Int;
    #[doc = "From a signed integer."]
    ToFloat Float;
    #[doc = "From an unsigned integer."]
    UnsignedToFloat Float;
    #[doc = "Truncates, as C's conversion."]
    ToInt Int;
    #[doc = "Truncates, from 0 to 2³² - 1."]
    ToUnsigned Int;
    #[doc = "To nearest even, as `lrintf`."]
    Nearest Int;
    #[doc = "The bits of a float."]
    BitsOf Int;
    #[doc = "A float of these bits."]
    FloatOf Float;
    #[doc = "The same, in a register of its own."]
    Copy Int;
    #[doc = "Choice of integers."]
    Select Int;
    #[doc = "Choice of floats."]
    SelectFloat Float;
}

impl Op {
    /// Operations of the machine that it takes, roughly.
    pub(super) fn cost(self) -> usize {
        match self {
            Op::Pow => 168,
            Op::Fmod => 392,
            Op::Tan | Op::Tanh | Op::Log1p | Op::Log => 50,
            Op::Exp
            | Op::Expm1
            | Op::Asin
            | Op::Erf
            | Op::Round
            | Op::Floor
            | Op::Ceil
            | Op::Rint
            | Op::Trunc => 20,
            Op::IntMul | Op::IntDiv | Op::ToInt | Op::ToUnsigned | Op::UnsignedToFloat => 10,
            Op::UnsignedDiv => 40,
            Op::ProductHigh => 30,
            _ => 1,
        }
    }
}

/// A value of 32 bits.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(super) enum Node {
    Int(i32),
    /// Bits of a binary32 number.
    Float(u32),
    /// A variable's value, between two of its writes; the second number tells them apart.
    Var(usize, u32),
    /// The index of a counted loop.
    Index(usize),
    Op(Op, [Id; 3], u8),
    /// A word of an array in memory; the last number tells loads apart.
    Load(usize, Id, u32),
}

/// Place in the C source.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct Place {
    pub(super) unit: usize,
    pub(super) offset: usize,
}

/// Smallest and greatest value of an integer node, as a signed number.
pub(super) type Range = (i64, i64);

pub(super) const FULL: Range = (i32::MIN as i64, i32::MAX as i64);

#[derive(Clone, Debug)]
pub(super) struct Data {
    pub(super) node: Node,
    pub(super) kind: Kind,
    pub(super) range: Range,
    /// Name in C that the value was first given.
    pub(super) label: Option<String>,
    /// The value depends on counters of loops that remain, and on nothing else that the program computes.
    counted: bool,
}

/// A variable: a register that is written more than once.
#[derive(Clone, Debug)]
pub(super) struct Var {
    pub(super) name: String,
    pub(super) kind: Kind,
}

/// An array in data memory.
#[derive(Clone, Debug)]
pub(super) struct Array {
    pub(super) name: String,
    /// The type of all elements, `None` if they differ.
    pub(super) kind: Option<Kind>,
    /// Values that the loader sets, one for each word.
    pub(super) words: Vec<u32>,
}

#[derive(Clone, Debug)]
pub(super) enum Statement {
    Def(Id),
    Store {
        array: usize,
        index: Id,
        value: Id,
    },
    /// Writes variables, all at once.
    Set(Vec<(usize, Id)>),
    If {
        condition: Id,
        then: Block,
        other: Block,
    },
    /// Counts `index` from `first` to `last`.
    For {
        index: usize,
        first: i64,
        last: i64,
        step: i64,
        body: Block,
    },
    /// Repeats the body while `again` is not zero, at most `bound` times.
    Loop {
        bound: u64,
        body: Block,
        again: Id,
    },
}

pub(super) type Block = Vec<(Statement, Place)>;

/// All nodes of a program, variables and arrays.
#[derive(Default)]
pub(super) struct Nodes {
    list: Vec<Data>,
    known: HashMap<Node, Id>,
    /// Nodes in the order of their insertion into `known`, so that the nodes of a branch can be forgotten after it.
    log: Vec<Node>,
    pub(super) vars: Vec<Var>,
    pub(super) arrays: Vec<Array>,
    /// Names of loops' indices.
    pub(super) indices: Vec<String>,
    serial: u32,
}

impl Nodes {
    pub(super) fn len(&self) -> usize {
        self.list.len()
    }

    pub(super) fn get(&self, id: Id) -> &Data {
        &self.list[id.0 as usize]
    }

    pub(super) fn get_mut(&mut self, id: Id) -> &mut Data {
        &mut self.list[id.0 as usize]
    }

    pub(super) fn node(&self, id: Id) -> Node {
        self.get(id).node
    }

    pub(super) fn kind(&self, id: Id) -> Kind {
        self.get(id).kind
    }

    pub(super) fn range(&self, id: Id) -> Range {
        self.get(id).range
    }

    pub(super) fn serial(&mut self) -> u32 {
        self.serial += 1;
        self.serial
    }

    /// The node and whether it is new.
    pub(super) fn add(&mut self, node: Node, kind: Kind, range: Range) -> (Id, bool) {
        if let Some(id) = self.known.get(&node) {
            return (*id, false);
        }
        let id = Id(u32::try_from(self.list.len()).expect("the number of nodes is limited"));
        let counted = match node {
            Node::Index(_) | Node::Int(_) => true,
            Node::Op(_, operands, count) => {
                operands[..usize::from(count)].iter().all(|id| self.is_counted(*id))
            }
            _ => false,
        };
        self.list.push(Data { node, kind, range, label: None, counted });
        self.known.insert(node, id);
        self.log.push(node);
        (id, true)
    }

    pub(super) fn int(&mut self, value: i32) -> Id {
        self.add(Node::Int(value), Kind::Int, (i64::from(value), i64::from(value))).0
    }

    pub(super) fn float(&mut self, value: f32) -> Id {
        self.add(Node::Float(value.to_bits()), Kind::Float, FULL).0
    }

    pub(super) fn var(&mut self, name: &str, kind: Kind) -> usize {
        self.vars.push(Var { name: name.to_owned(), kind });
        self.vars.len() - 1
    }

    /// The value of a variable from now to its next write.
    pub(super) fn read(&mut self, var: usize, range: Range) -> Id {
        let serial = self.serial();
        let kind = self.vars[var].kind;
        self.add(Node::Var(var, serial), kind, range).0
    }

    pub(super) fn operands(&self, id: Id) -> Vec<Id> {
        match self.node(id) {
            Node::Op(_, operands, count) => operands[..usize::from(count)].to_vec(),
            Node::Load(_, index, _) => vec![index],
            _ => Vec::new(),
        }
    }

    pub(super) fn is_counted(&self, id: Id) -> bool {
        self.get(id).counted
    }

    /// A mark for [`Nodes::forget`].
    pub(super) fn mark(&self) -> usize {
        self.log.len()
    }

    /// Removes all nodes since a mark, when there were `count`: nothing refers to them.
    pub(super) fn undo(&mut self, mark: usize, count: usize) {
        for node in self.log.drain(mark..) {
            self.known.remove(&node);
        }
        self.list.truncate(count);
    }

    /// Forgets the nodes since a mark, so that later uses compute them again: a branch may have skipped them. Constants stay.
    pub(super) fn forget(&mut self, mark: usize) {
        let since = self.log.split_off(mark);
        for node in since {
            match node {
                Node::Op(..) | Node::Load(..) => {
                    self.known.remove(&node);
                }
                _ => self.log.push(node),
            }
        }
    }
}
