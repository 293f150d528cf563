// SPDX-License-Identifier: MIT OR Apache-2.0
//! Files of numbers: `.array A = "A.csv"`. A part of [`expand`](crate::expand).
//!
//! A file becomes a tree of its own that has a literal for each number: all rules for literals apply, and messages show the number
//! where it stands.

use crate::context::{AstPlace, ErrorReported, ScopeId};
use crate::expand::Expander;
use crate::expand::files::{FileError, FileId, text_of};
use crate::expand::load::{Loader, include_path};
use crate::limits;
use std::rc::Rc;
use std::sync::Arc;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::{Source, Span};
use takt_syntax::ast::*;

/// The numbers of a file, by rows, each a literal of a tree.
pub(crate) struct Table {
    pub(crate) at: AstPlace,
    pub(crate) values: Vec<Expr>,
    /// Numbers in each row.
    pub(crate) columns: usize,
}

impl Table {
    pub(crate) fn rows(&self) -> usize {
        self.values.len() / self.columns.max(1)
    }

    /// Sizes of an array for the file: one size for a single row or column.
    pub(crate) fn sizes(&self) -> Vec<usize> {
        match (self.rows(), self.columns) {
            (rows, 1) => vec![rows],
            (1, columns) => vec![columns],
            (rows, columns) => vec![rows, columns],
        }
    }

    /// The sizes match the file's numbers, and the last size its columns.
    pub(crate) fn fits(&self, sizes: &[u32]) -> bool {
        let words: usize = sizes.iter().map(|size| *size as usize).product();
        let last = sizes.last().map_or(0, |size| *size as usize);
        let is_column = sizes.len() == 1 && self.columns == 1;
        words == self.values.len() && (is_column || last == self.columns)
    }
}

/// The separator of a line's numbers; `None` for blanks.
fn separator(line: &str) -> Option<char> {
    [';', ',', '\t'].into_iter().find(|separator| line.contains(*separator))
}

/// The cells of a line, each with its byte offset.
fn cells(line: &str, separator: Option<char>) -> Vec<(usize, &str)> {
    let start = |cell: &str| cell.as_ptr() as usize - line.as_ptr() as usize;
    let cells: Vec<&str> = match separator {
        Some(separator) => line.split(separator).map(str::trim).collect(),
        None => line.split_whitespace().collect(),
    };
    cells.into_iter().map(|cell| (start(cell), cell)).collect()
}

/// A number of a file, as a literal.
fn number(cell: &str) -> Option<NodeKind> {
    if let Ok(value) = cell.parse::<i64>() {
        return Some(NodeKind::Int(value));
    }
    let value = cell.parse::<f64>().ok()?;
    // Accept infinity only if it is spelled out, not as the result of an overflow.
    let is_named = cell.contains(['n', 'N']);
    (value.is_finite() || is_named).then_some(NodeKind::Real(value))
}

/// The message and help for a cell that is not a number.
fn mistake(cell: &str) -> (String, &'static str) {
    let help = match cell {
        "" => "each row has a number in each column",
        _ if cell.replacen(',', ".", 1).parse::<f64>().is_ok() => "the decimal point is a `.`",
        _ => "numbers are written as 12, -0.5 or 1e-3",
    };
    (
        if cell.is_empty() { "a number is missing".to_owned() } else { format!("`{cell}` is not a number") },
        help,
    )
}

impl Expander<'_> {
    /// Reads a file of numbers, given as the source names it, or finds it among the files read.
    pub(crate) fn numbers(
        &mut self,
        at: AstPlace,
        path: &str,
        span: Span,
    ) -> Result<Rc<Table>, ErrorReported> {
        let from = &self.origins[at.ast as usize];
        let Some(within) = include_path(&from.path, path) else {
            let error = Diagnostic::error("load", span, format!("`{path}` is not a path within the project"))
                .note(
                    "paths are relative to the file that names them, and stay in the folder of the first one",
                );
            return Err(self.context.report(at.scope, error));
        };
        let id = FileId { place: from.place, path: within };
        if let Some(known) = self.tables.get(&id) {
            return Ok(Rc::clone(known));
        }
        let file = self.numbers_file(at, &id, span)?;
        let source = self.context.reports.sources.files()[file].clone();
        let mut ast = Ast::default();
        let parsed = self.parse_numbers(&source, &mut ast, span);
        // Trees and their files share one numbering.
        self.context.asts.push(Rc::new(ast));
        self.origins.push(id.clone());
        let (values, columns) = parsed?;
        let at = AstPlace { ast: self.context.asts.len() as u32 - 1, scope: ScopeId::ROOT };
        let table = Rc::new(Table { at, values, columns });
        self.tables.insert(id, Rc::clone(&table));
        Ok(table)
    }

    /// Adds the file to the sources.
    fn numbers_file(&mut self, at: AstPlace, id: &FileId, span: Span) -> Result<usize, ErrorReported> {
        let (name, loader): (String, &dyn Loader) = match id.place {
            None => (id.path.clone(), self.loader),
            Some(place) => {
                let place = &self.loader.places()[place];
                (place.name_of(&id.path), place)
            }
        };
        let read = loader.load(&id.path).map_err(FileError::from).and_then(|bytes| {
            self.count_bytes(bytes.len())?;
            text_of(bytes)
        });
        let text = match read {
            Ok(text) => text,
            Err(unread) => {
                let error = Diagnostic::error("load", span, format!("`{name}` cannot be read: {unread}"));
                let error = match self.loader.takes_folders() {
                    true => error,
                    false => error.note("a page reads only the files that are open in it"),
                };
                return Err(self.context.report(at.scope, error));
            }
        };
        self.context.reports.sources.add_shared(&name, Arc::new(text)).ok_or_else(|| {
            let message = format!("`{name}` cannot be read: {}", FileError::TooMuch);
            self.context.error(at.scope, "limit", span, message)
        })
    }

    /// The literals of a file's numbers, and the number of columns.
    fn parse_numbers(
        &mut self,
        source: &Source,
        ast: &mut Ast,
        span: Span,
    ) -> Result<(Vec<Expr>, usize), ErrorReported> {
        let mut values: Vec<Expr> = Vec::new();
        let mut first: Option<(Option<char>, usize, Span)> = None;
        let mut has_names = false;
        let mut offset = 0;
        for line in source.text.split('\n') {
            offset += line.len() + 1;
            let line = line.trim_start_matches('\u{feff}');
            let base = source.base as usize + offset - 1 - line.len();
            if line.trim().is_empty() || line.trim_start().starts_with('#') {
                continue;
            }
            let separator = first.map_or_else(|| separator(line.trim()), |(separator, ..)| separator);
            let cells = cells(line, separator);
            let place = |(start, cell): (usize, &str)| {
                let start = (base + start) as u32;
                Span::new(start, start + cell.len() as u32)
            };
            let whole = place(cells[0]).to(place(cells[cells.len() - 1]));
            // The first line may name the columns.
            if first.is_none() && !has_names && cells.iter().all(|(_, cell)| is_name(cell)) {
                has_names = true;
                continue;
            }
            let (_, columns, row) = *first.get_or_insert((separator, cells.len(), whole));
            if cells.len() != columns {
                let message = format!("{} in this row, and {columns} in the first", count(cells.len()));
                let error = Diagnostic::error("array", whole, message)
                    .also(row, "the first row")
                    .also(span, "read here");
                return Err(self.context.report(ScopeId::ROOT, error));
            }
            for (start, cell) in cells {
                let here = place((start, cell));
                let Some(kind) = number(cell) else {
                    let (message, help) = mistake(cell);
                    let error =
                        Diagnostic::error("array", if cell.is_empty() { whole } else { here }, message)
                            .also(span, "read here")
                            .help(help);
                    return Err(self.context.report(ScopeId::ROOT, error));
                };
                let id = ExprId { first: ast.nodes.len() as u32, count: 1 };
                ast.nodes.push(Node { kind, span: here });
                values.push(Expr { id, span: here });
            }
            if values.len() > limits::DATA_WORDS {
                let message = format!("`{}` has more than {} numbers", source.name, limits::DATA_WORDS);
                return Err(self.context.error(ScopeId::ROOT, "limit", span, message));
            }
        }
        match first {
            Some((_, columns, _)) => Ok((values, columns)),
            None => {
                let message = format!("`{}` has no numbers", source.name);
                Err(self.context.error(ScopeId::ROOT, "array", span, message))
            }
        }
    }
}

/// A cell is the name of a column.
fn is_name(cell: &str) -> bool {
    let text = cell.trim_matches('"');
    number(text).is_none() && text.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

fn count(numbers: usize) -> String {
    let plural = if numbers == 1 { "" } else { "s" };
    format!("{numbers} number{plural}")
}

/// The rows and columns of a file, in words.
pub(crate) fn shape_text(table: &Table) -> String {
    let rows = table.rows();
    let plural = if rows == 1 { "" } else { "s" };
    format!("{rows} row{plural} of {}", count(table.columns))
}
