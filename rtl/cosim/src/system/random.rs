// SPDX-License-Identifier: MIT OR Apache-2.0
//! Random systems, their programs, and the actions of their host.

use super::lockstep::SystemLockstep;
use crate::random::with_inputs_at;
use crate::{LockstepError, Simulation};
use std::collections::BTreeMap;
use std::sync::Arc;
use takt_emu::testing::{Options, Random, random_program};
use takt_isa::timing::Cycle;
use takt_isa::{Machine, Program};
use takt_rtl::system::SystemPlan;
use takt_system::testing::random_description;
use takt_system::{Description, End, LinkKind};

/// Cycles of a random system, unless a core stops it earlier.
pub const CYCLES: Cycle = 4000;

/// Counts of the events in random runs.
#[derive(Clone, Debug, Default)]
pub struct Coverage {
    /// Number of completed runs.
    pub runs: u64,
    /// Cycles of all runs.
    pub cycles: u64,
    /// Events and pins that were equal on both sides.
    pub compared: u64,
    /// Runs in which base ticks started.
    pub started: u64,
    /// Runs stopped by a fault.
    pub faults: u64,
    /// Number of missed deadlines.
    pub missed: u64,
}

/// Random system and its [`variants`].
pub fn systems(seed: u64, machines: &[&'static Machine], count: u64) -> Vec<Description> {
    variants(random_description(seed, machines), seed, count)
}

/// Variants of a system that differ only in their random programs: one circuit with different memory contents. Ports and presets of
/// output ports stay the first system's, because they are part of the circuit.
pub fn variants(first: Description, seed: u64, count: u64) -> Vec<Description> {
    let others = (1..count).map(|number| {
        let mut other = first.clone();
        for (i, core) in other.cores.iter_mut().enumerate() {
            let seed = seed.wrapping_mul(0x2545_f491).wrapping_add(number << 8 | i as u64);
            core.program = Arc::new(another(&core.program, seed));
        }
        other
    });
    let others: Vec<Description> = others.collect();
    [first].into_iter().chain(others).collect()
}

fn another(first: &Program, seed: u64) -> Program {
    let machine = first.machine;
    // Few bundles, so that some periods write no port; many, so that some periods exceed the interval of ticks.
    let bundles = 2 + Random::new(seed).below(45);
    let program = random_program(seed, machine, Options { bundles, ..Options::TAME });
    let inputs: Vec<_> = first.inputs.iter().map(|port| port.register).collect();
    let program = with_inputs_at(program, &inputs);
    let presets: BTreeMap<_, _> =
        first.constants.iter().copied().filter(|(register, _)| machine.is_output(*register)).collect();
    let constants = program
        .constants
        .iter()
        .map(|&(register, bits)| (register, presets.get(&register).copied().unwrap_or(bits)));
    let constants = constants.collect();
    Program { latched: first.latched, constants, ..program }
}

/// Runs a system on both sides, with a host controlled by the seed, and adds to the coverage.
///
/// # Errors
/// A difference, or the end of the simulation.
pub fn run(
    seed: u64,
    description: &Description,
    plan: &SystemPlan,
    simulation: Simulation,
    coverage: &mut Coverage,
) -> Result<(), LockstepError> {
    let mut random = Random::new(!seed);
    let mut lockstep = SystemLockstep::new(description, plan, simulation)?;
    let mut running = true;
    while running && lockstep.system().now() < CYCLES {
        for (number, link) in description.links.iter().enumerate() {
            if link.from == End::Host && random.once_in(2) {
                let values: Vec<u32> = link.fields.iter().map(|_| random.word()).collect();
                // Several wires may carry one value of the host.
                if !shares_a_name(description, number) {
                    lockstep.write(number, &values)?;
                }
            }
            if link.to == End::Host && matches!(link.kind, LinkKind::Fifo { .. }) && random.once_in(2) {
                lockstep.pop(number)?;
            }
        }
        let step = if seed.is_multiple_of(4) { 12 } else { 300 };
        running = lockstep.run_until(lockstep.system().now() + u64::from(1 + random.below(step)))?;
    }
    lockstep.finish()?;
    coverage.runs += 1;
    coverage.cycles += lockstep.system().now();
    coverage.compared += lockstep.compared();
    coverage.started += u64::from(lockstep.system().start().is_some());
    coverage.faults += u64::from(lockstep.fault().is_some());
    let cores = 0..description.cores.len();
    coverage.missed += cores.map(|core| lockstep.system().core(core).statistics().missed).sum::<u64>();
    Ok(())
}

/// An earlier wire from the host has the same name.
fn shares_a_name(description: &Description, number: usize) -> bool {
    let link = &description.links[number];
    let mut before = description.links[..number].iter();
    matches!(link.kind, LinkKind::Wire)
        && before.any(|other| {
            matches!(other.kind, LinkKind::Wire)
                && other.from == End::Host
                && other.fields[0].from == link.fields[0].from
        })
}
