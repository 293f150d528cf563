// SPDX-License-Identifier: MIT OR Apache-2.0
//! Emulator, whose cores run ahead, against the cycle-by-cycle reference, on random systems.

use takt_emu::testing::Random;
use takt_isa::{Register, timing::Cycle};
use takt_system::testing::{Reference, all_machines, random_description};
use takt_system::{Description, End, LinkEventKind, LinkKind, System};

const SYSTEMS: u64 = 60;
const CYCLES: Cycle = 4000;

/// Random actions of the host between two chunks.
fn host(random: &mut Random, description: &Description, system: &mut System, reference: &mut Reference) {
    for (number, link) in description.links.iter().enumerate() {
        if link.from == End::Host && random.once_in(2) {
            let values: Vec<u32> = link.fields.iter().map(|_| random.word()).collect();
            for (field, &value) in link.fields.iter().zip(&values) {
                let name = match link.kind {
                    LinkKind::Wire => field.from.clone(),
                    _ => format!("{}.{}", link.name, field.from),
                };
                system.set_input(&name, value).unwrap();
            }
            match link.kind {
                LinkKind::Wire => {}
                LinkKind::Snapshot { .. } => system.publish(number).unwrap(),
                LinkKind::Fifo { .. } => {
                    system.push(number).unwrap();
                }
            }
            reference.write(number, &values);
        }
        if link.to == End::Host && matches!(link.kind, LinkKind::Fifo { .. }) && random.once_in(2) {
            let head = reference.fifo_entries(number).first().cloned();
            assert_eq!(system.pop(number).unwrap(), head);
            if head.is_some() {
                reference.pop(number);
            }
        }
    }
}

fn assert_same(seed: u64, description: &Description, system: &System, reference: &Reference) {
    let now = reference.now();
    assert_eq!(system.start(), reference.start(), "seed {seed}: start in cycle {now}");
    for (number, core) in description.cores.iter().enumerate() {
        let (fast, step) = (system.core(number), reference.core(number));
        let place = |what: &str| format!("seed {seed}: {what} of {} in cycle {now}", core.name);
        assert_eq!(fast.now(), step.now(), "{}", place("now"));
        assert_eq!(fast.status(), step.status(), "{}", place("status"));
        for register in Register::all() {
            let name = core.program.register_text(register);
            assert_eq!(fast.register(register), step.register(register), "{}", place(&name));
        }
        assert_eq!(fast.memory(), step.memory(), "{}", place("memory"));
        assert_eq!(fast.statistics(), step.statistics(), "{}", place("statistics"));
    }
    for (number, link) in description.links.iter().enumerate() {
        assert_eq!(system.fifo_entries(number), reference.fifo_entries(number), "seed {seed}: {}", link.name);
    }
    for port in description.outputs() {
        let value = reference.output(port.link, port.field);
        assert_eq!(system.output(&port.name).unwrap(), value, "seed {seed}: {} in cycle {now}", port.name);
    }
}

#[test]
fn random_systems_agree() {
    let (mut faults, mut started, mut missed) = (0, 0, 0);
    let mut seen = std::collections::BTreeMap::new();
    for seed in 0..SYSTEMS {
        let description = random_description(seed, &all_machines());
        let mut system = System::new(&description).unwrap();
        let mut reference = Reference::new(&description).unwrap();
        system.keep_events();
        // Observation must not change the run.
        if seed % 2 == 0 {
            system.keep_core_events();
        }
        let mut random = Random::new(!seed);
        let mut failed = None;
        while reference.now() < CYCLES && failed.is_none() {
            host(&mut random, &description, &mut system, &mut reference);
            let until = reference.now() + u64::from(1 + random.below(if seed % 4 == 0 { 12 } else { 900 }));
            while reference.now() < until && failed.is_none() {
                failed = reference.step().err();
            }
            let result = system.run_until(until).map_err(|fault| (fault.core, fault.fault));
            assert_eq!(result.err(), failed, "seed {seed}");
            if failed.is_none() {
                assert_same(seed, &description, &system, &reference);
            }
            for event in system.take_events() {
                let kind = match event.kind {
                    LinkEventKind::Value(_) => "value".to_owned(),
                    kind => format!("{kind:?}"),
                };
                *seen.entry(kind).or_insert(0) += 1;
            }
        }
        faults += u64::from(failed.is_some());
        started += u64::from(system.start().is_some());
        let cores = 0..description.cores.len();
        missed += cores.map(|core| system.core(core).statistics().missed).sum::<u64>();
    }
    // The systems show events of every kind.
    let kinds: Vec<&str> = seen.keys().map(String::as_str).collect();
    let all = ["Overflow", "Popped", "Published", "Pushed", "Skipped", "Taken", "Underflow", "value"];
    assert_eq!(kinds, all, "{seen:?}");
    assert!(started > SYSTEMS / 2 && missed > 0 && faults < SYSTEMS / 4, "{started} {missed} {faults}");
}
