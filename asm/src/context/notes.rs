// SPDX-License-Identifier: MIT OR Apache-2.0
//! Names and their places, noted for [`index`](crate::index) while names are resolved. A part of [`context`](crate::context).

use crate::context::ScopeId;
use crate::limits;
use takt_diagnostics::source::Span;
use takt_syntax::name::NameId;

/// Uses of names, in the order in which they were resolved: a place in a macro's body occurs once for each use of the macro.
#[derive(Clone, Debug, Default)]
pub(crate) struct Notes {
    /// Names of registers, constants, labels and parameters: place, scope and name.
    pub(crate) names: Vec<(Span, ScopeId, NameId)>,
    /// Uses of macros: place and name.
    pub(crate) macros: Vec<(Span, NameId)>,
    /// Sums of equations: place of the sum, place of its index variable, and its name.
    pub(crate) sums: Vec<(Span, Span, NameId)>,
    /// `.include`s: place, and index of the source.
    pub(crate) includes: Vec<(Span, usize)>,
    /// Some references were dropped at the limit.
    pub(crate) cut: bool,
}

impl Notes {
    #[inline]
    pub(crate) fn name(&mut self, span: Span, scope: ScopeId, name: NameId) {
        if self.names.len() < limits::REFERENCES {
            self.names.push((span, scope, name));
        } else {
            self.cut = true;
        }
    }

    pub(crate) fn sum(&mut self, sum: Span, variable: Span, name: NameId) {
        if self.sums.len() < limits::REFERENCES {
            self.sums.push((sum, variable, name));
        } else {
            self.cut = true;
        }
    }

    pub(crate) fn macro_use(&mut self, span: Span, name: NameId) {
        if self.macros.len() < limits::REFERENCES {
            self.macros.push((span, name));
        } else {
            self.cut = true;
        }
    }
}
