// SPDX-License-Identifier: MIT OR Apache-2.0
//! Handlers of requests that concern a document.

use crate::lsp::pipeline::{self, Pipeline, ProgramFacts};
use crate::lsp::program::{AssemblyResult, CountedProgram, File, Front};
use crate::lsp::text::Text;
use crate::lsp::{Server, complete, diagnostics, hover, names, outline, rewrite, signature, timing, uri};
use lsp_server::ErrorCode;
use lsp_types::{
    CodeActionKind, CodeActionParams, CodeLens, Command, CompletionList, CompletionParams,
    DocumentFormattingParams, DocumentHighlight, DocumentLink, DocumentOnTypeFormattingParams,
    DocumentRangeFormattingParams, FoldingRangeParams, Hover, HoverContents, InlayHint, InlayHintLabel,
    InlayHintParams, InlayHintTooltip, Location, MarkupContent, MarkupKind, Position, Range, ReferenceParams,
    RenameParams, SelectionRangeParams, SemanticTokens, SemanticTokensParams, SemanticTokensRangeParams,
    SymbolInformation, TextDocumentIdentifier, TextDocumentPositionParams, TextEdit, Uri, WorkspaceEdit,
    WorkspaceSymbolParams,
};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use takt_asm::source::{Span, line_feeds};

/// Error response: code and message.
pub(crate) struct Failed(pub(crate) ErrorCode, pub(crate) String);

/// Limit on the names of an answer to `workspace/symbol`.
const SYMBOLS: usize = 500;

/// Lenses that run a program: title, and the command of a client that has `takt/runs` among its experimental capabilities. The argument is
/// the document's URI.
const RUNS: [(&str, &str); 2] = [("run", "takt.run"), ("debug", "takt.debug")];

/// A name contains the letters of a query in their order, whatever their case.
fn within(query: &str, name: &str) -> bool {
    let mut letters = name.chars().flat_map(char::to_lowercase);
    query.chars().flat_map(char::to_lowercase).all(|wanted| letters.any(|letter| letter == wanted))
}

/// A kind of code actions is another, or one of its parts: `refactor.rewrite` of `refactor`.
fn is_of_kind(kind: &str, wanted: &str) -> bool {
    kind.strip_prefix(wanted).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

/// Deserialises the parameters of a message.
pub(crate) fn parameters<P: DeserializeOwned>(method: &str, params: Value) -> Result<P, Failed> {
    let error = |error| Failed(ErrorCode::InvalidParams, format!("the parameters of `{method}`: {error}"));
    serde_json::from_value(params).map_err(error)
}

fn failed(message: impl Into<String>) -> Failed {
    Failed(ErrorCode::RequestFailed, message.into())
}

fn value(answer: impl Serialize) -> Result<Value, Failed> {
    serde_json::to_value(answer).map_err(|error| Failed(ErrorCode::InternalError, error.to_string()))
}

/// A document and its program.
struct RequestContext<'s> {
    path: PathBuf,
    front: &'s Front,
    full: Option<&'s AssemblyResult>,
    file: &'s File,
}

impl RequestContext<'_> {
    fn counted(&self) -> Option<&CountedProgram> {
        self.full?.program.as_ref()
    }
}

impl Server {
    /// Answers a request, based on the current texts.
    pub(crate) fn answer(&mut self, method: &str, params: Value) -> Result<Value, Failed> {
        if !self.stale.is_empty() {
            self.read();
        }
        match method {
            "textDocument/hover" => value(self.hover(&parameters(method, params)?)?),
            "textDocument/completion" => value(self.completion(&parameters(method, params)?)?),
            "textDocument/definition" => value(self.definition(&parameters(method, params)?)?),
            "textDocument/references" => value(self.references(&parameters(method, params)?)?),
            "textDocument/documentHighlight" => value(self.highlights(&parameters(method, params)?)?),
            "textDocument/prepareRename" => self.prepare_rename(&parameters(method, params)?),
            "textDocument/rename" => value(self.rename(&parameters(method, params)?)?),
            "textDocument/documentSymbol" => {
                let document = self.document_of(&params)?;
                let here = self.request_context(&document)?;
                value(outline::symbols(here.front, here.file, self.client.encoding))
            }
            "textDocument/foldingRange" => {
                let params: FoldingRangeParams = parameters(method, params)?;
                let here = self.request_context(&params.text_document.uri)?;
                value(outline::folds(here.front, here.file))
            }
            "textDocument/selectionRange" => {
                let params: SelectionRangeParams = parameters(method, params)?;
                let here = self.request_context(&params.text_document.uri)?;
                let of = |position| here.file.text.byte(position, self.client.encoding);
                let places = params.positions.into_iter().map(of);
                let ranges =
                    places.map(|at| outline::selection(here.front, here.file, at, self.client.encoding));
                value(ranges.collect::<Vec<_>>())
            }
            "textDocument/signatureHelp" => {
                let (here, byte) = self.at(&parameters(method, params)?)?;
                value(signature::signature(here.front, here.file, byte))
            }
            "textDocument/documentLink" => {
                let document = self.document_of(&params)?;
                value(self.links(&document)?)
            }
            "workspace/symbol" => {
                let params: WorkspaceSymbolParams = parameters(method, params)?;
                value(self.symbols(&params.query))
            }
            "textDocument/onTypeFormatting" => {
                let params: DocumentOnTypeFormattingParams = parameters(method, params)?;
                let at = params.text_document_position;
                // The line that has ended: the cursor stands in the next.
                let line = at.position.line.saturating_sub(1);
                let ended = Range::new(Position::new(line, 0), Position::new(line, 0));
                value(self.format(&at.text_document.uri, Some(ended))?)
            }
            "textDocument/semanticTokens/full" => {
                let params: SemanticTokensParams = parameters(method, params)?;
                value(self.colours(&params.text_document.uri, None)?)
            }
            "textDocument/semanticTokens/range" => {
                let params: SemanticTokensRangeParams = parameters(method, params)?;
                value(self.colours(&params.text_document.uri, Some(params.range))?)
            }
            "textDocument/inlayHint" => value(self.hints(&parameters(method, params)?)?),
            "textDocument/codeLens" => {
                let document = self.document_of(&params)?;
                value(self.lenses(&document)?)
            }
            "takt/pipeline" => {
                let document = self.document_of(&params)?;
                value(self.pipeline(&document)?)
            }
            "textDocument/codeAction" => value(self.fixes(&parameters(method, params)?)),
            "textDocument/formatting" => {
                let params: DocumentFormattingParams = parameters(method, params)?;
                value(self.format(&params.text_document.uri, None)?)
            }
            "textDocument/rangeFormatting" => {
                let params: DocumentRangeFormattingParams = parameters(method, params)?;
                value(self.format(&params.text_document.uri, Some(params.range))?)
            }
            _ => Err(Failed(ErrorCode::MethodNotFound, format!("Takt's language server has no `{method}`"))),
        }
    }

    fn document_of(&self, params: &Value) -> Result<Uri, Failed> {
        let document: TextDocumentIdentifier = parameters("textDocument", params["textDocument"].clone())?;
        Ok(document.uri)
    }

    /// Document that a URI denotes, with its first program, as last read.
    fn request_context(&self, uri: &Uri) -> Result<RequestContext<'_>, Failed> {
        let path = uri::path(uri);
        if !self.workspace.open.contains_key(&path) {
            return Err(failed(format!("`{}` is not open", uri.as_str())));
        }
        let roots = self.workspace.roots(&path);
        let found = roots.iter().find_map(|root| {
            let program = self.programs.get(root)?;
            let file = program.front.files.of(&path)?;
            Some(RequestContext {
                path: path.clone(),
                front: &program.front,
                full: program.full.as_ref(),
                file,
            })
        });
        found.ok_or_else(|| failed(format!("`{}` could not be read", uri.as_str())))
    }

    /// Program and file at the position of a request.
    fn at(&self, at: &TextDocumentPositionParams) -> Result<(RequestContext<'_>, usize), Failed> {
        let encoding = self.client.encoding;
        let here = self.request_context(&at.text_document.uri)?;
        let byte = here.file.text.byte(at.position, encoding);
        Ok((here, byte))
    }

    fn hover(&self, params: &TextDocumentPositionParams) -> Result<Option<Hover>, Failed> {
        let encoding = self.client.encoding;
        let (here, byte) = self.at(params)?;
        let Some((bytes, mut text)) = hover::hover(here.front, here.counted(), here.file, byte) else {
            return Ok(None);
        };
        // For an instruction, add the timing of its line.
        let is_fresh = here
            .full
            .and_then(|full| full.files.of(&here.path))
            .is_some_and(|old| old.text.text == here.file.text.text);
        let word = &here.file.text.text[bytes.clone()];
        if let Some(counted) =
            here.counted().filter(|_| is_fresh && takt_isa::Op::from_mnemonic(word).is_some())
            && let Some(more) = hover::of_line(counted, &here.file.name, here.file.text.line_of(byte) as u32)
        {
            text = format!("{text}\n\nHere:\n{more}");
        }
        let contents = HoverContents::Markup(MarkupContent { kind: MarkupKind::Markdown, value: text });
        Ok(Some(Hover { contents, range: Some(here.file.text.range(bytes, encoding)) }))
    }

    fn completion(&self, params: &CompletionParams) -> Result<CompletionList, Failed> {
        let (settings, client) = (&self.settings, self.client);
        let (here, byte) = self.at(&params.text_document_position)?;
        let items =
            complete::complete(settings, here.front, here.file, byte, client.snippets, client.encoding);
        Ok(CompletionList { is_incomplete: false, items })
    }

    /// Location of a span, in a file that the client can open.
    fn location(&self, front: &Front, span: Span) -> Option<Location> {
        let (file, range) = front.files.range(span, self.client.encoding)?;
        let uri = match &file.path {
            Some(path) => uri::of_path(path),
            None if self.settings.library_by_name => uri::of_name(&file.name),
            None => uri::of_path(&self.library_copy(file)?),
        };
        Some(Location { uri: uri?, range })
    }

    /// Copy of a library file that an editor can open.
    fn library_copy(&self, file: &File) -> Option<PathBuf> {
        let folder = self.settings.library_folder.as_deref()?;
        let path = folder.join(file.name.trim_matches(['<', '>']));
        takt_cache::copy(&path, file.text.text.as_bytes()).ok()?;
        Some(path)
    }

    fn definition(&self, params: &TextDocumentPositionParams) -> Result<Vec<Location>, Failed> {
        let (here, byte) = self.at(params)?;
        let offset = here.file.base + byte as u32;
        if let Some((_, file)) =
            here.front.index.includes.iter().find(|(span, _)| (span.start..=span.end).contains(&offset))
        {
            let start = here.front.files.0.get(*file).map_or(0, |file| file.base);
            return Ok(self.location(here.front, Span::new(start, start)).into_iter().collect());
        }
        let Some((_, symbols)) = names::at(here.front, here.file, byte) else { return Ok(Vec::new()) };
        let mut spans: Vec<Span> = symbols.iter().map(|symbol| here.front.symbol(*symbol).span).collect();
        spans.dedup();
        Ok(spans.into_iter().filter_map(|span| self.location(here.front, span)).collect())
    }

    /// Links from `.include`s to their files.
    fn links(&self, uri: &Uri) -> Result<Vec<DocumentLink>, Failed> {
        let here = self.request_context(uri)?;
        let links = here.front.index.includes.iter().filter_map(|(span, file)| {
            let (of, range) = here.front.files.range(*span, self.client.encoding)?;
            let to = here.front.files.0.get(*file)?;
            let target = self.location(here.front, Span::new(to.base, to.base))?.uri;
            std::ptr::eq(of, here.file).then(|| DocumentLink {
                range,
                target: Some(target),
                tooltip: Some(to.name.to_string()),
                data: None,
            })
        });
        Ok(links.collect())
    }

    /// Names that the programs declare and whose letters contain those of a query, in their order.
    #[allow(deprecated, reason = "the protocol's type has the field")]
    fn symbols(&self, query: &str) -> Vec<SymbolInformation> {
        let mut found: Vec<SymbolInformation> = Vec::new();
        for program in self.programs.values() {
            let front = &program.front;
            for symbol in &front.index.symbols {
                // The name in the source stands once, whatever the number of expansions.
                let name = front.files.text(symbol.span);
                let kind = outline::protocol_kind(symbol.kind).filter(|_| within(query, name));
                let (Some(kind), Some(location)) = (kind, self.location(front, symbol.span)) else {
                    continue;
                };
                if found.len() == SYMBOLS || found.iter().any(|known| known.location == location) {
                    continue;
                }
                let file = front.files.place(symbol.span).map(|(file, _)| &front.files.0[file]);
                found.push(SymbolInformation {
                    name: name.to_owned(),
                    kind,
                    tags: None,
                    deprecated: None,
                    location,
                    container_name: file.map(|file| file.name.to_string()),
                });
            }
        }
        found.sort_by(|a, b| (a.name.len(), &a.name).cmp(&(b.name.len(), &b.name)));
        found
    }

    /// All programs that contain a file.
    fn fronts(&self, path: &Path) -> Vec<(&Path, &Front)> {
        let of = self.programs.iter().filter(|(_, program)| program.front.files.of(path).is_some());
        of.map(|(root, program)| (root.as_path(), &program.front)).collect()
    }

    fn references(&self, params: &ReferenceParams) -> Result<Vec<Location>, Failed> {
        let at = &params.text_document_position;
        self.at(at)?;
        let path = uri::path(&at.text_document.uri);
        let mut found: Vec<Location> = Vec::new();
        for (_, front) in self.fronts(&path) {
            let Some(file) = front.files.of(&path) else { continue };
            let byte = file.text.byte(at.position, self.client.encoding);
            let Some((_, symbols)) = names::at(front, file, byte) else { continue };
            for reference in front.references(&symbols) {
                let declares = front.symbol(reference.symbol).span == reference.span;
                if (params.context.include_declaration || !declares)
                    && let Some(location) = self.location(front, reference.span)
                    && !found.contains(&location)
                {
                    found.push(location);
                }
            }
        }
        Ok(found)
    }

    fn highlights(&self, params: &TextDocumentPositionParams) -> Result<Vec<DocumentHighlight>, Failed> {
        let encoding = self.client.encoding;
        let (here, byte) = self.at(params)?;
        let Some((_, symbols)) = names::at(here.front, here.file, byte) else { return Ok(Vec::new()) };
        let places = here.front.references(&symbols).into_iter().filter_map(|reference| {
            let (file, range) = here.front.files.range(reference.span, encoding)?;
            std::ptr::eq(file, here.file).then_some(DocumentHighlight { range, kind: None })
        });
        Ok(places.collect())
    }

    fn prepare_rename(&self, params: &TextDocumentPositionParams) -> Result<Value, Failed> {
        let encoding = self.client.encoding;
        let (here, byte) = self.at(params)?;
        let (span, name) = names::renamable(here.front, here.file.base + byte as u32).map_err(failed)?;
        let (_, range) = here.front.files.range(span, encoding).ok_or_else(|| failed("it is in no file"))?;
        Ok(json!({ "range": range, "placeholder": name }))
    }

    fn rename(&self, params: &RenameParams) -> Result<WorkspaceEdit, Failed> {
        let at = &params.text_document_position;
        let (_, byte) = self.at(at)?;
        let path = uri::path(&at.text_document.uri);
        let fronts = self.fronts(&path);
        let open = self.workspace.texts();
        let edits =
            names::rename(&self.settings, &fronts, &path, byte, &params.new_name, &open).map_err(failed)?;
        let edits = names::as_edits(&fronts, &edits, self.client.encoding);
        let edits = edits.into_iter().filter_map(|(path, edits)| Some((uri::of_path(&path)?, edits)));
        #[allow(clippy::mutable_key_type, reason = "the protocol's type")]
        let changes: HashMap<Uri, Vec<TextEdit>> = edits.collect();
        Ok(WorkspaceEdit { changes: Some(changes), ..WorkspaceEdit::default() })
    }

    fn colours(&self, uri: &Uri, range: Option<Range>) -> Result<SemanticTokens, Failed> {
        let encoding = self.client.encoding;
        let here = self.request_context(uri)?;
        let lines =
            range.map_or(0..usize::MAX, |range| range.start.line as usize..range.end.line as usize + 1);
        let data = outline::colours(here.front, here.file, lines, encoding);
        Ok(SemanticTokens { result_id: None, data })
    }

    fn hints(&self, params: &InlayHintParams) -> Result<Vec<InlayHint>, Failed> {
        let encoding = self.client.encoding;
        let here = self.request_context(&params.text_document.uri)?;
        let Some((counted, moved)) = here.counted().and_then(|counted| Some((counted, here.moved()?))) else {
            return Ok(Vec::new());
        };
        let text = &here.file.text;
        let hints = timing::hints(counted, &here.file.name).into_iter().filter_map(|hint| {
            let line = moved.line(hint.line)?;
            (params.range.start.line..=params.range.end.line).contains(&line).then_some(())?;
            let position = text.position(text.line(line as usize)?.end, encoding);
            let tooltip = MarkupContent { kind: MarkupKind::Markdown, value: hint.more };
            Some(InlayHint {
                position,
                label: InlayHintLabel::String(hint.text),
                kind: None,
                text_edits: None,
                tooltip: Some(InlayHintTooltip::MarkupContent(tooltip)),
                padding_left: Some(true),
                padding_right: None,
                data: None,
            })
        });
        Ok(hints.collect())
    }

    /// Pipeline diagram of the document's program; `None` before its cycles are counted.
    fn pipeline(&self, uri: &Uri) -> Result<Option<Pipeline>, Failed> {
        let here = self.request_context(uri)?;
        let Some((counted, moved)) = here.counted().and_then(|counted| Some((counted, here.moved()?))) else {
            return Ok(None);
        };
        let path = |name: &str| here.full?.files.named(name)?.path.as_deref().and_then(uri::of_path);
        // Lines of this document follow edits; lines of other files stay as scheduled.
        let line = |name: &str, line| if *here.file.name == *name { moved.line(line) } else { Some(line) };
        let is_current = here.full.is_some_and(|full| full.files.are(&here.front.files));
        let whole = ProgramFacts { is_current, sections: timing::sections(counted, &self.settings) };
        Ok(Some(pipeline::pipeline(counted, whole, path, line)))
    }

    fn lenses(&self, uri: &Uri) -> Result<Vec<CodeLens>, Failed> {
        let here = self.request_context(uri)?;
        let Some((counted, moved)) = here.counted().and_then(|counted| Some((counted, here.moved()?))) else {
            return Ok(Vec::new());
        };
        let lens = |(line, title): (u32, String)| {
            let line = moved.line(line)?;
            let position = Position::new(line, 0);
            let command = Command { title, command: String::new(), arguments: None };
            Some(CodeLens { range: Range::new(position, position), command: Some(command), data: None })
        };
        // Lines refer to the scheduled text; the line of a label is known as long as it has not moved.
        let old = here.full.and_then(|full| full.files.named(&here.file.name));
        let head = |name: &str| old.and_then(|file| outline::head_line(file, name));
        let lenses = timing::lenses(counted, &self.settings, &here.file.name, &head);
        let mut lenses: Vec<CodeLens> = lenses.into_iter().filter_map(lens).collect();
        let is_program = self.workspace.roots(&here.path).contains(&here.path);
        if self.client.runs
            && is_program
            && let Some(first) = lenses.iter().map(|lens| lens.range).min_by_key(|range| range.start)
        {
            lenses.extend(RUNS.map(|(title, command)| {
                let (title, command) = (title.to_owned(), command.to_owned());
                let command = Command { title, command, arguments: Some(vec![json!(uri.as_str())]) };
                CodeLens { range: first, command: Some(command), data: None }
            }));
        }
        Ok(lenses)
    }

    fn fixes(&self, params: &CodeActionParams) -> Vec<lsp_types::CodeAction> {
        let path = uri::path(&params.text_document.uri);
        let sent: Vec<_> =
            self.published.get(&path).into_iter().flat_map(|by| by.values().flatten().cloned()).collect();
        let Some(text) = self.workspace.open.get(&path) else { return Vec::new() };
        let uri = &params.text_document.uri;
        let mut actions = diagnostics::fixes(uri, text, params.range, &sent);
        if let Ok(here) = self.request_context(uri) {
            let byte = here.file.text.byte(params.range.start, self.client.encoding);
            let rewrites = rewrite::rewrites(here.front, here.file, byte).into_iter();
            actions.extend(rewrites.map(|rewrite| {
                let range = here.file.text.range(rewrite.bytes, self.client.encoding);
                let title =
                    format!("write `{}`", rewrite.text.split_whitespace().collect::<Vec<_>>().join(" "));
                let edit = TextEdit { range, new_text: rewrite.text };
                diagnostics::action(uri, title, CodeActionKind::REFACTOR_REWRITE, edit)
            }));
        }
        let only = params.context.only.as_deref();
        let is_wanted = |kind: &CodeActionKind| {
            only.is_none_or(|only| only.iter().any(|wanted| is_of_kind(kind.as_str(), wanted.as_str())))
        };
        actions.retain(|action| action.kind.as_ref().is_none_or(is_wanted));
        actions
    }

    /// Edits that format the document.
    fn format(&self, uri: &Uri, range: Option<Range>) -> Result<Vec<TextEdit>, Failed> {
        let path = uri::path(uri);
        let text = self
            .workspace
            .open
            .get(&path)
            .ok_or_else(|| failed(format!("`{}` is not open", uri.as_str())))?;
        let laid = Text::new(takt_asm::format::format(&text.text));
        let mut edits = Vec::new();
        let mut line = 0;
        // Formatting preserves line numbers, except that it removes empty lines at the end.
        while let (Some(old), Some(new)) = (text.line(line), laid.line(line)) {
            let wanted =
                range.is_none_or(|range| (range.start.line..=range.end.line).contains(&(line as u32)));
            let new_text = &laid.text[new.clone()];
            if wanted && text.text[old.clone()] != *new_text {
                edits.push(TextEdit {
                    range: text.range(old, self.client.encoding),
                    new_text: new_text.to_owned(),
                });
            }
            line += 1;
        }
        if range.is_none() {
            let whole = |text: &Text| text.line(line.saturating_sub(1)).map_or(0, |line| line.end);
            let (old, new) = (whole(text), whole(&laid));
            if text.text[old..] != laid.text[new..] {
                let range = text.range(old..text.text.len(), self.client.encoding);
                edits.push(TextEdit { range, new_text: laid.text[new..].to_owned() });
            }
        }
        Ok(edits)
    }
}

/// Maps lines of an older text to a newer one, by a common head and a common tail.
struct LineMapping {
    /// Number of equal lines at the beginning.
    head: u32,
    /// First line of the common tail, in the older text.
    tail: u32,
    /// Offset of the tail's lines.
    by: i64,
}

impl LineMapping {
    fn line(&self, line: u32) -> Option<u32> {
        if line < self.head {
            return Some(line);
        }
        (line >= self.tail).then(|| u32::try_from(i64::from(line) + self.by).ok())?
    }
}

impl RequestContext<'_> {
    /// Mapping from the lines at the time of scheduling to the current lines.
    fn moved(&self) -> Option<LineMapping> {
        let old = &self.full?.files.named(&self.file.name)?.text.text;
        let (old, new) = (&*line_feeds(old), &*line_feeds(&self.file.text.text));
        if old == new {
            return Some(LineMapping { head: u32::MAX, tail: u32::MAX, by: 0 });
        }
        let count = |text: &str| text.lines().count();
        let head = old.lines().zip(new.lines()).take_while(|(old, new)| old == new).count();
        let most = count(old).min(count(new)) - head;
        let tail =
            old.lines().rev().zip(new.lines().rev()).take(most).take_while(|(old, new)| old == new).count();
        let by = count(new) as i64 - count(old) as i64;
        Some(LineMapping { head: head as u32, tail: (count(old) - tail) as u32, by })
    }
}
