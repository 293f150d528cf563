//! Systems of several cores: their circuit against their emulator.
#![allow(clippy::print_stdout)]

use std::path::PathBuf;
use std::sync::OnceLock;
use takt_cosim::system::{SystemLockstepError, SystemModel, random};
use takt_isa::spec::units::*;
use takt_isa::{Bank, Machine, Slot, T1};
use takt_rtl::{Library, SystemDesign, export_system};
use takt_system::{Description, End, LinkKind};

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR"))
}

/// Small cores, which compile soon: it is what is between them that is tested here. One with a single slot, one with two, whose
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
        slots: Vec::leak(vec![
            slot("sum", "a", 0, &[ADD]),
            slot("all", "r", 128, &[ALU, MEMORY, SEQUENCER]),
        ]),
        inputs,
        outputs_per_bank: 16,
        code_depth: 256,
        data_depth: 128,
        ..T1
    });
    [one, two]
}

/// The circuit of a system for the programs of several.
fn design(systems: &[Description], name: &str) -> SystemDesign {
    let designs = systems.iter().map(|system| {
        export_system(system, name, &Library::builtin()).unwrap_or_else(|error| panic!("{error}"))
    });
    designs.max_by_key(|design| design.records).expect("a system")
}

/// What kinds of links systems have, in words.
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

/// `TAKT_SYSTEMS` random systems, 3 unless stated, each with several sets of programs.
#[test]
fn random_systems() {
    let count: u64 = std::env::var("TAKT_SYSTEMS").map_or(3, |text| text.parse().expect("a number"));
    let mut seen = std::collections::BTreeSet::new();
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
                .unwrap_or_else(|error: SystemLockstepError| panic!("system {seed}, programs {number}: {error}"));
        }
    }
    println!("{coverage:?}\n{seen:?}");
}
