// SPDX-License-Identifier: MIT OR Apache-2.0
//! Parser from tokens to the tree. It skips a line with a mistake and continues with the next.

use super::table;
use super::tokens::Token;
use super::tree::{
    Action, Block, Console, Course, Expression, Item, Name, Pace, Simulation, Statement, StatementKind,
};
use crate::host::LinkFault;
use crate::limits;
use crate::packet::{JogMode, Profile};
use logos::Logos;
use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::nearest;
use takt_diagnostics::source::Span;

/// Result of parsing a text.
#[derive(Debug, Default)]
pub struct ParsedText {
    /// Statements without a mistake.
    pub block: Block,
    /// Mistakes in the text.
    pub mistakes: Vec<Diagnostic>,
    /// A block is open at the end: a prompt asks for more lines.
    pub open: bool,
}

/// Parses a text whose first byte has the offset `base` among all sources.
pub fn parse(text: &str, base: u32) -> ParsedText {
    let mut tokens = Vec::new();
    let place = |range: std::ops::Range<usize>| Span::new(base + range.start as u32, base + range.end as u32);
    for (token, range) in Token::lexer(text).spanned() {
        tokens.push((token.unwrap_or(Token::Bad), place(range)));
    }
    tokens.push((Token::Newline, place(text.len()..text.len())));
    let mut parser = Parser { text, base, tokens, at: 0, depth: 0, size: 0, parsed: ParsedText::default() };
    let block = parser.block(&mut Vec::new(), &[]);
    ParsedText { block, ..parser.parsed }
}

pub(super) type Outcome<T> = Result<T, Box<Diagnostic>>;

/// Fails with a mistake.
pub(super) fn fail<T>(mistake: Diagnostic) -> Outcome<T> {
    Err(Box::new(mistake))
}

/// Cursor over the tokens, and the result so far.
pub(super) struct Parser<'t> {
    text: &'t str,
    base: u32,
    tokens: Vec<(Token, Span)>,
    at: usize,
    /// Nesting depth of expressions at the cursor.
    pub(super) depth: usize,
    /// Number of values and operators in the present expression.
    pub(super) size: usize,
    parsed: ParsedText,
}

impl<'t> Parser<'t> {
    pub(super) fn peek(&self) -> Token {
        self.tokens.get(self.at).map_or(Token::Newline, |(token, _)| *token)
    }

    pub(super) fn span(&self) -> Span {
        let last = self.tokens.last().map_or(Span::default(), |(_, span)| *span);
        self.tokens.get(self.at).map_or(last, |(_, span)| *span)
    }

    /// Span of the previous token.
    pub(super) fn before(&self) -> Span {
        self.at.checked_sub(1).and_then(|at| self.tokens.get(at)).map_or(Span::default(), |(_, span)| *span)
    }

    pub(super) fn text(&self, span: Span) -> &'t str {
        self.text.get((span.start - self.base) as usize..(span.end - self.base) as usize).unwrap_or("")
    }

    /// Present token if it is a word, else an empty text.
    pub(super) fn word(&self) -> &'t str {
        if self.peek() == Token::Word { self.text(self.span()) } else { "" }
    }

    pub(super) fn advance(&mut self) -> Span {
        let span = self.span();
        self.at += 1;
        span
    }

    pub(super) fn step_back(&mut self) {
        self.at -= 1;
    }

    pub(super) fn take(&mut self, token: Token) -> bool {
        let is = self.peek() == token;
        self.at += usize::from(is);
        is
    }

    pub(super) fn take_word(&mut self, word: &str) -> bool {
        let is = self.word() == word;
        self.at += usize::from(is);
        is
    }

    /// Diagnostic for an unexpected token.
    pub(super) fn unexpected(&self, expected: &str) -> Diagnostic {
        let (token, span) = (self.peek(), self.span());
        let there = match token {
            Token::Newline => "the line ends".to_owned(),
            Token::NotNumber => format!("`{}` is not a number", self.text(span)),
            Token::OpenText => "this text has no end".to_owned(),
            _ => format!("there is `{}`", self.text(span)),
        };
        Diagnostic::error("syntax", span, format!("expected {expected}, but {there}"))
    }

    pub(super) fn expect(&mut self, token: Token, what: &str) -> Outcome<Span> {
        if self.peek() == token { Ok(self.advance()) } else { fail(self.unexpected(what)) }
    }

    /// Takes one of these words; returns its index.
    fn one_of(&mut self, words: &[&str]) -> Outcome<usize> {
        let word = self.word();
        if let Some(place) = words.iter().position(|known| *known == word) {
            self.advance();
            return Ok(place);
        }
        let listed: Vec<String> = words.iter().map(|word| format!("`{word}`")).collect();
        let mut mistake = self.unexpected(&listed.join(" or "));
        if let Some(near) = nearest(word, words.iter().copied()) {
            mistake = mistake.did_you_mean(Some(near));
        }
        fail(mistake)
    }

    fn name(&mut self, of: &str) -> Outcome<Name> {
        if self.peek() != Token::Word {
            return fail(self.unexpected(&format!("the name of {of}")));
        }
        let span = self.advance();
        let text = self.text(span).to_owned();
        if table::is_reserved(&text) {
            let message = format!("`{text}` already has another meaning");
            return fail(Diagnostic::error("name", span, message).help("choose another name"));
        }
        Ok(Name { text, span })
    }

    /// Takes a quoted text; returns it without the quotes.
    fn quoted(&mut self, what: &str) -> Outcome<Name> {
        let span = self.expect(Token::Text, what)?;
        let text = self.text(span).trim_matches('"').to_owned();
        Ok(Name { text, span })
    }

    // ---- Lines and blocks.

    /// Skips to the end of the line.
    fn skip_line(&mut self) {
        while self.peek() != Token::Newline {
            self.advance();
        }
    }

    fn wrong(&mut self, mistake: Diagnostic) {
        if self.parsed.mistakes.len() < limits::SHOWN {
            self.parsed.mistakes.push(mistake);
        }
    }

    /// Parses statements up to one of the words that end this block, which is not consumed. `open` holds the lines of open blocks.
    fn block(&mut self, open: &mut Vec<Span>, ends: &[&str]) -> Block {
        let mut block = Vec::new();
        loop {
            while self.at < self.tokens.len() && self.take(Token::Newline) {}
            if self.at >= self.tokens.len() {
                if let Some(&line) = open.last() {
                    self.parsed.open = true;
                    let mistake = Diagnostic::error("syntax", line, "this block has no `end`");
                    self.wrong(mistake.help("write `end` on a line of its own after the block"));
                    // A single message suffices for nested open blocks.
                    open.clear();
                }
                return block;
            }
            if ends.contains(&self.word()) {
                return block;
            }
            match self.statement(open) {
                Ok(statement) => block.push(statement),
                Err(mistake) => {
                    self.depth = 0;
                    self.wrong(*mistake);
                    self.skip_line();
                    continue;
                }
            }
            if self.peek() != Token::Newline {
                let mistake = self.unexpected("the end of the line");
                self.wrong(mistake);
                self.skip_line();
            }
        }
    }

    /// Parses a block after the line that opens it, to its `end`; or to `else`, if `ends` contains it.
    fn inner(&mut self, open: &mut Vec<Span>, line: Span, ends: &[&str]) -> Outcome<Block> {
        if self.peek() != Token::Newline {
            let mistake = self.unexpected("the end of the line");
            self.wrong(mistake);
            self.skip_line();
        }
        if open.len() >= limits::BLOCK_DEPTH {
            // The contents of a block nested too deeply are skipped.
            self.at = self.tokens.len();
            open.clear();
            let message = format!("more than {} blocks in one another", limits::BLOCK_DEPTH);
            return fail(Diagnostic::error("limit", line, message).help("make a subprogram of it"));
        }
        open.push(line);
        let block = self.block(open, ends);
        open.pop();
        Ok(block)
    }

    fn statement(&mut self, open: &mut Vec<Span>) -> Outcome<Statement> {
        let begin = self.span();
        let word = self.word();
        let kind = match word {
            "if" => {
                self.advance();
                let mut arms = Vec::new();
                let mut otherwise = Vec::new();
                let condition = self.header(Self::expression);
                let line = begin.to(self.before());
                let block = self.inner(open, line, &["else", "end"])?;
                arms.extend(condition.map(|condition| (condition, block)));
                while self.take_word("else") {
                    if self.take_word("if") {
                        let condition = self.header(Self::expression);
                        let block = self.inner(open, line, &["else", "end"])?;
                        arms.extend(condition.map(|condition| (condition, block)));
                    } else {
                        otherwise = self.inner(open, line, &["end"])?;
                        break;
                    }
                }
                self.take_word("end");
                return Ok(Statement { span: line, kind: StatementKind::If(arms, otherwise) });
            }
            "repeat" | "while" => {
                self.advance();
                let value = self.header(Self::expression);
                let line = begin.to(self.before());
                let body = self.inner(open, line, &["end"])?;
                self.take_word("end");
                let kind = match value {
                    Some(value) if word == "repeat" => StatementKind::Repeat(value, body),
                    Some(value) => StatementKind::While(value, body),
                    None => StatementKind::Return,
                };
                return Ok(Statement { span: line, kind });
            }
            "sub" => {
                self.advance();
                let header = self.header(Self::subprogram);
                let line = begin.to(self.before());
                if !open.is_empty() {
                    let mistake = Diagnostic::error("syntax", line, "a subprogram within a block");
                    self.wrong(mistake.help("subprograms stand by themselves: move it out"));
                }
                let body = self.inner(open, line, &["end"])?;
                self.take_word("end");
                let kind = match header {
                    Some((name, parameters)) => StatementKind::Sub(name, parameters, body),
                    None => StatementKind::Return,
                };
                return Ok(Statement { span: line, kind });
            }
            "try" => {
                let line = self.advance();
                let body = self.inner(open, line, &["else", "end"])?;
                let otherwise =
                    if self.take_word("else") { self.inner(open, line, &["end"])? } else { Vec::new() };
                self.take_word("end");
                return Ok(Statement { span: line, kind: StatementKind::Try(body, otherwise) });
            }
            "end" | "else" => {
                let message = format!("`{word}` does not end a block");
                let span = self.advance();
                return fail(Diagnostic::error("syntax", span, message));
            }
            "call" => {
                self.advance();
                let name = self.name("a subprogram")?;
                StatementKind::Call(name, self.arguments()?)
            }
            "return" => {
                self.advance();
                StatementKind::Return
            }
            _ => match self.console()? {
                Some(console) => StatementKind::Console(console),
                None => StatementKind::Do(self.action()?),
            },
        };
        Ok(Statement { span: begin.to(self.before()), kind })
    }

    /// Parses the head of a block after its first word. After a mistake, the block is parsed all the same.
    fn header<T>(&mut self, read: impl FnOnce(&mut Self) -> Outcome<T>) -> Option<T> {
        match read(self) {
            Ok(value) => Some(value),
            Err(mistake) => {
                self.depth = 0;
                self.wrong(*mistake);
                self.skip_line();
                None
            }
        }
    }

    /// Parses a subprogram's name and parameters.
    fn subprogram(&mut self) -> Outcome<(Name, Vec<Name>)> {
        let name = self.name("a subprogram")?;
        let mut parameters: Vec<Name> = Vec::new();
        self.expect(Token::Open, "`(`, the parameters")?;
        while self.peek() != Token::Close {
            let parameter = self.name("a parameter")?;
            if parameters.iter().any(|known| known.text == parameter.text) {
                let message = format!("`{}` is a parameter already", parameter.text);
                return fail(Diagnostic::error("name", parameter.span, message));
            }
            parameters.push(parameter);
            if !self.take(Token::Comma) {
                break;
            }
        }
        self.expect(Token::Close, "`)`")?;
        if parameters.len() > limits::PARAMETERS {
            let message = format!("more than {} parameters", limits::PARAMETERS);
            return fail(Diagnostic::error("limit", name.span, message));
        }
        Ok((name, parameters))
    }

    // ---- Statements without a block.

    fn console(&mut self) -> Outcome<Option<Console>> {
        let next = self.tokens.get(self.at + 1).map_or(Token::Newline, |(token, _)| *token);
        let word = self.word();
        let known = match word {
            // A `check move ...` belongs to programs.
            "check" => next != Token::Word,
            _ => table::command_named(word).is_some_and(|command| command.console),
        };
        if !known {
            return Ok(None);
        }
        self.advance();
        let file = |parser: &mut Self| -> Outcome<Option<Name>> {
            if parser.peek() == Token::Newline {
                Ok(None)
            } else {
                parser.quoted("a file's name in quotes").map(Some)
            }
        };
        Ok(Some(match word {
            "check" => Console::Check(file(self)?),
            "run" => Console::Run(file(self)?),
            "load" => Console::Load(self.quoted("a file's name in quotes")?),
            "save" => Console::Save(self.quoted("a file's name in quotes")?),
            "list" => Console::List,
            "new" => Console::New,
            "record" => Console::Record(self.one_of(&["off", "on"])? == 1),
            "step" => Console::Step,
            "continue" => Console::Continue,
            "quit" => Console::Quit,
            _ if self.peek() == Token::Word => {
                let span = self.advance();
                Console::Help(Some(Name { text: self.text(span).to_owned(), span }))
            }
            _ => Console::Help(None),
        }))
    }

    fn action(&mut self) -> Outcome<Action> {
        let word = self.word();
        let span = self.span();
        self.advance();
        Ok(match word {
            "move" | "movel" => self.motion(word == "movel", Course::Whole)?,
            "via" | "start" | "check" => {
                let course = match word {
                    "via" => Course::Via,
                    "start" => Course::Start,
                    _ => Course::Check,
                };
                let line = self.one_of(&["move", "movel"])? == 1;
                self.motion(line, course)?
            }
            "jog" => match self.one_of(&["joints", "world", "gripper", "off"])? {
                3 => Action::JogOff,
                mode => {
                    let mode = JogMode::of(mode as u32).unwrap_or(JogMode::Joints);
                    let rates = self.six("a rate")?;
                    Action::Jog(mode, rates, self.after_word("for")?)
                }
            },
            "stop" => Action::Stop,
            "speed" if self.take_word("fast") => Action::SpeedFast,
            "speed" => {
                let joints = self.expression()?;
                let line = if self.take(Token::Comma) { Some(self.expression()?) } else { None };
                Action::Speed(joints, line)
            }
            "profile" => Action::Profile(self.profile()?),
            "signal" => {
                let number = self.expression()?;
                Action::Signal(number, self.one_of(&["off", "on"])? == 1)
            }
            "level" => {
                let channel = self.expression()?;
                self.expect(Token::Comma, "`,` and the value")?;
                Action::Level(channel, self.expression()?)
            }
            "wait" if self.take_word("done") => Action::WaitDone,
            "wait" if self.take_word("until") => {
                let condition = self.expression()?;
                Action::WaitUntil(condition, self.after_word("for")?)
            }
            "wait" if self.word() == "input" && !self.calls() => {
                let word = self.advance();
                let number = self.expression()?;
                let on = self.one_of(&["off", "on"])? == 1;
                let span = word.to(self.before());
                let input = Name { text: "input".to_owned(), span: word };
                Action::WaitUntil(Expression::is(span, input, number, on), self.after_word("for")?)
            }
            "wait" => Action::Wait(self.expression()?),
            "tool" => Action::Tool(self.list(3, "a coordinate")?),
            "limits" => match self.one_of(&["speed", "torque"])? {
                0 => Action::LimitSpeed(self.six("a limit")?),
                _ => Action::LimitTorque(self.six("a limit")?),
            },
            "reset" => Action::Reset,
            "where" => Action::Where,
            "say" => {
                let mut items = vec![self.item()?];
                while self.take(Token::Comma) {
                    items.push(self.item()?);
                }
                Action::Say(items)
            }
            "teach" => {
                let name = self.name("a place")?;
                Action::Teach(name, self.take_word("joints"))
            }
            "let" => {
                let name = self.name("a value")?;
                self.expect(Token::Assign, "`=`")?;
                Action::Let(name, self.expression()?)
            }
            "simulate" => self.simulation()?,
            _ => {
                self.at -= 1;
                let names = table::COMMANDS.iter().map(|command| command.name);
                let mistake = if word.is_empty() {
                    self.unexpected("a command")
                } else {
                    let mistake = Diagnostic::error("command", span, format!("there is no command `{word}`"));
                    mistake.did_you_mean(nearest(word, names))
                };
                let help = mistake.help.is_none();
                return fail(if help { mistake.help("`help` lists the commands") } else { mistake });
            }
        })
    }

    /// The present word is followed by `(`: a call.
    fn calls(&self) -> bool {
        self.tokens.get(self.at + 1).is_some_and(|(token, _)| *token == Token::Open)
    }

    fn item(&mut self) -> Outcome<Item> {
        if matches!(self.peek(), Token::Text | Token::OpenText) {
            return Ok(Item::Text(self.quoted("a text")?.text));
        }
        self.expression().map(Item::Value)
    }

    fn profile(&mut self) -> Outcome<Profile> {
        let names: Vec<&str> = Profile::ALL.iter().map(|profile| profile.text()).collect();
        let place = self.one_of(&names)?;
        Ok(Profile::ALL[place])
    }

    fn motion(&mut self, line: bool, course: Course) -> Outcome<Action> {
        let target = self.expression()?;
        let (mut pace, mut profile) = (None, None);
        loop {
            let span = self.span();
            let again = match self.word() {
                "at" | "in" | "fast" => pace.is_some(),
                "profile" => profile.is_some(),
                _ => return Ok(Action::Move { line, course, target, pace, profile }),
            };
            if again {
                let what =
                    if self.word() == "profile" { "a second profile" } else { "a second speed or time" };
                return fail(Diagnostic::error("syntax", span, what).help("say it once"));
            }
            match self.word() {
                "profile" => {
                    self.advance();
                    profile = Some(self.profile()?);
                }
                word => {
                    self.advance();
                    pace = Some(match word {
                        "at" => Pace::At(self.expression()?),
                        "in" => Pace::In(self.expression()?),
                        _ => Pace::Fast,
                    });
                }
            }
        }
    }

    fn simulation(&mut self) -> Outcome<Action> {
        let words: Vec<&str> = ["input", "analogue"]
            .into_iter()
            .chain(LinkFault::ALL.iter().map(|fault| fault.name()))
            .collect();
        let what = match self.one_of(&words)? {
            0 => {
                let number = self.expression()?;
                Simulation::Input(number, self.one_of(&["off", "on"])? == 1)
            }
            1 => {
                let channel = self.expression()?;
                self.expect(Token::Comma, "`,` and the value")?;
                Simulation::Analogue(channel, self.expression()?)
            }
            fault => Simulation::Fault(LinkFault::ALL[fault - 2]),
        };
        Ok(Action::Simulate(what, self.after_word("after")?))
    }

    fn after_word(&mut self, word: &str) -> Outcome<Option<Expression>> {
        if self.take_word(word) { self.expression().map(Some) } else { Ok(None) }
    }

    fn six(&mut self, what: &str) -> Outcome<Vec<Expression>> {
        self.list(6, what)
    }

    /// Parses `count` values between commas.
    fn list(&mut self, count: usize, what: &str) -> Outcome<Vec<Expression>> {
        let mut values = vec![self.expression()?];
        while values.len() < count {
            self.expect(Token::Comma, &format!("`,` and {what}: there are {count}"))?;
            values.push(self.expression()?);
        }
        Ok(values)
    }
}
