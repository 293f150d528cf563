//! The assembler's diagnostics as the protocol has them, and its own advice as edits.

use crate::lsp::program::Files;
use crate::lsp::text::Encoding;
use crate::lsp::uri;
use lsp_types::{
    CodeAction, CodeActionKind, Diagnostic, DiagnosticRelatedInformation, DiagnosticSeverity, Location,
    NumberOrString, Range, TextEdit, Uri, WorkspaceEdit,
};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use takt_asm::diag::{self, Diagnostics, Severity};

/// What a diagnostic carries along for its fix.
#[derive(Serialize, Deserialize)]
struct Data {
    /// What to write in the place of the mistake.
    replacement: String,
}

/// Diagnostics by file; those without a place are at the beginning of `root`.
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
            // In the library: where it is used stands among the other places.
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
        data: diagnostic
            .replacement
            .clone()
            .and_then(|replacement| serde_json::to_value(Data { replacement }).ok()),
    }
}

/// The fixes of diagnostics: what the assembler itself would write there.
pub(crate) fn fixes(uri: &Uri, range: Range, diagnostics: &[Diagnostic]) -> Vec<CodeAction> {
    let touches = |other: &Range| other.start <= range.end && range.start <= other.end;
    let fix = |diagnostic: &Diagnostic| {
        let data: Data = serde_json::from_value(diagnostic.data.clone()?).ok()?;
        let edit = TextEdit { range: diagnostic.range, new_text: data.replacement.clone() };
        // Uri has interior mutability in its parsed form; as a key of the protocol's own type there is no way around.
        #[allow(clippy::mutable_key_type)]
        let changes = HashMap::from([(uri.clone(), vec![edit])]);
        Some(CodeAction {
            title: format!("write `{}`", data.replacement),
            kind: Some(CodeActionKind::QUICKFIX),
            diagnostics: Some(vec![diagnostic.clone()]),
            edit: Some(WorkspaceEdit { changes: Some(changes), ..WorkspaceEdit::default() }),
            is_preferred: Some(true),
            ..CodeAction::default()
        })
    };
    diagnostics.iter().filter(|diagnostic| touches(&diagnostic.range)).filter_map(fix).collect()
}
