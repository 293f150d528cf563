// SPDX-License-Identifier: MIT OR Apache-2.0
//! Dispatch of messages to their handlers.

use crate::lsp::requests::{Failed, parameters};
use crate::lsp::text::{Encoding, Text};
use crate::lsp::{Client, Phase, Server, outline, uri};
use lsp_server::{ErrorCode, Notification, Request, Response};
use lsp_types::{
    CodeActionKind, CodeActionOptions, CodeActionProviderCapability, CodeLensOptions, CompletionOptions,
    DidChangeTextDocumentParams, DidCloseTextDocumentParams, DidOpenTextDocumentParams, DocumentLinkOptions,
    DocumentOnTypeFormattingOptions, FoldingRangeProviderCapability, HoverProviderCapability,
    InitializeParams, OneOf, PositionEncodingKind, RenameOptions, SaveOptions,
    SelectionRangeProviderCapability, SemanticTokensFullOptions, SemanticTokensLegend, SemanticTokensOptions,
    ServerCapabilities, SignatureHelpOptions, TextDocumentSyncCapability, TextDocumentSyncKind,
    TextDocumentSyncOptions, TextDocumentSyncSaveOptions, WorkDoneProgressOptions,
};
use serde_json::{Value, json};
use std::panic::{AssertUnwindSafe, catch_unwind};

impl Server {
    pub(crate) fn request(&mut self, request: Request) {
        let Request { id, method, params } = request;
        let result = match (self.phase, method.as_str()) {
            (Phase::Starting, "initialize") => self.initialize(params),
            (Phase::Starting, _) => {
                Err(Failed(ErrorCode::ServerNotInitialized, format!("`{method}` before `initialize`")))
            }
            (Phase::Ending, _) => {
                Err(Failed(ErrorCode::InvalidRequest, format!("`{method}` after `shutdown`")))
            }
            (Phase::Running, "initialize") => {
                Err(Failed(ErrorCode::InvalidRequest, "`initialize` was sent before".to_owned()))
            }
            (Phase::Running, "shutdown") => {
                self.phase = Phase::Ending;
                Ok(Value::Null)
            }
            (Phase::Running, _) => {
                // A panic in one answer must not end the session.
                let answer = catch_unwind(AssertUnwindSafe(|| self.answer(&method, params)));
                answer.unwrap_or_else(|_| {
                    Err(Failed(
                        ErrorCode::InternalError,
                        format!("a defect in Takt: `{method}` could not be answered"),
                    ))
                })
            }
        };
        self.send(match result {
            Ok(value) => Response::new_ok(id, value),
            Err(Failed(code, message)) => Response::new_err(id, code as i32, message),
        });
    }

    fn initialize(&mut self, params: Value) -> Result<Value, Failed> {
        let params: InitializeParams = parameters("initialize", params)?;
        let general = params.capabilities.general.unwrap_or_default();
        let offered = general.position_encodings.unwrap_or_default();
        let encoding =
            if offered.contains(&PositionEncodingKind::UTF8) { Encoding::Utf8 } else { Encoding::Utf16 };
        let document = params.capabilities.text_document.unwrap_or_default();
        let workspace = params.capabilities.workspace.unwrap_or_default();
        let item = document.completion.and_then(|completion| completion.completion_item);
        let experimental = params.capabilities.experimental.unwrap_or_default();
        self.client = Client {
            encoding,
            wants_counted: experimental["takt/counted"] == true,
            runs: experimental["takt/runs"] == true,
            snippets: item.and_then(|item| item.snippet_support).unwrap_or(false),
            refreshes_hints: workspace.inlay_hint.and_then(|hint| hint.refresh_support).unwrap_or(false),
            refreshes_lenses: workspace.code_lens.and_then(|lens| lens.refresh_support).unwrap_or(false),
        };
        let folders = params.workspace_folders.unwrap_or_default();
        self.workspace.folders = folders.iter().map(|folder| uri::path(&folder.uri)).collect();
        #[allow(deprecated, reason = "older clients send nothing else")]
        if let Some(root) = params.root_uri.filter(|_| self.workspace.folders.is_empty()) {
            self.workspace.folders.push(uri::path(&root));
        }
        self.workspace.folders.retain(|folder| folder.is_absolute());
        self.phase = Phase::Running;
        Ok(json!({
            "capabilities": capabilities(encoding),
            "serverInfo": { "name": "takt", "version": env!("CARGO_PKG_VERSION") },
        }))
    }

    pub(crate) fn notification(&mut self, notification: Notification) {
        if self.phase != Phase::Running {
            return;
        }
        let Notification { method, params } = notification;
        let result = match method.as_str() {
            "textDocument/didOpen" => parameters(&method, params).map(|params| self.opened(params)),
            "textDocument/didChange" => parameters(&method, params).and_then(|params| self.changed(params)),
            "textDocument/didClose" => parameters(&method, params).map(|params| self.closed(&params)),
            "textDocument/didSave" | "workspace/didChangeWatchedFiles" => {
                self.touch_all();
                Ok(())
            }
            // The protocol requires servers to ignore unknown notifications.
            _ => Ok(()),
        };
        if let Err(Failed(_, message)) = result {
            self.log(&message);
        }
    }

    fn opened(&mut self, params: DidOpenTextDocumentParams) {
        let path = uri::path(&params.text_document.uri);
        self.workspace.set(&path, Text::new(params.text_document.text));
        self.workspace.scan();
        self.touch(&path);
    }

    fn changed(&mut self, params: DidChangeTextDocumentParams) -> Result<(), Failed> {
        let path = uri::path(&params.text_document.uri);
        let Some(text) = self.workspace.open.get(&path) else {
            let uri = params.text_document.uri.as_str();
            return Err(Failed(ErrorCode::InvalidParams, format!("`{uri}` changed, and is not open")));
        };
        let text = text.changed(params.content_changes, self.client.encoding);
        self.workspace.set(&path, text);
        self.touch(&path);
        Ok(())
    }

    fn closed(&mut self, params: &DidCloseTextDocumentParams) {
        let path = uri::path(&params.text_document.uri);
        // Once a document is closed, the text on disk applies again.
        self.touch(&path);
        self.workspace.close(&path);
        self.workspace.scan();
        self.read();
    }
}

fn capabilities(encoding: Encoding) -> ServerCapabilities {
    let (token_types, token_modifiers) = outline::legend();
    let semantic = SemanticTokensOptions {
        legend: SemanticTokensLegend { token_types, token_modifiers },
        range: Some(true),
        full: Some(SemanticTokensFullOptions::Bool(true)),
        ..SemanticTokensOptions::default()
    };
    let sync = TextDocumentSyncOptions {
        open_close: Some(true),
        change: Some(TextDocumentSyncKind::INCREMENTAL),
        save: Some(TextDocumentSyncSaveOptions::SaveOptions(SaveOptions::default())),
        ..TextDocumentSyncOptions::default()
    };
    ServerCapabilities {
        position_encoding: Some(match encoding {
            Encoding::Utf8 => PositionEncodingKind::UTF8,
            Encoding::Utf16 => PositionEncodingKind::UTF16,
        }),
        text_document_sync: Some(TextDocumentSyncCapability::Options(sync)),
        hover_provider: Some(HoverProviderCapability::Simple(true)),
        completion_provider: Some(CompletionOptions {
            trigger_characters: Some([".", "<", "\"", ":"].map(str::to_owned).into()),
            ..CompletionOptions::default()
        }),
        signature_help_provider: Some(SignatureHelpOptions {
            trigger_characters: Some([" ", ",", "("].map(str::to_owned).into()),
            ..SignatureHelpOptions::default()
        }),
        definition_provider: Some(OneOf::Left(true)),
        references_provider: Some(OneOf::Left(true)),
        document_highlight_provider: Some(OneOf::Left(true)),
        document_symbol_provider: Some(OneOf::Left(true)),
        workspace_symbol_provider: Some(OneOf::Left(true)),
        document_link_provider: Some(DocumentLinkOptions {
            resolve_provider: Some(false),
            work_done_progress_options: WorkDoneProgressOptions::default(),
        }),
        selection_range_provider: Some(SelectionRangeProviderCapability::Simple(true)),
        code_action_provider: Some(CodeActionProviderCapability::Options(CodeActionOptions {
            code_action_kinds: Some(vec![CodeActionKind::QUICKFIX, CodeActionKind::REFACTOR_REWRITE]),
            ..CodeActionOptions::default()
        })),
        code_lens_provider: Some(CodeLensOptions { resolve_provider: Some(false) }),
        document_formatting_provider: Some(OneOf::Left(true)),
        document_range_formatting_provider: Some(OneOf::Left(true)),
        document_on_type_formatting_provider: Some(DocumentOnTypeFormattingOptions {
            first_trigger_character: "\n".to_owned(),
            more_trigger_character: None,
        }),
        rename_provider: Some(OneOf::Right(RenameOptions {
            prepare_provider: Some(true),
            work_done_progress_options: WorkDoneProgressOptions::default(),
        })),
        folding_range_provider: Some(FoldingRangeProviderCapability::Simple(true)),
        semantic_tokens_provider: Some(semantic.into()),
        inlay_hint_provider: Some(OneOf::Left(true)),
        ..ServerCapabilities::default()
    }
}
