// SPDX-License-Identifier: MIT OR Apache-2.0
//! Replays: a core alone repeats its run in a system.

use takt_emu::Event;
use takt_isa::{T1, T3};
use takt_system::testing::random_description;
use takt_system::{Recording, Replay, System};

/// Events of a core by itself.
fn alone(Replay { mut emulator, mut inputs, end }: Replay) -> Vec<Event> {
    let mut events = Vec::new();
    while emulator.now() < end {
        inputs.set(&mut emulator);
        let mut sink = |event: &Event| events.push(event.clone());
        if emulator.observed(&mut sink).step_cycle().is_err() {
            break;
        }
    }
    events
}

#[test]
fn replays_are_the_cores_of_random_systems() {
    let mut waits = 0;
    for seed in 0..40 {
        let description = random_description(seed, &[&T1, &T3]);
        let both = [(); 2].map(|()| System::new(&description).expect("random programs fit"));
        let [mut system, mut seen] = both;
        let mut recording = Recording::new(&mut system);
        seen.keep_core_events();
        // A fault ends both runs at the same cycle.
        for cycle in (500..5000).step_by(500) {
            let running = system.run_until(cycle).is_ok();
            assert_eq!(seen.run_until(cycle).is_ok(), running);
            recording.record(&mut system);
            if !running {
                break;
            }
        }
        let wanted = seen.take_core_events();
        for core in 0..description.cores.len() {
            let replay = recording.replay(&system, core).expect("random programs fit");
            let wanted: Vec<Event> =
                wanted.iter().filter(|(of, _)| *of == core).map(|(_, event)| event.clone()).collect();
            // Replays end with the core's last completed period.
            let is_wait = |event: &Event| matches!(event, Event::Wait { .. });
            let Some(last) = wanted.iter().rposition(is_wait) else { continue };
            waits += wanted.iter().filter(|event| is_wait(event)).count();
            let events = alone(replay);
            assert_eq!(events[..=last.min(events.len() - 1)], wanted[..=last], "seed {seed}, core {core}");
        }
    }
    assert!(waits > 200, "{waits} waits");
}
