// SPDX-License-Identifier: MIT OR Apache-2.0
//! Writes the head of a source, declaration by declaration, and the period at its end.

use super::number;
use crate::Error;
use std::fmt::Write;
use takt_isa::Machine;

/// Line width for lists of registers.
const WIDTH: usize = 100;

/// Text of a head under construction.
#[derive(Default)]
pub(crate) struct Head(String);

/// Body of a program, and the directives before it.
pub(crate) struct Period<'a> {
    /// Statements of a period.
    pub(crate) code: &'a str,
    /// Fuse products into sums (`.contract on`), and begin the first period with the first tick.
    pub(crate) contracted: bool,
}

impl Head {
    /// Adds a comment line.
    pub(crate) fn comment(&mut self, text: &str) {
        let _ = writeln!(self.0, "; {}", text.replace(['\n', '\r'], " "));
    }

    /// Adds an empty line.
    pub(crate) fn blank(&mut self) {
        self.0.push('\n');
    }

    /// Adds finished lines of declarations.
    pub(crate) fn lines(&mut self, text: &str) {
        self.0.push_str(text);
    }

    /// The lines so far.
    pub(super) fn text(&self) -> &str {
        &self.0
    }

    /// Adds the machine. A machine from a file is chosen on the command line (`-m`): the source mentions it in a comment.
    pub(crate) fn machine(&mut self, machine: &Machine) {
        let comment = if machine.is_builtin() { "" } else { "; " };
        let _ = writeln!(self.0, "{comment}{}", machine.directive());
    }

    /// Includes a file of the library.
    pub(crate) fn include(&mut self, file: &str) {
        let _ = writeln!(self.0, ".include <{file}>");
    }

    /// Adds an input port, or an array of input ports with `dims`.
    pub(crate) fn input(&mut self, name: &str, dims: &[usize], meaning: &str) {
        self.port(".input ", name, dims, meaning);
    }

    /// Adds an output port, or an array of output ports with `dims`.
    pub(crate) fn output(&mut self, name: &str, dims: &[usize], meaning: &str) {
        self.port(".output", name, dims, meaning);
    }

    fn port(&mut self, directive: &str, name: &str, dims: &[usize], meaning: &str) {
        let _ = write!(self.0, "{directive} {name}{}", brackets(dims));
        if !meaning.is_empty() {
            let _ = write!(self.0, " ; {meaning}");
        }
        self.0.push('\n');
    }

    /// Adds `.ports latched`: a period samples all inputs at one instant, and all outputs change at one.
    pub(crate) fn latched(&mut self) {
        self.0.push_str(".ports  latched\n");
    }

    /// Declares registers, in lines of [`WIDTH`] columns.
    pub(crate) fn registers(&mut self, names: &[String]) {
        let mut column = usize::MAX;
        for name in names {
            if column.saturating_add(name.len()) >= WIDTH {
                if column != usize::MAX {
                    self.0.push('\n');
                }
                self.0.push_str(".reg    ");
                column = 0;
            } else {
                self.0.push(' ');
            }
            self.0.push_str(name);
            column += name.len() + 1;
        }
        if !names.is_empty() {
            self.0.push('\n');
        }
    }

    /// Declares the range of an input or a state.
    ///
    /// # Errors
    /// If a limit exceeds binary32's range.
    pub(crate) fn range(&mut self, name: &str, (low, high): (f64, f64)) -> Result<(), Error> {
        let _ = writeln!(self.0, ".range  {name} = {}, {}", number(low)?, number(high)?);
        Ok(())
    }

    /// Presets a register, for the first period.
    ///
    /// # Errors
    /// If the value exceeds binary32's range.
    pub(crate) fn preset(&mut self, name: &str, value: f64) -> Result<(), Error> {
        let _ = writeln!(self.0, ".preset {name} = {}", number(value)?);
        Ok(())
    }

    /// Text without a period, for a body that is included.
    pub(crate) fn into_text(self) -> String {
        self.0
    }

    /// Text of a program: head and period.
    pub(crate) fn into_program(mut self, period: &Period<'_>) -> String {
        self.0.push_str(match period.contracted {
            true => ".schedule on\n.contract on\n.once\n        wait    period\n",
            false => ".schedule on\n\n",
        });
        let _ = write!(self.0, ".period\nperiod:\n{}        wait    period\n", period.code);
        self.0
    }
}

/// Dimensions in brackets; empty for a number.
pub(super) fn brackets(dims: &[usize]) -> String {
    match dims {
        [] => String::new(),
        _ => format!("[{}]", dims.iter().map(usize::to_string).collect::<Vec<_>>().join(",")),
    }
}
