// SPDX-License-Identifier: MIT OR Apache-2.0
//! Types of macros' parameters: the arguments that each parameter takes.

use crate::context::{AstPlace, Context, ErrorReported, words};
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::nearest;
use takt_diagnostics::source::Span;
use takt_isa::Type;
use takt_syntax::ast::Name;
use takt_syntax::name::NameId;

/// The arguments that a parameter takes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum ArgumentKind {
    /// Values of a type: a register, an element, an array of these, or a constant, which becomes a value of that type.
    Value(Type),
    /// A number that is known while the program is assembled.
    Number,
    /// A name with any meaning.
    Name,
}

impl ArgumentKind {
    /// Every kind, in the order of messages.
    pub(crate) const ALL: [ArgumentKind; 5] = [
        ArgumentKind::Value(Type::F),
        ArgumentKind::Value(Type::I),
        ArgumentKind::Value(Type::B),
        ArgumentKind::Number,
        ArgumentKind::Name,
    ];

    /// Name of the type in the language.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            ArgumentKind::Value(ty) => ty.name(),
            ArgumentKind::Number => "number",
            ArgumentKind::Name => "name",
        }
    }

    /// Description of the arguments, for messages.
    pub(crate) const fn words(self) -> &'static str {
        match self {
            ArgumentKind::Value(ty) => words(ty),
            ArgumentKind::Number => "a number that is known when the program is assembled",
            ArgumentKind::Name => "a name",
        }
    }
}

/// The type that a parameter asks of its argument.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ParameterType {
    pub(crate) takes: ArgumentKind,
    /// The source declares the type; otherwise the instructions of the body imply it.
    pub(crate) declared: bool,
    /// Macro of the parameter.
    pub(crate) of: NameId,
    /// Name of the parameter.
    pub(crate) parameter: NameId,
    /// Position in the definition.
    pub(crate) span: Span,
}

impl ParameterType {
    /// The type of a value that is either float or integer.
    pub(crate) fn value(&self) -> Option<Type> {
        match self.takes {
            ArgumentKind::Value(ty @ (Type::F | Type::I)) => Some(ty),
            _ => None,
        }
    }
}

/// A parameter whose type is neither declared nor follows from the body, though an instruction there takes its bits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Open {
    pub(crate) parameter: NameId,
    pub(crate) span: Span,
    /// The instruction, and its operand.
    pub(crate) taken: (&'static str, Span),
}

/// The parameters of a macro.
#[derive(Clone, Default, Debug)]
pub(crate) struct Parameters {
    /// Type of each parameter, if known.
    pub(crate) asked: Vec<Option<ParameterType>>,
    pub(crate) open: Vec<Open>,
}

impl Context {
    /// The type of a parameter, by its name.
    pub(crate) fn parameter_type(&mut self, at: AstPlace, ty: Name) -> Result<ArgumentKind, ErrorReported> {
        let text = self.reports.sources.text(ty.span).to_owned();
        if let Some(takes) = ArgumentKind::ALL.into_iter().find(|takes| takes.name() == text) {
            return Ok(takes);
        }
        let names = ArgumentKind::ALL.map(ArgumentKind::name);
        let error = Diagnostic::error("type", ty.span, format!("`{text}` is not a type of parameters"))
            .note(format!("types: {}", names.join(" ")))
            .did_you_mean(nearest(&text, names));
        Err(self.report(at.scope, error))
    }
}
