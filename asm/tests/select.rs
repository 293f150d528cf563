// SPDX-License-Identifier: MIT OR Apache-2.0
//! Short branches that become selections, and short branches that must not.

use takt_asm::{AssembledProgram, MemoryLoader, Options, Schedule, assemble};
use takt_emu::{Emulator, Stop};
use takt_isa::{MACHINES, Machine};

fn assembled(source: &str, machine: &'static Machine, schedule: Schedule) -> AssembledProgram {
    let options = Options { machine, schedule, ..Options::default() };
    match assemble("select.s", &MemoryLoader::of("select.s", source), &options) {
        Ok(assembled) => assembled,
        Err(mistakes) => panic!("{}\n{source}", mistakes.render(false)),
    }
}

/// The outputs when the program halts, and the cycle of the halt.
fn outcome(assembled: &AssembledProgram) -> (Vec<Option<u32>>, u64) {
    let mut emulator = Emulator::new(&assembled.program).expect("it fits");
    emulator.set_cycle_limit(1_000_000);
    assert_eq!(emulator.run(), Ok(Stop::Halted));
    let outputs = assembled.program.outputs.iter().map(|port| emulator.output_bits(port.register));
    (outputs.collect(), emulator.now())
}

/// The greatest element of an array, and where it stands: the loop is pipelined although it branches.
#[test]
fn a_search_is_pipelined() {
    let elements: String = (0..40).map(|k| format!(".float {}\n", (k * 23 % 40) as f32 / 8.0)).collect();
    let source = format!(
        ".output y, k:int\n.reg best at:int i:int v w:int\n.data\nv0: {elements}.once\n mov best, zero\n li at, 0\n li i, 0\n\
         loop 40, done\n ld v, v0[i]\n flt w, best, v\n bz w, next\n mov best, v\n mov at, i\nnext: iadd i, i, 1\ndone:\n\
         mov y, best\n mov k, at\n halt\n"
    );
    for machine in MACHINES {
        let (plain, selected) =
            (assembled(&source, machine, Schedule::None), assembled(&source, machine, Schedule::All));
        assert_eq!((plain.selections.len(), selected.selections.len()), (0, 1), "{}", machine.name);
        assert_eq!(selected.selections[0].registers, 2);
        // A single slot is full without overlap.
        let pipelined = usize::from(machine.slots.len() > 1);
        assert_eq!(selected.loops.len(), pipelined, "{}: {:?}", machine.name, selected.plain_loops);
        assert_eq!(outcome(&plain).0, outcome(&selected).0);
        assert_eq!(outcome(&selected).0[1], Some(33), "39 = 33 * 23 modulo 40");
        let (before, after) = (outcome(&plain).1, outcome(&selected).1);
        let least = if pipelined > 0 { 2 * before / 3 } else { before };
        assert!(after <= least, "{}: {after} cycles, {before} with the branch", machine.name);
    }
}

/// Two registers change places: no selection reads the result of an earlier one.
#[test]
fn registers_may_change_places() {
    for condition in [0, 1] {
        for branch in ["bz", "bnz"] {
            let source = format!(
                ".output y:int, z:int\n.reg a:int b:int t:int\n.data\nd: .word {condition}, 7, 9\n.once\n ld t, d\n ld a, d+1\n\
                 ld b, d+2\n ixor t, t, 0\n {branch} t, skip\n mov y0, a\n mov a, b\n mov b, y0\nskip: mov y, a\n mov z, b\n halt\n"
            )
            .replace("y0", "u")
            .replace("t:int\n", "t:int u:int\n")
            .replace("ld t, d\n", "ld t, d\n li u, 0\n");
            // Three registers are too many; without the third it is two.
            let two = source.replace("mov u, a\n mov a, b\n mov b, u", "mov a, b\n ixor b, a, 1");
            for (source, selections) in [(source, 0), (two, 1)] {
                for machine in MACHINES {
                    let (plain, selected) = (
                        assembled(&source, machine, Schedule::None),
                        assembled(&source, machine, Schedule::All),
                    );
                    assert_eq!(selected.selections.len(), selections, "{}\n{source}", machine.name);
                    assert_eq!(outcome(&plain).0, outcome(&selected).0, "{}\n{source}", machine.name);
                }
            }
        }
    }
}

/// An operation whose effect can be seen, or that can fault, stays after the branch.
#[test]
fn observable_operations_stay_behind_a_branch() {
    let passed = [
        ("mov v, x", true),
        ("iadd n, n, 1", true),
        ("fadd v, v, x", false),
        ("mov y, x", false),
        ("ld v, d[n]", false),
        ("st d, v", false),
        ("mov late, x", false),
        ("mov v, late", false),
        ("mov w, x", false),
        ("mov v, x\n mov n, m\n mov m, n", false),
    ];
    for (operations, is_selected) in passed {
        let source = format!(
            ".input x\n.output y z\n.reg v n:int m:int w:int late\n.data\nd: .space 4\n.schedule on\n.once\n mov v, zero\n li n, 0\n li m, 1\n\
             wait period\n.period\nperiod: ilt w, m, n\n bz w, skip\n {operations}\nskip: mov late, v\n fadd z, v, late\n itof y, n\n wait period\n"
        );
        // A value does not outlive its period: on the first path to its read, `late` has no value.
        let assembled = assembled(&source, &takt_isa::T3, Schedule::AsWritten);
        assert_eq!(assembled.selections.len(), usize::from(is_selected), "{operations}");
    }
}
