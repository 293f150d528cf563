// SPDX-License-Identifier: MIT OR Apache-2.0
//! Operations at which bounds are lost: beside the errors of a run.

use crate::accuracy::source;
use takt_analysis::accuracy::{Shadow, enclose_in_boxes, loss};
use takt_emu::Emulator;
use takt_isa::F3;

/// Lines at which the bounds of the outputs are lost, with the part of the factor that arises there, for periods with these inputs x.
fn lost(text: &str, inputs: &[f32]) -> Vec<Option<(u32, f64)>> {
    let program = source(text, &F3);
    let enclosure = enclose_in_boxes(&program, &Default::default()).unwrap();
    let (mut emulator, mut shadow) =
        (Emulator::new(&program).unwrap(), Shadow::new(&program).each_period_afresh());
    let port = program.inputs[0].register;
    for x in [&inputs[..1], inputs].concat() {
        emulator.set_input_bits(port, x.to_bits()).unwrap();
        shadow.run_period(&mut emulator).unwrap();
    }
    let line = |word: u32| program.lines[word as usize].unwrap().line;
    let of = enclosure.outputs.iter().map(|output| loss(&enclosure, &shadow, output));
    of.map(|loss| loss.map(|loss| (line(loss.word), loss.gain))).collect()
}

const HEAD: &str =
    ".ports latched\n.input x\n.range x = 0, 1\n.output y\n.reg a b c d\n.once\n y = 0\n wait p\n";

/// A quotient amid operations that keep the factor: found behind sums, behind a branch, and behind a word of memory.
#[test]
fn the_quotient_is_named_behind_other_operations() {
    let inputs = [0.6, 0.7, 0.9];
    let straight = ".period\np: a = x*0.7\n b = a*a + 0.00001\n c = 1/b\n d = c*3 + x\n y = d - a\n wait p\n";
    let branch = ".period\np: a = x*0.7\n b = a*a + 0.00001\n c = 1/b\n feq d, x, zero\n d = c\n bz d, q\n d = c*2\nq: y = d - a\n wait p\n";
    let memory = ".array A[4]\n.period\np: a = x*0.7\n b = a*a + 0.00001\n c = 1/b\n A[2] = c\n d = A[2] + x\n y = d\n wait p\n";
    for (text, line) in [(straight, 12), (branch, 12), (memory, 13)] {
        let [Some((found, gain))] = lost(&format!("{HEAD}{text}"), &inputs)[..] else { panic!("{text}") };
        assert!(found == line && gain > 100.0, "{text}: line {found}, {gain}");
    }
}

/// A bound that is near the run's errors is lost nowhere, and one that a hazard leaves open is lost at the hazard.
#[test]
fn a_hazard_loses_all_and_a_product_nothing() {
    let inputs = [0.6, 0.7, 0.9];
    let [Some((_, gain))] = lost(&format!("{HEAD}.period\np: a = x*0.7\n y = a*0.3\n wait p\n"), &inputs)[..]
    else {
        panic!()
    };
    assert!(gain < 10.0, "{gain}");
    let open = ".period\np: a = x*0.7\n c = 1/a\n d = c*3\n y = d + a\n wait p\n";
    let [Some((found, gain))] = lost(&format!("{HEAD}{open}"), &inputs)[..] else { panic!() };
    assert!(found == 11 && gain.is_infinite(), "line {found}, {gain}");
}
