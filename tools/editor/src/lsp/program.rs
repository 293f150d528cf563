// SPDX-License-Identifier: MIT OR Apache-2.0
//! A program in the editor: analysis after each keystroke ([`Front`]), and results of scheduling and cycle counting ([`AssemblyResult`]).

use crate::lsp::Settings;
use crate::lsp::text::{Encoding, Text};
use lsp_types::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use takt_analysis::{BoundError, Bounds, StaticIssue};
use takt_asm::diag::Diagnostics;
use takt_asm::index::{Index, Reference, Symbol};
use takt_asm::source::{Sources, Span};
use takt_asm::{AssembledProgram, CheckedProgram, FileLoader, Loader, MemoryLoader, Open, Options, Search};
use takt_isa::Machine;

/// A source file of a program.
pub(crate) struct File {
    /// Path on disk; `None` for a library file.
    pub(crate) path: Option<PathBuf>,
    /// Name of the file in the program.
    pub(crate) name: Arc<str>,
    /// Offset of the file's first byte in the address space shared by all sources.
    pub(crate) base: u32,
    pub(crate) text: Text,
}

/// Source files of a program.
#[derive(Default)]
pub(crate) struct Files(pub(crate) Vec<File>);

impl Files {
    fn new(root: &Path, sources: &Sources) -> Files {
        let folder = root.parent().unwrap_or(Path::new(""));
        let file = |source: &takt_asm::source::Source| {
            let name = &*source.name;
            // Name forms are those of `Search`: library, additional folder, project.
            let path = match name.as_bytes().first() {
                Some(b'<') => None,
                Some(b'.' | b'/') => {
                    std::path::absolute(name).ok().map(|path| crate::lsp::workspace::normal(&path))
                }
                _ if folder.as_os_str().is_empty() => Some(PathBuf::from(name)),
                _ => Some(folder.join(name)),
            };
            File {
                path,
                name: Arc::clone(&source.name),
                base: source.base,
                text: Text::shared(Arc::clone(&source.text)),
            }
        };
        Files(sources.files().iter().map(file).collect())
    }

    /// Index of the file that contains a span, with the byte range in that file.
    pub(crate) fn place(&self, span: Span) -> Option<(usize, std::ops::Range<usize>)> {
        let file = self.0.partition_point(|file| file.base <= span.start).checked_sub(1)?;
        let File { base, text, .. } = &self.0[file];
        let clamp = |offset: u32| (offset.saturating_sub(*base) as usize).min(text.text.len());
        Some((file, clamp(span.start)..clamp(span.end)))
    }

    pub(crate) fn range(&self, span: Span, encoding: Encoding) -> Option<(&File, Range)> {
        let (file, bytes) = self.place(span)?;
        let file = &self.0[file];
        Some((file, file.text.range(bytes, encoding)))
    }

    pub(crate) fn text(&self, span: Span) -> &str {
        self.place(span).and_then(|(file, bytes)| self.0[file].text.text.get(bytes)).unwrap_or("")
    }

    /// Finds a file by its path.
    pub(crate) fn of(&self, path: &Path) -> Option<&File> {
        self.0.iter().find(|file| file.path.as_deref() == Some(path))
    }

    /// Both lists contain the same names and texts.
    pub(crate) fn are(&self, others: &Files) -> bool {
        let same = |(one, other): (&File, &File)| one.name == other.name && one.text.text == other.text.text;
        self.0.len() == others.0.len() && self.0.iter().zip(&others.0).all(same)
    }

    pub(crate) fn named(&self, name: &str) -> Option<&File> {
        self.0.iter().find(|file| *file.name == *name)
    }
}

impl File {
    /// Span of a byte range in the file.
    pub(crate) fn span(&self, bytes: std::ops::Range<usize>) -> Span {
        Span::new(self.base + bytes.start as u32, self.base + bytes.end as u32)
    }
}

/// Analysis of a program without scheduling.
pub(crate) struct Front {
    /// Machine of the program.
    pub(crate) machine: &'static Machine,
    pub(crate) files: Files,
    pub(crate) index: Index,
    pub(crate) diagnostics: Diagnostics,
}

impl Front {
    /// Symbols referenced at a source offset, with the span of the name.
    pub(crate) fn at(&self, offset: u32) -> Option<(Span, Vec<u32>)> {
        let found = self.index.at(offset);
        Some((found.first()?.span, found.iter().map(|reference| reference.symbol).collect()))
    }

    pub(crate) fn symbol(&self, number: u32) -> &Symbol {
        &self.index.symbols[number as usize]
    }

    /// References to the declarations of these symbols.
    pub(crate) fn references(&self, symbols: &[u32]) -> Vec<Reference> {
        let declared: Vec<Span> = symbols.iter().map(|symbol| self.symbol(*symbol).span).collect();
        let same = |reference: &&Reference| declared.contains(&self.symbol(reference.symbol).span);
        let mut found: Vec<Reference> = self.index.references.iter().filter(same).copied().collect();
        found.dedup_by_key(|reference| reference.span);
        found
    }
}

/// Result of assembling a program, or the error that prevented it.
pub(crate) struct AssemblyResult {
    pub(crate) files: Files,
    pub(crate) diagnostics: Diagnostics,
    pub(crate) program: Option<CountedProgram>,
}

/// An assembled program with its cycle counts.
pub(crate) struct CountedProgram {
    pub(crate) assembled: AssembledProgram,
    pub(crate) issues: Vec<StaticIssue>,
    pub(crate) bounds: Result<Bounds, BoundError>,
}

/// Reads and checks the program that starts with the source at `root`.
pub(crate) fn check(settings: &Settings, root: &Path, open: &Open) -> (Front, CheckedProgram) {
    let (folder, name) = match (root.parent(), root.file_name()) {
        (Some(folder), Some(name)) if root.is_absolute() => {
            (folder.to_owned(), name.to_string_lossy().into_owned())
        }
        _ => (PathBuf::new(), bare_name(root)),
    };
    let options = Options { machine: settings.machine, levels: settings.levels, ..Options::default() };
    let check = |project: &dyn Loader, name: &str| takt_asm::check(name, project, &options);
    let checked = if folder.as_os_str().is_empty() {
        let mut alone = MemoryLoader::new(settings.beside);
        if let Some(text) = open.get(root) {
            alone.add(&name, text.as_bytes());
        }
        check(&search(settings, alone, open), &name)
    } else {
        check(&search(settings, FileLoader::new(&folder).with_open(Arc::clone(open)), open), &name)
    };
    let mut files = Files::new(root, checked.sources());
    if folder.as_os_str().is_empty()
        && let Some(first) = files.0.first_mut()
    {
        first.path = Some(root.to_owned());
    }
    let (index, machine) = (checked.index().clone(), checked.machine());
    let front = Front { files, index, machine, diagnostics: checked.diagnostics() };
    (front, checked)
}

/// Name used in messages for a document without a file: `Untitled-1` for the URI `untitled:Untitled-1`.
fn bare_name(root: &Path) -> String {
    let uri = root.to_string_lossy();
    let name = uri.rsplit(['/', '\\', ':']).next().unwrap_or_default();
    // Names that begin in this way denote files of the library or of an additional folder.
    if name.is_empty() || name.starts_with(['<', '.']) { "untitled.s".to_owned() } else { name.to_owned() }
}

fn search<L: Loader>(settings: &Settings, project: L, open: &Open) -> Search<L> {
    let folders = settings.folders.iter();
    folders.fold(Search::new(project), Search::folder).with_open(open).library(settings.library)
}

/// Completes a checked program: schedules and emits it, and counts its cycles.
pub(crate) fn finish(root: &Path, checked: CheckedProgram) -> AssemblyResult {
    let files = Files::new(root, checked.sources());
    match checked.finish() {
        Err(diagnostics) => AssemblyResult { files, diagnostics, program: None },
        Ok(assembled) => {
            let issues = takt_analysis::static_issue(&assembled.program);
            let bounds = takt_analysis::bound(&assembled.program);
            let diagnostics = assembled.warnings.clone();
            AssemblyResult { files, diagnostics, program: Some(CountedProgram { assembled, issues, bounds }) }
        }
    }
}
