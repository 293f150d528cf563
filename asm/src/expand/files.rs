// SPDX-License-Identifier: MIT OR Apache-2.0
//! Source files: reading them, and `.include`. A part of [`expand`](crate::expand).

use crate::context::{AstPlace, ErrorReported};
use crate::expand::load::{IncludePath, LoadError, Loader, include_path};
use crate::expand::{Expander, FrameKind};
use crate::foreign;
use crate::limits;
use std::rc::Rc;
use std::sync::Arc;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::nearest;
use takt_diagnostics::source::{Lines, Span};
use takt_syntax::parse;

/// A source file: the loader's place, and its path there.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub(crate) struct FileId {
    /// Index among the loader's places beyond the project; `None` is the project itself.
    pub(crate) place: Option<usize>,
    pub(crate) path: String,
}

/// The reason why a file cannot be read.
#[derive(Debug, thiserror::Error)]
pub(crate) enum FileError {
    #[error("{0}")]
    Load(#[from] LoadError),
    #[error(
        "with it the program's sources have more than the {} bytes that the assembler reads",
        limits::SOURCE_BYTES
    )]
    TooMuch,
    #[error("it seems to be {0}, and no source")]
    Foreign(&'static str),
    #[error(
        "it is not UTF-8 text: byte 0x{byte:02x} at offset {offset} (line {line}, byte {column} of the line)"
    )]
    NotText { byte: u8, offset: usize, line: usize, column: usize },
}

/// A file's bytes as text.
pub(crate) fn text_of(bytes: Vec<u8>) -> Result<String, FileError> {
    String::from_utf8(bytes).map_err(|error| {
        let offset = error.utf8_error().valid_up_to();
        // The bytes before the error are text.
        let before = std::str::from_utf8(&error.as_bytes()[..offset]).unwrap_or_default();
        let lines = Lines::of(before);
        let index = lines.index(offset as u32);
        let (line, column) = (index + 1, offset - lines.range(index).map_or(0, |range| range.start) + 1);
        FileError::NotText { byte: error.as_bytes()[offset], offset, line, column }
    })
}

impl Expander<'_> {
    /// A tree belongs to a file of the library in memory.
    pub(crate) fn is_in_library(&self, ast: u32) -> bool {
        let place = self.origins.get(ast as usize).and_then(|origin| origin.place);
        place.is_some_and(|place| !self.loader.places()[place].takes_quoted())
    }

    /// Reads and parses a file, or finds it among those read.
    pub(crate) fn load(&mut self, id: &FileId) -> Result<(u32, usize), FileError> {
        if let Some(known) = self.files.get(id) {
            return Ok(*known);
        }
        let (name, loader): (String, &dyn Loader) = match id.place {
            None => (id.path.clone(), self.loader),
            Some(place) => {
                let place = &self.loader.places()[place];
                (place.name_of(&id.path), place)
            }
        };
        let text = match loader.text(&id.path) {
            Some(text) => {
                self.count_bytes(text.len())?;
                text
            }
            None => {
                let bytes = loader.load(&id.path)?;
                self.count_bytes(bytes.len())?;
                Arc::new(text_of(bytes)?)
            }
        };
        // The command that reads the program has looked at its first file.
        if !self.frames.is_empty()
            && let Some((kind, _)) = foreign::kind(&id.path, text.as_bytes())
        {
            return Err(FileError::Foreign(kind));
        }
        let file = self.context.reports.sources.add_shared(&name, text).ok_or(FileError::TooMuch)?;
        let source = self.context.reports.sources.files()[file].clone();
        let ast = parse::parse(&source, self.context.scopes.names_mut(), &mut self.context.reports.sink);
        self.context.asts.push(Rc::new(ast));
        self.origins.push(id.clone());
        let known = (self.context.asts.len() as u32 - 1, file);
        self.files.insert(id.clone(), known);
        Ok(known)
    }

    /// Counts the bytes of a file against the limits.
    pub(crate) fn count_bytes(&mut self, bytes: usize) -> Result<(), FileError> {
        if bytes > limits::FILE_BYTES {
            return Err(LoadError::TooLarge.into());
        }
        self.bytes += bytes;
        if self.bytes > limits::SOURCE_BYTES { Err(FileError::TooMuch) } else { Ok(()) }
    }

    /// `.include "path"`, or `.include <path>` of the library.
    pub(crate) fn include(
        &mut self,
        at: AstPlace,
        path: &str,
        library: bool,
        span: Span,
    ) -> Result<(), ErrorReported> {
        let files = self.frames.iter().filter_map(|frame| match frame.kind {
            FrameKind::File(file, _) => Some(file),
            _ => None,
        });
        let open: Vec<usize> = files.collect();
        let from = open.last().map(|file| self.origins[*file].clone());
        let from = from.unwrap_or(FileId { place: None, path: String::new() });
        let within = include_path(if library { "" } else { &from.path }, path);
        let Some(within) = within else {
            let what = if library { "library" } else { "project" };
            let error = Diagnostic::error("load", span, format!("`{path}` is not a path within the {what}"));
            let error = match library {
                true => error.help("a file of the project is written in `\"`"),
                false => error.note(
                    "paths are relative to the including file, and stay in the folder of the first one",
                ),
            };
            return Err(self.context.report(at.scope, error));
        };
        if self.include_depth >= limits::INCLUDE_DEPTH {
            let message = format!("files include one another more than {} deep", limits::INCLUDE_DEPTH);
            return Err(self.context.error(at.scope, "limit", span, message));
        }
        self.includes += 1;
        if self.includes > limits::INCLUDES {
            self.limit(at.scope, span, format!("files are included more than {} times", limits::INCLUDES));
            return Err(ErrorReported);
        }
        // Search beside the including file, then in the places that take such names.
        let beside = FileId { place: from.place, path: within.clone() };
        let path = if library { Some(within.clone()) } else { include_path("", path) };
        let places = self.loader.places().iter().enumerate();
        let taken = places.filter(|(_, place)| library || place.takes_quoted());
        let further =
            taken.filter_map(|(number, _)| Some(FileId { place: Some(number), path: path.clone()? }));
        let candidates: Vec<FileId> = Some(beside).filter(|_| !library).into_iter().chain(further).collect();
        for id in candidates {
            if let Some((_, file)) = self.files.get(&id).copied() {
                // A library file is read once, however many files include it.
                if library {
                    self.note_include(span, file);
                    return Ok(());
                }
                if open.contains(&file) {
                    let name = |file: usize| &*self.context.reports.sources.files()[file].name;
                    let chain: Vec<&str> =
                        open.iter().skip_while(|open| **open != file).map(|open| name(*open)).collect();
                    let message = format!("`{}` includes itself", name(file));
                    let error = Diagnostic::error("include-cycle", span, message).note(format!(
                        "{} → {}",
                        chain.join(" → "),
                        name(file)
                    ));
                    return Err(self.context.report(at.scope, error));
                }
            }
            match self.load(&id) {
                Ok((ast, file)) => {
                    self.note_include(span, file);
                    self.enter_file(ast, file);
                    return Ok(());
                }
                Err(FileError::Load(LoadError::NotFound)) => {}
                Err(unread) => {
                    let message = format!("`{}` cannot be read: {unread}", id.path);
                    return Err(self.context.error(at.scope, "load", span, message));
                }
            }
        }
        let error = match library {
            true => self.not_in_library(&within, span),
            false => self.not_found((from.place, &within), span),
        };
        // List the chain from the innermost file to the outermost.
        let name = |file: &usize| format!("`{}`", self.context.reports.sources.files()[*file].name);
        let chain: Vec<String> = open.iter().rev().map(name).collect();
        let error = match &chain[..] {
            [_, around @ ..] if !around.is_empty() => error.note(format!(
                "{} is included from {}",
                chain[0],
                around.join(", which is included from ")
            )),
            _ => error,
        };
        Err(self.context.report(at.scope, error))
    }

    /// Records the file of an `.include` for the index.
    fn note_include(&mut self, span: Span, file: usize) {
        if let Some(notes) = &mut self.context.notes {
            notes.includes.push((span, file));
        }
    }

    /// The error for an `.include "path"` that finds no file, with advice.
    fn not_found(&self, (place, path): (Option<usize>, &str), span: Span) -> Diagnostic {
        let message = format!("`{path}` cannot be read: {}", LoadError::NotFound);
        let error = Diagnostic::error("load", span, message);
        let (folders, libraries): (Vec<&IncludePath>, Vec<&IncludePath>) =
            self.loader.places().iter().partition(|place| place.takes_quoted());
        if libraries.iter().any(|library| library.load(path).is_ok()) {
            let instead = format!(".include <{path}>");
            return error.mend(format!("write `{instead}` for the library's"), instead);
        }
        let (folder, name) = path.rsplit_once('/').unwrap_or(("", path));
        let loader: &dyn Loader = match place {
            Some(place) => &self.loader.places()[place],
            None => self.loader,
        };
        let names = loader.names(folder);
        let near = nearest(name, names.iter().map(String::as_str)).map(|near| match folder {
            "" => near.to_owned(),
            folder => format!("{folder}/{near}"),
        });
        let error = match folders.iter().map(|folder| format!("`{}`", folder.name_of(""))).collect::<Vec<_>>()
        {
            folders if folders.is_empty() => error,
            folders => error.note(format!("nor is it in {}", folders.join(", "))),
        };
        match near {
            Some(near) => error.help(format!("did you mean `{near}`?")),
            None if self.loader.takes_folders() => error.help("a folder to look in is given by `-I FOLDER`"),
            None if names.is_empty() => error,
            None => error.help(format!("the files here are {}", names.join(", "))),
        }
    }

    /// The error for an `.include <path>` that finds no file.
    fn not_in_library(&self, path: &str, span: Span) -> Diagnostic {
        let error = Diagnostic::error("load", span, format!("there is no `<{path}>`"));
        let mut names: Vec<String> = self.loader.places().iter().flat_map(IncludePath::sources).collect();
        names.sort();
        names.dedup();
        let meant = nearest(path, names.iter().map(String::as_str));
        let more = if names.len() > limits::LISTED { ", …" } else { "" };
        let listed: Vec<String> = names.iter().take(limits::LISTED).map(|name| format!("<{name}>")).collect();
        let error = match listed.is_empty() {
            true => error.note("there is no library here, and no folder to look in"),
            false => error.note(format!("there are {}{more}", listed.join(", "))),
        };
        match meant {
            Some(meant) => error.did_you_mean(Some(format!(".include <{meant}>"))),
            None if self.loader.load(path).is_ok() => {
                let instead = format!(".include \"{path}\"");
                error.mend(format!("write `{instead}` for the project's"), instead)
            }
            None => error,
        }
    }
}
