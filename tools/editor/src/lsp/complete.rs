// SPDX-License-Identifier: MIT OR Apache-2.0
//! Completion at a position.

use crate::lsp::program::{File, Front};
use crate::lsp::{Settings, functions, hover, names};
use lsp_types::{
    CompletionItem, CompletionItemKind, CompletionTextEdit, Documentation, InsertTextFormat, MarkupContent,
    MarkupKind, Range, TextEdit,
};
use std::collections::BTreeMap;
use takt_asm::Directive;
use takt_asm::expr::{BUILTINS, Function};
use takt_asm::index::SymbolKind;
use takt_asm::tokens::{self, Token, TokenKind};
use takt_isa::{Machine, Op, Operand, ROWS, Row, Type};

/// Properties of a completion request.
struct CompletionOptions<'a> {
    /// The client supports snippets with placeholders.
    snippets: bool,
    range: Range,
    settings: &'a Settings,
    /// Machine of the program.
    machine: &'static Machine,
}

impl CompletionOptions<'_> {
    fn item(&self, label: &str, kind: CompletionItemKind, detail: String, text: String) -> CompletionItem {
        CompletionItem {
            label: label.to_owned(),
            kind: Some(kind),
            detail: Some(detail).filter(|detail| !detail.is_empty()),
            text_edit: Some(CompletionTextEdit::Edit(TextEdit { range: self.range, new_text: text })),
            ..CompletionItem::default()
        }
    }

    /// Item for an operation, with placeholders for the operands, aligned to their column.
    fn with_operands(
        &self,
        label: &str,
        kind: CompletionItemKind,
        detail: String,
        operands: &[String],
    ) -> CompletionItem {
        if operands.is_empty() {
            return self.item(label, kind, detail, label.to_owned());
        }
        let blanks = takt_asm::format::CODE.saturating_sub(label.len()).max(1);
        let shown = |(number, operand): (usize, &String)| match self.snippets {
            true => format!("${{{}:{}}}", number + 1, operand.replace(['$', '}'], "")),
            false => operand.clone(),
        };
        let operands: Vec<String> = operands.iter().enumerate().map(shown).collect();
        let head = if self.snippets { label.replace('$', "\\$") } else { label.to_owned() };
        let mut item = self.item(label, kind, detail, head + &" ".repeat(blanks) + &operands.join(", "));
        if self.snippets {
            item.insert_text_format = Some(InsertTextFormat::SNIPPET);
        } else {
            // Without placeholders, insert no operands, which the user would have to delete.
            item.text_edit = Some(CompletionTextEdit::Edit(TextEdit {
                range: self.range,
                new_text: format!("{label}{}", " ".repeat(blanks)),
            }));
        }
        item
    }

    fn instruction(&self, row: &Row) -> CompletionItem {
        let operands: Vec<String> =
            row.shape.syntax().split(", ").filter(|one| !one.is_empty()).map(str::to_owned).collect();
        let detail = format!("{} {}", row.mnemonic, row.shape.syntax());
        let mut item = self.with_operands(row.mnemonic, CompletionItemKind::FUNCTION, detail, &operands);
        item.documentation = Some(Documentation::MarkupContent(MarkupContent {
            kind: MarkupKind::Markdown,
            value: hover::instruction(row, self.machine),
        }));
        item
    }
}

/// Completions at a byte offset of a file.
pub(crate) fn complete(
    settings: &Settings,
    front: &Front,
    file: &File,
    byte: usize,
    snippets: bool,
    encoding: crate::lsp::text::Encoding,
) -> Vec<CompletionItem> {
    let Some(line) = file.text.line(file.text.line_of(byte)) else { return Vec::new() };
    let before = &file.text.text[line.start..byte.max(line.start)];
    let lines = tokens::lines(before);
    let Some(tokens) = lines.first() else { return Vec::new() };
    let touches = |token: &&Token| token.range.end == before.len();
    // Split off the partial word before the cursor.
    let written = tokens.last().filter(touches).filter(|token| {
        matches!(
            token.kind,
            TokenKind::Name | TokenKind::Directive | TokenKind::UnknownDirective | TokenKind::TemplateBegin
        ) || before[token.range.clone()] == *"."
    });
    if tokens.last().is_some_and(|token| token.kind == TokenKind::Comment) {
        return Vec::new();
    }
    let dot = tokens.last().filter(touches).filter(|token| before[token.range.clone()] == *".");
    let start = written.or(dot).map_or(before.len(), |token| token.range.start);
    let tokens = if written.is_some() { &tokens[..tokens.len() - 1] } else { &tokens[..] };
    let word = |token: &Token| &before[token.range.clone()];
    let range = file.text.range(line.start + start..byte, encoding);
    let wanted = CompletionOptions { snippets, range, settings, machine: front.machine };

    // Operation that contains the cursor.
    let begin = tokens.iter().rposition(|token| token.kind == TokenKind::Bars).map_or(0, |bars| bars + 1);
    let operation = &tokens[begin..];
    let operation = match operation {
        [name, colon, rest @ ..]
            if colon.kind == TokenKind::Colon && name.kind == TokenKind::Name && begin == 0 =>
        {
            rest
        }
        operation => operation,
    };
    let Some((head, operands)) = operation.split_first() else {
        return beginnings(&wanted, front);
    };
    let previous = operands.last().unwrap_or(head);
    if previous.kind == TokenKind::Colon {
        let types = [Type::F, Type::I, Type::B].map(Type::name);
        return types
            .map(|ty| wanted.item(ty, CompletionItemKind::TYPE_PARAMETER, String::new(), ty.to_owned()))
            .into();
    }
    if head.kind == TokenKind::Directive {
        return match Directive::ALL.iter().copied().find(|directive| directive.name() == word(head)) {
            Some(Directive::Include) => includes(&wanted, file, before, head),
            Some(directive) => of_directive(&wanted, front, file, byte, directive),
            None => Vec::new(),
        };
    }
    // Index of the operand that contains the cursor.
    let number = operands.iter().filter(|token| token.kind == TokenKind::Comma).count();
    let Some(op) = Op::from_mnemonic(word(head)) else {
        // An equation, or a macro's arguments, which may be equations.
        let mut items = named(&wanted, front, file, byte, &ANY);
        items.extend(of_equations(&wanted, front));
        return items;
    };
    let brackets = operands.iter().any(|token| word(token) == "[");
    match op.row().shape.operands().get(number) {
        Some(operand) => of_operand(&wanted, front, file, byte, *operand, brackets),
        None => Vec::new(),
    }
}

/// Completions of a directive's operands.
fn of_directive(
    wanted: &CompletionOptions<'_>,
    front: &Front,
    file: &File,
    byte: usize,
    directive: Directive,
) -> Vec<CompletionItem> {
    // Alternatives such as `on|off`.
    if directive.operands().contains('|') {
        let words = directive.operands().split('|');
        let item =
            |word: &str| wanted.item(word, CompletionItemKind::KEYWORD, String::new(), word.to_owned());
        return words.map(item).collect();
    }
    match directive {
        Directive::Deadline => named(wanted, front, file, byte, &[SymbolKind::Output]),
        Directive::Late => named(wanted, front, file, byte, &[SymbolKind::Input]),
        Directive::Order => named(wanted, front, file, byte, &[SymbolKind::Input, SymbolKind::Output]),
        Directive::Reg | Directive::State | Directive::Input | Directive::Output | Directive::Macro => {
            Vec::new()
        }
        _ => values(wanted, front, file, byte),
    }
}

/// Completions of an operand. `brackets`: the operand is an address whose bracket is open.
fn of_operand(
    wanted: &CompletionOptions<'_>,
    front: &Front,
    file: &File,
    byte: usize,
    operand: Operand,
    brackets: bool,
) -> Vec<CompletionItem> {
    let named = |kinds: &[SymbolKind]| named(wanted, front, file, byte, kinds);
    let values = || values(wanted, front, file, byte);
    match operand {
        Operand::Dest => {
            named(&[SymbolKind::Register, SymbolKind::State, SymbolKind::Output, SymbolKind::Parameter])
        }
        Operand::Source(_) => {
            let mut items = named(&READABLE);
            items.extend(values().into_iter().filter(|item| item.kind != Some(CompletionItemKind::VARIABLE)));
            items
        }
        Operand::Target => named(&[SymbolKind::Code, SymbolKind::Parameter]),
        Operand::Memory if brackets => named(&READABLE),
        Operand::Memory => values(),
        Operand::Immediate => {
            let mut items = values();
            items.extend(named(&[SymbolKind::Code]));
            items
        }
    }
}

/// Kinds of symbols that an operation can read.
const READABLE: [SymbolKind; 7] = [
    SymbolKind::Register,
    SymbolKind::State,
    SymbolKind::Input,
    SymbolKind::Tunable,
    SymbolKind::Output,
    SymbolKind::Table,
    SymbolKind::Parameter,
];

const ANY: [SymbolKind; 12] = [
    SymbolKind::Array,
    SymbolKind::Table,
    SymbolKind::Register,
    SymbolKind::State,
    SymbolKind::Input,
    SymbolKind::Tunable,
    SymbolKind::Output,
    SymbolKind::Constant,
    SymbolKind::Code,
    SymbolKind::Data,
    SymbolKind::Parameter,
    SymbolKind::Count,
];

/// Words that can begin a line or an operation of a bundle.
fn beginnings(wanted: &CompletionOptions<'_>, front: &Front) -> Vec<CompletionItem> {
    let here =
        |row: &&Row| row.function == takt_isa::Function::Idle || wanted.machine.host(row.function).is_some();
    let mut items: Vec<CompletionItem> =
        ROWS.iter().filter(here).map(|row| wanted.instruction(row)).collect();
    for symbol in front.index.symbols.iter().filter(|symbol| symbol.kind == SymbolKind::Macro) {
        let detail = format!("{} {}", symbol.name, symbol.parameters.join(", "));
        // Placeholders carry the parameter's name without its type.
        let bare = |parameter: &String| parameter.split(':').next().unwrap_or_default().to_owned();
        let operands: Vec<String> = symbol.parameters.iter().map(bare).collect();
        items.push(wanted.with_operands(&symbol.name, CompletionItemKind::MODULE, detail, &operands));
    }
    for directive in Directive::ALL {
        let detail = format!("{} {}", directive.name(), directive.operands());
        let mut item = wanted.item(
            directive.name(),
            CompletionItemKind::KEYWORD,
            detail.trim_end().to_owned(),
            directive.name().to_owned(),
        );
        item.documentation = Some(Documentation::MarkupContent(MarkupContent {
            kind: MarkupKind::Markdown,
            value: hover::directive(directive),
        }));
        items.push(item);
    }
    items
}

/// Names of the given kinds that are visible at a place.
fn named(
    wanted: &CompletionOptions<'_>,
    front: &Front,
    file: &File,
    byte: usize,
    kinds: &[SymbolKind],
) -> Vec<CompletionItem> {
    let mut items: BTreeMap<String, CompletionItem> = BTreeMap::new();
    for (_, symbol, name) in names::visible(front, file, byte) {
        if !kinds.contains(&symbol.kind) {
            continue;
        }
        let kind = match symbol.kind {
            SymbolKind::Constant | SymbolKind::Count => CompletionItemKind::CONSTANT,
            SymbolKind::Code | SymbolKind::Data => CompletionItemKind::REFERENCE,
            SymbolKind::Input | SymbolKind::Output | SymbolKind::Tunable => CompletionItemKind::PROPERTY,
            _ => CompletionItemKind::VARIABLE,
        };
        let ty = symbol.ty.map_or(String::new(), |ty| format!(":{}", ty.name()));
        let detail = format!("{}{ty}", symbol.kind.text());
        let item = wanted.item(name, kind, detail, name.to_owned());
        items.entry(name.to_owned()).or_insert(item);
    }
    items.into_values().collect()
}

/// Names of values: constants, data labels, functions.
fn values(wanted: &CompletionOptions<'_>, front: &Front, file: &File, byte: usize) -> Vec<CompletionItem> {
    let kinds = [SymbolKind::Constant, SymbolKind::Data, SymbolKind::Parameter, SymbolKind::Count];
    let mut items = named(wanted, front, file, byte, &kinds);
    items.extend(of_constants(wanted));
    items
}

/// Functions and macros of equations, then those that take constants only.
fn of_equations(wanted: &CompletionOptions<'_>, front: &Front) -> Vec<CompletionItem> {
    let call = |name: &str, kind: CompletionItemKind, arguments: &str, text: &str| {
        let detail = format!("{name}({arguments}){text}");
        wanted.item(name, kind, detail, format!("{name}("))
    };
    let own = functions::all(wanted.machine);
    let mut items: Vec<CompletionItem> = own
        .iter()
        .map(|function| {
            let text = format!(": {}", function.text);
            call(function.name, CompletionItemKind::FUNCTION, &function.arguments.join(", "), &text)
        })
        .collect();
    let macros = front.index.symbols.iter().filter(|symbol| symbol.kind == SymbolKind::Macro);
    // The first parameter is the result.
    items.extend(macros.filter_map(|symbol| {
        let (_, arguments) = symbol.parameters.split_first()?;
        Some(call(&symbol.name, CompletionItemKind::MODULE, &arguments.join(", "), ""))
    }));
    let known: Vec<String> = items.iter().map(|item| item.label.clone()).collect();
    for mut item in of_constants(wanted).into_iter().filter(|item| !known.contains(&item.label)) {
        if item.kind == Some(CompletionItemKind::OPERATOR) {
            item.detail = item.detail.map(|detail| format!("of constants only: {detail}"));
            item.sort_text = Some(format!("~{}", item.label));
        }
        items.push(item);
    }
    items
}

/// Functions that take constants, and constants that are always there.
fn of_constants(wanted: &CompletionOptions<'_>) -> Vec<CompletionItem> {
    let function = |function: &Function| {
        let arguments = match function.arguments() {
            0 => "a, …".to_owned(),
            count => ["a", "b", "c"][..count.min(3)].join(", "),
        };
        let detail = format!("{}({arguments}): {}", function.name(), function.text());
        wanted.item(function.name(), CompletionItemKind::OPERATOR, detail, format!("{}(", function.name()))
    };
    let constant = |(name, value): &(&str, takt_asm::expr::Value)| {
        wanted.item(name, CompletionItemKind::CONSTANT, format!("{:?}", value.real()), (*name).to_owned())
    };
    Function::ALL.iter().map(function).chain(BUILTINS.iter().map(constant)).collect()
}

/// Files that can be included.
fn includes(wanted: &CompletionOptions<'_>, file: &File, before: &str, head: &Token) -> Vec<CompletionItem> {
    let rest = before[head.range.end..].trim_start();
    // The partial path may contain characters that would end a token.
    let typed = rest.trim_start_matches(['<', '"']);
    let start = wanted.range.end.character
        - typed.encode_utf16().count().min(wanted.range.end.character as usize) as u32;
    let range = Range::new(lsp_types::Position::new(wanted.range.end.line, start), wanted.range.end);
    let wanted = CompletionOptions { range, ..*wanted };
    let file_item =
        |name: &str, text: String| wanted.item(name, CompletionItemKind::FILE, String::new(), text);
    let library = wanted.settings.library.iter().map(|(name, _)| *name);
    let folder = file.path.as_deref().and_then(|path| path.parent());
    let beside = folder.and_then(|folder| std::fs::read_dir(folder).ok()).into_iter().flatten().flatten();
    let mut beside: Vec<String> = beside
        .filter_map(|entry| entry.file_name().into_string().ok())
        .filter(|name| takt_asm::is_source(name))
        .take(200)
        .collect();
    beside.sort();
    match rest.chars().next() {
        Some('<') => library.map(|name| file_item(name, format!("{name}>"))).collect(),
        Some('"') => beside.iter().map(|name| file_item(name, format!("{name}\""))).collect(),
        _ => {
            let library = library.map(|name| format!("<{name}>"));
            library
                .chain(beside.iter().map(|name| format!("\"{name}\"")))
                .map(|name| file_item(&name, name.clone()))
                .collect()
        }
    }
}
