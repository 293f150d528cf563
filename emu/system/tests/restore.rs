// SPDX-License-Identifier: MIT OR Apache-2.0
//! Systems that go on: written files give the same system, and resumed states the same run, whatever cycle they were taken in.

use takt_emu::testing::Random;
use takt_isa::Register;
use takt_system::testing::{all_machines, describe, random_description};
use takt_system::{Core, Description, Host, LinkKind, System, write};

#[test]
fn written_files_are_the_systems() {
    let mut kinds = [0; 3];
    for seed in 0..200 {
        let description = random_description(seed, &all_machines());
        let programs = description.cores.iter().enumerate();
        let programs = programs.map(|(number, core)| (format!("{number}.takt"), (*core.program).clone()));
        let text = write(&description, |number| format!("{number}.takt"));
        let read = describe(&text, &programs.collect()).unwrap_or_else(|error| panic!("{error}\n{text}"));
        let paths = description.cores.iter().map(|core| core.path.clone());
        let cores = read.cores.into_iter().zip(paths).map(|(core, path)| Core { path, ..core });
        let read = Description { cores: cores.collect(), ..read };
        assert_eq!(format!("{read:?}"), format!("{description:?}"), "seed {seed}\n{text}");
        for link in &description.links {
            kinds[match link.kind {
                LinkKind::Wire => 0,
                LinkKind::Snapshot { .. } => 1,
                LinkKind::Fifo { .. } => 2,
            }] += 1;
        }
    }
    assert!(kinds.iter().all(|count| *count > 100), "{kinds:?}");
}

/// Everything that tells two runs apart, but for counts.
fn seen(system: &System) -> String {
    let mut text = format!("{} {:?} {:?}\n", system.now(), system.start(), system.fault());
    for (number, core) in system.description().cores.iter().enumerate() {
        let emulator = system.core(number);
        // The next tick alone copies latched inputs to the program, so nothing can tell when their own side changed.
        let inputs = core.program.inputs.iter().filter(|_| core.program.latched);
        let inputs: Vec<Register> = inputs.map(|port| port.register).collect();
        let registers = Register::all().filter(|register| !inputs.contains(register));
        let registers: Vec<_> = registers.map(|register| emulator.register(register)).collect();
        let status = emulator.status();
        text += &format!(
            "{} {status:?} {:?} {registers:?} {:?}\n",
            core.name,
            emulator.flags(),
            emulator.memory()
        );
    }
    for port in system.description().outputs() {
        text += &format!("{} {:?}\n", port.name, system.output(&port.name));
    }
    for link in 0..system.description().links.len() {
        text += &format!("{:?} {:?}\n", system.fifo_entries(link), system.fifo_counts(link));
    }
    text
}

#[test]
fn resumed_states_go_on_as_the_run_did() {
    let (mut resumed, mut busy, mut taken) = (0, 0, 0);
    for seed in 0..150 {
        let description = random_description(seed, &all_machines());
        let host = Host::new(&description);
        let columns = host.columns(&description);
        let mut random = Random::new(!seed);
        let mut system = System::new(&description).unwrap();
        let mut other: Option<System> = None;
        let mut until = 0;
        while until < 6000 {
            let row = columns.iter().map(|column| (column.register, random.word())).collect();
            until += u64::from(1 + random.below(400));
            let run = |system: &mut System| {
                host.write(system, &row).unwrap();
                let fault = system.run_until(until).is_err();
                (host.read(system).unwrap(), fault)
            };
            let (values, fault) = run(&mut system);
            if let Some(other) = &mut other {
                assert_eq!(run(other), (values, fault), "seed {seed}");
                assert_eq!(seen(other), seen(&system), "seed {seed}");
            }
            if fault {
                break;
            }
            match system.waiting_state() {
                Ok(state) => {
                    taken += u64::from(format!("{state:?}").contains("taken: true"));
                    let text = serde_json::to_string(&state.transit).unwrap();
                    assert_eq!(serde_json::from_str::<takt_system::Transit>(&text).unwrap(), state.transit);
                    let next =
                        System::resume(&description, &state).unwrap().expect("the state is the system's");
                    assert_eq!(next.waiting_state().as_ref(), Ok(&state), "seed {seed}");
                    other = Some(next);
                    resumed += 1;
                }
                Err(_) => busy += 1,
            }
        }
    }
    // States of every kind: also with a tick that a core has been promised.
    assert!(resumed > 150 && busy > 300 && taken > 3, "{resumed} {busy} {taken}");
}

#[test]
fn impossible_states_are_refused() {
    let mut random = Random::new(7);
    let (mut refused, mut accepted) = (0, 0);
    for seed in 0..60 {
        let description = random_description(seed, &all_machines());
        let mut system = System::new(&description).unwrap();
        let state = (100..6000).step_by(97).find_map(|cycle| {
            system.run_until(cycle).ok()?;
            system.waiting_state().ok()
        });
        let Some(state) = state else { continue };
        let text = serde_json::to_string(&state.transit).unwrap();
        // Each number in turn is replaced by one that may be of no state: an error, or a run that ends, but no panic.
        let ends: Vec<usize> = text.match_indices(|c: char| c.is_ascii_digit()).map(|(at, _)| at).collect();
        for _ in 0..40 {
            let at = ends[random.below(ends.len() as u32) as usize];
            let digit = ["0", "7", "99", "18446744073709551615"][random.below(4) as usize];
            let tampered = format!("{}{digit}{}", &text[..at], &text[at + 1..]);
            let Ok(transit) = serde_json::from_str(&tampered) else { continue };
            let tampered = takt_system::WaitingSystem { transit, ..state.clone() };
            match System::resume(&description, &tampered).unwrap() {
                None => refused += 1,
                Some(mut system) => {
                    accepted += 1;
                    let _ = system.run_until(system.now() + 3000);
                }
            }
        }
        let mut other = state.clone();
        other.cores.pop();
        assert!(System::resume(&description, &other).unwrap().is_none());
    }
    assert!(refused > 100 && accepted > 100, "{refused} {accepted}");
}
