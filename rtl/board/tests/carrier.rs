// SPDX-License-Identifier: MIT OR Apache-2.0
//! Three half bridges on a small carrier: every duty after every other, written in every cycle of a period, and interruptions in every
//! cycle, against rules about whole waveforms that share no code with circuit and model.

use crate::harness::{Part, compare};
use takt_board::VERILOG;
use takt_board::model::Model;

/// Half a period.
const HALF: u32 = 5;
const PERIOD: u32 = 2 * HALF;
/// Cycles of an experiment: a duty from its second period on, another one in the fourth, and two periods to see it.
const SPAN: u32 = 6 * PERIOD;
/// Cycles before the first experiment, in reset.
const BEFORE: u32 = 5 * PERIOD;
/// Cycles from a put to the first in which its duty can act.
const ACTS: u32 = 2;

/// Settings of the half bridges.
#[derive(Clone, Copy, Debug)]
struct Setting {
    dead: u32,
    minimum: u32,
    update: u32,
}

/// All settings: each time of an update, with several dead times and least times.
fn settings() -> Vec<Setting> {
    let times = [(0, 0), (1, 0), (2, 1), (0, 3), (1, 2)];
    let all = (0..4).flat_map(|update| times.map(|(dead, minimum)| Setting { dead, minimum, update }));
    all.collect()
}

/// Cycles of the pulse for a duty: pulses and gaps that are too short are left out.
fn length(duty: u32, setting: Setting) -> u32 {
    let least = setting.dead + setting.minimum.max(1);
    match duty.min(PERIOD) {
        duty if duty < least => 0,
        duty if PERIOD - duty < least => PERIOD,
        duty => duty,
    }
}

/// The pulse's length in force in each cycle, from puts as (cycle, duty) in their order.
fn in_force(cycles: usize, puts: &[(usize, u32)], setting: Setting) -> Vec<u32> {
    let may_begin = |cycle: &usize| match setting.update {
        0 => true,
        1 => cycle.is_multiple_of(PERIOD as usize),
        2 => cycle % PERIOD as usize == HALF as usize,
        _ => cycle.is_multiple_of(HALF as usize),
    };
    let mut force = vec![0; cycles];
    for (cycle, duty) in puts {
        let acts = (cycle + ACTS as usize..).find(may_begin).expect("a place comes");
        force.iter_mut().skip(acts).for_each(|force| *force = length(*duty, setting));
    }
    force
}

/// Pulse in each cycle. In a half before a peak, it begins in the first cycle that is no further from the peak than half the length in
/// force, and lasts until the peak; in a half after a peak, it ends in the first cycle that is as far from the peak.
fn pulse(force: &[u32]) -> Vec<bool> {
    let halves = force.chunks(HALF as usize).enumerate().flat_map(|(number, half)| {
        let rises = number % 2 == 0;
        let edge = half.iter().zip(0..).position(|(length, place)| match rises {
            true => HALF - place <= length.div_ceil(2),
            false => place >= length / 2,
        });
        let edge = edge.unwrap_or(half.len());
        (0..half.len()).map(move |place| (place >= edge) == rises)
    });
    halves.collect()
}

/// Switch that is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Switch {
    Off,
    Low,
    High,
}

/// Switches in each cycle, from the requested ones, with the dead time between two, and the minimum time of one unless it is interrupted.
/// They lag by a cycle.
fn switches(wanted: &[Switch], interrupted: impl Fn(usize) -> bool, setting: Setting) -> Vec<Switch> {
    let (mut rows, mut now) = (vec![Switch::Off], Switch::Off);
    while rows.len() < wanted.len() {
        // The present state begins with the last row, and ends with `last`.
        let begins = rows.len() - 1;
        let may_end = |cycle: usize| {
            let lasts = (cycle - begins + 1) as u32;
            match now {
                Switch::Off => lasts >= setting.dead,
                _ => lasts >= setting.minimum || interrupted(cycle),
            }
        };
        let last = (begins..wanted.len()).find(|cycle| wanted[*cycle] != now && may_end(*cycle));
        let Some(last) = last else {
            rows.resize(wanted.len(), now);
            break;
        };
        rows.resize(last + 1, now);
        now = if now == Switch::Off || setting.dead == 0 { wanted[last] } else { Switch::Off };
        rows.push(now);
    }
    rows
}

/// Pins of three phases from their switches.
fn pins(phases: &[Vec<Switch>; 3], cycle: usize) -> Vec<u32> {
    phases
        .iter()
        .flat_map(|phase| [Switch::High, Switch::Low].map(|on| (phase[cycle] == on).into()))
        .collect()
}

/// Precomputed waveforms, in place of a model.
struct Expected {
    cycle: usize,
    phases: [Vec<Switch>; 3],
}

impl Model for Expected {
    fn outputs(&self) -> Vec<u32> {
        match self.cycle.checked_sub(BEFORE as usize) {
            Some(cycle) if cycle < self.phases[0].len() => pins(&self.phases, cycle),
            _ => vec![0; 6],
        }
    }

    fn clock(&mut self, _: &[u32]) {
        self.cycle += 1;
    }
}

/// Inputs of a cycle.
#[derive(Clone, Copy, Default)]
struct Inputs {
    disabled: bool,
    trip: bool,
    duties: Option<[u32; 3]>,
}

/// Half bridges with their inputs from the first experiment on, and their expected waveforms.
fn part(number: usize, setting: Setting, inputs: Vec<Inputs>) -> Part {
    let phases = [0, 1, 2].map(|phase| {
        let puts: Vec<(usize, u32)> =
            inputs.iter().enumerate().filter_map(|(i, inputs)| Some((i, inputs.duties?[phase]))).collect();
        let pulse = pulse(&in_force(inputs.len(), &puts, setting));
        // The switches follow from the first valley on that comes after a cycle without interruption.
        let stops = |cycle: usize| inputs[cycle].disabled || inputs[cycle].trip;
        let mut follow = false;
        let wanted: Vec<(Switch, bool)> = (0..inputs.len())
            .map(|cycle| {
                let is_valley = cycle > 0 && cycle.is_multiple_of(PERIOD as usize);
                follow = !stops(cycle) && (follow || is_valley && !stops(cycle - 1));
                let switch = match (follow, pulse[cycle]) {
                    (true, true) => Switch::High,
                    (true, false) => Switch::Low,
                    (false, _) if inputs[cycle].trip => Switch::Low,
                    (false, _) => Switch::Off,
                };
                (switch, follow)
            })
            .collect();
        let (wanted, follows): (Vec<Switch>, Vec<bool>) = wanted.into_iter().unzip();
        switches(&wanted, |cycle| !follows[cycle], setting)
    });
    let goes_on = inputs.iter().all(|inputs| !inputs.disabled && !inputs.trip);
    assert!(!goes_on || phases.iter().all(|phase| goes_on_once(phase)), "{setting:?}: two edges in a half");
    let parameters = [
        ("HALF", HALF),
        ("DEAD", setting.dead),
        ("MINIMUM", setting.minimum),
        ("UPDATE", setting.update),
        ("TRIPPED", 1),
    ];
    let takes = ["rst", "enable", "trip", "off", "place", "back", "put", "w_a", "w_b", "w_c", "w_stop"];
    let width = |name: &str| {
        if name == "place" {
            16
        } else if name.starts_with("w_") {
            32
        } else {
            1
        }
    };
    let drives = ["pin_high_a", "pin_low_a", "pin_high_b", "pin_low_b", "pin_high_c", "pin_low_c"];
    Part {
        name: format!("bridges_{number}"),
        module: "takt_pwm3".to_owned(),
        parameters: parameters.map(|(name, value)| (name.to_owned(), value)).to_vec(),
        takes: takes.map(|name| (name.to_owned(), width(name))).to_vec(),
        drives: drives.map(|name| (name.to_owned(), 1)).to_vec(),
        model: Box::new(Expected { cycle: 0, phases }),
        stimulus: Box::new(move |cycle| {
            let now = cycle.checked_sub(BEFORE).and_then(|at| inputs.get(at as usize)).copied();
            let before = Inputs { disabled: true, ..Inputs::default() };
            let Inputs { disabled, trip, duties } = now.unwrap_or(before);
            let [a, b, c] = duties.unwrap_or_default();
            let enable = u32::from(!disabled);
            vec![enable, trip.into(), 0, cycle % HALF, cycle / HALF % 2, duties.is_some().into(), a, b, c, 0]
        }),
    }
}

fn compared(name: &str, inputs: impl Fn(Setting) -> Vec<Inputs>) {
    let cycles = inputs(settings()[0]).len() as u32;
    let mut parts: Vec<Part> =
        settings().into_iter().enumerate().map(|(i, setting)| part(i, setting, inputs(setting))).collect();
    let files: Vec<(&str, String)> = VERILOG.iter().map(|&(name, text)| (name, text.to_owned())).collect();
    // The reset of the harness ends within the cycles before the first experiment.
    let found = compare(name, &files, &mut parts, BEFORE + cycles - 40);
    let found: Vec<String> = found.into_iter().flatten().collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// No switch turns on twice within half a period.
fn goes_on_once(phase: &[Switch]) -> bool {
    [Switch::High, Switch::Low].into_iter().all(|on| {
        let goes = |cycle: &usize| phase[*cycle] == on && phase[cycle - 1] != on;
        let rises: Vec<usize> = (1..phase.len()).filter(goes).collect();
        rises.windows(2).all(|pair| pair[1] - pair[0] >= HALF as usize)
    })
}

#[test]
fn every_duty_follows_every_other_in_every_cycle() {
    compared("duties", |_| {
        let mut inputs = Vec::new();
        let duties = || 0..=PERIOD + 1;
        for (old, new) in duties().flat_map(|old| duties().map(move |new| (old, new))) {
            for at in 0..PERIOD {
                let mut experiment = vec![Inputs::default(); SPAN as usize];
                experiment[(PERIOD - ACTS) as usize].duties = Some([old, new, old]);
                experiment[(3 * PERIOD + at) as usize].duties = Some([new, old, old]);
                inputs.extend(experiment);
            }
        }
        inputs
    });
}

#[test]
fn interruptions_in_every_cycle_keep_the_dead_time() {
    compared("interruptions", |_| {
        let mut inputs = Vec::new();
        for duty in [0, 3, 5, 8, PERIOD] {
            for (at, length) in (0..PERIOD).flat_map(|at| (1..=PERIOD).map(move |length| (at, length))) {
                for kind in 0..3 {
                    let mut experiment = vec![Inputs::default(); SPAN as usize];
                    experiment[(PERIOD - ACTS) as usize].duties = Some([duty, PERIOD - duty, 5]);
                    for (i, inputs) in experiment.iter_mut().skip((2 * PERIOD + at) as usize).enumerate() {
                        let is_in = i < length as usize;
                        inputs.trip = is_in && kind != 1;
                        // A trip that begins while the drive is disabled, and outlasts that.
                        inputs.disabled = is_in && (kind == 1 || kind == 2 && i < 2);
                    }
                    // A duty in the cycle of the interruption.
                    experiment[(2 * PERIOD + at) as usize].duties = Some([PERIOD - duty, duty, 4]);
                    inputs.extend(experiment);
                }
            }
        }
        inputs
    });
}
