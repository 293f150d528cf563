// SPDX-License-Identifier: MIT OR Apache-2.0
//! Random programs in C through `takt cc` against gcc, bit for bit, 20 periods each. `TAKT_PROGRAMS` says how many, `TAKT_SEED` the first.
#![allow(clippy::print_stdout)]

use crate::c99::word;
use crate::common::gcc::{Program, compiled, difference, emulated, folder, run, translated_text};
use rand_pcg::Pcg32;
use rand_pcg::rand_core::{Rng, SeedableRng};
use std::fmt::Write as _;
use takt_front::c::{Source, Translation};
use takt_isa::{Machine, T1, T3, T4};

const PERIODS: usize = 20;
/// Programs in a call of gcc.
const BATCH: u64 = 50;

/// Names in scope of an expression.
#[derive(Clone, Default)]
struct Names {
    floats: Vec<String>,
    integers: Vec<String>,
    /// Names that can be assigned.
    float_places: Vec<String>,
    integer_places: Vec<String>,
}

struct Generator {
    random: Pcg32,
    /// Prefix of all names of the program.
    prefix: String,
    text: String,
    count: usize,
    /// Number of statements still to write.
    left: usize,
    /// Number of enclosing loops.
    loops: usize,
}

impl Generator {
    fn below(&mut self, most: usize) -> usize {
        self.random.next_u32() as usize % most
    }

    fn chance(&mut self, one_in: usize) -> bool {
        self.below(one_in) == 0
    }

    fn pick(&mut self, of: &[String]) -> String {
        of[self.below(of.len())].clone()
    }

    fn fresh(&mut self) -> String {
        self.count += 1;
        format!("v{}", self.count)
    }

    fn line(&mut self, depth: usize, text: &str) {
        let _ = writeln!(self.text, "{:1$}{text}", "", 2 * depth);
    }

    fn float(&mut self, names: &Names, depth: usize) -> String {
        if depth == 0 || self.chance(5) {
            return match self.below(4) {
                0 => {
                    ["0.5f", "1.0f", "-2.25f", "3e-3f", "0.0f", "17.5f", "-0.125f"][self.below(7)].to_owned()
                }
                _ => self.pick(&names.floats),
            };
        }
        let p = self.prefix.clone();
        let a = self.float(names, depth - 1);
        match self.below(16) {
            0 | 1 => format!("({a} + {})", self.float(names, depth - 1)),
            2 | 3 => format!("({a} - {})", self.float(names, depth - 1)),
            4 | 5 => format!("{a} * {}", self.factor(names, depth - 1)),
            6 => format!("({a} / ({} + 3.0f))", self.float(names, depth - 1)),
            7 => format!("({} ? {a} : {})", self.condition(names, depth - 1), self.float(names, depth - 1)),
            8 => format!("(float)({})", self.integer(names, depth - 1)),
            9 => format!("sqrtf(fabsf({a}))"),
            // Given zeros of both signs, gcc returns either: the sum hides which.
            10 => format!("(fminf({a}, {}) + 0.0f)", self.float(names, depth - 1)),
            11 => format!("(fmaxf({a}, {}) + 0.0f)", self.float(names, depth - 1)),
            12 => format!("{p}m[({}) & 7]", self.integer(names, depth - 1)),
            13 => format!("{p}t[({}) & 7]", self.integer(names, depth - 1)),
            14 => format!("{p}st.a[({}) & 3]", self.integer(names, depth - 1)),
            _ => format!("-({a})"),
        }
    }

    /// A factor in parentheses if it is a sum.
    fn factor(&mut self, names: &Names, depth: usize) -> String {
        format!("({})", self.float(names, depth))
    }

    fn integer(&mut self, names: &Names, depth: usize) -> String {
        if depth == 0 || self.chance(5) {
            return match self.below(4) {
                0 => ["0", "1", "-7", "100", "255u", "0x7fff", "65536"][self.below(7)].to_owned(),
                _ => self.pick(&names.integers),
            };
        }
        let p = self.prefix.clone();
        let a = self.integer(names, depth - 1);
        match self.below(24) {
            0 | 1 => format!("({a} + {})", self.integer(names, depth - 1)),
            2 | 3 => format!("({a} - {})", self.integer(names, depth - 1)),
            4 => format!("({a}) * {}", [3, 5, -2, 10, 255][self.below(5)]),
            5 => format!("(({a}) * ({}))", self.integer(names, depth - 1)),
            6 => format!("(({a}) & {})", self.integer(names, depth - 1)),
            7 => format!("(({a}) | ({}))", self.integer(names, depth - 1)),
            8 => format!("(({a}) ^ ({}))", self.integer(names, depth - 1)),
            9 => format!("(({a}) << {})", self.below(9)),
            10 => format!("(({a}) >> {})", self.below(9)),
            11 => format!("(({a}) >> (({}) & 31))", self.integer(names, depth - 1)),
            12 => format!("(({a}) / {})", [2, 4, 16, -8, 1024][self.below(5)]),
            13 => format!("(({a}) % {})", [2, 4, 16, 256][self.below(4)]),
            14 => format!("({})", self.condition(names, depth - 1)),
            15 => format!("{p}cut({})", self.float(names, depth - 1)),
            16 => format!("{p}u[({a}) & 3]"),
            17 => {
                let ty = ["short", "unsigned char", "signed char", "unsigned", "unsigned short", "int"]
                    [self.below(6)];
                format!("({ty})({a})")
            }
            18 => {
                let operator = ["/", "%"][self.below(2)];
                // No divisor is 0 or -1.
                let by = match self.below(3) {
                    0 => ["3", "10", "-7", "1000", "12345", "60u"][self.below(6)].to_owned(),
                    1 => format!("((({}) & 1023) + 1)", self.integer(names, depth - 1)),
                    _ => format!("(({}) | 0x40000002u)", self.integer(names, depth - 1)),
                };
                format!("(({a}) {operator} {by})")
            }
            19 => {
                let (b, ty) = (self.integer(names, depth - 1), self.wide());
                let operator = ["*", "+", "-", "^", "&", "|"][self.below(6)];
                format!("(int)((({ty})({a}) {operator} ({b})) >> {})", self.below(64))
            }
            20 => {
                let (b, ty, c) =
                    (self.integer(names, depth - 1), self.wide(), self.integer(names, depth - 1));
                let compare = ["<", "<=", ">", "==", "!="][self.below(5)];
                format!("((({ty})({a}) << {}) {compare} ({ty})({b})*({c}))", self.below(40))
            }
            21 => format!("(int)({p}w >> {})", self.below(64)),
            22 => format!("(int)-~({p}w - ({a}))"),
            _ => format!("({} ? {a} : {})", self.condition(names, depth - 1), self.integer(names, depth - 1)),
        }
    }

    fn wide(&mut self) -> &'static str {
        ["long long", "unsigned long long"][self.below(2)]
    }

    fn condition(&mut self, names: &Names, depth: usize) -> String {
        let compare = ["<", "<=", ">", ">=", "==", "!="][self.below(6)];
        if depth == 0 {
            return format!("{} {compare} {}", self.pick(&names.integers), self.below(9) as i32 - 4);
        }
        match self.below(6) {
            0 => {
                format!("(({}) && ({}))", self.condition(names, depth - 1), self.condition(names, depth - 1))
            }
            1 => {
                format!("(({}) || ({}))", self.condition(names, depth - 1), self.condition(names, depth - 1))
            }
            2 => format!("!({})", self.condition(names, depth - 1)),
            3 => {
                format!("({}) {compare} ({})", self.integer(names, depth - 1), self.integer(names, depth - 1))
            }
            _ => format!("{} {compare} {}", self.float(names, depth - 1), self.float(names, depth - 1)),
        }
    }

    fn block(&mut self, names: &Names, depth: usize, count: usize) {
        let mut own = names.clone();
        for _ in 0..count {
            if self.left == 0 {
                return;
            }
            self.left -= 1;
            self.statement(&mut own, depth);
        }
    }

    fn statement(&mut self, names: &mut Names, depth: usize) {
        let nested = depth < 4;
        match self.below(20) {
            0 | 1 => self.declaration(names, depth),
            2..=5 => {
                let (to, value) = (self.pick(&names.float_places), self.float(names, 3));
                let operator = ["=", "=", "=", "+=", "-=", "*="][self.below(6)];
                self.line(depth, &format!("{to} {operator} {value};"));
            }
            6..=8 => {
                let (to, value) = (self.pick(&names.integer_places), self.integer(names, 3));
                let operator = ["=", "=", "+=", "-=", "^=", "|=", "&="][self.below(7)];
                self.line(depth, &format!("{to} {operator} {value};"));
            }
            9 if self.chance(2) => {
                let (a, p) = (self.integer(names, 2), self.prefix.clone());
                let line = match self.below(4) {
                    0 => format!("{p}w = ({a});"),
                    1 => format!("{p}w += (long long)({a})*({});", self.integer(names, 2)),
                    2 => format!("{p}w ^= {p}w << {};", self.below(64)),
                    _ => format!("{p}w++;"),
                };
                self.line(depth, &line);
            }
            9 => {
                let to = self.pick(&names.integer_places);
                let line = [format!("({to})++;"), format!("--({to});")][self.below(2)].clone();
                self.line(depth, &line);
            }
            10 => self.store(names, depth),
            11 => self.call(names, depth),
            12 | 13 if nested => self.choice(names, depth),
            14 if nested => self.switch(names, depth),
            15 | 16 if nested && self.loops < 2 => self.repetition(names, depth),
            17 if self.loops > 0 => {
                let condition = self.condition(names, 2);
                let leave = ["break", "continue"][self.below(2)];
                self.line(depth, &format!("if ({condition}) {leave};"));
            }
            18 if nested && self.chance(3) => {
                let (condition, value) = (self.condition(names, 2), self.float(names, 2));
                self.line(depth, &format!("if ({condition}) return {value};"));
            }
            _ => {
                let (to, value) = (self.pick(&names.float_places), self.float(names, 2));
                self.line(depth, &format!("{to} = {value};"));
            }
        }
    }

    /// A pointer that data choose, to one of two objects or to one or none.
    fn pointer(&mut self, names: &mut Names, depth: usize) {
        let (name, p, condition) = (self.fresh(), self.prefix.clone(), self.condition(names, 2));
        if self.chance(3) {
            let (index, value) = (self.integer(names, 1), self.float(names, 2));
            self.line(depth, &format!("float *{name} = {condition} ? &{p}m[({index}) & 7] : 0;"));
            self.line(depth, &format!("if ({name}) *{name} = {value}; else {p}k++;"));
            return;
        }
        if self.chance(2) {
            self.line(depth, &format!("struct {p}s *{name} = {condition} ? &{p}st : &{p}su;"));
        } else {
            self.line(depth, &format!("struct {p}s *{name} = &{p}su;"));
            self.line(depth, &format!("if ({condition}) {name} = &{p}st;"));
        }
        for (places, all, member) in [
            (&mut names.float_places, &mut names.floats, "f"),
            (&mut names.integer_places, &mut names.integers, "n"),
        ] {
            let place = format!("{name}->{member}");
            places.push(place.clone());
            all.push(place);
        }
    }

    fn declaration(&mut self, names: &mut Names, depth: usize) {
        if self.chance(6) {
            return self.pointer(names, depth);
        }
        let name = self.fresh();
        if self.chance(2) {
            let value = self.float(names, 3);
            self.line(depth, &format!("float {name} = {value};"));
            names.floats.push(name.clone());
            names.float_places.push(name);
        } else {
            let value = self.integer(names, 3);
            let ty = ["int", "int", "short", "unsigned char", "unsigned", "unsigned short"][self.below(6)];
            self.line(depth, &format!("{ty} {name} = {value};"));
            names.integers.push(name.clone());
            names.integer_places.push(name);
        }
    }

    fn store(&mut self, names: &Names, depth: usize) {
        let (index, p) = (self.integer(names, 2), self.prefix.clone());
        let line = match self.below(4) {
            0 => format!("{p}m[({index}) & 7] = {};", self.float(names, 2)),
            1 => format!("{p}q[({index}) & 3] = {};", self.integer(names, 2)),
            2 => format!("v[{}] = {};", self.below(3), self.float(names, 2)),
            _ => format!("{p}st.a[({index}) & 3] += {};", self.float(names, 1)),
        };
        self.line(depth, &line);
    }

    fn call(&mut self, names: &Names, depth: usize) {
        let p = self.prefix.clone();
        let (to, a, n) = (self.pick(&names.float_places), self.float(names, 2), self.integer(names, 2));
        let line = match self.below(4) {
            0 => format!("{to} = {p}f({a}, {n}, &{p}g);"),
            1 => {
                let structures = [format!("&{p}st"), format!("&{p}su")];
                let (x, y) = (self.pick(&structures), self.pick(&structures));
                format!("{p}h({x}, {y}, {n});")
            }
            2 => format!("{p}su = {p}r({p}st, {a});"),
            _ => format!("{to} = {p}r({p}su, {a}).f;"),
        };
        self.line(depth, &line);
    }

    fn choice(&mut self, names: &Names, depth: usize) {
        let condition = self.condition(names, 2);
        self.line(depth, &format!("if ({condition}) {{"));
        let count = 1 + self.below(4);
        self.block(names, depth + 1, count);
        if self.chance(2) {
            self.line(depth, "} else {");
            let count = 1 + self.below(4);
            self.block(names, depth + 1, count);
        }
        self.line(depth, "}");
    }

    fn switch(&mut self, names: &Names, depth: usize) {
        let value = self.integer(names, 2);
        self.line(depth, &format!("switch (({value}) & 3) {{"));
        // `break` belongs to the switch here.
        let loops = std::mem::take(&mut self.loops);
        for case in 0..3 {
            self.line(depth, &format!("case {case}:"));
            let count = 1 + self.below(2);
            self.block_in_braces(names, depth + 1, count);
            if !self.chance(3) {
                self.line(depth + 1, "break;");
            }
        }
        if self.chance(2) {
            self.line(depth, "default:");
            self.block_in_braces(names, depth + 1, 1);
        }
        self.loops = loops;
        self.line(depth, "}");
    }

    fn block_in_braces(&mut self, names: &Names, depth: usize, count: usize) {
        self.line(depth, "{");
        self.block(names, depth + 1, count);
        self.line(depth, "}");
    }

    fn repetition(&mut self, names: &Names, depth: usize) {
        let index = self.fresh();
        let count = match self.below(4) {
            0 => 30 + self.below(60),
            _ => 2 + self.below(7),
        };
        let head = match self.below(5) {
            4 => {
                let end = self.integer(names, 1);
                format!("for (int {index} = 0; {index} < (({end}) & 7); {index}++) {{")
            }
            0 => format!("for (int {index} = {count}; {index} > 0; {index}--) {{"),
            1 => {
                let condition = self.condition(names, 1);
                format!("for (int {index} = 0; {index} < {count} && {condition}; {index}++) {{")
            }
            2 => format!("for (int {index} = 1; {index} <= {}; {index} += 2) {{", 2 * count),
            _ => format!("for (int {index} = 0; {index} < {count}; {index}++) {{"),
        };
        self.line(depth, &head);
        let mut own = names.clone();
        own.integers.push(index);
        self.loops += 1;
        let body = 1 + self.below(3);
        self.block(&own, depth + 1, body);
        self.loops -= 1;
        self.line(depth, "}");
    }

    fn program(mut self) -> String {
        let p = self.prefix.clone();
        let _ = write!(
            self.text,
            "struct {p}s {{ float f; int n; short h; float a[4]; }};
static float {p}g = 0.75f;
static int {p}k;
static long long {p}w = -3;
static unsigned char {p}c = 7;
static float {p}m[8] = {{ 1, 2, 3 }};
static int {p}q[4];
static struct {p}s {p}st, {p}su = {{ 1.5f, -3, 12, {{ 1, 2, 3, 4 }} }};
static const float {p}t[8] = {{ 0.5f, -1, 2, 4.25f, 1e-3f, -7, 0, 11 }};
static const short {p}u[4] = {{ 3, -4, 500, -600 }};
static int {p}cut(float x) {{ return x > -1e6f && x < 1e6f ? (int)x : -1; }}
static float {p}f(float a, int n, float *o) {{ if (n > 3) {{ *o = a*0.5f; return a; }} *o += 0.25f; return *o - a; }}
static void {p}h(struct {p}s *x, const struct {p}s *y, int n) {{ x->f += y->f*0.5f; x->n ^= y->n + n; x->h = (short)(x->h + y->n); x->a[n & 3] = y->a[0]; }}
static struct {p}s {p}r(struct {p}s x, float a) {{ struct {p}s z = x; z.f = a - x.f*0.25f; z.a[1] += 1; z.n--; return z; }}
float {p}step(float x, float y, int n, unsigned u, short h, float v[3], int *w)
{{
  float r = 0;
"
        );
        let owned = |names: &[&str]| names.iter().map(|name| name.replace('@', &p)).collect::<Vec<_>>();
        let names = Names {
            floats: owned(&["x", "y", "r", "@g", "v[0]", "v[1]", "@st.f", "@su.a[1]", "@m[2]"]),
            integers: owned(&["n", "u", "h", "@k", "@c", "@st.n", "@su.h", "@q[1]", "*w"]),
            float_places: owned(&["r", "@g", "v[2]", "v[0]", "@st.f", "@m[3]", "y"]),
            integer_places: owned(&["n", "@k", "@c", "@st.n", "@st.h", "@q[0]", "*w", "h", "u"]),
        };
        let count = 4 + self.below(14);
        self.left = 40;
        self.block(&names, 1, count);
        let _ = writeln!(
            self.text,
            "  *w += {p}k + {p}c + {p}st.n + {p}su.h + {p}q[2];\n  v[1] = {p}g + {p}m[1] + {p}su.f;\n  return r + {p}m[n & 7] + {p}st.a[2];\n}}"
        );
        self.text
    }
}

fn generated(seed: u64) -> Program {
    let prefix = format!("p{seed}_");
    let random = Pcg32::seed_from_u64(seed);
    let generator =
        Generator { random, prefix: prefix.clone(), text: String::new(), count: 0, left: 0, loops: 0 };
    let code = generator.program();
    Program {
        name: format!("p{seed}"),
        code,
        step: format!("{prefix}step"),
        init: None,
        set: Vec::new(),
        ignore: Vec::new(),
        loop_bound: None,
        double_is_float: false,
    }
}

fn number(variable: &str, otherwise: u64) -> u64 {
    std::env::var(variable).map_or(otherwise, |text| text.parse().expect("a number"))
}

#[test]
fn programs_compute_what_gcc_does() {
    let (first, count) = (number("TAKT_SEED", 0), number("TAKT_PROGRAMS", 200));
    let folder = folder(&format!("random-{first}"));
    let (mut refused, mut branches, mut loops, mut memory) = (0, 0, 0, 0);
    let mut next = first;
    while next < first + count {
        let end = (next + BATCH).min(first + count);
        let mut ready: Vec<(Program, Translation, Vec<Vec<u32>>)> = Vec::new();
        for seed in next..end {
            let program = generated(seed);
            let source = Source { name: format!("{}.c", program.name), text: program.code.clone() };
            match translated_text(&program, source) {
                Ok(translation) => {
                    let mut random = Pcg32::seed_from_u64(seed ^ 0x5eed);
                    let row =
                        |_| translation.inputs.iter().map(|port| word(&mut random, port.float)).collect();
                    let inputs = (0..PERIODS).map(row).collect();
                    branches += usize::from(translation.text.contains("        bz "));
                    loops += usize::from(translation.text.contains(".for "));
                    memory += usize::from(translation.text.contains(".array "));
                    ready.push((program, translation, inputs));
                }
                Err(error) => {
                    println!("refused: {error}");
                    refused += 1;
                    assert!(refused * 6 <= count.max(100), "too many are refused: {error}\n{}", program.code);
                }
            }
        }
        let batch: Vec<_> =
            ready.iter().map(|(program, text, inputs)| (program, text, inputs.as_slice())).collect();
        let expected = compiled(&batch, &folder);
        for (index, (program, translation, inputs)) in ready.iter().enumerate() {
            // Every program on one machine, all machines in turn.
            let machines: [&'static Machine; 3] = [&T3, &T1, &T4];
            let machine = machines[index % 3];
            let found = emulated(program, translation, machine, inputs);
            if let Some(text) = difference(program, translation, inputs, &expected[index], &found) {
                panic!("{}: {text}", machine.name);
            }
        }
        next = end;
    }
    let _ = std::fs::remove_dir_all(folder);
    println!(
        "figures: programs={count} refused={refused} with_branches={branches} with_loops={loops} with_arrays={memory}"
    );
}

/// A changed line; `None` if there is nothing to change.
type Change = fn(&str) -> Option<String>;

/// The text with one line of the period changed, the first for which there is a change.
fn planted(text: &str, change: Change) -> Option<String> {
    let at = text.find("\nperiod:\n")?;
    let (head, code) = text.split_at(at + 9);
    let mut done = false;
    let lines = code.split_inclusive('\n').map(|line| {
        let changed = if done { None } else { change(line.split(';').next().unwrap_or(line)) };
        done |= changed.is_some();
        changed.map_or_else(|| line.to_owned(), |line| line.trim_end().to_owned() + "\n")
    });
    let code: String = lines.collect();
    done.then(|| head.to_owned() + &code)
}

/// `a ? b : c` with its alternatives exchanged, where the line has one choice.
fn exchanged(line: &str) -> Option<String> {
    let (condition, rest) = line.split_once(" ? ")?;
    let (yes, no) = rest.split_once(" : ")?;
    let single = !rest.contains('?') && !condition.contains(['(', '?']) && !no.contains(')');
    single.then(|| format!("{condition} ? {} : {yes}", no.trim_end()))
}

/// A cut to a narrow type that is gone.
fn uncut(line: &str) -> Option<String> {
    let cuts = [
        ("<< 24) >> 24", "<< 0) >> 0"),
        ("<< 16) >> 16", "<< 0) >> 0"),
        ("& 255", "& -1"),
        ("& 65535", "& -1"),
    ];
    cuts.iter().find(|(cut, _)| line.contains(cut)).map(|(cut, none)| line.replacen(cut, none, 1))
}

/// A store into an array that is gone.
fn unstored(line: &str) -> Option<String> {
    let (place, _) = line.split_once(" = ")?;
    place.contains('[').then(String::new)
}

/// Faults of a translation, planted into its text, are noticed: exchanged alternatives, a lost cut to a narrow type, a lost store.
#[test]
fn faults_of_the_translation_are_noticed() {
    let folder = folder("planted");
    let kinds: [(&str, Change); 3] = [("exchanged", exchanged), ("uncut", uncut), ("unstored", unstored)];
    let mut counts = [(0, 0); 3];
    let mut ready = Vec::new();
    for seed in 0..60 {
        let program = generated(seed);
        let source = Source { name: format!("{}.c", program.name), text: program.code.clone() };
        let Ok(translation) = translated_text(&program, source) else { continue };
        let mut random = Pcg32::seed_from_u64(seed);
        let row = |_| translation.inputs.iter().map(|port| word(&mut random, port.float)).collect();
        let inputs: Vec<Vec<u32>> = (0..PERIODS).map(row).collect();
        ready.push((program, translation, inputs));
    }
    let batch: Vec<_> =
        ready.iter().map(|(program, text, inputs)| (program, text, inputs.as_slice())).collect();
    let expected = compiled(&batch, &folder);
    for ((program, translation, inputs), expected) in ready.iter().zip(&expected) {
        for ((_, change), (of, noticed)) in kinds.iter().zip(&mut counts) {
            let Some(text) = planted(&translation.text, *change) else { continue };
            let changed = Translation { text, ..translation.clone() };
            let Ok(found) = run(&changed, &T3, inputs) else { continue };
            *of += 1;
            *noticed += usize::from(difference(program, &changed, inputs, expected, &found).is_some());
        }
    }
    let _ = std::fs::remove_dir_all(folder);
    for ((kind, _), (of, noticed)) in kinds.iter().zip(counts) {
        println!("figures: kind={kind} planted={of} noticed={noticed}");
        assert!(noticed >= 5 && 4 * noticed > of, "{kind}: {noticed} of {of}");
    }
}
