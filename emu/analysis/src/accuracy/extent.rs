// SPDX-License-Identifier: MIT OR Apache-2.0
//! Ranges and error bounds at each operation, over all its executions: between its operands and its result a bound may be lost.

use super::interval::Interval;
use super::node::{Made, Node};
use super::value::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use takt_isa::Type;

/// Range of a value in the run and the bound of its error; `None` if a problem leaves them open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Range of the values in the run.
    pub range: Option<Interval>,
    /// Bound on the error's magnitude.
    pub error: Option<f64>,
}

/// Operand of an operation.
#[derive(Clone, Debug, PartialEq)]
pub struct OperandExtent {
    /// Values that the operation reads.
    pub extent: Extent,
    /// Words of the operations that may have computed these; empty for an input, a state, a constant and what a summarised loop carries.
    pub from: BTreeSet<u32>,
}

/// Operation with all values that it reads and gives.
#[derive(Clone, Debug, PartialEq)]
pub struct OperationExtent {
    /// Values of the result.
    pub result: Extent,
    /// Values of the operands, in the order of the instruction's.
    pub operands: Vec<OperandExtent>,
}

/// Operations by word.
pub(super) type Extents = BTreeMap<u32, OperationExtent>;

impl Extent {
    fn of(value: &Value) -> Extent {
        let number = value.float().ok();
        Extent {
            range: number.as_ref().map(|number| number.actual),
            error: number.map(|number| number.error_range().magnitude()),
        }
    }

    fn join(self, other: Extent) -> Extent {
        Extent {
            range: self.range.zip(other.range).map(|(a, b)| a.hull(b)),
            error: self.error.zip(other.error).map(|(a, b)| a.max(b)),
        }
    }
}

impl OperationExtent {
    /// Extent of an operation; `None` for one whose result is an integer.
    pub(super) fn of(made: &Made, node: &Rc<Node>) -> Option<OperationExtent> {
        let row = made.instruction.op.row();
        (row.result_type() != Type::I).then(|| OperationExtent {
            result: Extent::of(&node.value),
            operands: made.operands[..row.shape.sources()]
                .iter()
                .map(|operand| OperandExtent {
                    extent: Extent::of(&operand.value),
                    from: operand.from().iter().copied().collect(),
                })
                .collect(),
        })
    }

    fn join(&mut self, other: OperationExtent) {
        self.result = self.result.join(other.result);
        for (known, operand) in self.operands.iter_mut().zip(other.operands) {
            known.extent = known.extent.join(operand.extent);
            known.from.extend(operand.from);
        }
    }
}

/// Adds an execution of an operation, or several.
pub(super) fn join_extent(known: &mut Extents, word: u32, extent: OperationExtent) {
    match known.get_mut(&word) {
        Some(known) => known.join(extent),
        None => _ = known.insert(word, extent),
    }
}
