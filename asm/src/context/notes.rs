// SPDX-License-Identifier: MIT OR Apache-2.0
//! Which names stand where: noted while names are resolved, for [`index`](crate::index). A part of [`context`](crate::context).

use crate::context::ScopeId;
use crate::limits;
use crate::report::source::Span;
use crate::syntax::name::NameId;

/// Uses of names, in the order in which they were resolved: a place in a macro's body occurs once for each use of the macro.
#[derive(Clone, Debug, Default)]
pub(crate) struct Notes {
    /// Names of registers, constants, labels and parameters: where, in which scope, and which.
    pub(crate) names: Vec<(Span, ScopeId, NameId)>,
    /// Uses of macros.
    pub(crate) macros: Vec<(Span, NameId)>,
    /// Sums of equations: where each stands, and where what it counts with.
    pub(crate) sums: Vec<(Span, Span, NameId)>,
    /// `.include`s, and which of the sources each means.
    pub(crate) includes: Vec<(Span, usize)>,
    /// More was met than is kept.
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
