// SPDX-License-Identifier: MIT OR Apache-2.0
//! Random sources from a seed, which every machine takes.
#![allow(dead_code)]

pub(crate) mod full_language;

use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng as _, SeedableRng as _};
use std::fmt::Write as _;

/// Random choices from a seed: the same programs on every machine.
pub(crate) struct Random(Pcg64);

impl Random {
    pub(crate) fn new(seed: u64) -> Random {
        Random(Pcg64::seed_from_u64(seed))
    }

    pub(crate) fn below(&mut self, n: u64) -> u64 {
        self.0.next_u64() % n
    }

    pub(crate) fn pick<'a>(&mut self, from: &[&'a str]) -> &'a str {
        from[self.below(from.len() as u64) as usize]
    }
}

const BINARY: [&[&str]; 3] = [
    &["fmul", "fmul", "fmul", "fdiv"],
    &["fadd", "fsub"],
    &["iadd", "ixor", "iand", "fmin", "fmax", "fsat", "feq", "flt", "ilt", "ishr"],
];
const UNARY: [&[&str]; 3] = [&["fsqrt", "fsin"], &["itof", "ftoi"], &["mov", "fabs", "fneg", "fsign"]];
/// First letters of the names that each slot of f3 writes: a name is written by one slot, so that runs may differ.
const PREFIX: [&str; 3] = ["m", "a", "x"];
const NAMES: u64 = 6;
const INPUTS: [&str; 4] = ["in0", "in1", "in2", "in3"];

/// A counted loop with a count from a constant or a register, perhaps around another, over an array; perhaps with a maximum search,
/// whose branch can become a selection.
fn counted_loop(random: &mut Random, number: u64, operand: &dyn Fn(&mut Random) -> String) -> String {
    let mut text = String::new();
    let variable = format!("q{number}");
    let (first, last) = (random.below(3), random.below(12));
    let is_nest = random.below(4) == 0;
    let _ = match random.below(3) {
        _ if is_nest => writeln!(text, " .for p{number}, 1, 5\n .for {variable}, 1, p{number} + {first}"),
        0 => writeln!(text, " iand u, {}, 15\n .for {variable}, 1, u max 15", operand(random)),
        _ => writeln!(text, " .for {variable}, {}, {}", 1 + first, 1 + last),
    };
    for _ in 0..1 + random.below(8) {
        let (a, b) = (operand(random), operand(random));
        let slot = random.below(3) as usize;
        let dest = format!("{}{}", PREFIX[slot], random.below(NAMES));
        let _ = match random.below(8) {
            0 | 1 => writeln!(text, " ld x{}, V[{variable}]", random.below(NAMES)),
            2 => writeln!(text, " st V[{variable}+1], {a}"),
            3 => writeln!(text, " greater w{number}, {a}, {b}"),
            4 => writeln!(text, " {} {dest}, {a}", random.pick(UNARY[slot])),
            _ => writeln!(text, " {} {dest}, {a}, {b}", random.pick(BINARY[slot])),
        };
    }
    text.push_str(if is_nest { " .endfor\n .endfor\n" } else { " .endfor\n" });
    text
}

/// End of a period that publishes its outputs before.
pub(crate) const PUBLISHED: &str = " publish\n fmul m0, m1, 0.5\n fadd a0, m0, a1\n st buf[zero], a0\n";

/// A source of a few hundred operations: arithmetic with reuse of names, loads and stores, ports, flags, bundles, branches.
pub(crate) fn source(seed: u64) -> String {
    source_with(seed, false)
}

/// A source as [`source`] makes it, with counted loops.
pub(crate) fn source_with_loops(seed: u64) -> String {
    source_with(seed, true)
}

fn source_with(seed: u64, has_loops: bool) -> String {
    let random = &mut Random::new(seed);
    let mut text =
        String::from(".schedule on\n.input in0, in1, in2:int, in3\n.output om, oa, ox:bits, of:bits\n");
    for prefix in PREFIX {
        for k in 0..NAMES {
            let _ = writeln!(text, ".state {prefix}{k}");
        }
    }
    text.push_str(
        ".macro greater w, a:bits, b:bits\n flt w, a, b\n bz w, not\n mov x1, b\n mov x2, x0\nnot:\n.endm\n",
    );
    text.push_str(".reg t u:int index:int w0:int w1:int w2:int\n.array V[20]\n.data\nbuf: .float 1.0, -2.5, 1e-30, 3e38\n .space 12\n.once\n");
    for k in 0..NAMES {
        let _ =
            writeln!(text, " fmul m{k}, {k}.5, 1.25\n fadd a{k}, {k}.0, 0.5\n li x{k}, {}", random.below(9));
    }
    text.push_str(" wait period\n.period\nperiod:\n");
    let (mut label, mut loops) = (0, 0);
    let mut open: Option<(u64, u64)> = None;
    for _ in 0..20 + random.below(200) {
        if let Some((name, left)) = open {
            if left == 0 {
                let _ = writeln!(text, "skip{name}:");
                open = None;
            } else {
                open = Some((name, left - 1));
            }
        }
        let operand = |random: &mut Random| -> String {
            match random.below(12) {
                0 => random.pick(&INPUTS).to_owned(),
                1 => random.below(5).to_string(),
                _ => format!("{}{}", random.pick(&PREFIX), random.below(NAMES)),
            }
        };
        let slot = random.below(3) as usize;
        let dest = match random.below(14) {
            0 => format!("o{}", PREFIX[slot]),
            _ => format!("{}{}", PREFIX[slot], random.below(NAMES)),
        };
        let (a, b, c) = (operand(random), operand(random), operand(random));
        let _ = match random.below(24) {
            0 => writeln!(text, " iand index, {a}, 15\n ld x{}, buf[index]", random.below(NAMES)),
            1 => writeln!(text, " iand index, {a}, 7\n st buf+4[index], {b}"),
            2 => writeln!(text, " ld {}, buf+2", format_args!("x{}", random.below(NAMES))),
            3 => writeln!(text, " sel x{}, {a}, {b}, {c}", random.below(NAMES)),
            // A name for values of several slots.
            4 => writeln!(text, " fmul t, {a}, {b}\n fadd t, t, {c}\n fabs t, t\n mov ox, t"),
            5 => writeln!(text, " fmul m0, a0, m1 || fadd a2, m1, a0 || mov x2, x3"),
            6 if random.below(3) == 0 => writeln!(text, " rdflags u\n mov of, u\n clrflags"),
            7 if open.is_none() => {
                label += 1;
                open = Some((label, 1 + random.below(12)));
                writeln!(text, " {} {a}, skip{label}", random.pick(&["bz", "bnz"]))
            }
            20..24 if has_loops && open.is_none() && loops < 3 => {
                loops += 1;
                text.push_str(&counted_loop(random, loops - 1, &operand));
                Ok(())
            }
            8 | 9 => writeln!(text, " {} {dest}, {a}", random.pick(UNARY[slot])),
            _ => writeln!(text, " {} {dest}, {a}, {b}", random.pick(BINARY[slot])),
        };
    }
    if let Some((name, _)) = open {
        let _ = writeln!(text, "skip{name}:");
    }
    text.push_str(" fmul om, m0, m1\n fadd oa, a0, a1\n mov ox, x0\n rdflags u\n mov of, u\n");
    if seed % 8 == 5 {
        text.push_str(PUBLISHED);
    }
    text.push_str(" wait period\n");
    text
}
