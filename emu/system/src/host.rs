// SPDX-License-Identifier: MIT OR Apache-2.0
//! Host of a system that works in rows: one row of inputs and one row of outputs in each base tick.

use crate::{Description, End, HostAction, HostError, Link, LinkKind, System, SystemPort};
use takt_emu::Row;
use takt_isa::program::Port;
use takt_isa::{Register, Type};

/// A system that accepts host actions, or a system and its circuit in lockstep.
pub trait HostSide {
    /// Reason why an action fails.
    type Error;

    /// Executes a host action; see [`System::act`].
    ///
    /// # Errors
    /// If the system has no such input or link.
    fn act(&mut self, action: &HostAction) -> Result<bool, Self::Error>;

    /// The emulated system.
    fn system(&self) -> &System;
}

impl HostSide for System {
    type Error = HostError;

    fn act(&mut self, action: &HostAction) -> Result<bool, HostError> {
        System::act(self, action)
    }

    fn system(&self) -> &System {
        self
    }
}

/// Suffix of a column's name that tells whether a row pushes an entry into a FIFO.
const PUSH: &str = "push";

/// Host that writes and reads rows: meanings of the columns.
#[derive(Clone, Debug)]
pub struct Host {
    /// Input ports of the system: the first columns of a row of inputs.
    pub inputs: Vec<SystemPort>,
    /// Snapshots that each row publishes, as indices of links.
    pub snapshots: Vec<usize>,
    /// FIFOs that a row may push to, as indices of links: the further columns of a row of inputs.
    pub pushes: Vec<usize>,
    /// FIFOs from which each row takes an entry, as indices of links.
    pub pops: Vec<usize>,
    /// Output ports of the system: the columns of a row of outputs.
    pub outputs: Vec<SystemPort>,
}

impl Host {
    /// Host of a system.
    pub fn new(description: &Description) -> Host {
        let links = |wanted: &dyn Fn(&Link) -> bool| -> Vec<usize> {
            let numbered = description.links.iter().enumerate();
            numbered.filter(|(_, link)| wanted(link)).map(|(number, _)| number).collect()
        };
        let fifo = |link: &Link| matches!(link.kind, LinkKind::Fifo { .. });
        Host {
            inputs: description.inputs(),
            snapshots: links(&|link| link.is_snapshot() && link.from == End::Host),
            pushes: links(&|link| fifo(link) && link.from == End::Host),
            pops: links(&|link| fifo(link) && link.to == End::Host),
            outputs: description.outputs(),
        }
    }

    /// Input columns, in the order of their values.
    pub fn columns(&self, description: &Description) -> Vec<Port> {
        // A table needs a register for each column; which one does not matter.
        let port = |name, ty| Port { name, register: Register::ZERO, ty };
        let inputs = self.inputs.iter().map(|input| port(input.name.clone(), input.ty));
        let pushes = self.pushes.iter().map(|link| port(Host::push_column(description, *link), Type::I));
        inputs.chain(pushes).collect()
    }

    /// Name of the push column of a FIFO.
    pub fn push_column(description: &Description, link: usize) -> String {
        format!("{}.{PUSH}", description.links[link].name)
    }

    /// Executes the actions of a row; returns the number of rejected entries.
    ///
    /// # Errors
    /// If an action fails, as no action of a row with a value for each column does on a system itself.
    pub fn write<S: HostSide>(&self, system: &mut S, row: &Row) -> Result<u64, S::Error> {
        let (inputs, pushes) = row.split_at(self.inputs.len());
        for (input, (_, bits)) in self.inputs.iter().zip(inputs) {
            system.act(&HostAction::Input { name: input.name.clone(), bits: *bits })?;
        }
        for &link in &self.snapshots {
            system.act(&HostAction::Publish(link))?;
        }
        let mut refused = 0;
        for (&link, (_, push)) in self.pushes.iter().zip(pushes) {
            if *push != 0 && !system.act(&HostAction::Push(link))? {
                refused += 1;
            }
        }
        Ok(refused)
    }

    /// Outputs as the host sees them now. Pops one entry from each FIFO; `None` if the FIFO is empty.
    ///
    /// # Errors
    /// If an action fails, as none does on a system itself.
    pub fn read<S: HostSide>(&self, system: &mut S) -> Result<Vec<Option<u32>>, S::Error> {
        let value = |output: &SystemPort| system.system().field_bits(output.link, output.field);
        let mut values: Vec<Option<u32>> = self.outputs.iter().map(value).collect();
        for &link in &self.pops {
            if !system.act(&HostAction::Pop(link))? {
                let fields = self.outputs.iter().zip(&mut values).filter(|(output, _)| output.link == link);
                fields.for_each(|(_, value)| *value = None);
            }
        }
        Ok(values)
    }
}
