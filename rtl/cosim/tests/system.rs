// SPDX-License-Identifier: MIT OR Apache-2.0
//! Lockstep of systems of several cores.
#![allow(clippy::print_stdout)]

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::OnceLock;
use takt_cosim::LockstepError;
use takt_cosim::random::{places, with_inputs_at};
use takt_cosim::system::{PROBE, SystemModel, random};
use takt_emu::testing::{Options, random_program};
use takt_isa::spec::units::*;
use takt_isa::{Bank, Machine, Program, Slot, T1};
use takt_rtl::{Library, SystemDesign, export_system};
use takt_system::testing::describe;
use takt_system::{Description, End, LinkKind};

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR"))
}

/// Small cores, which compile fast, because the test is about their surroundings: one with a single slot, and one with two slots, whose
/// output ports are in two banks.
fn machines() -> [&'static Machine; 2] {
    static ONE: OnceLock<Machine> = OnceLock::new();
    static TWO: OnceLock<Machine> = OnceLock::new();
    let inputs = Bank { name: "i", base: 896, depth: 128 };
    let slot = |name, bank, base, units| Slot { name, bank: Bank { name: bank, base, depth: 64 }, units };
    let one = ONE.get_or_init(|| Machine {
        name: "one",
        slots: Vec::leak(vec![slot("all", "r", 0, &[ALU, MEMORY, SEQUENCER])]),
        inputs,
        outputs_per_bank: 16,
        code_depth: 256,
        data_depth: 128,
        ..T1
    });
    let two = TWO.get_or_init(|| Machine {
        name: "two",
        slots: Vec::leak(vec![slot("sum", "a", 0, &[ADD]), slot("all", "r", 128, &[ALU, MEMORY, SEQUENCER])]),
        inputs,
        outputs_per_bank: 16,
        code_depth: 256,
        data_depth: 128,
        ..T1
    });
    [one, two]
}

/// Circuit of a system, with room for the programs of all `systems`.
fn design(systems: &[Description], name: &str) -> SystemDesign {
    let designs = systems.iter().map(|system| {
        export_system(system, name, &Library::builtin()).unwrap_or_else(|error| panic!("{error}"))
    });
    designs.max_by_key(|design| design.records).expect("a system")
}

/// Kinds of a system's links, as text.
fn kinds(description: &Description) -> Vec<&'static str> {
    let kind = |link: &takt_system::Link| match (&link.kind, link.from, link.to) {
        (LinkKind::Wire, End::Host, _) => "wire from the host",
        (LinkKind::Wire, _, End::Host) => "wire to the host",
        (LinkKind::Wire, ..) if description.core(link.from).is_some_and(|core| core.program.latched) => {
            "wire from latched ports"
        }
        (LinkKind::Wire, ..) => "wire",
        (LinkKind::Snapshot { .. }, End::Host, _) => "snapshot from the host",
        (LinkKind::Snapshot { .. }, _, End::Host) => "snapshot to the host",
        (LinkKind::Snapshot { strobe: Some(_) }, ..) => "snapshot by strobe",
        (LinkKind::Snapshot { .. }, ..) => "snapshot",
        (LinkKind::Fifo { .. }, End::Host, _) => "fifo from the host",
        (LinkKind::Fifo { .. }, _, End::Host) => "fifo to the host",
        (LinkKind::Fifo { .. }, ..) => "fifo",
    };
    description.links.iter().map(kind).collect()
}

/// Random systems (`TAKT_SYSTEMS`, by default 3), each with several sets of programs.
#[test]
fn random_systems() {
    let count: u64 = std::env::var("TAKT_SYSTEMS").map_or(3, |text| text.parse().expect("a number"));
    let mut seen = BTreeSet::new();
    let mut coverage = random::Coverage::default();
    for seed in 0..count {
        let systems = random::systems(seed, &machines(), 12);
        seen.extend(kinds(&systems[0]));
        let design = design(&systems, "random");
        let model = SystemModel::build(&design, &folder(), false).unwrap_or_else(|error| panic!("{error}"));
        for (number, system) in systems.iter().enumerate() {
            let image = design.image_of(system).expect("the circuit has room for the largest image");
            let simulation = model.start(&image, &[]).unwrap_or_else(|error| panic!("{error}"));
            random::run(number as u64, system, &design.plan, simulation, &mut coverage)
                .unwrap_or_else(|error: LockstepError| panic!("system {seed}, programs {number}: {error}"));
        }
    }
    println!("{coverage:?}\n{seen:?}");
    // Every kind of link occurred, with every kind of end.
    assert!(count < 3 || seen.len() == 11, "{seen:?}");
    assert!(coverage.started == coverage.runs && coverage.missed > 0, "{coverage:?}");
}

/// Three cores with a link of every kind, with delays of every kind: none, flip-flops, a ring.
const LINKS: &str = r#"
tick = 61

[[core]]
name = "a"
program = "a.s"

[[core]]
name = "b"
program = "b.s"
offset = 21

[[core]]
name = "c"
program = "c.s"
tick = 2
offset = 3

[[wire]]
from = "a.A0"
to = "b.in0"
latency = 6

[[wire]]
from = "b.B0"
to = "a.in0"
latency = 12

[[wire]]
from = "host.h"
to = "c.in0"
latency = 40

[[wire]]
from = "c.A0"
to = "host.o"

[[wire]]
from = "a.A1"
to = "host.p"

[[snapshot]]
name = "strobed"
from = "b"
to = "a"
ports = ["B0 -> in1", "B1 -> in2"]
strobe = "B2"

[[snapshot]]
name = "waited"
from = "a"
to = "c"
ports = ["A1 -> in1", "A0 -> in2"]

[[snapshot]]
name = "commanded"
from = "host"
to = "b"
ports = ["x -> in1"]

[[fifo]]
name = "queue"
from = "c"
to = "b"
ports = ["A1 -> in2"]
depth = 3
push = "A0"
pop = "B3"
sender = { overflow = "in3" }
receiver = { count = "in3" }

[[fifo]]
name = "orders"
from = "host"
to = "a"
ports = ["y -> in3"]
depth = 2
pop = "A1"

[[fifo]]
name = "answers"
from = "b"
to = "host"
ports = ["B1", "B0"]
depth = 40
latency = 5
push = "B1"
"#;

/// The system [`LINKS`] with random programs, whose input ports are spread over their bank; core a has latched ports.
fn with_every_link() -> Description {
    let [one, two] = machines();
    let programs: BTreeMap<String, Program> = [("a.s", one, 1), ("b.s", two, 2), ("c.s", one, 3)]
        .map(|(path, machine, seed)| {
            let program = random_program(seed, machine, Options::TAME);
            let program = with_inputs_at(program, &places(machine));
            (path.to_owned(), Program { latched: seed == 1, ..program })
        })
        .into();
    let mut text = LINKS.to_owned();
    for (letter, path) in [("A", "a.s"), ("B", "b.s")] {
        for (i, port) in programs[path].outputs.iter().enumerate() {
            for (before, after) in [("\"", "\""), (".", "\""), ("\"", " ->")] {
                let [from, to] =
                    [format!("{letter}{i}"), port.name.clone()].map(|name| format!("{before}{name}{after}"));
                text = text.replace(&from, &to);
            }
        }
    }
    describe(&text, &programs).unwrap_or_else(|error| panic!("{error:?}"))
}

/// Fault: module, an expression that occurs once in it, and its replacement.
type Fault = (&'static str, &'static str, &'static str);

#[rustfmt::skip]
const FAULTS: &[Fault] = &[
    // Delay: a cycle too short, a cycle too long.
    ("takt_delay", "all[(LENGTH+1)*(WIDTH+1)-1 -: WIDTH+1]", "all[LENGTH*(WIDTH+1)-1 -: WIDTH+1]"),
    ("takt_delay", "ring[next]", "ring[at]"),
    // Wire: another value. From latched ports: sent without a write, sent twice.
    ("takt_wire", "{write, value}", "{write, value[30:0], 1'b0}"),
    ("takt_wire", "publish & changed", "publish"),
    ("takt_wire", "write | (changed & ~publish)", "write | changed"),
    // Snapshot: half old and half new; values still in transit; taken a cycle early, or by a core that does not wait.
    ("takt_snapshot", "HOST ? arrived : working", "(working & {FIELDS{32'hffff0000}}) | (shown & {FIELDS{32'h0000ffff}})"),
    ("takt_snapshot", "HOST ? arrived : working", "arrived"),
    ("takt_snapshot", "HOST ? arrived : working", "working"),
    ("takt_pace", "left == TAKE[BITS-1:0]", "left == TAKE[BITS-1:0] + 1'b1"),
    ("takt_system_links", "c_take & c_waiting", "c_take"),
    // FIFO: flags that are not sticky, room after a pop that stays unused, an unreported refusal, and the like.
    ("takt_fifo", "overflow | refused", "refused"),
    ("takt_fifo", "underflow | missed", "missed"),
    ("takt_fifo", "~full | popped", "~full"),
    ("takt_fifo", "put & full & ~popped", "1'b0"),
    ("takt_fifo", "popped & count != ONE", "popped"),
    ("takt_fifo", "put | pop", "pushed | popped"),
    ("takt_fifo", "pushed & free == next", "1'b0"),
    ("takt_fifo", "words[first]", "words[free]"),
    ("takt_fifo", "{empty, full, count, overflow, underflow}", "{empty, full, count, 1'b0, underflow}"),
    ("takt_fifo", "write[f] ? value[32*f +: 32] : working[32*f +: 32]", "working[32*f +: 32]"),
    // FIFO: wraps at a power of two instead of its depth, for the next entry and for the first.
    ("takt_fifo", "free == LAST[ADDRESS-1:0]", "&free"),
    ("takt_fifo", "first == LAST[ADDRESS-1:0]", "&first"),
    // Loader: a record left out.
    ("takt_loader", "state == 2'd1", "state == 2'd1 & next != 3"),
    // Gate: one of two ports whose numbers differ in a bit, the last mailbox first, an old value that stays, a newer value that is lost.
    ("takt_gate", "NUMBERS[INDEX*i +: INDEX]", "(NUMBERS[INDEX*i +: INDEX] & ~64)"),
    ("takt_gate", "next & (~next + 1'b1)", "next & ~((next >> 1) | (next >> 2) | (next >> 3))"),
    ("takt_gate", "arrives[k]", "arrives[k] & ~waits[k]"),
    ("takt_gate", "arrives | (waits & ~goes)", "(arrives & ~waits) | (waits & ~goes)"),
    // Ticks: before all cores have waited, at a cycle that is not a multiple of their interval, at a wrong interval.
    ("takt_start", "&(waited | waiting | halted)", "|(waited | waiting | halted)"),
    ("takt_start", "left == {BITS{1'b0}} ? LAST[BITS-1:0] : left - 1'b1", "left == {BITS{1'b0}} ? LAST[BITS-1:0] - 1'b1 : left - 1'b1"),
    ("takt_pace", "left == {BITS{1'b0}} ? LAST[BITS-1:0] : left - 1'b1", "left == {BITS{1'b0}} ? LAST[BITS-1:0] - 1'b1 : left - 1'b1"),
];

/// Number of sets of programs that a fault may survive before it counts as not found.
const VARIANTS: u64 = 32;

/// A single simulation holds all faults, and `+fault=` selects a fault; each fault is found.
#[test]
fn planted_faults_are_found() {
    let systems = random::variants(with_every_link(), 1, VARIANTS);
    let whole = design(&systems, "links");
    let mut design = whole.clone();
    // Faults that replace the same expression share a multiplexer.
    let mut places: BTreeMap<(&str, &str), String> = BTreeMap::new();
    for (number, &(module, from, to)) in FAULTS.iter().enumerate() {
        let text = places.entry((module, from)).or_insert_with(|| format!("({from})"));
        *text = format!("({PROBE}.planted == {} ? ({to}) : {text})", number + 1);
    }
    for ((module, from), text) in places {
        let own = format!("{module}.v");
        let file = design.files.iter_mut().find(|file| file.name.rsplit('/').next() == Some(&own));
        let file = file.unwrap_or_else(|| panic!("no module {module}"));
        assert_eq!(file.text.matches(from).count(), 1, "`{from}` must occur once in {module}");
        file.text = file.text.replace(from, &text);
    }
    let model = SystemModel::build(&design, &folder(), false).unwrap_or_else(|error| panic!("{error}"));
    let mut survivors = Vec::new();
    for number in 0..=FAULTS.len() {
        let argument = format!("+fault={number}");
        let mut found = None;
        for (set, system) in systems.iter().enumerate() {
            let image = whole.image_of(system).expect("the circuit has room for the largest image");
            let simulation =
                model.start(&image, &[argument.as_ref()]).unwrap_or_else(|error| panic!("{error}"));
            match random::run(set as u64, system, &whole.plan, simulation, &mut random::Coverage::default()) {
                Ok(()) => {}
                Err(LockstepError::Difference(difference)) => {
                    found = Some((set, difference));
                    break;
                }
                Err(error) => panic!("{error}"),
            }
        }
        match (number.checked_sub(1).map(|index| FAULTS[index]), found) {
            (None, None) => {}
            (None, Some((set, difference))) => panic!("without a fault, programs {set}: {difference}"),
            (Some(fault), None) => survivors.push(format!("{fault:?}")),
            (Some(fault), Some((set, difference))) => {
                println!(
                    "{} `{}`: programs {set}, cycle {}, {}",
                    fault.0, fault.2, difference.cycle, difference.place
                );
            }
        }
    }
    assert!(survivors.is_empty(), "not found:\n{}", survivors.join("\n"));
}
