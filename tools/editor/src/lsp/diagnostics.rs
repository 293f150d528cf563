// SPDX-License-Identifier: MIT OR Apache-2.0
//! Diagnostics of the assembler in the protocol's form, and their suggested fixes as edits.

use crate::lsp::program::Files;
use crate::lsp::text::{Encoding, Text};
use crate::lsp::uri;
use lsp_types::{
    CodeAction, CodeActionKind, Diagnostic, DiagnosticRelatedInformation, DiagnosticSeverity, Location,
    NumberOrString, Position, Range, TextEdit, Uri, WorkspaceEdit,
};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use takt_asm::Directive;
use takt_asm::diag::{self, Diagnostics, Severity};
use takt_asm::tokens::{self, Token, TokenKind};

/// Data attached to a diagnostic, from which fixes are made.
#[derive(Serialize, Deserialize)]
struct Data {
    /// Replacement for the faulty text.
    replacement: Option<String>,
    /// Alternative lines, one of which the source lacks.
    missing: Vec<String>,
}

/// Diagnostics by file; a diagnostic without a place is shown at the beginning of `root`.
pub(crate) fn by_file(
    files: &Files,
    diagnostics: &Diagnostics,
    root: &Path,
    encoding: Encoding,
) -> BTreeMap<PathBuf, Vec<Diagnostic>> {
    let mut out: BTreeMap<PathBuf, Vec<Diagnostic>> = BTreeMap::new();
    for diagnostic in &diagnostics.list {
        let mut shown = convert(files, diagnostic, encoding);
        let main = diagnostic.labels.first().and_then(|label| files.range(label.span, encoding));
        let path = match main.map(|(file, range)| (file.path.clone(), range)) {
            Some((Some(path), range)) => {
                shown.range = range;
                path
            }
            // In the library: show the diagnostic at the place of use, which is among the other places.
            Some((None, _)) => {
                let mut others =
                    diagnostic.labels.iter().filter_map(|label| files.range(label.span, encoding));
                match others.find_map(|(file, range)| Some((file.path.clone()?, range))) {
                    Some((path, range)) => {
                        shown.range = range;
                        path
                    }
                    None => root.to_owned(),
                }
            }
            None => root.to_owned(),
        };
        out.entry(path).or_default().push(shown);
    }
    out
}

fn convert(files: &Files, diagnostic: &diag::Diagnostic, encoding: Encoding) -> Diagnostic {
    let mut message = diagnostic.message.clone();
    let here = diagnostic.labels.first().map_or("", |label| label.message.as_str());
    let notes = diagnostic.notes.iter().map(|note| format!("note: {note}"));
    let help = diagnostic.help.iter().map(|help| format!("help: {help}"));
    for line in Some(here.to_owned()).filter(|here| !here.is_empty()).into_iter().chain(notes).chain(help) {
        message.push('\n');
        message.push_str(&line);
    }
    let related = diagnostic.labels.iter().skip(1).filter_map(|label| {
        let (file, range) = files.range(label.span, encoding)?;
        let location = Location { uri: uri::of_path(file.path.as_deref()?)?, range };
        Some(DiagnosticRelatedInformation { location, message: label.message.clone() })
    });
    Diagnostic {
        range: Range::default(),
        severity: Some(match diagnostic.severity {
            Severity::Error => DiagnosticSeverity::ERROR,
            Severity::Warning => DiagnosticSeverity::WARNING,
        }),
        code: Some(NumberOrString::String(diagnostic.code.to_owned())),
        code_description: None,
        source: Some("takt".to_owned()),
        message,
        related_information: Some(related.collect::<Vec<_>>()).filter(|related| !related.is_empty()),
        tags: None,
        data: Some(Data { replacement: diagnostic.replacement.clone(), missing: diagnostic.missing.clone() })
            .filter(|data| data.replacement.is_some() || !data.missing.is_empty())
            .and_then(|data| serde_json::to_value(data).ok()),
    }
}

/// An action that edits a document.
pub(crate) fn action(uri: &Uri, title: String, kind: CodeActionKind, edit: TextEdit) -> CodeAction {
    // `Uri` caches its parsed form through interior mutability; the protocol's types require it as a key.
    #[allow(clippy::mutable_key_type)]
    let changes = HashMap::from([(uri.clone(), vec![edit])]);
    CodeAction {
        title,
        kind: Some(kind),
        edit: Some(WorkspaceEdit { changes: Some(changes), ..WorkspaceEdit::default() }),
        ..CodeAction::default()
    }
}

/// Quick fixes of diagnostics: the assembler's replacements and missing lines.
pub(crate) fn fixes(uri: &Uri, text: &Text, range: Range, diagnostics: &[Diagnostic]) -> Vec<CodeAction> {
    let touches = |other: &Range| other.start <= range.end && range.start <= other.end;
    let fix = |diagnostic: &Diagnostic, title: String, preferred: bool, edit: TextEdit| CodeAction {
        diagnostics: Some(vec![diagnostic.clone()]),
        is_preferred: Some(preferred),
        ..action(uri, title, CodeActionKind::QUICKFIX, edit)
    };
    let mut found = Vec::new();
    for diagnostic in diagnostics.iter().filter(|diagnostic| touches(&diagnostic.range)) {
        let data = diagnostic.data.clone().and_then(|data| serde_json::from_value::<Data>(data).ok());
        let Some(Data { replacement, missing }) = data else { continue };
        if let Some(replacement) = replacement {
            let edit = TextEdit { range: diagnostic.range, new_text: replacement.clone() };
            found.push(fix(diagnostic, format!("write `{replacement}`"), true, edit));
        }
        for line in missing {
            let at = Position::new(home(text, &line, diagnostic.range.start.line), 0);
            let edit = TextEdit { range: Range::new(at, at), new_text: format!("{line}\n") };
            found.push(fix(diagnostic, format!("add `{line}`"), false, edit));
        }
    }
    found
}

/// Line, from 0, before which to insert a missing line: an `.include` goes after the leading comment, a declaration before the section
/// that contains the mistake.
fn home(text: &Text, missing: &str, mistake: u32) -> u32 {
    let lines = tokens::lines(&text.text);
    let is_one_of = |line: &Vec<Token>, directives: &[Directive]| {
        let mut words = line.iter().filter(|token| token.kind == TokenKind::Directive);
        words.any(|token| directives.iter().any(|known| known.name() == &text.text[token.range.clone()]))
    };
    let before = &lines[..lines.len().min(mistake as usize)];
    let place = if missing.starts_with(Directive::Include.name()) {
        before.iter().position(|line| line.iter().any(|token| token.kind != TokenKind::Comment))
    } else {
        let opens = [Directive::Once, Directive::Period, Directive::Data];
        before.iter().position(|line| is_one_of(line, &opens))
    };
    place.map_or(mistake, |line| line as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_lines_have_a_place() {
        let text = Text::new("; about\n\n.input x\n.once\n wait p\n.period\np: fadd y, x, a\n");
        assert_eq!(home(&text, ".reg a", 6), 3, "before the sections");
        assert_eq!(home(&text, ".include <math.s>", 6), 2, "behind the first comment");
        let text = Text::new("fadd y, x, a\n");
        assert_eq!((home(&text, ".reg a", 0), home(&text, ".include <math.s>", 0)), (0, 0));
        let text = Text::new(".reg b\n; it\nfadd y, x, a\n.period\n");
        assert_eq!(home(&text, ".reg a", 2), 2, "of a part, before the mistake");
    }
}
