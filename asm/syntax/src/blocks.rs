// SPDX-License-Identifier: MIT OR Apache-2.0
//! Blocks of a file: `.macro`, `.rep`, `.for` and `.if` to the directives that close them.

use crate::ast::*;
use crate::limits;
use takt_diagnostics::diag::{Diagnostic, Sink};

/// An open block.
struct OpenBlock {
    opener: Directive,
    /// Index of the directive that opens it.
    directive: usize,
    /// Index of the latest branch of a condition.
    latest: usize,
    branches: Vec<usize>,
    has_else: bool,
}

/// Blocks of a file up to a statement.
#[derive(Default)]
struct Blocks {
    open: Vec<OpenBlock>,
    /// Closed blocks: opener, index of the opening directive, index of the closing directive.
    closed: Vec<(Directive, usize, usize)>,
}

/// Finds the end of every block of the file, so that expansion can jump.
pub(crate) fn close(ast: &mut Ast, sink: &mut Sink) {
    let mut blocks = Blocks::default();
    for index in 0..ast.statements.len() {
        let StatementKind::Directive(id) = ast.statements[index].kind else { continue };
        let id = id as usize;
        match ast.directives[id].kind {
            DirectiveKind::Macro { .. } => blocks.begin(ast, sink, id, Directive::Macro),
            DirectiveKind::Rep { .. } => blocks.begin(ast, sink, id, Directive::Rep),
            DirectiveKind::For { .. } => blocks.begin(ast, sink, id, Directive::For),
            DirectiveKind::If(..) => blocks.begin(ast, sink, id, Directive::If),
            DirectiveKind::Broken(opener, _) => blocks.begin(ast, sink, id, opener),
            DirectiveKind::Elif(..) => blocks.branch(ast, sink, (index, id), false),
            DirectiveKind::Else(..) => blocks.branch(ast, sink, (index, id), true),
            DirectiveKind::End(closer) => blocks.end(ast, sink, (index, id), closer),
            _ => {}
        }
    }
    blocks.end_of_file(ast, sink);
}

impl Blocks {
    /// Opens a block.
    fn begin(&mut self, ast: &Ast, sink: &mut Sink, id: usize, opener: Directive) {
        let span = ast.directives[id].span;
        if self.open.len() == limits::BLOCK_DEPTH {
            let message =
                format!("blocks nest deeper than the {} that the assembler reads", limits::BLOCK_DEPTH);
            sink.push(Diagnostic::error("limit", span, message));
        }
        if opener == Directive::Macro && !self.open.iter().all(|block| block.opener == Directive::If) {
            let outer = &self.open.iter().rfind(|block| block.opener != Directive::If);
            let mut error = Diagnostic::error("block", span, "a macro is defined outside of any other block");
            if let Some(outer) = outer {
                let message = format!("this `{}` is open", outer.opener.name());
                error = error.also(ast.directives[outer.directive].span, message);
            }
            sink.push(error.help("move the definition before the block"));
        }
        let branches = Vec::new();
        self.open.push(OpenBlock { opener, directive: id, latest: id, branches, has_else: false });
    }

    /// Begins a branch of the innermost block, a condition.
    fn branch(&mut self, ast: &mut Ast, sink: &mut Sink, (index, id): (usize, usize), is_else: bool) {
        let span = ast.directives[id].span;
        let word = if is_else { ".else" } else { ".elif" };
        match self.open.last_mut() {
            Some(block) if block.opener == Directive::If => {
                if block.has_else {
                    let first = ast.directives[block.latest].span;
                    sink.push(
                        Diagnostic::error("block", span, format!("`{word}` after `.else`"))
                            .also(first, "this is the last branch"),
                    );
                }
                set_next(&mut ast.directives[block.latest].kind, index as u32);
                block.latest = id;
                block.branches.push(id);
                block.has_else = is_else;
            }
            outer => {
                let error = Diagnostic::error("block", span, format!("`{word}` without an `.if`"));
                let outer = outer.map(|block| (block.opener, block.directive));
                sink.push(note_open(error, outer, ast));
                ast.statements[index].kind = StatementKind::Empty;
            }
        }
    }

    /// Closes the innermost block.
    fn end(&mut self, ast: &mut Ast, sink: &mut Sink, (index, id): (usize, usize), closer: Directive) {
        let wanted = match closer {
            Directive::EndMacro => Directive::Macro,
            Directive::EndRep => Directive::Rep,
            Directive::EndFor => Directive::For,
            _ => Directive::If,
        };
        if let Some(block) = self.open.pop_if(|block| block.opener == wanted) {
            self.closed.push((block.opener, block.directive, id));
            finish(ast, block.directive, block.latest, &block.branches, index as u32);
            return;
        }
        let message = if self.open.iter().any(|block| block.opener == wanted) {
            format!("`{}` within a block that is still open", closer.name())
        } else {
            format!("`{}` without `{}`", closer.name(), wanted.name())
        };
        let outer = self.open.last().map(|block| (block.opener, block.directive));
        let error = Diagnostic::error("block", ast.directives[id].span, message);
        sink.push(note_open(error, outer, ast));
        ast.statements[index].kind = StatementKind::Empty;
    }

    /// Ends the blocks that are still open with the file.
    fn end_of_file(mut self, ast: &mut Ast, sink: &mut Sink) {
        let end = ast.statements.len() as u32;
        while let Some(block) = self.open.pop() {
            let closer = match block.opener {
                Directive::Macro => ".endm",
                Directive::Rep => ".endr",
                Directive::For => ".endfor",
                _ => ".endif",
            };
            let span = ast.directives[block.directive].span;
            let name = block.opener.name();
            let mut error = Diagnostic::error("block", span, format!("this `{name}` is never closed"))
                .help(format!("end its body with `{closer}`"));
            // An inner block of the same kind may lack its end, and have taken this block's.
            let within = |(opener, directive, _): &&(Directive, usize, usize)| {
                *opener == block.opener && *directive > block.directive
            };
            if let Some((_, inner, last)) = self.closed.iter().rfind(within) {
                error = error
                    .also(ast.directives[*inner].span, format!("this `{name}` is closed …"))
                    .also(ast.directives[*last].span, "… by this one");
            }
            sink.push(error);
            sink.is_partial = true;
            finish(ast, block.directive, block.latest, &block.branches, end);
        }
    }
}

fn note_open(error: Diagnostic, outer: Option<(Directive, usize)>, ast: &Ast) -> Diagnostic {
    match outer {
        Some((opener, directive)) => {
            error.also(ast.directives[directive].span, format!("this `{}` is open", opener.name()))
        }
        None => error,
    }
}

/// Sets the statement at which a branch that is not taken continues.
fn set_next(kind: &mut DirectiveKind, at: u32) {
    match kind {
        DirectiveKind::If(_, next) | DirectiveKind::Elif(_, next, _) | DirectiveKind::Broken(_, next) => {
            *next = at
        }
        _ => {}
    }
}

/// Sets the end of a block in its opener and its branches.
fn finish(ast: &mut Ast, opener: usize, latest: usize, branches: &[usize], at: u32) {
    set_next(&mut ast.directives[latest].kind, at);
    for &branch in branches {
        match &mut ast.directives[branch].kind {
            DirectiveKind::Elif(_, _, end) | DirectiveKind::Else(end) => *end = at,
            _ => {}
        }
    }
    match &mut ast.directives[opener].kind {
        DirectiveKind::Macro { end, .. }
        | DirectiveKind::Rep { end, .. }
        | DirectiveKind::For { end, .. }
        | DirectiveKind::Broken(_, end) => {
            *end = at;
        }
        _ => {}
    }
}
