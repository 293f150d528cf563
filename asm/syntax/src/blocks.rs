// SPDX-License-Identifier: MIT OR Apache-2.0
//! Blocks of a file: `.macro`, `.rep`, `.for` and `.if` to the directives that close them.

use crate::ast::*;
use crate::limits;
use crate::report::diag::{Diagnostic, Sink};

/// Finds for every block of the file where it ends, so that expansion can jump.
pub(crate) fn close(ast: &mut Ast, sink: &mut Sink) {
    // The statement that opened the block, its directive, and that of its latest branch.
    struct Open {
        opener: Directive,
        directive: usize,
        latest: usize,
        branches: Vec<usize>,
        has_else: bool,
    }
    let mut open: Vec<Open> = Vec::new();
    // Blocks that are closed: their openers, and where the opening and the closing directives stand.
    let mut closed: Vec<(Directive, usize, usize)> = Vec::new();
    for index in 0..ast.statements.len() {
        let StatementKind::Directive(id) = ast.statements[index].kind else { continue };
        let id = id as usize;
        let span = ast.directives[id].span;
        let here = index as u32;
        match ast.directives[id].kind {
            DirectiveKind::Macro { .. }
            | DirectiveKind::Rep { .. }
            | DirectiveKind::For { .. }
            | DirectiveKind::If(..)
            | DirectiveKind::Broken(..) => {
                let opener = match ast.directives[id].kind {
                    DirectiveKind::Macro { .. } => Directive::Macro,
                    DirectiveKind::Rep { .. } => Directive::Rep,
                    DirectiveKind::For { .. } => Directive::For,
                    DirectiveKind::Broken(opener, _) => opener,
                    _ => Directive::If,
                };
                if open.len() == limits::BLOCK_DEPTH {
                    let message = format!(
                        "blocks nest deeper than the {} that the assembler reads",
                        limits::BLOCK_DEPTH
                    );
                    sink.push(Diagnostic::error("limit", span, message));
                }
                if opener == Directive::Macro && !open.iter().all(|block| block.opener == Directive::If) {
                    let outer = &open.iter().rfind(|block| block.opener != Directive::If);
                    let mut error =
                        Diagnostic::error("block", span, "a macro is defined outside of any other block");
                    if let Some(outer) = outer {
                        let message = format!("this `{}` is open", outer.opener.name());
                        error = error.also(ast.directives[outer.directive].span, message);
                    }
                    sink.push(error.help("move the definition before it"));
                }
                open.push(Open { opener, directive: id, latest: id, branches: Vec::new(), has_else: false });
            }
            DirectiveKind::Elif(..) | DirectiveKind::Else(..) => {
                let is_else = matches!(ast.directives[id].kind, DirectiveKind::Else(..));
                let word = if is_else { ".else" } else { ".elif" };
                match open.last_mut() {
                    Some(block) if block.opener == Directive::If => {
                        if block.has_else {
                            let first = ast.directives[block.latest].span;
                            sink.push(
                                Diagnostic::error("block", span, format!("`{word}` after `.else`"))
                                    .also(first, "this is the last branch"),
                            );
                        }
                        set_next(&mut ast.directives[block.latest].kind, here);
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
            DirectiveKind::End(closer) => {
                let wanted = match closer {
                    Directive::EndMacro => Directive::Macro,
                    Directive::EndRep => Directive::Rep,
                    Directive::EndFor => Directive::For,
                    _ => Directive::If,
                };
                if open.last().is_some_and(|block| block.opener == wanted) {
                    let Some(block) = open.pop() else { continue };
                    closed.push((block.opener, block.directive, id));
                    finish(ast, block.directive, block.latest, &block.branches, here);
                } else {
                    let message = if open.iter().any(|block| block.opener == wanted) {
                        format!("`{}` within a block that is still open", closer.name())
                    } else {
                        format!("`{}` without `{}`", closer.name(), wanted.name())
                    };
                    let outer = open.last().map(|block| (block.opener, block.directive));
                    let error = note_open(Diagnostic::error("block", span, message), outer, ast);
                    sink.push(error);
                    ast.statements[index].kind = StatementKind::Empty;
                }
            }
            _ => {}
        }
    }
    // Blocks that are still open end with the file.
    let end = ast.statements.len() as u32;
    while let Some(block) = open.pop() {
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
        // It may be one within it that lacks an end, and has taken this one's.
        let within = |(opener, directive, _): &&(Directive, usize, usize)| {
            *opener == block.opener && *directive > block.directive
        };
        if let Some((_, inner, last)) = closed.iter().rfind(within) {
            error = error
                .also(ast.directives[*inner].span, format!("this `{name}` is closed …"))
                .also(ast.directives[*last].span, "… by this one");
        }
        sink.push(error);
        sink.is_partial = true;
        finish(ast, block.directive, block.latest, &block.branches, end);
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

/// Sets where a branch that is not taken continues.
fn set_next(kind: &mut DirectiveKind, at: u32) {
    match kind {
        DirectiveKind::If(_, next) | DirectiveKind::Elif(_, next, _) | DirectiveKind::Broken(_, next) => {
            *next = at
        }
        _ => {}
    }
}

/// Sets where a block ends.
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
