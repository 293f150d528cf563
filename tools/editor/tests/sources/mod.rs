// SPDX-License-Identifier: MIT OR Apache-2.0
//! Random sources that are well-formed but meaningless, generated from the grammar, and mutations of sources.

#[path = "../../../../asm/tests/random_source/mod.rs"]
pub(crate) mod random_source;

pub(crate) use random_source::Random;

use takt_asm::{Directive, Operator};

const NAMES: [&str; 10] = ["a", "fadd", "x2", "_", "a.b", "on", "off", "e5", "sin", "P"];
const NUMBERS: [&str; 16] = [
    "0", "12", "1_000", "0x1f", "0xF_", "0b1_0", "2.", ".5", "0.25e-6", "1e3", "1_.5", "0x1.8p-3", "0x.8P+1",
    "0x1p0", "0x_1", "7_e+1",
];
/// Tokens of every kind, including invalid ones.
const TOKENS: [&str; 66] = [
    "a",
    "fadd",
    "x.y",
    "{",
    "l{",
    "}",
    "}m{",
    "}5.x",
    "}{",
    "0",
    "12",
    "5c",
    "1.2.3",
    "0x",
    "0b2",
    "0x_",
    "1e",
    "1e-3",
    "0x1p-3",
    ".5",
    "2.",
    "\"t\"",
    "\"",
    "\"a\\\"b\"",
    ",",
    ":",
    "(",
    ")",
    "[",
    "]",
    "@",
    "=",
    "?",
    "||",
    "||\n",
    "\n",
    "\n",
    "==",
    "!=",
    "<",
    "<=",
    ">",
    ">=",
    "|",
    "&",
    "<<",
    ">>",
    "+",
    "-",
    "*",
    "/",
    "//",
    "%",
    "~",
    "!",
    "^",
    "'",
    "#",
    "; c",
    ".regx",
    ".",
    "\r\n",
    "\t",
    "\u{e9}",
    "_",
    "\u{c}",
];

/// Context of an expression, which decides whether array elements are allowed.
#[derive(Clone, Copy, PartialEq)]
enum In {
    Line,
    Equation,
}

/// Writes random text that the grammar accepts.
struct Writer<'r> {
    random: &'r mut Random,
    text: String,
}

impl Writer<'_> {
    fn chance(&mut self, of: u64) -> bool {
        self.random.below(of) == 0
    }

    /// Writes a token, sometimes surrounded by optional blanks.
    fn put(&mut self, token: &str) {
        let word = |c: char| c.is_ascii_alphanumeric() || "_.{}".contains(c);
        let joins = |a: Option<char>, b: Option<char>| match (a, b) {
            (Some(a), Some(b)) => word(a) && word(b) || "<>=!|/".contains(a) && "<>=|/".contains(b),
            _ => false,
        };
        // Inside a name with braces, no blank may follow a closing brace.
        if joins(self.text.chars().last(), token.chars().next()) || self.chance(3) {
            let blank = self.random.pick(&[" ", " ", "  ", "\t", "\u{c}"]);
            self.text.push_str(blank);
        }
        self.text.push_str(token);
    }

    fn name(&mut self, kind: In, depth: u32) {
        if depth == 0 || !self.chance(6) {
            let name = self.random.pick(&NAMES);
            return self.put(name);
        }
        let head = self.random.pick(&["", "a", "l", "x.1"]);
        self.put(&format!("{head}{{"));
        self.expression(kind, depth - 1);
        while self.chance(4) {
            let middle = self.random.pick(&["", "m", "_5", ".", "2e"]);
            self.put(&format!("}}{middle}{{"));
            self.expression(kind, depth - 1);
        }
        let tail = self.random.pick(&["", "", "x", "7", "5e", ".b"]);
        self.put(&format!("}}{tail}"));
    }

    fn commas(&mut self, least: u64, mut part: impl FnMut(&mut Self)) {
        let count = least + self.random.below(3);
        for index in 0..count {
            if index > 0 {
                self.put(",");
            }
            part(self);
        }
    }

    fn names(&mut self) {
        self.name(In::Line, 2);
        while self.chance(2) {
            if self.chance(2) {
                self.put(",");
            }
            self.name(In::Line, 2);
        }
    }

    fn expression(&mut self, kind: In, depth: u32) {
        if depth == 0 {
            return match self.chance(2) {
                true => self.put_of(&NAMES),
                false => self.put_of(&NUMBERS),
            };
        }
        let operators = |keep: fn(&Operator) -> bool| -> Vec<&'static str> {
            Operator::ALL.iter().filter(|operator| keep(operator)).map(|operator| operator.text()).collect()
        };
        match self.random.below(9) {
            0..=2 => self.expression(kind, 0),
            3 => {
                self.put_of(&operators(|operator| operator.is_prefix()));
                self.expression(kind, depth - 1);
            }
            4 | 5 => {
                self.expression(kind, depth - 1);
                self.put_of(&operators(|operator| operator.precedence() > 0));
                self.expression(kind, depth - 1);
            }
            6 => match self.random.below(3) {
                0 => {
                    self.put("(");
                    self.expression(kind, depth - 1);
                    self.put(")");
                }
                1 => self.name(kind, depth),
                _ if kind == In::Equation => self.element(kind, 1, depth),
                _ => self.expression(kind, 0),
            },
            7 => {
                self.put_of(&NAMES);
                self.put("(");
                self.commas(0, |writer| writer.expression(kind, depth - 1));
                self.put(")");
            }
            _ => {
                // A nested conditional needs parentheses.
                self.put("(");
                self.expression(kind, depth - 1);
                self.put(")");
                self.put("?");
                self.expression(kind, depth - 1);
                self.put(":");
                self.expression(kind, depth - 1);
            }
        }
    }

    fn put_of(&mut self, tokens: &[&str]) {
        let token = self.random.pick(tokens);
        self.put(token);
    }

    /// Writes array indices, in some of the cases.
    fn indices(&mut self) {
        if self.chance(3) {
            self.put("[");
            self.commas(1, |writer| writer.expression(In::Line, 1));
            self.put("]");
        }
    }

    fn element(&mut self, kind: In, least: u64, depth: u32) {
        self.name(kind, depth - 1);
        self.put("[");
        self.commas(least, |writer| writer.expression(kind, depth - 1));
        self.put("]");
    }

    fn typed(&mut self) {
        if self.chance(4) {
            self.put(":");
            self.name(In::Line, 1);
        }
    }

    fn base(&mut self) {
        match self.chance(3) {
            true => {
                self.put("@");
                self.name(In::Line, 1);
            }
            false => self.expression(In::Line, 2),
        }
    }

    fn operand(&mut self) {
        match self.random.below(6) {
            0 => self.element(In::Line, 2, 2),
            1 => {
                if self.chance(2) {
                    self.expression(In::Line, 2);
                }
                self.put("[");
                self.base();
                self.typed();
                self.put("]");
            }
            _ => self.base(),
        }
        self.typed();
    }

    fn bars(&mut self) {
        self.put("||");
        if self.chance(3) {
            self.put_of(&["\n", " ; more\n", "\n\n", "\n ; so\n"]);
        }
    }

    fn bundle(&mut self) {
        loop {
            match self.chance(6) {
                true => {
                    self.put(Directive::Raw.name());
                    self.name(In::Line, 1);
                    self.expression(In::Line, 2);
                }
                false => {
                    self.name(In::Line, 2);
                    self.commas(0, Writer::operand);
                }
            }
            if !self.chance(3) {
                return;
            }
            self.bars();
        }
    }

    fn equation(&mut self) {
        let target = |writer: &mut Self| match writer.random.below(4) {
            0 => {
                writer.put("@");
                writer.name(In::Equation, 2);
            }
            1 => writer.element(In::Equation, 1, 2),
            _ => writer.name(In::Equation, 2),
        };
        self.commas(1, target);
        self.put("=");
        self.commas(1, |writer| writer.expression(In::Equation, 3));
    }

    fn assigned(&mut self) {
        self.put("=");
        self.expression(In::Line, 3);
    }

    fn library(&mut self) {
        self.put("<");
        for index in 0..1 + self.random.below(4) {
            let token = self
                .random
                .pick(&["robot.s", "a", "/", "-", "..", "2.5", "{", "}", "<", "\"x\"", ".once", "@"]);
            // A leading `<` could merge into `<<` or `<=`.
            let token = if index == 0 && token == "<" { "a" } else { token };
            self.put(if token == ".." { "_" } else { token });
        }
        self.put(">");
    }

    fn location(&mut self) {
        if self.chance(4) {
            return self.name(In::Line, 1);
        }
        self.put("\"f.s\"");
        self.expression(In::Line, 1);
        if self.chance(2) {
            self.put("[");
            self.expression(In::Line, 1);
            self.put(",");
            self.expression(In::Line, 1);
            self.put("]");
        }
    }

    fn declarations(&mut self) {
        for index in 0..1 + self.random.below(3) {
            if index > 0 && self.chance(2) {
                self.put(",");
            }
            self.declaration();
        }
    }

    fn declaration(&mut self) {
        self.name(In::Line, 1);
        if self.chance(3) {
            self.put("[");
            self.commas(1, |writer| writer.expression(In::Line, 1));
            self.put("]");
        }
        self.typed();
        if self.chance(3) {
            self.put("@");
            self.expression(In::Line, 1);
        }
    }

    /// Writes a directive with its operands; a block directive, with the whole block.
    fn directive(&mut self, within: bool, depth: u32) {
        use Directive::*;
        let choice = Directive::ALL[self.random.below(Directive::ALL.len() as u64) as usize];
        let block = matches!(choice, Macro | Rep | For | If);
        let choice = match choice {
            Elif | Else | EndIf | EndMacro | EndRep | EndFor | Raw => Period,
            Macro if within => Once,
            _ if block && depth == 0 => Data,
            choice => choice,
        };
        self.put(choice.name());
        match choice {
            Macro | Rep | For | If => self.block(choice, within, depth),
            _ => self.operands(choice),
        }
    }

    fn operands(&mut self, directive: Directive) {
        use Directive::*;
        match directive {
            Reg | State | Input | Output => self.declarations(),
            Machine => {
                self.name(In::Line, 1);
                while self.chance(2) {
                    if self.chance(2) {
                        self.put(",");
                    }
                    self.name(In::Line, 1);
                    self.assigned();
                }
            }
            Array => {
                self.declarations();
                if self.chance(2) {
                    self.put("=");
                    self.commas(1, |writer| writer.expression(In::Line, 1));
                }
            }
            Const => {
                self.name(In::Line, 1);
                self.assigned();
            }
            Param => {
                self.declaration();
                self.put("=");
                self.commas(1, |writer| writer.expression(In::Line, 1));
                if self.chance(2) {
                    self.name(In::Line, 1);
                    self.expression(In::Line, 1);
                    self.put("..");
                    self.expression(In::Line, 1);
                }
            }
            Preset => {
                if self.chance(2) {
                    self.put("@");
                }
                self.name(In::Line, 1);
                self.indices();
                self.assigned();
            }
            Float | Word => self.commas(1, |writer| writer.expression(In::Line, 2)),
            Space => self.expression(In::Line, 2),
            LoopBound => {
                self.expression(In::Line, 2);
                if self.chance(2) {
                    self.name(In::Line, 1);
                    self.expression(In::Line, 1);
                }
            }
            Include if self.chance(2) => self.library(),
            Include | Error => self.put("\"a \\\" b\""),
            Loc => {
                self.location();
                while self.chance(3) {
                    self.bars();
                    self.location();
                }
            }
            Schedule | Contract | Ports => self.name(In::Line, 1),
            Fast | Order | Result => self.names(),
            Assume => {
                self.name(In::Line, 1);
                self.indices();
                let compared = [">=", "<="][usize::from(self.chance(2))];
                self.put(compared);
                self.expression(In::Line, 2);
            }
            Deadline => {
                self.names();
                self.assigned();
            }
            Range => {
                if self.chance(2) {
                    self.put("@");
                }
                self.names();
                self.assigned();
                self.put(",");
                self.expression(In::Line, 2);
            }
            Late => {
                self.names();
                if self.chance(2) {
                    self.assigned();
                }
            }
            Once | Period | Data | Elif | Else | EndIf | EndMacro | EndRep | EndFor | Raw => {}
            // They stand before a body.
            Macro | Rep | For | If => {}
        }
    }

    /// Operands, body and end of a block directive.
    fn block(&mut self, directive: Directive, within: bool, depth: u32) {
        use Directive::*;
        match directive {
            Macro => {
                self.names();
                self.body(true, depth);
                self.put(EndMacro.name());
            }
            Rep => {
                self.name(In::Line, 1);
                self.put(",");
                self.expression(In::Line, 1);
                self.put(",");
                self.expression(In::Line, 1);
                self.body(true, depth);
                self.put(EndRep.name());
            }
            For => {
                self.name(In::Line, 1);
                self.put(",");
                self.expression(In::Line, 1);
                self.put(",");
                self.expression(In::Line, 1);
                while self.chance(3) {
                    self.name(In::Line, 1);
                    self.expression(In::Line, 1);
                }
                self.body(true, depth);
                self.put(EndFor.name());
            }
            If => {
                self.expression(In::Line, 2);
                self.body(within, depth);
                while self.chance(3) {
                    self.put(Elif.name());
                    self.expression(In::Line, 2);
                    self.body(within, depth);
                }
                if self.chance(2) {
                    self.put(Else.name());
                    self.body(within, depth);
                }
                self.put(EndIf.name());
            }
            _ => {}
        }
    }

    /// Writes the end of the opening line, the lines of the block, and optionally a label before the closing directive.
    fn body(&mut self, within: bool, depth: u32) {
        self.put("\n");
        self.lines(within, depth - 1);
        self.label(In::Line);
    }

    fn label(&mut self, kind: In) {
        if self.chance(4) {
            self.name(kind, 2);
            self.put(":");
        }
    }

    fn lines(&mut self, within: bool, depth: u32) {
        for _ in 0..self.random.below(4) {
            match self.random.below(8) {
                0 => self.label(In::Line),
                1 | 2 => {
                    self.label(In::Equation);
                    self.equation();
                }
                3 | 4 => {
                    self.label(In::Line);
                    self.bundle();
                }
                _ => {
                    self.label(In::Line);
                    self.directive(within, depth);
                }
            }
            if self.chance(6) {
                self.put("; \"it is\" so || \u{e9}");
            }
            self.put_of(&["\n", "\n", "\r\n", "\n\n", "\r"]);
        }
    }
}

/// Random lines that the assembler's parser accepts.
pub(crate) fn valid(random: &mut Random) -> String {
    let mut writer = Writer { random, text: String::new() };
    if writer.chance(20) {
        writer.text.push('\u{feff}');
    }
    writer.lines(false, 3);
    if writer.chance(4) {
        writer.bundle();
    }
    writer.text
}

/// Text after one or two random mutations: a token is deleted, doubled, replaced or inserted.
pub(crate) fn mutated(random: &mut Random, text: &str) -> String {
    let mut text = text.to_owned();
    for _ in 0..1 + random.below(2) {
        let tokens: Vec<_> = takt_asm::tokens::lines(&text).into_iter().flatten().collect();
        if tokens.is_empty() {
            return text;
        }
        let mut pick = || tokens[random.below(tokens.len() as u64) as usize].range.clone();
        let (range, other) = (pick(), pick());
        let other = text[other].to_owned();
        let new = random.pick(&TOKENS);
        match random.below(7) {
            0 => text.replace_range(range, ""),
            1 => text.replace_range(range, new),
            2 => text.insert_str(range.end, new),
            3 => text.insert_str(range.start, &format!(" {new} ")),
            4 => text.replace_range(range, &other),
            5 => text.insert_str(range.start, &other),
            // Merge two tokens or two lines.
            _ => {
                let blanks = text[range.end..].len() - text[range.end..].trim_start().len();
                text.replace_range(range.end..range.end + blanks, "");
            }
        }
    }
    text
}

/// Random tokens in random order.
pub(crate) fn tokens(random: &mut Random) -> String {
    let directives: Vec<&str> = Directive::ALL.iter().map(|directive| directive.name()).collect();
    let mut text = String::new();
    if random.below(3) == 0 {
        text.push_str(random.pick(&directives));
    }
    for _ in 0..random.below(10) {
        text.push_str(random.pick(&["", "", " "]));
        text.push_str(random.pick(&TOKENS));
    }
    text
}
