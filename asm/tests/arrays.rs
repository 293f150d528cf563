// SPDX-License-Identifier: MIT OR Apache-2.0
//! Arrays in data memory and counted loops: random nests on the emulator against their direct evaluation in binary32, in the order
//! of the source.

use crate::common;
use crate::random_source::Random;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use takt_asm::diag::{Diagnostics, Severity};
use takt_asm::{AssembledProgram, MemoryLoader, Options, Schedule, assemble};
use takt_emu::Emulator;
use takt_isa::{F1, F3, MACHINES, Machine};

/// An affine function of indices: a constant, and coefficients.
type Affine = (i64, Vec<(char, i64)>);

#[derive(Clone, Debug)]
enum Expr {
    Literal(i64),
    Element(char, Vec<Affine>),
    Index(char),
    Infix(char, Box<Expr>, Box<Expr>),
    Sum(char, Affine, Affine, Box<Expr>),
}

#[derive(Clone, Debug)]
enum Statement {
    For {
        variable: char,
        first: Affine,
        last: Affine,
        step: i64,
        unroll: i64,
        run_time: bool,
        body: Vec<Statement>,
    },
    Assign(char, Vec<Affine>, Expr),
}

/// Values of the known indices, and the arrays.
struct Machine32 {
    indices: BTreeMap<char, i64>,
    arrays: BTreeMap<char, (Vec<i64>, Vec<f32>)>,
    steps: u64,
}

impl Machine32 {
    fn value(&self, (constant, terms): &Affine) -> i64 {
        constant + terms.iter().map(|(index, factor)| factor * self.indices[index]).sum::<i64>()
    }

    fn place(&self, array: char, subscripts: &[Affine]) -> usize {
        let sizes = &self.arrays[&array].0;
        let place = subscripts.iter().zip(sizes).fold(0, |place, (subscript, size)| {
            let index = self.value(subscript);
            assert!((1..=*size).contains(&index), "the generator keeps to the array");
            place * size + index - 1
        });
        place as usize
    }

    fn compute(&mut self, expr: &Expr) -> f32 {
        match expr {
            Expr::Literal(value) => *value as f32 / 4.0,
            Expr::Index(index) => self.indices[index] as f32,
            Expr::Element(array, subscripts) => self.arrays[array].1[self.place(*array, subscripts)],
            Expr::Infix(operator, a, b) => {
                let (a, b) = (self.compute(a), self.compute(b));
                match operator {
                    '+' => a + b,
                    '-' => a - b,
                    _ => a * b,
                }
            }
            Expr::Sum(index, first, last, part) => {
                let (first, last) = (self.value(first), self.value(last));
                let mut sum: Option<f32> = None;
                for value in first..=last {
                    self.indices.insert(*index, value);
                    let part = self.compute(part);
                    sum = Some(sum.map_or(part, |sum| sum + part));
                }
                self.indices.remove(index);
                sum.unwrap_or(0.0)
            }
        }
    }

    fn run(&mut self, statements: &[Statement]) {
        for statement in statements {
            match statement {
                Statement::Assign(array, subscripts, expr) => {
                    let value = self.compute(expr);
                    let place = self.place(*array, subscripts);
                    self.arrays.get_mut(array).expect("it is declared").1[place] = value;
                    self.steps += 1;
                }
                Statement::For { variable, first, last, step, body, .. } => {
                    let (mut value, last) = (self.value(first), self.value(last));
                    while if *step > 0 { value <= last } else { value >= last } {
                        self.indices.insert(*variable, value);
                        self.run(body);
                        value += step;
                    }
                    self.indices.remove(variable);
                }
            }
        }
    }
}

fn affine((constant, terms): &Affine) -> String {
    let mut text = String::new();
    for (index, factor) in terms {
        let _ = match factor {
            1 => write!(text, "+{index}"),
            -1 => write!(text, "-{index}"),
            factor => write!(text, "+({factor})*{index}"),
        };
    }
    if *constant != 0 || text.is_empty() {
        let _ = write!(text, "{}{constant}", if *constant < 0 { "" } else { "+" });
    }
    text.trim_start_matches('+').to_owned()
}

fn element(array: char, subscripts: &[Affine]) -> String {
    let subscripts: Vec<String> = subscripts.iter().map(affine).collect();
    format!("{array}[{}]", subscripts.join(","))
}

fn written(expr: &Expr) -> String {
    match expr {
        Expr::Literal(value) => format!("({:?})", *value as f64 / 4.0),
        Expr::Index(index) => format!("itof({index})"),
        Expr::Element(array, subscripts) => element(*array, subscripts),
        Expr::Infix(operator, a, b) => format!("({} {operator} {})", written(a), written(b)),
        Expr::Sum(index, first, last, part) => {
            format!("sum({index}, {}, {}, {})", affine(first), affine(last), written(part))
        }
    }
}

/// The source of statements; bounds at run time are in registers that are set before.
fn source(statements: &[Statement], depth: usize, numbers: &mut Vec<i64>, text: &mut String) {
    let indent = "  ".repeat(depth);
    for statement in statements {
        match statement {
            Statement::Assign(array, subscripts, expr) => {
                let _ = writeln!(text, "{indent} {} = {}", element(*array, subscripts), written(expr));
            }
            Statement::For { variable, first, last, step, unroll, run_time, body } => {
                let mut options = String::new();
                if *step != 1 {
                    let _ = write!(options, " step {step}");
                }
                if *unroll > 0 {
                    let _ = write!(options, " unroll {unroll}");
                }
                let last = if *run_time {
                    numbers.push(last.0);
                    let _ = write!(options, " max {}", last.0.max(0) + 1);
                    format!("n{}", numbers.len())
                } else {
                    affine(last)
                };
                let _ = writeln!(text, "{indent} .for {variable}, {}, {last}{options}", affine(first));
                source(body, depth + 1, numbers, text);
                let _ = writeln!(text, "{indent} .endfor");
            }
        }
    }
}

/// A generator that knows the values of the indices around, to keep subscripts within their arrays.
struct Generator<'r> {
    random: &'r mut Random,
    arrays: BTreeMap<char, Vec<i64>>,
    /// The enclosing loops: index, first, last (at run time, a greater declared maximum), step.
    around: Vec<(char, Affine, Affine, i64)>,
}

impl Generator<'_> {
    fn below(&mut self, n: u64) -> i64 {
        self.random.below(n) as i64
    }

    /// All values of an affine function over the enclosing loops.
    fn extremes(&self, function: &Affine) -> Option<(i64, i64)> {
        fn go(
            around: &[(char, Affine, Affine, i64)],
            known: &mut BTreeMap<char, i64>,
            of: &Affine,
        ) -> Option<(i64, i64)> {
            let value = |(constant, terms): &Affine, known: &BTreeMap<char, i64>| {
                constant + terms.iter().map(|(index, factor)| factor * known[index]).sum::<i64>()
            };
            let Some((index, first, last, step)) = around.first() else {
                let value = value(of, known);
                return Some((value, value));
            };
            let (mut at, last) = (value(first, known), value(last, known));
            let mut all: Option<(i64, i64)> = None;
            while if *step > 0 { at <= last } else { at >= last } {
                known.insert(*index, at);
                if let Some((low, high)) = go(&around[1..], known, of) {
                    all = Some(all.map_or((low, high), |(least, most)| (least.min(low), most.max(high))));
                }
                at += step;
            }
            all
        }
        go(&self.around, &mut BTreeMap::new(), function)
    }

    /// A subscript that lies in 1 to `size` over the enclosing loops.
    fn subscript(&mut self, size: i64) -> Affine {
        let indices: Vec<char> = self.around.iter().map(|around| around.0).collect();
        for _ in 0..4 {
            let mut terms = Vec::new();
            for index in &indices {
                let factor = [1, 1, -1, 2, 0, 0, 0][self.below(7) as usize];
                if factor != 0 {
                    terms.push((*index, factor));
                }
            }
            let Some((low, high)) = self.extremes(&(0, terms.clone())) else { return (1, terms) };
            if high - low < size {
                let shift = self.below((size - (high - low)) as u64);
                return (1 - low + shift, terms);
            }
        }
        (1 + self.below(size as u64), Vec::new())
    }

    fn element(&mut self) -> (char, Vec<Affine>) {
        let which = self.below(self.arrays.len() as u64) as usize;
        let (array, sizes) =
            self.arrays.iter().nth(which).map(|(a, s)| (*a, s.clone())).expect("it is there");
        (array, sizes.iter().map(|size| self.subscript(*size)).collect())
    }

    fn expr(&mut self, depth: u32) -> Expr {
        match self.below(if depth == 0 { 4 } else { 9 }) {
            0 => Expr::Literal(self.below(9) - 4),
            1 if !self.around.is_empty() && self.below(2) == 0 => {
                let which = self.below(self.around.len() as u64) as usize;
                // The indices of sums that are written out are constants.
                match self.around[which].0 {
                    index @ ('i' | 'j' | 'k' | 'l') => Expr::Index(index),
                    _ => Expr::Literal(2),
                }
            }
            1..=3 => {
                let (array, subscripts) = self.element();
                Expr::Element(array, subscripts)
            }
            8 => {
                let index =
                    ['s', 't', 'u'][self.around.iter().filter(|around| around.0 >= 's').count().min(2)];
                if self.around.len() >= 4 || self.around.iter().any(|around| around.0 == index) {
                    return Expr::Literal(1);
                }
                let (first, last) = self.bounds();
                self.around.push((index, first.clone(), last.clone(), 1));
                let part = self.expr(depth - 1);
                self.around.pop();
                Expr::Sum(index, first, last, Box::new(part))
            }
            _ => {
                let operator = ['+', '-', '*'][self.below(3) as usize];
                Expr::Infix(operator, Box::new(self.expr(depth - 1)), Box::new(self.expr(depth - 1)))
            }
        }
    }

    fn bounds(&mut self) -> (Affine, Affine) {
        let outer: Vec<char> = self.around.iter().map(|around| around.0).collect();
        let mut bound = |low: u64| {
            let constant = self.below(low);
            match outer.last() {
                Some(index) if self.below(3) == 0 => (constant - 1, vec![(*index, 1)]),
                _ => (constant, Vec::new()),
            }
        };
        let (first, mut last) = (bound(3), bound(4));
        last.0 += 3;
        (first, last)
    }

    fn statements(&mut self, depth: usize) -> Vec<Statement> {
        let count = 1 + self.below(2);
        (0..count).map(|_| self.statement(depth)).collect()
    }

    fn statement(&mut self, depth: usize) -> Statement {
        if depth == 3 || self.below(4) == 0 && depth > 0 {
            let (array, subscripts) = self.element();
            return Statement::Assign(array, subscripts, self.expr(2));
        }
        let variable = ['i', 'j', 'k', 'l'][depth];
        let (mut first, mut last) = self.bounds();
        let step = [1i64, 1, 1, 2, 3, -1, -2][self.below(7) as usize];
        if step < 0 {
            std::mem::swap(&mut first, &mut last);
        }
        // The number of steps in a range whose length depends on an index would need a division.
        if step.abs() != 1 {
            (first.1, last.1) = (Vec::new(), Vec::new());
        }
        let run_time = step == 1 && last.1.is_empty() && self.below(3) == 0;
        let unroll = [0, 0, 1, 2, 4, 3]
            [self.below(if run_time || !first.1.is_empty() || !last.1.is_empty() { 5 } else { 6 }) as usize];
        // The declared maximum is greater than the count.
        let most = if run_time { (last.0.max(0) + 1, Vec::new()) } else { last.clone() };
        self.around.push((variable, first.clone(), most, step));
        let body = self.statements(depth + 1);
        self.around.pop();
        Statement::For { variable, first, last, step, unroll, run_time, body }
    }
}

fn program(text: &str, machine: &'static Machine, schedule: Schedule) -> Option<AssembledProgram> {
    let options = Options { machine, schedule, effort: 0, ..Options::default() };
    let assembled = assemble("random.s", &MemoryLoader::of("random.s", text), &options);
    let fits = |errors: &Diagnostics| {
        errors.list.iter().any(|error| error.severity == Severity::Error && error.code != "memory-full")
    };
    match assembled {
        Ok(assembled) => Some(assembled),
        Err(errors) if !fits(&errors) => None,
        Err(errors) => panic!("{text}\n{}", errors.render(false)),
    }
}

#[test]
fn loop_nests_compute_the_expected_values() {
    let (mut steps, mut programs, most) = (0, 0, crate::common::programs(40, 400));
    for seed in 0..most {
        let random = &mut Random::new(seed);
        let mut arrays = BTreeMap::new();
        for name in ['A', 'B', 'x', 'y'] {
            let dimensions = if name < 'a' { 2 } else { 1 };
            arrays.insert(name, (0..dimensions).map(|_| 3 + random.below(5) as i64).collect::<Vec<i64>>());
        }
        let mut text = String::from(".once\n");
        let mut machine32 = Machine32 { indices: BTreeMap::new(), arrays: BTreeMap::new(), steps: 0 };
        for (name, sizes) in &arrays {
            let count: i64 = sizes.iter().product();
            let values: Vec<f32> = (0..count).map(|_| random.below(17) as f32 / 4.0 - 2.0).collect();
            let shown: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
            let sizes_text: Vec<String> = sizes.iter().map(i64::to_string).collect();
            let _ = writeln!(text, ".array {name}[{}] = {}", sizes_text.join(","), shown.join(", "));
            machine32.arrays.insert(*name, (sizes.clone(), values));
        }
        let mut generator = Generator { random, arrays: arrays.clone(), around: Vec::new() };
        let statements = generator.statements(0);
        let (mut body, mut numbers) = (String::new(), Vec::new());
        source(&statements, 0, &mut numbers, &mut body);
        for (number, value) in (1..).zip(&numbers) {
            let _ = writeln!(text, ".reg n{number}:int\n li n{number}, {value}");
        }
        if seed % 2 == 0 {
            text.push_str(".schedule on\n");
        }
        text.push_str(&body);
        text.push_str(" wait period\n.period\nperiod: wait period\n");
        machine32.run(&statements);
        steps += machine32.steps;
        let expected: Vec<f32> = machine32.arrays.values().flat_map(|(_, values)| values.clone()).collect();
        for &machine in MACHINES.iter().chain([&&F3, &&F1]) {
            for schedule in [Schedule::AsWritten, Schedule::All] {
                let Some(assembled) = program(&text, machine, schedule) else { continue };
                programs += 1;
                let shown = || common::bundles(&assembled).join("\n");
                let mut emulator = Emulator::new(&assembled.program).expect("it fits");
                let outcome = emulator.run_period(&[]);
                assert!(
                    outcome.is_ok(),
                    "seed {seed} on {}, {schedule:?}:\n{text}\n{outcome:?}\n{}",
                    machine.name,
                    shown()
                );
                for (word, value) in expected.iter().enumerate() {
                    let found = f32::from_bits(emulator.memory()[word]);
                    assert!(
                        found.to_bits() == value.to_bits() || found.is_nan() && value.is_nan(),
                        "seed {seed} on {}, word {word}: {found} for {value}\n{text}\n{}",
                        machine.name,
                        shown()
                    );
                }
            }
        }
    }
    assert!(steps > 25 * most.min(40), "{steps} assignments");
    assert!(programs > 9 * most, "{programs} programs fit");
}

/// The words of an array after a program's `.once`, on every machine, as written and scheduled.
#[track_caller]
fn left(text: &str, name: &str, expected: &[f32]) {
    for &machine in MACHINES.iter().chain([&&F3, &&F1]) {
        for schedule in [Schedule::None, Schedule::All] {
            let text = format!("{text}\n wait period\n.period\nperiod: wait period\n");
            let assembled = program(&text, machine, schedule).expect("it fits");
            let label = assembled.program.symbols.iter().find(|symbol| symbol.name == name);
            let base = label.expect("it is a label").address as usize;
            let mut emulator = Emulator::new(&assembled.program).expect("it fits");
            let outcome = emulator.run_period(&[]);
            assert!(outcome.is_ok(), "{outcome:?} on {}, {schedule:?}", machine.name);
            let words = &emulator.memory()[base..base + expected.len()];
            let found: Vec<f32> = words.iter().map(|word| f32::from_bits(*word)).collect();
            assert_eq!(found, expected, "{name} on {}, {schedule:?}", machine.name);
        }
    }
}

const DECLARED: &str = ".array A[3,4] = 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12\n\
    .array x[8] = 1, 2, 3, 4, 5, 6, 7, 8\n.array y[4], k[2]:int = 3, 1\n.reg r[4] t n:int\n.once\n";

#[test]
fn slices_are_computed_element_by_element() {
    let check = |body: &str, name: &str, expected: &[f32]| left(&format!("{DECLARED}{body}"), name, expected);
    check(" A[2,:] = A[2,:] - 5*A[1,:]", "A", &[1., 2., 3., 4., 0., -4., -8., -12., 9., 10., 11., 12.]);
    check(" A[1,:], A[3,:] = A[3,:], A[1,:]", "A", &[9., 10., 11., 12., 5., 6., 7., 8., 1., 2., 3., 4.]);
    // A delay line, in either direction.
    check(" x[2:8] = x[1:7]\n x[1] = 0.5", "x", &[0.5, 1., 2., 3., 4., 5., 6., 7.]);
    check(" x[1:7] = x[2:8]", "x", &[2., 3., 4., 5., 6., 7., 8., 8.]);
}

#[test]
fn slices_of_all_kinds() {
    let check = |body: &str, name: &str, expected: &[f32]| left(&format!("{DECLARED}{body}"), name, expected);
    check(" y[:] = 0.5", "y", &[0.5; 4]);
    check(" A[:,:] = 2*A[:,:] + 1", "A", &[3., 5., 7., 9., 11., 13., 15., 17., 19., 21., 23., 25.]);
    check(" A[1:2,2:3] = A[2:3,3:4]", "A", &[1., 7., 8., 4., 5., 11., 12., 8., 9., 10., 11., 12.]);
    check(" r[:] = A[3,:]\n y[:] = x[1:4]*r[:]", "y", &[9., 20., 33., 48.]);
    check(" .for i, 1, 3 unroll 1\n  y[i] = sum(j, 1, 4, A[i,j])\n .endfor", "y", &[10., 26., 42., 0.]);
    check(
        " .for i, 2, 3\n  A[i,1:i] = x[1:i]\n .endfor",
        "A",
        &[1., 2., 3., 4., 1., 2., 7., 8., 1., 2., 3., 12.],
    );
    let twice = ".macro twice d, a\n fadd d, a, a\n.endm\n";
    check(&format!("{twice} x[3:8] = twice(x[3:8]) + 1"), "x", &[1., 2., 7., 9., 11., 13., 15., 17.]);
}

#[test]
fn elements_are_operands_of_instructions() {
    let check = |body: &str, name: &str, expected: &[f32]| left(&format!("{DECLARED}{body}"), name, expected);
    check(" fadd y[2], A[1,2], x[8]", "y", &[0., 10., 0., 0.]);
    check(" .for i, 1, 4 unroll 1\n  fmul t, x[i], 2.0\n  st y[i], t\n .endfor", "y", &[2., 4., 6., 8.]);
    check(
        " .for i, 1, 4 unroll 1\n  ld t, A[2,i]\n  fadd y[5-i], t, A[1,i]\n .endfor",
        "y",
        &[12., 10., 8., 6.],
    );
    // The words of an array by its label, counted from 0.
    check(" ld t, x+2\n mov y[1], t\n st y+3, t", "y", &[3., 0., 0., 3.]);
    check(" fadd y[1], x[1], x[2] || mov t, x[5]\n fadd y[2], t, t", "y", &[3., 10., 0., 0.]);
    // An element on both sides: `y[1]` is read before it is written.
    check(" y[1] = 7\n y[2], y[1] = y[1], x[2]", "y", &[2., 7., 0., 0.]);
}

/// A read behind the write of an element has the type of the array, whatever was written: a number, or bits.
#[test]
fn what_an_element_was_written_from_does_not_change_its_type() {
    let check = |body: &str, name: &str, expected: &[f32]| left(&format!("{DECLARED}{body}"), name, expected);
    let over = ".macro over d:int, a:int\n d = 5 < a\n.endm\n";
    for written in ["7", "n & 15", "xor(n, 16)", "n << 3", "n | 64"] {
        check(
            &format!(" n = 7\n k[1] = {written}\n y[1] = itof(5 < k[1])\n y[2] = itof(k[1] > 6)"),
            "y",
            &[1., 1.],
        );
        check(&format!("{over} n = 7\n k[1] = {written}\n y[1] = itof(over(k[1]))"), "y", &[1.]);
        check(
            &format!(" n = 7\n k[1] = {written}\n n = k[1] + 100 & 0xff\n y[1] = itof(n > 99)"),
            "y",
            &[1.],
        );
    }
    // In a float array a whole number is a float, and is compared as one.
    check(" x[1] = 7\n y[1] = itof(5.5 < x[1])\n y[2] = x[1]/2", "y", &[1., 3.5]);
}

#[test]
fn subscripts_in_registers() {
    let check = |body: &str, name: &str, expected: &[f32]| left(&format!("{DECLARED}{body}"), name, expected);
    check(" li n, 3\n y[n] = x[n+4] - x[2*n-1]", "y", &[0., 0., 2., 0.]);
    check(" n = k[1]\n y[:] = A[n,:]\n n = k[2]\n y[n] = A[n,n+1]", "y", &[2., 10., 11., 12.]);
    check(" .for i, 1, 2 unroll 1\n  n = k[i]\n  y[i] = A[n,i]\n .endfor", "y", &[9., 2., 0., 0.]);
    // The index as a number, in a loop at run time and in a written-out loop.
    check(" .for i, 1, 4 unroll 1\n  y[i] = itof(2*i+1)\n .endfor", "y", &[3., 5., 7., 9.]);
    check(" .for i, 1, 4\n  y[i] = itof(2*i+1)\n .endfor", "y", &[3., 5., 7., 9.]);
}

/// A program beside a file of numbers.
fn with_file(array: &str, numbers: &str) -> Result<takt_asm::AssembledProgram, String> {
    let text =
        format!("{array}\n.output y, k:int\n.once\n wait p\n.period\np: ld y, A+1\n ld k, A+1\n wait p\n");
    let mut files = takt_asm::MemoryLoader::of("main/test.s", text);
    files.add("main/data/A.csv", numbers.as_bytes());
    let assembled = takt_asm::assemble("main/test.s", &files, &takt_asm::Options::default());
    assembled.map_err(|report| report.render(false))
}

#[test]
fn files_of_numbers_are_the_values_of_arrays() {
    let floats = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<u32>>();
    let data = |array: &str, numbers: &str| {
        with_file(array, numbers).unwrap_or_else(|report| panic!("{report}")).program.data
    };
    let listed = floats(&[1.0, -2.5, 0.001, 4.0, 5.0, 0.1]);
    for numbers in [
        "1, -2.5, 1e-3\n4,5,0.1\n",
        "\u{feff}# a comment\r\n\r\na, b, \"c\"\r\n1,-2.5,1e-3\r\n4,5,0.1",
        "1;-2.5;1e-3\n4;5;0.1\n",
        "1\t-2.5\t1e-3\n 4 \t5\t0.1\n",
        "  1 -2.5   1e-3\n4 5 0.1\n\n",
    ] {
        assert_eq!(data(".array A = \"data/A.csv\"", numbers), listed, "{numbers}");
        assert_eq!(data(".array A[2,3] = \"data/A.csv\"", numbers), listed, "{numbers}");
    }
    assert_eq!(data(".array A:int = \"data/A.csv\"", "1\n-2\n"), [1, 2u32.wrapping_neg()]);
    assert_eq!(data(".array A[3] = \"data/A.csv\"", "1\n2\n3\n"), floats(&[1.0, 2.0, 3.0]));
    assert_eq!(data(".array A[1,2] = \"data/A.csv\"", "inf, 2\n"), floats(&[f32::INFINITY, 2.0]));
    assert_eq!(data(".array B[2], A = \"data/A.csv\"", "7 8\n"), floats(&[0.0, 0.0, 7.0, 8.0]));
    // The shape comes from the file.
    let text = ".array A = \"data/A.csv\"\n.array c = \"data/A.csv\"\n.const D = A + 0\n.period\np: y = A[2,3] + c[1,1]\n wait p\n.output y\n";
    let mut files = takt_asm::MemoryLoader::of("t.s", text);
    files.add("data/A.csv", b"1,2,3\n4,5,6\n".to_vec());
    assert!(takt_asm::assemble("t.s", &files, &takt_asm::Options::default()).is_ok());
}

#[test]
fn mistakes_in_files_of_numbers_have_their_place() {
    let array = ".array A = \"data/A.csv\"";
    for (array, numbers, words) in [
        (array, "1,2\n3,x4\n", "`x4` is not a number"),
        (array, "1,2\n3,x4\n", "main/data/A.csv:2:3"),
        (array, "1;2\n3;4,5\n", "the decimal point is a `.`"),
        (array, "1,2\n3\n", "1 number in this row, and 2 in the first"),
        (array, "1,2,\n", "a number is missing"),
        (array, "# none\n", "has no numbers"),
        (array, "1e39, 2\n", "main/data/A.csv:1:1"),
        (".array A:int = \"data/A.csv\"", "1, 2.5\n", "2.5 is not an integer"),
        (
            ".array A[3,2] = \"data/A.csv\"",
            "1,2,3\n4,5,6\n",
            "`A` is `A[3,2]`, and the file has 2 rows of 3 numbers",
        ),
        (".array A = \"data/B.csv\"", "1\n", "`main/data/B.csv` cannot be read"),
        (".array A = \"../../B.csv\"", "1\n", "not a path within the project"),
        (".array A", "1\n", "`A` has no size"),
    ] {
        let report = with_file(array, numbers).expect_err(numbers);
        assert!(report.contains(words), "{array}, {numbers:?}: no `{words}` in\n{report}");
    }
}
