// SPDX-License-Identifier: MIT OR Apache-2.0
//! Arrays of data memory, counted loops, and the element that each access touches, by which the scheduler tells accesses apart.

use crate::ir::{Ir, LabelId, Operation};
use crate::loops::LoopCount;
use smallvec::SmallVec;
use takt_diagnostics::source::Span;
use takt_isa::Type;

/// An array of [`Ir::arrays`].
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, PartialOrd, Ord)]
pub struct ArrayId(pub u32);

/// A counted loop of [`Ir::loops`].
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, PartialOrd, Ord)]
pub struct LoopId(pub u32);

/// An access of [`Ir::accesses`].
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, PartialOrd, Ord)]
pub struct AccessId(pub u32);

/// An array of data memory, declared by `.array`. Its words follow one another, the last index counting fastest.
#[derive(Clone, Debug)]
pub struct Array {
    /// Name of the array; locals of a macro are prefixed with the macro's name and the use's number.
    pub name: String,
    /// First word in data memory.
    pub base: u32,
    /// Number of words, the product of the sizes.
    pub words: u32,
    /// The number of elements in each dimension; indices count from 1.
    pub sizes: SmallVec<[u32; 2]>,
    /// Type of the elements.
    pub ty: Type,
    /// Place of the declaration.
    pub span: Span,
}

/// A counted loop. Its body is the bundles from `head` up to `end`, which control enters at `head` only and leaves at `end` only,
/// except for calls.
#[derive(Clone, Copy, Debug)]
pub struct Loop {
    /// Index of the first bundle of the body. Bundles before it compute the values that the loop needs once.
    pub head: u32,
    /// The label after the last bundle of the body.
    pub end: LabelId,
    /// Number of iterations each time that the loop is entered.
    pub iterations: LoopCount,
    /// Innermost enclosing loop, if any.
    pub parent: Option<LoopId>,
    /// Number of enclosing loops.
    pub depth: u32,
    /// Place of the `.for`, or of the sum.
    pub span: Span,
}

/// The element of an array that a load or store accesses.
///
/// The access never leaves its array: for an element whose subscripts are affine the assembler checks all iterations, for any
/// other the language leaves it undefined. Loads and stores of one array therefore touch no word of another.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ArrayAccess {
    /// Array that the access stays in.
    pub array: ArrayId,
    /// The word, from the array's first one; `None` if it depends on more than the iterations of the enclosing loops.
    pub word: Option<Affine>,
}

/// An affine function of iteration numbers, which count from 0 each time a loop is entered: of the enclosing loops, unless said otherwise.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Affine<L = LoopId> {
    /// The value where all iteration numbers are 0.
    pub constant: i64,
    /// Nonzero coefficients, by ascending loop.
    pub terms: SmallVec<[(L, i64); 4]>,
}

impl<L: Copy + Ord> Affine<L> {
    /// A function without iteration numbers.
    pub(crate) fn constant(constant: i64) -> Affine<L> {
        Affine { constant, terms: SmallVec::new() }
    }

    /// The iteration number of a loop, times a factor that is not 0.
    pub(crate) fn iteration(of: L, factor: i64) -> Affine<L> {
        Affine { constant: 0, terms: SmallVec::from_slice(&[(of, factor)]) }
    }

    /// The sum with a multiple of another; `None` if a number leaves 64 bits.
    pub(crate) fn plus(&self, other: &Affine<L>, factor: i64) -> Option<Affine<L>> {
        let mut sum = self.clone();
        sum.constant = sum.constant.checked_add(other.constant.checked_mul(factor)?)?;
        for &(of, coefficient) in &other.terms {
            let more = coefficient.checked_mul(factor)?;
            match sum.terms.binary_search_by_key(&of, |term| term.0) {
                Ok(at) => sum.terms[at].1 = sum.terms[at].1.checked_add(more)?,
                Err(at) => sum.terms.insert(at, (of, more)),
            }
        }
        sum.terms.retain(|term| term.1 != 0);
        Some(sum)
    }

    /// A multiple of the function; `None` if a number leaves 64 bits.
    pub(crate) fn times(&self, factor: i64) -> Option<Affine<L>> {
        Affine::constant(0).plus(self, factor)
    }

    /// The coefficient of a loop's iteration number; 0 if the function does not depend on it.
    pub(crate) fn coefficient(&self, of: L) -> i64 {
        self.terms.binary_search_by_key(&of, |term| term.0).map_or(0, |at| self.terms[at].1)
    }

    /// The function with a loop fixed in one iteration; `None` if a number leaves 64 bits.
    pub(crate) fn at(&self, of: L, iteration: i64) -> Option<Affine<L>> {
        let mut fixed = self.clone();
        fixed.constant = fixed.constant.checked_add(self.coefficient(of).checked_mul(iteration)?)?;
        fixed.terms.retain(|term| term.0 != of);
        Some(fixed)
    }

    /// The function `iterations` iterations of a loop later; `None` if a number leaves 64 bits.
    pub(crate) fn later(&self, of: L, iterations: i64) -> Option<Affine<L>> {
        let mut later = self.clone();
        later.constant = later.constant.checked_add(self.coefficient(of).checked_mul(iterations)?)?;
        Some(later)
    }

    /// The value, if the function is constant.
    pub(crate) fn as_constant(&self) -> Option<i64> {
        self.terms.is_empty().then_some(self.constant)
    }
}

impl Ir {
    /// The array element that an operation accesses; `None` for other addresses.
    pub fn access(&self, operation: &Operation) -> Option<&ArrayAccess> {
        operation.access.map(|AccessId(access)| &self.accesses[access as usize])
    }
}
