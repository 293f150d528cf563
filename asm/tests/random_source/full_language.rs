// SPDX-License-Identifier: MIT OR Apache-2.0
//! Random sources of everything that the language has: ports with numbers and of arrays, ranges, arrays and slices in memory, counted
//! loops of every kind, loops by branches with bounds, subroutines, macros, selections, data with labels, scheduled or not.

use super::Random;
use std::fmt::Write as _;

const FLOATS: [&str; 6] = ["f0", "f1", "f2", "f3", "s0", "s1"];
const INTEGERS: [&str; 4] = ["n0", "n1", "n2", "c0"];
const OUTPUTS: [&str; 5] = ["o0", "o1", "u[1]", "u[2]", "f2"];

/// A program under construction.
struct Source {
    random: Random,
    text: String,
    /// Number of names generated so far, for labels, loops and the like.
    names: u32,
    /// Loops around; each index lies between 1 and the number next to it.
    indices: Vec<(String, u64)>,
    /// Statements that may still be made.
    left: u32,
    /// The current code is a subroutine's, which may call no subroutine that calls.
    subroutine: bool,
}

/// A random source of the whole language.
pub(crate) fn whole_source(seed: u64) -> String {
    let mut random = Random::new(seed ^ 0x5a17);
    let left = 6 + random.below(40) as u32;
    let mut source =
        Source { random, text: String::new(), names: 0, indices: Vec::new(), left, subroutine: false };
    source.declarations();
    source.once();
    // States that every period reads first.
    source.line(".period\np:\n f3 = s0 - s1\n n0 = c0 & 7");
    while source.left > 0 {
        source.statement(0);
    }
    source.outputs();
    if seed % 8 == 3 {
        source.line(" publish\n s1 = s0*0.5 + x1");
    }
    source.line(" call sub0\n call sub1\n wait p");
    source.subroutine = true;
    for name in ["sub0", "sub1"] {
        source.line(&format!("{name}:"));
        source.left = 1 + source.random.below(6) as u32;
        while source.left > 0 {
            source.statement(1);
        }
        source.line(" ret");
    }
    source.text
}

impl Source {
    fn line(&mut self, text: &str) {
        self.text.push_str(text);
        self.text.push('\n');
    }

    fn below(&mut self, n: u64) -> u64 {
        self.random.below(n)
    }

    fn is(&mut self, one_in: u64) -> bool {
        self.below(one_in) == 0
    }

    fn name(&mut self, prefix: &str) -> String {
        self.names += 1;
        format!("{prefix}{}", self.names)
    }

    fn declarations(&mut self) {
        if !self.is(3) {
            self.line(".schedule on");
        }
        if self.is(3) {
            self.line(".ports latched");
        }
        if self.is(3) {
            self.line(".contract on");
        }
        let number = self.below(40);
        let ports = if self.is(2) {
            ".input x0, x1, m0:int, m1:int, z[2]".to_owned()
        } else {
            format!(".input x0, x1 @ {number}, m0:int, z[2], m1:int")
        };
        self.line(&ports);
        let number = self.below(24);
        let ports = if self.is(2) {
            ".output o0, o1, k0:int, u[2]".to_owned()
        } else {
            format!(".output o0, o1 @ {number}, u[2], k0:int")
        };
        self.line(&ports);
        if self.is(2) {
            self.line(".range x0, x1 = -4, 4\n.range m0 = -3, 9");
        }
        self.line(".state s0 s1 c0:int\n.reg f0 f1 f2 f3 n0:int n1:int n2:int b0:int r[3]");
        self.line(".array A[9], B[4,5] = 1, -2, 0.5, 3, 4, 1.5, 2, 0.25, -1, 7, 6, 5, 4, 3, 2, 1, 0, -3, 2.5, 8\n.array D[8]:int = 3, 1, 4, 1, 5, 2, 6, 5");
        if self.is(2) {
            self.line(".range s0 = -100, 100");
        }
        self.line(".macro twice to, by\n.reg own\n own = by*2\n flt b0, own, to\n bz b0, keep\n fadd to, own, by\nkeep:\n.endm");
        self.line(".data\ntab: .float 1.0, -2.5, 0.125, 3\nwords: .word 7, 2\n .space 3");
        self.line(".preset r = 0.5\n.preset f0 = 1.5\n.preset f1 = -0.25\n.preset f2 = 3\n.preset f3 = 0.75");
        let presets = ["n0 = 2", "n1 = 1", "n2 = 3", "c0 = 0", "s0 = 0.5", "s1 = -1", "b0 = 0"];
        for preset in presets {
            self.line(&format!(".preset {preset}"));
        }
    }

    fn once(&mut self) {
        if self.is(2) {
            return;
        }
        self.line(".once\nstart:");
        for _ in 0..self.below(4) {
            let index = 1 + self.below(9);
            let value = self.below(50);
            self.line(&format!(" A[{index}] = {value}\n li s1, {value}.5\n n1 = {}", value % 3));
        }
        self.line(" wait p");
    }

    fn float(&mut self) -> String {
        match self.below(12) {
            0 | 1 => ["x0", "x1", "z[1]", "z[2]"][self.below(4) as usize].to_owned(),
            2 => format!("{}.5", self.below(6)),
            3 => format!("r[{}]", 1 + self.below(3)),
            4 | 5 => self.element(),
            6 => match self.indices.last() {
                Some((index, _)) => format!("itof({index})"),
                None => "itof(m0)".to_owned(),
            },
            _ => FLOATS[self.below(6) as usize].to_owned(),
        }
    }

    fn integer(&mut self) -> String {
        match self.below(8) {
            0 => ["m0", "m1"][self.below(2) as usize].to_owned(),
            1 => self.below(9).to_string(),
            2 => format!("D[{}]", 1 + self.below(8)),
            3 if !self.indices.is_empty() => self.index(),
            _ => INTEGERS[self.below(4) as usize].to_owned(),
        }
    }

    fn index(&mut self) -> String {
        let at = self.below(self.indices.len() as u64) as usize;
        self.indices[at].0.clone()
    }

    /// An index from 1 to a number.
    fn within(&mut self, most: u64) -> String {
        let fitting: Vec<(String, u64)> =
            self.indices.iter().filter(|index| index.1 <= most).cloned().collect();
        if fitting.is_empty() || self.is(3) {
            return (1 + self.below(most)).to_string();
        }
        let (name, last) = fitting[self.below(fitting.len() as u64) as usize].clone();
        match self.below(3) {
            0 if last < most => format!("{name}+{}", 1 + self.below(most - last)),
            1 => format!("{}-{name}", last + 1 + self.below(most - last + 1).min(most - last)),
            _ => name,
        }
    }

    /// An element of an array of floats.
    fn element(&mut self) -> String {
        match self.below(5) {
            0 | 1 => format!("A[{}]", self.within(9)),
            2 => {
                let mask = self.masked(3);
                format!("A[{mask}+1]")
            }
            _ => format!("B[{},{}]", self.within(4), self.within(5)),
        }
    }

    /// A register that holds a number from 0 to a mask.
    fn masked(&mut self, mask: u32) -> String {
        let from = self.random.pick(&["m0", "m1", "n0", "c0"]).to_owned();
        self.line(&format!(" n2 = {from} & {mask}"));
        "n2".to_owned()
    }

    fn expression(&mut self, depth: u32) -> String {
        if depth == 0 || self.is(4) {
            return self.float();
        }
        let (a, b) = (self.expression(depth - 1), self.expression(depth - 1));
        match self.below(12) {
            0 => format!("({a} - {b})"),
            1 => format!("abs({a})"),
            2 => format!("min({a}, {b})"),
            3 => format!("sat({a}, 8.0)"),
            4 => {
                let (c, d) = (self.float(), self.float());
                format!("(({c} < {d}) ? {a} : {b})")
            }
            5 => format!("({a} / (1.5 + abs({b})))"),
            6..8 => format!("({a} + {b})"),
            _ => format!("({a} * {b})"),
        }
    }

    fn target(&mut self) -> String {
        match self.below(8) {
            0 => OUTPUTS[self.below(5) as usize].to_owned(),
            1 => format!("r[{}]", 1 + self.below(3)),
            2 | 3 => self.element(),
            _ => FLOATS[self.below(6) as usize].to_owned(),
        }
    }

    fn outputs(&mut self) {
        for output in ["o0", "o1", "u[1]", "u[2]"] {
            let value = self.expression(1);
            self.line(&format!(" {output} = {value}"));
        }
        let value = self.integer();
        self.line(&format!(" k0 = {value} & 255"));
    }

    fn statement(&mut self, nest: u32) {
        self.left = self.left.saturating_sub(1);
        match self.below(22) {
            0 => {
                let (a, b) = (self.integer(), self.integer());
                let operator = self.random.pick(&["+", "-", "&", "|"]).to_owned();
                let to = INTEGERS[self.below(4) as usize];
                self.line(&format!(" {to} = {a} {operator} {b}"));
            }
            1 => self.slice(),
            2 | 3 if nest < 3 => self.counted(nest),
            4 if nest < 3 => self.counted(nest),
            5 | 6 => self.branch(nest),
            7 if nest < 2 => self.bounded(nest),
            8 if nest < 2 && !self.subroutine => {
                let name = self.random.pick(&["sub0", "sub1"]).to_owned();
                self.line(&format!(" call {name}"));
            }
            9 => {
                let (to, by) = (self.below(4), self.float_register());
                self.line(&format!(" twice f{to}, {by}"));
            }
            10 => {
                let name = self.name("mark");
                self.line(&format!("{name}:"));
            }
            11 => {
                let (to, at) = (self.below(4), self.below(4));
                let mask = self.masked(1);
                self.line(&format!(" ld f{to}, tab+{at}\n ld n0, words[{mask}]"));
            }
            12 => {
                let (a, b) = (self.expression(1), self.expression(1));
                self.line(&format!(" f0, f1 = {a}, {b}"));
            }
            13 => {
                let to = self.target();
                self.line(&format!(" {to} = sum(i, 1, 4, A[i]*r[1]) + sum(j, 2, 3, B[j,2])"));
            }
            14 if self.is(3) => self.line(" rdflags n0\n n0 = n0 & 3\n clrflags"),
            15 if self.is(3) => self.line(".rep q, 1, 3\n r[q] = r[q] + q\n.endr"),
            16 if self.is(4) => {
                let switch = self.random.pick(&[".schedule off", ".schedule on"]).to_owned();
                self.line(&switch);
            }
            17 => {
                let (a, b) = (self.float_register(), self.float_register());
                self.line(&format!(" fmul f1, {a}, {b}\n fadd f2, f1, {b}"));
            }
            _ => {
                let value = self.expression(2);
                let to = self.target();
                self.line(&format!(" {to} = {value}"));
            }
        }
    }

    fn float_register(&mut self) -> String {
        FLOATS[self.below(6) as usize].to_owned()
    }

    fn slice(&mut self) {
        let by = self.float_register();
        let row = 1 + self.below(4);
        let text = match self.below(7) {
            0 => format!("A[:] = A[:] - {by}"),
            1 => "A[2:9] = A[1:8]".to_owned(),
            2 => format!("B[{row},:] = {by}*B[{row},:]"),
            3 => "A[1:4], A[5:8] = A[5:8], A[1:4]".to_owned(),
            4 => format!("B[:,:] = 0.5*B[:,:] + {by}"),
            5 => format!("A[1:5] = B[{row},:]"),
            _ => "D[1:7] = D[2:8]".to_owned(),
        };
        self.line(&format!(" {text}"));
    }

    /// A counted loop of any kind.
    fn counted(&mut self, nest: u32) {
        let index = self.name("i");
        let unroll = match self.below(4) {
            0 => format!(" unroll {}", 1 << self.below(3)),
            _ => String::new(),
        };
        let last = match self.below(6) {
            0 | 1 => {
                let last = 2 + self.below(7);
                self.line(&format!(" .for {index}, 1, {last}{unroll}"));
                last
            }
            2 => {
                let last = 1 + self.below(8);
                let mask = [1, 3, 7][self.below(3) as usize];
                let from = self.random.pick(&["m0", "n0"]).to_owned();
                self.line(&format!(
                    " n2 = {from} & {mask}\n .for {index}, 1, n2 max {}{unroll}",
                    last.max(mask)
                ));
                last.max(mask)
            }
            3 if !self.indices.is_empty() => {
                let (around, last) = self.indices[self.indices.len() - 1].clone();
                self.line(&format!(" .for {index}, 1, {around}{unroll}"));
                last
            }
            4 => {
                let last = 4 + self.below(5);
                self.line(&format!(" .for {index}, {last}, 1 step -1{unroll}"));
                last
            }
            _ => {
                self.line(&format!(" .for {index}, 1, 9 step 2{unroll}"));
                9
            }
        };
        self.indices.push((index, last));
        for _ in 0..1 + self.below(4) {
            self.statement(nest + 1);
        }
        self.indices.pop();
        self.line(" .endfor");
    }

    /// A branch over a few operations, which may become selections, or over many.
    fn branch(&mut self, nest: u32) {
        let label = self.name("L");
        let condition = match self.below(3) {
            0 => {
                let (a, b) = (self.float_register(), self.float_register());
                format!(" flt b0, {a}, {b}")
            }
            1 => {
                let (a, b) = (INTEGERS[self.below(4) as usize], INTEGERS[self.below(4) as usize]);
                format!(" ilt b0, {a}, {b}")
            }
            _ => " iand b0, m0, 1".to_owned(),
        };
        let branch = self.random.pick(&["bz", "bnz"]).to_owned();
        self.line(&format!("{condition}\n {branch} b0, {label}"));
        match self.below(4) {
            0 => {
                let (a, b) = (self.float_register(), self.float_register());
                self.line(&format!(" mov {a}, {b}"));
            }
            1 => {
                let (a, b) = (INTEGERS[self.below(4) as usize], INTEGERS[self.below(4) as usize]);
                self.line(&format!(" iadd {a}, {b}, 1"));
            }
            _ => {
                for _ in 0..1 + self.below(3) {
                    self.statement(nest + 1);
                }
            }
        }
        self.line(&format!("{label}:"));
    }

    /// A loop by a branch, with a bound.
    fn bounded(&mut self, nest: u32) {
        let label = self.name("again");
        let counter = self.name("count");
        let total = if self.is(2) { " total 4000" } else { "" };
        let _ = write!(
            self.text,
            ".reg {counter}:int\n iand {counter}, m1, 3\n iadd {counter}, {counter}, 1\n.loop_bound {}{total}\n{label}:\n",
            4 + self.names % 3
        );
        for _ in 0..1 + self.below(2) {
            self.statement(nest + 1);
        }
        self.line(&format!(" isub {counter}, {counter}, 1\n bnz {counter}, {label}"));
    }
}
