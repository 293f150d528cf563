// SPDX-License-Identifier: MIT OR Apache-2.0
//! Random programs from a seed: arrays, loops, calls of subroutines with loops of their own, macros, branches, both sections. Every
//! machine takes the programs, and no program faults: subscripts stay in their arrays, and each read follows a write.

use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng as _, SeedableRng as _};
use std::fmt::Write as _;

/// Depth of nested counted loops, loops of called subroutines included: every machine counts as many.
const NEST: usize = 4;
/// Rough bounds of a section: statements that it executes (`COST`), and statements written out (`SIZE`).
const COST: u64 = 4000;
const SIZE: u64 = 160;
const FLOATS: u64 = 6;
const INTEGERS: u64 = 4;

/// The name of an index, and the range of its values.
type Index = (String, i64, i64);

/// A subroutine that later code may call.
struct Subroutine {
    text: String,
    /// The subroutine stands in `.once`, before its callers.
    before: bool,
    nest: usize,
    cost: u64,
}

/// Context of a statement.
#[derive(Clone)]
struct Place {
    indices: Vec<Index>,
    /// Number of counted loops that enclose the statement.
    nest: usize,
    /// Upper bounds of the statement's executions and of its copies.
    runs: u64,
    copies: u64,
    /// Nesting of loops and branches, by which the next index is named.
    depth: usize,
}

struct Generator {
    random: Pcg64,
    /// Text of the current code.
    text: String,
    /// Subroutines made so far, which the current code may call.
    subroutines: Vec<Subroutine>,
    names: u64,
    nest: usize,
    cost: u64,
    size: u64,
}

/// The program of a seed.
pub(crate) fn program(seed: u64) -> String {
    let mut generator = Generator {
        random: Pcg64::seed_from_u64(seed),
        text: String::new(),
        subroutines: Vec::new(),
        names: 0,
        nest: 0,
        cost: 0,
        size: 0,
    };
    generator.program()
}

const MACROS: &str = "\
.macro scale d, a, b
.reg t c:int
 fmul t, a, b
 flt c, t, a
 bz c, done
 fsub t, a, 0.5
done:
 fadd d, t, a
.endm
.macro square d, x
 d = x*x - 0.25
.endm
.macro fill a, v
.for q, 1, 5
 a[q] = a[q]*0.5 + v
.endfor
.endm
.macro again target
.for q, 1, 3 unroll 1
 call target
.endfor
.endm
";

impl Generator {
    fn below(&mut self, n: u64) -> u64 {
        self.random.next_u64() % n
    }

    fn once_in(&mut self, n: u64) -> bool {
        self.below(n) == 0
    }

    fn pick<'a>(&mut self, from: &[&'a str]) -> &'a str {
        from[self.below(from.len() as u64) as usize]
    }

    fn line(&mut self, text: &str) {
        let _ = writeln!(self.text, " {text}");
    }

    fn name(&mut self, head: &str) -> String {
        self.names += 1;
        format!("{head}{}", self.names)
    }

    fn program(&mut self) -> String {
        for number in 0..self.below(4) {
            let before = self.once_in(2);
            self.code(SIZE / 3, |generator, place| {
                generator.block(place);
                generator.line("ret");
            });
            let (text, nest, cost) = (std::mem::take(&mut self.text), self.nest, self.cost);
            self.subroutines.push(Subroutine { text: format!("sub{number}:\n{text}"), before, nest, cost });
        }
        let once = self.section(|generator, place| {
            for register in 0..FLOATS {
                let value = generator.below(17);
                generator.line(&format!("f{register} = {}.25", value as i64 - 8));
            }
            generator.line("c, q, m = 1, 0, 3");
            generator.line("r[1], r[2], r[3], r[4] = 1.5, -0.5, 2.25, 0.125");
            if generator.once_in(3) {
                generator.block(place);
            }
        });
        let period = self.section(|generator, place| {
            generator.block(place);
            generator.block(place);
            for register in 0..FLOATS {
                generator.line(&format!("R[{}] = f{register}", register + 1));
            }
            generator.line("R[7], R[8], R[9], R[10] = r[1], r[2], r[3], r[4]");
            for register in 0..INTEGERS {
                generator.line(&format!("L[{}] = k{register}", register + 1));
            }
        });
        let mut text = self.declarations();
        let subroutines = |before: bool, subroutines: &[Subroutine]| {
            let own = subroutines.iter().filter(|subroutine| subroutine.before == before);
            own.map(|subroutine| subroutine.text.clone()).collect::<String>()
        };
        let schedule = self.pick(&["", ".schedule on\n"]);
        text += &format!(
            "{MACROS}{schedule}.once\n jmp start\n{}start:\n{once} wait p\n",
            subroutines(true, &self.subroutines)
        );
        text += &format!(".period\np:\n{period} wait p\n{}", subroutines(false, &self.subroutines));
        text
    }

    fn declarations(&mut self) -> String {
        let mut text = String::from(
            ".input x0, x1, n0:int, n1:int\n.output y0, y1, z0:int\n.array R[10], L[4]:int\n.reg r[4] c:int q:int m:int\n",
        );
        let mut values = |count: i64, divide: bool| {
            let value = |_| match divide {
                true => format!("{:?}", self.below(33) as f64 / 4.0 - 4.0),
                false => (self.below(9) as i64 - 4).to_string(),
            };
            (0..count).map(value).collect::<Vec<_>>().join(", ")
        };
        for (name, sizes) in [("A", &[12][..]), ("B", &[6, 5]), ("C", &[8])] {
            let shape: Vec<String> = sizes.iter().map(i64::to_string).collect();
            let values = values(sizes.iter().product(), true);
            let _ = writeln!(text, ".array {name}[{}] = {values}", shape.join(","));
        }
        let _ = writeln!(text, ".array K[9]:int = {}", values(9, false));
        for register in 0..FLOATS {
            let _ = writeln!(text, ".reg f{register}");
        }
        for register in 0..INTEGERS {
            let _ = writeln!(text, ".reg k{register}:int\n.preset k{register} = {register}");
        }
        text
    }

    fn section(&mut self, write: impl FnOnce(&mut Generator, &Place)) -> String {
        self.code(SIZE, write);
        std::mem::take(&mut self.text)
    }

    /// Writes code of about `size` statements.
    fn code(&mut self, size: u64, write: impl FnOnce(&mut Generator, &Place)) {
        (self.nest, self.cost, self.size) = (0, 0, size);
        write(self, &Place { indices: Vec::new(), nest: 0, runs: 1, copies: 1, depth: 0 });
    }

    fn block(&mut self, place: &Place) {
        for _ in 0..2 + self.below(5) {
            self.statement(place);
        }
    }

    fn body(&mut self, place: &Place) {
        for _ in 0..1 + self.below(3) {
            self.statement(place);
        }
    }

    fn statement(&mut self, place: &Place) {
        self.cost += place.runs;
        if place.copies > self.size {
            return;
        }
        self.size -= place.copies;
        match self.below(24) {
            0..=5 if place.depth < 5 => self.counted(place),
            6..=8 => self.call(place),
            9 | 10 if place.depth < 5 => self.branch(place),
            11 if place.depth < 2 => self.while_loop(place),
            12 => self.macros(place),
            13 => self.slice(place),
            14 | 15 => self.integers(place),
            16 => self.instruction(place),
            17 if self.once_in(2) => self.written_out(place),
            17 => {
                let (a, b) = (self.below(FLOATS), self.below(FLOATS - 1));
                let b = (a + 1 + b) % FLOATS;
                self.line(&format!("f{a}, f{b} = f{b}, f{a}"));
            }
            18 => {
                let value = self.float(place, 1);
                let port = self.pick(&["y0 =", "y1 ="]);
                self.line(&format!("{port} {value}"));
            }
            _ => {
                let (target, value) = (self.target(place), self.float(place, 2));
                self.line(&format!("{target} = {value}"));
            }
        }
    }

    /// A counted loop whose count comes from constants, an index around or a register.
    fn counted(&mut self, place: &Place) {
        if place.nest >= NEST || place.runs > COST / 8 {
            return;
        }
        let index = ["i", "j", "h", "l", "g"][place.depth.min(4)].to_owned();
        let mut inner = Place { nest: place.nest + 1, depth: place.depth + 1, ..place.clone() };
        let first = 1 + self.below(2) as i64;
        let around = place.indices.last().cloned();
        let (opener, low, high) = match (self.below(6), around) {
            (0, Some((outer, _, high))) if high <= 8 => {
                (format!(".for {index}, 1, {outer}{}", self.pick(&["", "-1"])), 1, high)
            }
            (1, Some((outer, low, _))) if low >= 1 => (format!(".for {index}, {outer}, 6"), low, 6),
            (2, _) if self.once_in(3) => {
                // The port itself, which gives 0 to 8.
                let unroll = self.pick(&["", " unroll 1", " unroll 2", " unroll 4"]);
                (format!(".for {index}, {first}, n0 max 8{unroll}"), first, 8)
            }
            (2 | 3, _) => {
                let count = self.pick(&["n0", "n1", "k0", "k1"]);
                self.line(&format!("m = {count} & 7"));
                let unroll = self.pick(&["", "", " unroll 1", " unroll 2", " unroll 4"]);
                (format!(".for {index}, {first}, m max 7{unroll}"), first, 7)
            }
            _ => {
                let (count, step) = (1 + self.below(7) as i64, [1, 1, 1, 2, -1, -2][self.below(6) as usize]);
                let unroll = self.pick(&["", "", " unroll 1", " unroll 2", " unroll 3", " unroll 4"]);
                let (from, to) =
                    if step > 0 { (first, first + count - 1) } else { (first + count - 1, first) };
                (format!(".for {index}, {from}, {to} step {step}{unroll}"), first, first + count - 1)
            }
        };
        let count = (high - low + 1).max(1) as u64;
        inner.runs *= count;
        // A short loop is written out, as is any loop with `unroll`.
        inner.copies *= if opener.contains("unroll") || count <= 4 { count.min(5) } else { 1 };
        if inner.runs > COST || inner.copies > self.size {
            return;
        }
        inner.indices.push((index, low, high));
        self.nest = self.nest.max(inner.nest);
        self.line(&opener);
        if self.once_in(8) {
            // The loop keeps the count that the register had at its beginning.
            self.line("m = m - 1");
        }
        self.body(&inner);
        self.line(".endfor");
    }

    /// A loop that is written out whatever its length, since its body needs the index, or a repetition.
    fn written_out(&mut self, place: &Place) {
        let (last, a) = (2 + self.below(3) as i64, self.below(FLOATS));
        let (open, close) = [(".for", ".endfor"), (".rep", ".endr")][self.below(2) as usize];
        let (index, count) = ("w", last as u64);
        if place.nest >= NEST || place.copies * count * 2 > self.size {
            return;
        }
        let mut inner = Place { nest: place.nest + 1, depth: place.depth + 1, ..place.clone() };
        (inner.runs, inner.copies) = (place.runs * count, place.copies * count);
        inner.indices.push((index.to_owned(), 1, last));
        self.nest = self.nest.max(inner.nest);
        self.line(&format!("{open} {index}, 1, {last}"));
        self.line(&format!("r[{index}] = r[{index}]*0.5 + f{a}"));
        self.line(&format!(".if {index} == 2"));
        let value = self.float(&inner, 1);
        self.line(&format!("f{a} = {value}"));
        self.line(&format!(".else\n k{{{index}-1}} = k{{{index}-1}} + {index}\n .endif"));
        self.line(close);
    }

    fn call(&mut self, place: &Place) {
        if self.subroutines.is_empty() {
            return;
        }
        let number = self.below(self.subroutines.len() as u64) as usize;
        let Subroutine { nest, cost, .. } = self.subroutines[number];
        // The macro calls three times, in a loop.
        let (times, within) = if self.once_in(4) { (3, 1) } else { (1, 0) };
        if place.nest + nest + within > NEST || place.runs * cost * times > COST {
            return;
        }
        self.nest = self.nest.max(place.nest + nest + within);
        self.cost += place.runs * cost * times;
        self.line(&match times {
            1 => format!("call sub{number}"),
            _ => format!("again sub{number}"),
        });
    }

    /// A branch over some statements; its label stands in the same body.
    fn branch(&mut self, place: &Place) {
        let (label, condition) = (self.name("L"), self.condition(place));
        self.line(&format!("c = {condition}"));
        let branch = self.pick(&["bz", "bnz"]);
        self.line(&format!("{branch} c, {label}"));
        // A short and harmless body becomes a selection.
        match self.below(3) {
            0 => {
                let (a, b) = (self.below(INTEGERS), self.below(INTEGERS));
                self.line(&format!("k{a} = k{b} + 1"));
            }
            1 => {
                let (a, b) = (self.below(FLOATS), self.below(FLOATS));
                self.line(&format!("mov f{a}, f{b}"));
            }
            _ => self.body(&Place { depth: place.depth + 1, ..place.clone() }),
        }
        let _ = writeln!(self.text, "{label}:");
    }

    /// A while loop: a label, a branch, and a counter of its own.
    fn while_loop(&mut self, place: &Place) {
        let (label, counter) = (self.name("W"), self.name("w"));
        let _ = writeln!(self.text, ".reg {counter}:int\n {counter} = 3\n .loop_bound 3\n{label}:");
        self.line(&format!("{counter} = {counter} - 1"));
        self.body(&Place { runs: place.runs * 3, depth: place.depth + 1, ..place.clone() });
        self.line(&format!("bnz {counter}, {label}"));
    }

    fn macros(&mut self, place: &Place) {
        let (a, b) = (self.below(FLOATS), self.below(FLOATS));
        match self.below(3) {
            0 if place.nest < NEST => {
                self.nest = self.nest.max(place.nest + 1);
                self.cost += 5 * place.runs;
                let array = self.pick(&["A", "C"]);
                self.line(&format!("fill {array}, f{a}"));
            }
            1 => {
                let value = self.float(place, 0);
                self.line(&format!("f{a} = square(f{b} + {value}) - f{b}"));
            }
            _ => {
                let c = self.below(FLOATS);
                self.line(&format!("scale f{a}, f{b}, f{c}"));
            }
        }
    }

    fn slice(&mut self, place: &Place) {
        if place.nest >= NEST {
            return;
        }
        self.nest = self.nest.max(place.nest + 1);
        self.cost += 6 * place.runs;
        let (a, from) = (self.below(FLOATS), 1 + self.below(6));
        let row = self.subscript(place, 6);
        let text = match self.below(5) {
            0 => format!("A[{from}:{}] = A[{}:{}]*f{a}", from + 5, from + 1, from + 6),
            1 => format!("B[{row},:] = B[{row},:] - 0.5*B[2,:]"),
            2 => format!("C[{from}:{}] = f{a}", from + 2),
            3 => format!("r[:] = B[{row},2:5]"),
            _ => format!("A[{from}:{}] = C[2:7] + f{a}", from + 5),
        };
        self.line(&text);
    }

    fn integers(&mut self, place: &Place) {
        let (target, value) = (self.below(INTEGERS), self.integer(place));
        let a = self.integer(place);
        let operator = self.pick(&["+", "-", "&", "|", "<<", "*"]);
        match self.below(5) {
            0 => {
                let subscript = self.subscript(place, 9);
                self.line(&format!("K[{subscript}] = {value} + k{target}"));
            }
            1 => self.line(&format!("z0 = k{target} + {value}")),
            2 => self.line(&format!("k{target} = mul24({a}, k{target})")),
            _ => self.line(&format!("k{target} = {a} {operator} k{target}")),
        }
    }

    fn instruction(&mut self, place: &Place) {
        let (a, b, d) = (self.below(FLOATS), self.float(place, 0), self.below(FLOATS));
        let subscript = self.subscript(place, 12);
        let text = match self.below(7) {
            0 => format!("ld f{d}, A[{subscript}]"),
            1 => format!("st A[{subscript}], f{a}"),
            2 => format!("fadd A[{subscript}], f{a}, f{d}"),
            3 => format!("sel f{d}, k0, f{a}, f{d}"),
            4 => format!("fmax f{d}, f{a}, {b}"),
            5 => format!("iadd k1, k1, {}", self.integer(place)),
            _ => format!("fmul f{d}, f{a}, {b}"),
        };
        self.line(&text);
    }

    fn target(&mut self, place: &Place) -> String {
        match self.below(7) {
            0 => format!("A[{}]", self.subscript(place, 12)),
            1 => format!("B[{},{}]", self.subscript(place, 6), self.subscript(place, 5)),
            2 => format!("C[{}]", self.subscript(place, 8)),
            3 => format!("r[{}]", 1 + self.below(4)),
            _ => format!("f{}", self.below(FLOATS)),
        }
    }

    /// A subscript of 1 to `size`, whatever the indices are.
    fn subscript(&mut self, place: &Place, size: i64) -> String {
        if !place.indices.is_empty() && !self.once_in(4) {
            let (index, low, high) = place.indices[self.below(place.indices.len() as u64) as usize].clone();
            let factor = [1, 1, 1, -1, 2][self.below(5) as usize];
            let (least, most) = if factor > 0 { (factor * low, factor * high) } else { (-high, -low) };
            if most - least < size {
                let more = 1 - least + self.below((size - (most - least)) as u64) as i64;
                return match factor {
                    -1 => format!("{more}-{index}"),
                    factor => format!("{factor}*{index}{more:+}"),
                };
            }
        }
        if self.once_in(4) && size > 4 {
            // A subscript that is known only when the program runs.
            let register = self.below(INTEGERS);
            self.line(&format!("q = k{register} & 3"));
            return "q+1".to_owned();
        }
        (1 + self.below(size as u64)).to_string()
    }

    fn integer(&mut self, place: &Place) -> String {
        match self.below(5) {
            0 => self.below(7).to_string(),
            1 => format!("K[{}]", self.subscript(place, 9)),
            2 | 3 if !place.indices.is_empty() => {
                place.indices[self.below(place.indices.len() as u64) as usize].0.clone()
            }
            _ => self.pick(&["n0", "k0", "k1", "k2", "k3"]).to_owned(),
        }
    }

    fn condition(&mut self, place: &Place) -> String {
        let comparison = self.pick(&["<", "<=", ">", ">=", "==", "!="]);
        match self.once_in(2) {
            true => format!("f{} {comparison} {}", self.below(FLOATS), self.float(place, 0)),
            false => format!("k{} {comparison} {}", self.below(INTEGERS), self.integer(place)),
        }
    }

    fn float(&mut self, place: &Place, depth: u32) -> String {
        match self.below(if depth == 0 { 6 } else { 14 }) {
            0 => format!("{:?}", self.below(17) as f64 / 4.0 - 2.0),
            1 => self.pick(&["x0", "x1"]).to_owned(),
            2 => format!("A[{}]", self.subscript(place, 12)),
            3 => format!("B[{},{}]", self.subscript(place, 6), self.subscript(place, 5)),
            4 | 5 => format!("f{}", self.below(FLOATS)),
            6 if !place.indices.is_empty() => {
                format!("itof({})", place.indices[self.below(place.indices.len() as u64) as usize].0)
            }
            7 if place.nest < NEST => {
                // A sum up to an index is a loop.
                self.nest = self.nest.max(place.nest + 1);
                self.cost += 7 * place.runs;
                let last = place.indices.iter().rfind(|(_, low, high)| *low >= 0 && *high <= 8);
                let last = last.map_or_else(|| "3".to_owned(), |(index, ..)| index.clone());
                let factor = self.float(place, 0);
                format!("sum(s, 1, {last}, C[s]*{factor})")
            }
            8 => format!("(c ? {} : {})", self.variable(place), self.variable(place)),
            9 => {
                let function = self.pick(&["sat", "min", "max"]);
                format!("{function}({}, {})", self.variable(place), self.float(place, 0))
            }
            _ => {
                let (a, b) = (self.float(place, depth - 1), self.float(place, depth - 1));
                let operator = self.pick(&["+", "-", "*"]);
                format!("({a} {operator} {b})")
            }
        }
    }

    /// A value that is known only when the program runs.
    fn variable(&mut self, place: &Place) -> String {
        match self.once_in(2) {
            true => format!("f{}", self.below(FLOATS)),
            false => format!("A[{}]", self.subscript(place, 12)),
        }
    }
}
