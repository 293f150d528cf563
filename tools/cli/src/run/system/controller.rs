// SPDX-License-Identifier: MIT OR Apache-2.0
//! Controller of the hybrid robot: a system in which one core computes the points of the path.

use super::observers::Observer;
use crate::run::deny::{Denials, DenyArguments};
use anyhow::{Context, Result, bail};
use takt_analysis::period::PERIOD_LIMIT;
use takt_isa::Register;
use takt_isa::timing::Cycle;
use takt_programs::hybrid::Outputs;
use takt_programs::hybrid::closed_loop::{Inputs, TrackingController};
use takt_programs::hybrid::generation::{Block, FIELDS};
use takt_programs::hybrid::ports::{INPUTS, OUTPUTS, REFERENCE_LEN};
use takt_system::{Description, HostError, LinkKind, System, SystemFault};

/// Name of the FIFO of motion blocks.
const BLOCKS: &str = "blocks";
/// Number of encoders, which are the first inputs.
const AXES: usize = 5;

/// A system as a controller that computes its own reference.
pub(crate) struct SystemController {
    pub(crate) system: System,
    observer: Observer,
    /// Names of a motion block's fields in the system.
    fields: [String; FIELDS.len()],
    fifo: usize,
    depth: usize,
    waiting: std::vec::IntoIter<Block>,
    /// Link and field that carry each output.
    outputs: [(usize, usize); OUTPUTS.len()],
    /// Core that computes the points, and its registers.
    generation: usize,
    point: [Register; REFERENCE_LEN],
    /// Cycle of the host's next write, and the distance between writes.
    next: Cycle,
    tick: Cycle,
}

/// Errors after which the system cannot continue to control the robot.
#[derive(Debug, thiserror::Error)]
pub(crate) enum StepError {
    #[error("{0}")]
    Fault(#[from] SystemFault),
    #[error(transparent)]
    Host(#[from] HostError),
    #[error("the FIFO `{BLOCKS}` has overflowed")]
    Overflow,
}

impl SystemController {
    pub(crate) fn new(
        description: &Description,
        path: Vec<Block>,
        deny: &DenyArguments,
    ) -> Result<SystemController> {
        let inputs: Vec<String> = description.inputs().into_iter().map(|port| port.name).collect();
        let given = |name: &str| inputs.iter().any(|known| known == name);
        let fields = FIELDS.map(|field| format!("{BLOCKS}.{field}"));
        let encoders = INPUTS[..AXES].iter().map(|port| port.name);
        if let Some(none) = encoders.chain(fields.iter().map(String::as_str)).find(|name| !given(name)) {
            bail!(
                "this system cannot control the hybrid robot: it has no input `{none}` (see programs/hybrid/two.toml)"
            );
        }
        let fifo = description.link_named(BLOCKS).context("its inputs have this link")?;
        let LinkKind::Fifo { depth, .. } = description.links[fifo].kind else {
            bail!("this system cannot control the hybrid robot: `{BLOCKS}` is not a FIFO");
        };
        let known = description.outputs();
        let mut outputs = [(0, 0); OUTPUTS.len()];
        for (place, port) in outputs.iter_mut().zip(&OUTPUTS) {
            let found = known.iter().find(|output| output.name == port.name);
            let found = found.with_context(|| {
                format!("this system cannot control the hybrid robot: it has no output `{}`", port.name)
            })?;
            *place = (found.link, found.field);
        }
        let generation = match description.links[fifo].to {
            takt_system::End::Core(core) => core,
            takt_system::End::Host => bail!(
                "this system cannot control the hybrid robot: the FIFO `{BLOCKS}` must lead to a core, not back to the host"
            ),
        };
        let core = &description.cores[generation];
        let mut point = [Register::ZERO; REFERENCE_LEN];
        for (register, port) in point.iter_mut().zip(&INPUTS[AXES..]) {
            let found = core.program.outputs.iter().find(|output| output.name == port.name);
            let found =
                found.with_context(|| format!("core {} does not compute `{}`", core.name, port.name))?;
            *register = found.register;
        }
        let mut system = System::new(description)?;
        let mut observer = Observer::watching(&mut system, deny);
        let start = system.run_to_start(PERIOD_LIMIT)?;
        let start = start.context("the cores do not reach their first ticks")?;
        observer.observe(&mut system);
        Ok(SystemController {
            system,
            observer,
            fields,
            fifo,
            depth: depth as usize,
            waiting: path.into_iter(),
            outputs,
            generation,
            point,
            next: start - description.lead(),
            tick: description.tick,
        })
    }

    /// Denied events that occurred, for each core.
    pub(crate) fn denials(&self) -> Vec<Denials> {
        self.observer.denials(&self.system)
    }

    /// Runs a base tick: pushes a block if there is room, writes the encoder counts, and runs the system up to the next tick.
    pub(crate) fn tick(&mut self, counts: [i32; AXES]) -> Result<(), StepError> {
        self.system.run_until(self.next)?;
        // Push one block per tick: the FIFO's count does not yet include entries in transit.
        if self.system.fifo_entries(self.fifo).len() < self.depth
            && let Some(block) = self.waiting.next()
        {
            for (name, word) in self.fields.iter().zip(block.to_words()) {
                self.system.set_input(name, word)?;
            }
            if !self.system.push(self.fifo)? {
                return Err(StepError::Overflow);
            }
        }
        for (port, count) in INPUTS.iter().zip(counts) {
            self.system.set_input(port.name, count.cast_unsigned())?;
        }
        self.next += self.tick;
        let result = self.system.run_until(self.next);
        self.observer.observe(&mut self.system);
        Ok(result?)
    }

    /// Point of this tick; 0 until the first one is computed.
    pub(crate) fn point(&self) -> [f32; REFERENCE_LEN] {
        let core = self.system.core(self.generation);
        self.point.map(|register| f32::from_bits(core.output_bits(register).unwrap_or(0)))
    }
}

impl TrackingController for SystemController {
    type Error = StepError;

    fn step(&mut self, inputs: &Inputs) -> Result<Outputs<f64>, StepError> {
        self.tick(inputs.counts)?;
        let bits = self.outputs.map(|(link, field)| self.system.field_bits(link, field).unwrap_or(0));
        Ok(Outputs::from_array(bits.map(|bits| f64::from(f32::from_bits(bits)))))
    }
}
