//! Source files: reading them, and `.include`. A part of [`expand`](crate::expand).

use crate::context::{At, Reported};
use crate::diag::Diagnostic;
use crate::expand::{Expander, FrameKind};
use crate::limits;
use crate::load::{LoadError, include_path};
use crate::parse;
use crate::source::Span;
use std::rc::Rc;

/// Makes the diagnostic of a file that cannot be read, at the `.include` that asks for it if there is one.
type Explain = Box<dyn FnOnce(Option<Span>) -> Diagnostic>;

impl Expander<'_> {
    /// Reads and parses a file, or finds it among those read. The error awaits the place of the `.include`.
    pub(crate) fn load(&mut self, path: &str) -> Result<(u32, usize), Explain> {
        if let Some(known) = self.files.get(path) {
            return Ok(*known);
        }
        let name = path.to_owned();
        let fail = move |message: String| -> Explain {
            Box::new(move |span: Option<Span>| {
                let message = format!("`{name}` cannot be read: {message}");
                match span {
                    Some(span) => Diagnostic::error("load", span, message),
                    None => Diagnostic::placeless("load", message),
                }
            })
        };
        let bytes = match self.loader.load(path) {
            Ok(bytes) if bytes.len() > limits::FILE_BYTES => {
                return Err(fail(LoadError::TooLarge.to_string()));
            }
            Ok(bytes) => bytes,
            Err(error) => return Err(fail(error.to_string())),
        };
        self.bytes += bytes.len();
        if self.bytes > limits::SOURCE_BYTES {
            return Err(fail(format!(
                "with it the program's sources have more than the {} bytes that the assembler reads",
                limits::SOURCE_BYTES
            )));
        }
        let text = match String::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => {
                let offset = error.utf8_error().valid_up_to();
                let before = &error.as_bytes()[..offset];
                let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
                let column =
                    offset - before.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1) + 1;
                let byte = error.as_bytes()[offset];
                return Err(fail(format!(
                    "it is not UTF-8 text: byte 0x{byte:02x} at offset {offset} (line {line}, byte {column} of the line)"
                )));
            }
        };
        let Some(file) = self.context.sources.add(path, text.into()) else {
            return Err(fail("the program's sources are too large".to_owned()));
        };
        let source = self.context.sources.files()[file].clone();
        let ast = parse::parse(&source, &mut self.context.names, &mut self.context.sink);
        self.context.asts.push(Rc::new(ast));
        let known = (self.context.asts.len() as u32 - 1, file);
        self.files.insert(path.to_owned(), known);
        Ok(known)
    }

    pub(crate) fn include(&mut self, at: At, path: &str, span: Span) -> Result<(), Reported> {
        let files = self.frames.iter().filter_map(|frame| match frame.kind {
            FrameKind::File(file, _) => Some(file),
            _ => None,
        });
        let open: Vec<usize> = files.collect();
        let from = open.last().map_or("", |file| &*self.context.sources.files()[*file].name).to_owned();
        let Some(path) = include_path(&from, path) else {
            let error = Diagnostic::error("load", span, format!("`{path}` is not a path within the project"))
                .note("paths are relative to the including file, and stay in the folder of the first one");
            return Err(self.context.report(at.scope, error));
        };
        if self.include_depth >= limits::INCLUDE_DEPTH {
            let message = format!("files include one another more than {} deep", limits::INCLUDE_DEPTH);
            return Err(self.context.error(at.scope, "limit", span, message));
        }
        self.includes += 1;
        if self.includes > limits::INCLUDES {
            self.limit(at.scope, span, format!("files are included more than {} times", limits::INCLUDES));
            return Err(Reported);
        }
        if let Some((_, file)) = self.files.get(&path).copied()
            && open.contains(&file)
        {
            let chain: Vec<&str> = open
                .iter()
                .skip_while(|open| **open != file)
                .map(|open| &*self.context.sources.files()[*open].name)
                .collect();
            let error = Diagnostic::error("include-cycle", span, format!("`{path}` includes itself"))
                .note(format!("{} → {path}", chain.join(" → ")));
            return Err(self.context.report(at.scope, error));
        }
        match self.load(&path) {
            Ok((ast, file)) => self.enter_file(ast, file),
            Err(diagnostic) => {
                self.context.report(at.scope, diagnostic(Some(span)));
            }
        }
        Ok(())
    }
}
