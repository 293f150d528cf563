// SPDX-License-Identifier: MIT OR Apache-2.0
//! Certificates of bounds: of every shipped program and of random ones, against the emulator; and changed ones, which are refused.
//!
//! Campaign: `cargo evidence campaign bounds`; `TAKT_PROGRAMS` and `TAKT_SEED` choose the random programs.

#![allow(clippy::print_stdout)]

use crate::random::number;
use crate::random::text as random_text;
use crate::shipped::{loader, shipped};
use std::num::NonZeroU64;
use takt_analysis::{Bounds, bound, certify};
use takt_asm::{Loader, MemoryLoader, Options, assemble};
use takt_emu::testing::{self, Random, input_ports, random_program};
use takt_emu::{Emulator, PeriodError, PeriodReport, Stop};
use takt_isa::certificate::{Certificate, Cost, Cycles, End, Lemma, Place, State, Step, Target, Turn};
use takt_isa::timing::Span;
use takt_isa::{F1, F3, Machine, Program, T1, T3, T4};
use takt_verify::bound::{ProvedBounds, check};

fn assembled(path: &str, loader: &dyn Loader, machine: &'static Machine) -> Option<Program> {
    let options = Options { machine, effort: 0, ..Options::default() };
    Some(assemble(path, loader, &options).ok()?.program)
}

/// Checks the certificate of a program; returns it as text. Its claims are the bounds.
fn certified(name: &str, program: &Program, bounds: &Bounds) -> (ProvedBounds, String) {
    let (again, certificate) = certify(program).expect("it has bounds");
    assert_eq!(again, *bounds, "{name}: a certificate changes no bound");
    let text = serde_json::to_string(&certificate).expect("it is plain data");
    let proved = check(program, text.as_bytes()).unwrap_or_else(|error| panic!("{name}: {error}"));
    assert_eq!(proved.sections.len(), bounds.sections.len(), "{name}");
    for (claim, section) in proved.sections.iter().zip(&bounds.sections) {
        assert_eq!(claim.name, section.name, "{name}");
        let span = |span: Span| -> Cycles { (span.best, span.worst) };
        assert_eq!((claim.once, claim.address), (section.once, section.address.get()), "{name}");
        assert_eq!(claim.cycles.refilled, span(section.cycles), "{name}");
        if !section.once {
            assert_eq!(claim.cycles.in_time, Some(span(section.in_time)), "{name}");
            assert_eq!(claim.cycles.missed, Some(span(section.missed)), "{name}");
        }
        let published = claim.published.map(|times| times.refilled);
        assert_eq!(published, section.published.map(|published| span(published.cycles)), "{name}");
    }
    (proved, text)
}

#[test]
fn every_shipped_program_has_its_bounds_proved() {
    let (mut programs, mut sections, mut places, mut bytes, mut longest) = (0, 0, 0, 0, (0, String::new()));
    let mut without = Vec::new();
    for machine in [&T1, &T3, &T4] {
        for (folder, file) in shipped() {
            let name = format!("{file} on {}", machine.name);
            let Some(program) = assembled(&file, &loader(&folder), machine) else { continue };
            if program.code.is_empty() {
                continue;
            }
            let Ok(bounds) = bound(&program) else {
                without.push(name);
                continue;
            };
            let (proved, text) = certified(&name, &program, &bounds);
            programs += 1;
            sections += proved.sections.len();
            places += proved.places;
            bytes += text.len();
            longest = longest.max((text.len(), name));
        }
    }
    println!(
        "{programs} pairs of program and machine, {sections} sections, {places} places, {bytes} bytes, at most {longest:?}; without a bound: {without:?}"
    );
    assert!(programs > 100 && without.len() < programs / 10, "{programs}: {without:?}");
}

/// Asserts that runs on random inputs, with ticks late, early and missed, keep to the claims. Returns the number of sections run.
fn run(name: &str, program: &Program, proved: &ProvedBounds, random: &mut Random) -> u64 {
    let Ok(mut emulator) = Emulator::new(program) else { return 0 };
    emulator.set_cycle_limit(1_000_000);
    if random.once_in(2) {
        emulator.set_tick_period(NonZeroU64::new(u64::from(1 + random.below(900))));
    }
    let inputs = |emulator: &mut Emulator, random: &mut Random| {
        for input in input_ports(program.machine) {
            let word = if random.once_in(3) { random.below(9) } else { random.word() };
            emulator.set_input_bits(input, word).expect("it is an input");
        }
    };
    let holds =
        |once: bool, address: u32, of: &dyn Fn(&takt_isa::certificate::Claim) -> Option<Cycles>, cycles| {
            let claim = proved.sections.iter().find(|claim| (claim.once, claim.address) == (once, address));
            let (best, worst) =
                claim.and_then(of).unwrap_or_else(|| panic!("{name}: no claim for {address}"));
            assert!(best <= cycles && cycles <= worst, "{name}: {cycles} are not {best} to {worst}");
        };
    inputs(&mut emulator, random);
    let mut waited = match emulator.run_to_wait() {
        Ok(Stop::Wait { cycle, .. }) => cycle,
        Ok(_) => emulator.now() - 1,
        // Runs with a fault have no bound.
        Err(_) => return 0,
    };
    holds(true, 0, &|claim| Some(claim.cycles.refilled), waited + 1);
    for period in 1..5 {
        inputs(&mut emulator, random);
        let address = emulator.next_address().get();
        match emulator.run_period(&[]) {
            Ok(PeriodReport { tick, start, published, wait, cycles, .. }) => {
                let is_missed = start != tick || tick <= waited;
                let is_soon = !is_missed && tick - waited < program.machine.refill.into();
                let of = |times: takt_isa::certificate::Times| match (is_missed, is_soon) {
                    (true, _) => times.missed,
                    (_, true) => times.in_time,
                    _ => Some(times.refilled),
                };
                holds(false, address, &|claim| of(claim.cycles), cycles);
                holds(
                    false,
                    address,
                    &|claim| of(claim.published.unwrap_or(claim.cycles)),
                    published - start,
                );
                waited = wait;
            }
            Err(PeriodError::Halted | PeriodError::Fault(_)) => return period,
            Err(error) => panic!("{name}: {error}"),
        }
    }
    5
}

/// Programs from `TAKT_SEED` on (by default 0), `TAKT_PROGRAMS` of them (by default 400): every other one in bundles, with calls and loops in
/// any place; the rest from sources. A program without a bound counts as such.
#[test]
fn random_programs_have_their_bounds_proved_and_keep_to_them() {
    let first = number("TAKT_SEED").unwrap_or(0);
    let programs = number("TAKT_PROGRAMS").unwrap_or(400);
    let (mut proved_programs, mut without, mut sections, mut places) = (0, 0, 0, 0);
    for seed in first..first + programs {
        let machine = [&T3, &T1, &T4, &F3, &F1][seed as usize / 2 % 5];
        let name = format!("seed {seed} on {}", machine.name);
        let program = if seed % 2 == 0 {
            Some(random_program(seed, machine, testing::Options::TAME))
        } else {
            assembled("random.s", &MemoryLoader::of("random.s", random_text(seed)), machine)
        };
        let Some((program, bounds)) = program.and_then(|program| {
            let bounds = bound(&program).ok()?;
            Some((program, bounds))
        }) else {
            without += 1;
            continue;
        };
        let (proved, _) = certified(&name, &program, &bounds);
        proved_programs += 1;
        places += proved.places;
        let mut random = Random::new(!seed);
        sections += (0..3).map(|_| run(&name, &program, &proved, &mut random)).sum::<u64>();
    }
    println!(
        "figures: programs={proved_programs} without_a_bound={without} sections_run={sections} places={places}"
    );
    assert!(proved_programs > programs / 2 && sections > programs, "{proved_programs} {sections}");
}

/// Program with everything that certificates have: branches, a subroutine, a count that a register holds, nested loops, a promised total, a
/// `publish`, results in flight at a tick.
const WHOLE: &str = "
.input n:int, x
.output y
.reg i:int, j:int, k:int, m:int, s, t
.once
        mov     s, zero
        li      i, 4
.loop_bound 4
outer:  isub    i, i, 1
        iadd    j, i, 1
        loop    j, inner
.loop_bound 9
        fadd    s, s, x
        nop
inner:  bnz     i, outer
        wait    first
.period
first:  fdiv    t, x, s
        call    sub
        bz      n, period
        fmul    t, t, x
period: li      k, 4
.loop_bound 4
row:    iand    m, n, 7
.loop_bound 7 total 12
next:   isub    m, m, 1
        bnz     m, next
        isub    k, k, 1
        bnz     k, row
        call    sub
        mov     y, s
        publish
        fsqrt   t, s
        fsin    t, t || wait period
sub:    bnz     n, short
        fadd    s, s, x
short:  ret
";

fn whole(machine: &'static Machine) -> Program {
    assembled("whole.s", &MemoryLoader::of("whole.s", WHOLE), machine).expect("it assembles")
}

/// Change of a certificate; false if nothing is there to change.
type Change = fn(&mut Certificate) -> bool;

fn places(certificate: &mut Certificate) -> impl Iterator<Item = &mut Place> {
    certificate.proofs[0].lemmas.iter_mut().flat_map(|lemma| match lemma {
        Lemma::Code { places, .. } => &mut places[..],
        Lemma::Loop { .. } => &mut [],
    })
}

/// First lemma of a loop for which this holds, as turns, recurrence and the number of the lemma.
fn turns(certificate: &mut Certificate) -> impl Iterator<Item = (&mut Vec<Vec<Turn>>, &mut Option<Cost>)> {
    certificate.proofs[0].lemmas.iter_mut().filter_map(|lemma| match lemma {
        Lemma::Loop { turns, steady, .. } => Some((turns, steady)),
        Lemma::Code { .. } => None,
    })
}

fn states(certificate: &mut Certificate) -> impl Iterator<Item = &mut State> {
    certificate.proofs[0].states.iter_mut()
}

/// Applies a change to the first of several.
fn first<T>(mut all: impl Iterator<Item = T>, change: impl FnOnce(T)) -> bool {
    all.next().map(change).is_some()
}

const CHANGES: &[(&str, Change, &str)] = &[
    (
        "another format",
        |of| {
            of.format.push('0');
            true
        },
        "format",
    ),
    (
        "a section with another's name",
        |of| {
            let name = of.sections[0].name.clone();
            of.sections[0].name = std::mem::replace(&mut of.sections[1].name, name);
            true
        },
        "is claimed to be",
    ),
    (
        "another machine",
        |of| {
            of.machine = "t1".to_owned();
            true
        },
        "is for machine `t1`",
    ),
    (
        "another program",
        |of| {
            of.program.replace_range(0..1, "x");
            true
        },
        "of another program",
    ),
    (
        "a worst case one less",
        |of| {
            of.sections[0].cycles.refilled.1 -= 1;
            true
        },
        "section `once` takes",
    ),
    (
        "a best case one more",
        |of| {
            of.sections[0].cycles.refilled.0 += 1;
            true
        },
        "section `once` takes",
    ),
    (
        "a worst case in time one less",
        |of| of.sections[1].cycles.in_time.as_mut().map(|cycles| cycles.1 -= 1).is_some(),
        "a tick in time",
    ),
    (
        "a worst case after a missed tick one less",
        |of| of.sections[1].cycles.missed.as_mut().map(|cycles| cycles.1 -= 1).is_some(),
        "a missed tick",
    ),
    (
        "a publication one cycle earlier",
        |of| of.sections[1].published.as_mut().map(|times| times.refilled.1 -= 1).is_some(),
        "published` takes",
    ),
    ("no publication", |of| of.sections[1].published.take().is_some(), "not of the same kind"),
    ("a section left out", |of| of.sections.pop().is_some(), "has no claim"),
    (
        "a section that does not exist",
        |of| {
            of.sections[0].address = 3;
            true
        },
        "is not proved",
    ),
    (
        "no proof",
        |of| {
            of.proofs.clear();
            true
        },
        "no proof",
    ),
    (
        "an edge a cycle shorter",
        |of| first(places(of), |place| place.edges[0].cycles = (0, place.edges[0].cycles.1 - 1)),
        "the edge",
    ),
    (
        "an edge whose best case is a cycle longer",
        |of| first(places(of), |place| place.edges[0].cycles.0 += 1),
        "the edge",
    ),
    (
        "a place reached a cycle earlier",
        |of| first(places(of).filter(|place| place.cycles.1 > 0), |place| place.cycles.1 -= 1),
        "the way to bundle",
    ),
    ("an entry before cycle 0", |of| first(places(of), |place| place.cycles.1 = -1), "the first place takes"),
    (
        "an edge left out",
        |of| first(places(of).filter(|place| place.edges.len() == 2), |place| _ = place.edges.pop()),
        "ways lead on",
    ),
    (
        "an edge that no run takes, as is claimed",
        |of| first(places(of), |place| place.edges[0].to = Target::None),
        "has no edge",
    ),
    (
        "two edges of a branch swapped",
        |of| {
            let branches =
                places(of).filter(|place| place.edges.len() == 2 && matches!(place.step, Step::To(_)));
            first(branches, |place| {
                let (to, other) = (place.edges[0].to, place.edges[1].to);
                (place.edges[0].to, place.edges[1].to) = (other, to);
            })
        },
        "",
    ),
    (
        "an edge back to its own place",
        |of| first(places(of), |place| place.edges[0].to = Target::Place(0)),
        "no later one",
    ),
    (
        "an edge to a place that does not exist",
        |of| first(places(of), |place| place.edges[0].to = Target::Place(u32::MAX)),
        "no later one",
    ),
    (
        "an edge to an exit that does not exist",
        |of| first(places(of), |place| place.edges[0].to = Target::Exit(u32::MAX)),
        "has no exit",
    ),
    ("a place at another bundle", |of| first(places(of).skip(1), |place| place.at += 1), ""),
    (
        "a straight line that ends a bundle earlier",
        |of| {
            let long = places(of).filter(|place| matches!(place.step, Step::To(last) if last > place.at));
            first(long, |place| {
                if let Step::To(last) = &mut place.step {
                    *last -= 1
                }
            })
        },
        "",
    ),
    (
        "a straight line beyond a branch",
        |of| {
            first(places(of), |place| {
                if let Step::To(last) = &mut place.step {
                    *last += 1
                }
            })
        },
        "ends here",
    ),
    (
        "a call as a straight line",
        |of| {
            let calls = places(of).filter(|place| matches!(place.step, Step::Call(..)));
            first(calls, |place| {
                if let Step::Call(last, _) = place.step {
                    place.step = Step::To(last)
                }
            })
        },
        "no lemma of its subroutine",
    ),
    (
        "a call of another lemma",
        |of| {
            let calls = places(of).filter(|place| matches!(place.step, Step::Call(_, lemma) if lemma > 0));
            first(calls, |place| {
                if let Step::Call(_, lemma) = &mut place.step {
                    *lemma = 0
                }
            })
        },
        "",
    ),
    (
        "a lemma that proves itself",
        |of| {
            let loops = places(of).filter(|place| matches!(place.step, Step::Loop(_)));
            first(loops, |place| place.step = Step::Loop(u32::MAX))
        },
        "does not stand before",
    ),
    (
        "a result that is there a cycle earlier",
        |of| {
            first(states(of).filter(|state| state.pending.iter().any(|one| one.1 > 1)), |state| {
                state.pending.iter_mut().find(|one| one.1 > 1).expect("one").1 -= 1;
            })
        },
        "the result for",
    ),
    (
        "a result that is not in flight",
        |of| first(states(of).filter(|state| !state.pending.is_empty()), |state| state.pending.clear()),
        "the result for",
    ),
    (
        "a unit that is free",
        |of| first(states(of).filter(|state| !state.busy.is_empty()), |state| state.busy.clear()),
        "units are busy",
    ),
    (
        "a register whose value is not known",
        |of| first(states(of).skip(1), |state| state.known.push((1023, 7))),
        "is not known to be 7",
    ),
    (
        "a count that is not known",
        |of| first(states(of).filter(|state| state.count.is_none()), |state| state.count = Some(1)),
        "count that is claimed",
    ),
    (
        "a state that no machine has",
        |of| first(states(of), |state| state.pending.push((0, 64))),
        "cannot have a result in flight",
    ),
    ("published from the beginning", |of| first(states(of), |state| state.published = true), ""),
    (
        "an iteration fewer",
        |of| {
            first(turns(of).filter(|(turns, steady)| turns.len() > 1 && steady.is_none()), |(turns, _)| {
                turns.pop();
            })
        },
        "is missing",
    ),
    (
        "a recurrence a cycle shorter",
        |of| {
            first(turns(of).filter(|(_, steady)| steady.is_some()), |(_, steady)| {
                *steady = steady.map(|(best, worst)| (best.min(1), worst - 1));
            })
        },
        "a further iteration takes",
    ),
    (
        "no recurrence",
        |of| first(turns(of).filter(|(_, steady)| steady.is_some()), |(_, steady)| *steady = None),
        "is missing",
    ),
    (
        "an iteration that begins a cycle earlier",
        |of| {
            let later = turns(of).flat_map(|(turns, _)| turns.iter_mut().skip(1).flatten());
            first(later, |turn| turn.cycles.1 -= 1)
        },
        "the way to iteration",
    ),
    (
        "an exit of a loop a cycle earlier",
        |of| {
            let exits = of.proofs[0].lemmas.iter_mut().filter_map(|lemma| match lemma {
                Lemma::Loop { exits, .. } => exits.first_mut(),
                Lemma::Code { .. } => None,
            });
            first(exits, |exit| exit.cycles.1 -= 1)
        },
        "the way to bundle",
    ),
    (
        "an exit to another bundle",
        |of| {
            let exits = of.proofs[0].lemmas.iter_mut().flat_map(|lemma| match lemma {
                Lemma::Code { exits, .. } | Lemma::Loop { exits, .. } => exits,
            });
            let go = exits.filter_map(|exit| match &mut exit.end {
                End::Go { to, .. } => Some(to),
                _ => None,
            });
            first(go, |to| *to += 1)
        },
        "is claimed to be one",
    ),
    (
        "an edge back that is none",
        |of| {
            let exits = of.proofs[0].lemmas.iter_mut().flat_map(|lemma| match lemma {
                Lemma::Code { exits, .. } | Lemma::Loop { exits, .. } => exits,
            });
            let go = exits.filter_map(|exit| match &mut exit.end {
                End::Go { back, .. } if *back => Some(back),
                _ => None,
            });
            first(go, |back| *back = false)
        },
        "is claimed to be one",
    ),
    (
        "a price",
        |of| {
            of.proofs[0].prices.push((0, 5));
            true
        },
        "no loop with a promised total",
    ),
    ("a higher price", |of| first(of.proofs[1].prices.iter_mut(), |price| price.1 += 1), ""),
    ("an entry left out", |of| of.proofs[0].entries.pop().is_some(), "no entry for"),
    (
        "no section that runs once",
        |of| {
            of.proofs[0].entries.remove(0);
            true
        },
        "runs once has no entry",
    ),
    (
        "an entry that is not the soonest",
        |of| {
            first(of.proofs[0].entries.iter_mut().filter(|entry| entry.soonest && !entry.once), |entry| {
                entry.soonest = false;
            })
        },
        "no entry for this `wait`",
    ),
    (
        "an entry with another section's lemma",
        |of| {
            of.proofs[0].entries[1].lemma = 0;
            true
        },
        "not that of this section",
    ),
    (
        "a number of cycles beyond all limits",
        |of| first(places(of), |place| place.edges[0].cycles = (0, i64::MAX)),
        "",
    ),
];

/// A section whose `publish` is left out, as if it had come before the section began.
#[test]
fn a_publication_cannot_be_claimed_away() {
    let program = assembled(
        "early.s",
        &MemoryLoader::of(
            "early.s",
            ".input x\n.output y\n.period\np: mov y, x\n publish\n nop\n wait p\n".to_owned(),
        ),
        &T3,
    );
    let program = program.expect("it assembles");
    let (_, mut certificate) = certify(&program).expect("it has bounds");
    let proof = &mut certificate.proofs[0];
    for entry in &mut proof.entries {
        let begin = proof.states[entry.state as usize].clone();
        entry.state = proof.states.len() as u32;
        proof.states.push(begin);
    }
    let begins = proof.states.len() - proof.entries.len();
    proof.states[..begins].iter_mut().for_each(|state| state.published = true);
    for lemma in &mut proof.lemmas {
        let Lemma::Code { places, exits } = lemma else { continue };
        exits.retain(|exit| !matches!(exit.end, End::Publish { .. }));
        places.iter_mut().for_each(|place| place.edges.truncate(1));
    }
    certificate.sections.iter_mut().for_each(|section| section.published = None);
    let text = serde_json::to_string(&certificate).expect("it is plain data");
    let error = check(&program, text.as_bytes()).expect_err("it publishes").to_string();
    assert!(error.contains("claimed wrongly whether a `publish`"), "{error}");
}

/// Iterations that are cheaper than their price: the fewest of them are the worst case of the loop, not the most.
#[test]
fn cheap_iterations_are_not_taken_for_granted() {
    let mut found = 0;
    for [a, b] in [[0, 1], [1, 0]] {
        let nops = " nop\n".repeat(8);
        let text = format!(
            ".input n:int, k:int\n.output y:int\n.reg r:int q:int m:int c:int\n.period\np: li r, {a}\n iadd c, r, 1\n \
             loop c, e\n.loop_bound 3\n nop\ne: mov q, n\n call f\n li r, {b}\n mov q, k\n call f\n mov y, m\n wait p\n\
             f: mov m, q\n{nops}{nops}.loop_bound 8 total 10\nnext: isub m, m, 1\n bz r, short\n{nops}short: bnz m, next\n ret\n"
        );
        let program = assembled("cheap.s", &MemoryLoader::of("cheap.s", text), &T3).expect("it assembles");
        let (_, text) = certified("cheap.s", &program, &bound(&program).expect("it has bounds"));
        let certificate: Certificate = serde_json::from_str(&text).expect("it is one");
        for at in 0..certificate.proofs[1].lemmas.len() {
            let mut changed = certificate.clone();
            let Lemma::Loop { steady: Some((_, ..0)), exits, .. } = &mut changed.proofs[1].lemmas[at] else {
                continue;
            };
            exits[0].cycles.1 -= 1;
            found += 1;
            let text = serde_json::to_string(&changed).expect("it is plain data");
            let error = check(&program, text.as_bytes()).expect_err("it is too little").to_string();
            assert!(error.contains("the way to bundle"), "{error}");
        }
    }
    assert!(found > 0);
}

/// A branch is taken for decided by a value that an operation has replaced.
#[test]
fn a_value_that_is_overwritten_decides_no_branch() {
    let text = ".input n:int\n.reg m:int\n.preset m = 1\n.once\n iadd m, m, n\n bz m, on\n nop\non: halt\n";
    let program =
        assembled("value.s", &MemoryLoader::of("value.s", text.to_owned()), &T3).expect("it assembles");
    let (_, mut certificate) = certify(&program).expect("it has bounds");
    let (register, value) = program.constants[0];
    let proof = &mut certificate.proofs[0];
    let begin = State { known: vec![(register.get(), value)], ..State::default() };
    proof.states.push(begin);
    let number = proof.states.len() as u32 - 1;
    proof.entries[0].state = number;
    let Lemma::Code { places, .. } = &mut proof.lemmas[0] else { panic!("it has no loop") };
    places[0].state = number;
    let known = serde_json::to_string(&certificate).expect("it is plain data");
    check(&program, known.as_bytes()).expect("the value is that at reset");
    let Lemma::Code { places, .. } = &mut certificate.proofs[0].lemmas[0] else { panic!("it has no loop") };
    places[0].edges[0].to = Target::None;
    let decided = serde_json::to_string(&certificate).expect("it is plain data");
    let error = check(&program, decided.as_bytes()).expect_err("it depends on an input").to_string();
    assert!(error.contains("has no edge"), "{error}");
}

#[test]
fn changed_certificates_are_refused_each_with_its_reason() {
    let mut applied = vec![0; CHANGES.len()];
    let mut wrong = Vec::new();
    for machine in [&T3, &T1] {
        let program = whole(machine);
        let (_, certificate) = certify(&program).expect("it has bounds");
        certified("whole.s", &program, &bound(&program).expect("it has bounds"));
        assert_eq!(certificate.proofs.len(), 2, "one proof uses the total");
        for ((what, change, reason), applied) in CHANGES.iter().zip(&mut applied) {
            let mut changed = certificate.clone();
            if !change(&mut changed) || changed == certificate {
                continue;
            }
            *applied += 1;
            let text = serde_json::to_string(&changed).expect("it is plain data");
            match check(&program, text.as_bytes()) {
                Ok(_) => wrong.push(format!("{what}: accepted")),
                Err(error) if !error.to_string().contains(reason) => wrong.push(format!("{what}: {error}")),
                Err(_) => {}
            }
        }
    }
    let unused = CHANGES.iter().zip(applied).filter(|(_, applied)| *applied == 0);
    wrong.extend(unused.map(|((what, ..), _)| format!("{what}: nothing is changed")));
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Changes of any number in a certificate: no panic, and what is accepted is no better than what is proved.
#[test]
fn random_changes_of_numbers_are_refused_or_claim_less() {
    let program = whole(&T3);
    let bounds = bound(&program).expect("it has bounds");
    let (_, text) = certified("whole.s", &program, &bounds);
    let honest: Certificate = serde_json::from_str(&text).expect("it is one");
    let digits: Vec<usize> = (0..text.len()).filter(|at| text.as_bytes()[*at].is_ascii_digit()).collect();
    let mut random = Random::new(7);
    let (mut refused, mut accepted) = (0, 0);
    for _ in 0..number("TAKT_CHANGES").unwrap_or(3000) {
        let mut changed = text.clone();
        let at = digits[random.below(digits.len() as u32) as usize];
        match random.below(4) {
            0 => changed.replace_range(at..=at, &random.below(10).to_string()),
            1 => changed.insert_str(at, &(1 + random.below(99)).to_string()),
            2 => changed.insert_str(at + 1, "000000000000000"),
            _ => changed.truncate(at),
        }
        match check(&program, changed.as_bytes()) {
            Err(_) => refused += 1,
            Ok(proved) => {
                accepted += 1;
                for (claim, honest) in proved.sections.iter().zip(&honest.sections) {
                    let (claim, honest) = (claim.cycles.refilled, honest.cycles.refilled);
                    assert!(claim.0 <= honest.0 && claim.1 >= honest.1, "{changed}");
                }
            }
        }
    }
    assert!(refused > 10 * accepted, "{refused} refused, {accepted} accepted");
}

#[test]
fn files_that_are_no_certificates_are_refused() {
    let program = whole(&T3);
    let nested = "[".repeat(100_000);
    for text in ["", "{}", "[]", "null", "{\"format\": 1}", "\u{0}", &nested] {
        let error = check(&program, text.as_bytes()).expect_err("it is no certificate").to_string();
        assert!(error.contains("no certificate"), "{error}");
    }
}

/// Programs whose counted loops are entered or left otherwise than by `loop` and their last bundle: the sequencer's count says nothing of them.
#[test]
fn counted_loops_that_are_entered_or_left_elsewhere_are_refused() {
    let head = ".input n:int\n.reg k:int\n.preset k = 3\n.once\n";
    let cases = [
        (" loop k, end\nhead: nop\n bnz n, on\n nop\non: nop\nend: halt\n", ""),
        (" loop k, end\nhead: nop\n bnz n, head\n nop\nend: halt\n", "enters or leaves"),
        (" loop k, end\nhead: nop\n bnz n, end\n nop\nend: halt\n", "enters or leaves"),
        (" loop k, end\nhead: nop\n bnz n, far\n nop\nend: halt\nfar: halt\n", "enters or leaves"),
        (" bnz n, in\n loop k, end\nhead: nop\nin: nop\n nop\nend: halt\n", "enters or leaves"),
        (" call in\n loop k, end\nhead: nop\nin: nop\n nop\nend: ret\n", "enters or leaves"),
        (" loop k, end\nhead: bnz n, on\n halt\non: nop\nend: halt\n", "enters or leaves"),
        (" loop k, end\n nop\nend: loop k, end\n halt\n", "does not end"),
    ];
    for (text, wanted) in cases {
        let text = format!("{head}{text}");
        let program =
            assembled("loop.s", &MemoryLoader::of("loop.s", text.clone()), &T3).expect("it assembles");
        let found = bound(&program).is_ok();
        assert_eq!(found, wanted.is_empty(), "{text}");
        // The program is refused for every certificate: here for one without a proof.
        let (_, mut empty) = certify(&whole(&T3)).expect("it has bounds");
        empty.program = takt_isa::certificate::fingerprint(&program);
        empty.proofs.clear();
        let error = check(&program, serde_json::to_string(&empty).expect("it is plain data").as_bytes());
        let error = error.expect_err("nothing is proved").to_string();
        assert!(error.contains(if wanted.is_empty() { "no proof" } else { wanted }), "{text}: {error}");
    }
}
