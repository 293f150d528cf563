// SPDX-License-Identifier: MIT OR Apache-2.0
//! Response times in periods: claims about small programs, and random programs against the emulator.

use std::collections::BTreeSet;
use takt_analysis::dependence::{Dependence, OutputEvent, Periods};
use takt_asm::{MemoryLoader, Options, assemble};
use takt_emu::Emulator;
use takt_emu::testing::{self, Random, input_ports, random_program};
use takt_isa::{F1, F3, MACHINES, Program, Register};

fn program(text: &str) -> Program {
    let options = Options { machine: &F1, ..Options::default() };
    assemble("p.s", &MemoryLoader::of("p.s", text), &options)
        .unwrap_or_else(|e| panic!("{e:?}\n{text}"))
        .program
}

fn port(program: &Program, name: &str) -> Register {
    let mut ports = program.inputs.iter().chain(&program.outputs);
    ports.find(|port| port.name == name).expect("a port").register
}

/// Response of `o` to `i` in periods, sent with each write and with the `wait`.
fn both(text: &str) -> [Option<Periods>; 2] {
    let program = program(text);
    let dependence = Dependence::new(&program, &BTreeSet::new()).expect("it can be followed");
    let on = dependence.on(port(&program, "i"));
    [OutputEvent::Written, OutputEvent::AtWait].map(|sent| on.output(port(&program, "o"), sent))
}

/// Program of one period; registers and states are integers.
fn one(body: &str) -> String {
    format!(
        ".input i:int j:int\n.output o:int\n.state s1:int s2:int s3:int n:int\n.reg x:int y:int\n.data\nd: .space 4\ne: .word 5\n\
         .once\n mov s1, zero\n mov s2, zero\n mov s3, zero\n mov n, zero\n mov o, zero\n wait p\n.period\np:\n{body}\n wait p\n"
    )
}

/// Expected response: least and most periods, and whether states carry it on.
fn follows(least: u32, most: impl Into<Option<u32>>, lasting: bool) -> Option<Periods> {
    Some(Periods { least, most: most.into(), lasting })
}

#[test]
fn registers_memory_and_branches_carry_values() {
    let cases = [
        ("a direct path", " iadd o, i, 1", follows(0, 0, false)),
        ("no path", " iadd o, j, 1", None),
        ("an overwritten one", " mov o, i\n mov o, j", follows(0, None, false)),
        ("a delay line", " mov o, s3\n mov s3, s2\n mov s2, s1\n mov s1, i", follows(3, 3, true)),
        (
            "one that is shifted first",
            " mov s3, s2\n mov s2, s1\n mov s1, i\n mov o, s3",
            follows(2, 2, true),
        ),
        ("a direct path beside states", " iadd o, s1, i\n mov s1, i", follows(0, 0, true)),
        ("a sum", " iadd s1, s1, i\n mov o, s1", follows(0, 0, true)),
        (
            "words of data memory",
            " ld x, d\n mov o, x\n ld x, d+1\n st d, x\n ld x, d+2\n st d+1, x\n st d+2, i",
            follows(3, 3, true),
        ),
        ("a word of its own beside", " ld o, e\n st d, i", None),
        ("a ring of words", " ld o, d[n]\n st d[n], i\n iadd n, n, 1\n iand n, n, 3", follows(1, None, true)),
        ("a word that the input picks", " ld o, d[i]", follows(0, 0, false)),
        (
            "either of two",
            " bz j, l\n mov o, s1\n jmp m\nl: mov o, s3\nm: mov s3, s2\n mov s2, s1\n mov s1, i",
            follows(1, 3, true),
        ),
        (
            "either of two, as the input has it",
            " mov s1, zero\n bz i, l\n mov s1, 1\nl: mov o, s1",
            follows(0, 0, false),
        ),
        ("now and then", " isub n, n, 1\n bnz n, l\n mov o, i\n mov n, 9\nl: nop", follows(0, None, true)),
        ("a subroutine", " call f\n mov o, x\n wait p\nf: mov x, s1\n mov s1, i\n ret", follows(1, 1, true)),
        (
            "a subroutine that is called twice",
            " mov y, j\n call f\n mov s1, x\n mov y, i\n call f\n mov o, x\n wait p\nf: mov x, y\n ret",
            follows(0, 0, false),
        ),
        (
            "a loop",
            " mov n, 4\n mov x, i\n.loop_bound 4\nl: iadd x, x, s2\n isub n, n, 1\n bnz n, l\n mov o, x\n mov s2, i",
            follows(0, 0, true),
        ),
        (
            "a loop that the input counts",
            " iand n, i, 3\n iadd n, n, 1\n mov x, zero\n.loop_bound 4\nl: iadd x, x, 1\n isub n, n, 1\n bnz n, l\n mov o, x",
            follows(0, 0, false),
        ),
        ("sticky flags", " fadd x, i, 1.0\n rdflags o", follows(0, None, true)),
        ("an end for good", " bz i, l\n mov o, j\n wait p\nl: halt", None),
    ];
    for (name, body, expected) in cases {
        let text = one(body);
        assert_eq!(both(&text)[0], expected, "{name}\n{text}");
    }
}

#[test]
fn what_is_sent_with_the_wait_comes_before_its_bundle() {
    let text =
        ".input i:int\n.output o:int\n.once\n mov o, zero\n wait p\n.period\np: nop\n mov o, i || wait p\n";
    let options = Options { machine: &F3, ..Options::default() };
    // The write goes to another slot than the sequencer's.
    let text = text
        .replace("mov o, i", "fadd o, i, 0.0")
        .replace(":int", "")
        .replace("mov o, zero", "fadd o, zero, zero");
    let program = assemble("p.s", &MemoryLoader::of("p.s", text.as_str()), &options)
        .unwrap_or_else(|e| panic!("{e:?}"))
        .program;
    let dependence = Dependence::new(&program, &BTreeSet::new()).expect("it can be followed");
    let on = dependence.on(port(&program, "i"));
    let sent = |sent| on.output(port(&program, "o"), sent);
    assert_eq!(sent(OutputEvent::Written), follows(0, 0, false));
    assert_eq!(sent(OutputEvent::AtWait), follows(1, 1, true));
}

#[test]
fn several_periods_in_turn() {
    let head =
        ".input i:int\n.output o:int\n.state s:int n:int\n.once\n mov s, zero\n mov n, zero\n mov o, zero\n";
    // Each period runs every other tick: `p` reads, `q` shows.
    let text = format!("{head} wait p\n.period\np: mov s, i\n wait q\nq: mov o, s\n wait p\n");
    assert_eq!(both(&text)[0], follows(1, 2, true));
    // An input read in the first period alone causes no later response.
    let text = format!("{head} wait p\n.period\np: mov s, i\n wait q\nq: mov o, s\n wait q\n");
    assert_eq!(both(&text)[0], None);
    // The input chooses the next period.
    let text = format!(
        "{head} wait p\n.period\np: mov o, zero\n bz i, l\n wait q\nl: wait p\nq: mov o, 1\n bz i, m\n wait q\nm: wait p\n"
    );
    assert_eq!(both(&text)[0].map(|periods| (periods.least, periods.most)), Some((1, None)));
}

#[test]
fn a_port_that_another_one_sends() {
    let sent_by = |body: &str| {
        let text = one(body)
            .replace(".output o:int", ".output o:int q:int")
            .replace(" mov o, zero", " mov o, zero\n mov q, zero");
        let program = program(&text);
        let pair = (port(&program, "o"), port(&program, "q"));
        let dependence = Dependence::new(&program, &BTreeSet::from([pair])).expect("it can be followed");
        dependence.on(port(&program, "i")).output(pair.0, OutputEvent::By(pair.1))
    };
    assert_eq!(sent_by(" mov o, i\n mov q, 1"), follows(0, 0, false));
    assert_eq!(sent_by(" mov q, 1\n nop\n nop\n nop\n nop\n mov o, i"), follows(1, 1, true));
    // Sends conditional on the input, then on a count.
    assert_eq!(sent_by(" mov o, 1\n bz i, l\n mov q, 1\nl: nop"), follows(0, 0, true));
    assert_eq!(
        sent_by(" mov o, i\n isub n, n, 1\n bnz n, l\n mov n, 4\n mov q, 1\nl: nop"),
        follows(0, None, true)
    );
    // The quotient is still in flight when the next bundle sends.
    assert_eq!(sent_by(" fdiv o:float, i:float, 3.0\n mov q, 1").map(|periods| periods.most), Some(None));
}

/// Subroutines that call the next one twice have twice as many call paths at each level: beyond the limit no response is claimed to be
/// certain or absent.
#[test]
fn more_call_paths_than_the_limit() {
    const LEVELS: usize = 15;
    let levels = (0..LEVELS).map(|level| format!("f{level}: call f{0}\n call f{0}\n ret\n", level + 1));
    let routines: String = levels.chain([format!("f{LEVELS}: nop\n ret\n")]).collect();
    let text = format!("{}{routines}", one(" call f0\n mov o, i"));
    let [written, at_wait] = both(&text);
    assert_eq!(written, follows(0, None, true));
    assert_eq!(at_wait, written);
}

/// Compares claims about a random program with its runs. Counts claims of no response within the period of the read, observed responses,
/// and responses observed in a later period.
fn compare(seed: u64, program: &Program, met: &mut [u64; 3]) {
    let Ok(dependence) = Dependence::new(program, &BTreeSet::new()) else { return };
    let mut random = Random::new(!seed);
    let inputs: Vec<Register> = input_ports(program.machine).collect();
    for &input in &inputs {
        let on = dependence.on(input);
        let mut pair = [(); 2].map(|()| Emulator::new(program).expect("it loads"));
        let change = 1 + random.below(3);
        let hold = random.once_in(2);
        for period in 0..10 {
            for &register in &inputs {
                let value = random.word();
                let other = random.word();
                let changed = register == input && (period == change || hold && period > change);
                pair[0].set_input_bits(register, value).expect("a port");
                pair[1].set_input_bits(register, if changed { other } else { value }).expect("a port");
            }
            let ends = pair.each_mut().map(|emulator| emulator.run_period(&[]).is_ok());
            if ends != [true; 2] {
                return;
            }
            for output in &program.outputs {
                let periods = on.output(output.register, OutputEvent::Written);
                met[0] += u64::from(periods.is_none_or(|periods| periods.least > 0));
                let [one, other] = pair.each_ref().map(|emulator| emulator.output_bits(output.register));
                if one != other {
                    let least = periods.map(|periods| change + periods.least);
                    assert!(
                        least.is_some_and(|least| least <= period),
                        "seed {seed} on {}: {} follows {input} in period {period} after {change}, and not {periods:?}",
                        program.machine.name,
                        output.name
                    );
                    met[1] += 1;
                    met[2] += u64::from(period > change && least > Some(change));
                }
            }
        }
    }
}

#[test]
fn random_programs_show_no_response_before_its_time() {
    let mut met = [0; 3];
    for machine in MACHINES {
        for seed in 0..150 {
            for options in
                [testing::Options::TAME, testing::Options { bundles: 12, ..testing::Options::TAME }]
            {
                compare(seed, &random_program(seed, machine, options), &mut met);
            }
        }
    }
    assert!(met.iter().all(|&count| count > 100), "few cases: {met:?}");
}
