// SPDX-License-Identifier: MIT OR Apache-2.0
//! Host in a run of a system: one row of inputs and one row of outputs per base tick.

use anyhow::Result;
use takt_cosim::system::SystemLockstep;
use takt_debug::system::TickActions;
use takt_isa::program::Port;
use takt_isa::{Register, Type};
use takt_system::{Description, End, HostAction, LinkKind, System, SystemPort};

/// A system that accepts host actions, or the two systems of a lockstep.
pub(crate) trait HostSide {
    /// Executes a host action; see [`System::act`].
    fn act(&mut self, action: &HostAction) -> Result<bool>;

    fn system(&self) -> &System;
}

impl HostSide for System {
    fn act(&mut self, action: &HostAction) -> Result<bool> {
        Ok(System::act(self, action)?)
    }

    fn system(&self) -> &System {
        self
    }
}

impl HostSide for SystemLockstep {
    fn act(&mut self, action: &HostAction) -> Result<bool> {
        Ok(SystemLockstep::act(self, action)?)
    }

    fn system(&self) -> &System {
        SystemLockstep::system(self)
    }
}

/// Suffix of a column's name that tells whether a row pushes an entry into a FIFO.
const PUSH: &str = "push";

/// Host of a run: meanings of the table's columns.
pub(crate) struct Host {
    pub(crate) inputs: Vec<SystemPort>,
    /// Snapshots that the host publishes.
    snapshots: Vec<usize>,
    /// FIFOs that the host pushes to.
    pushes: Vec<usize>,
    /// FIFOs that the host pops from.
    pub(crate) pops: Vec<usize>,
    pub(crate) outputs: Vec<SystemPort>,
}

impl Host {
    pub(crate) fn new(description: &Description) -> Host {
        let links = |wanted: &dyn Fn(&takt_system::Link) -> bool| -> Vec<usize> {
            let numbered = description.links.iter().enumerate();
            numbered.filter(|(_, link)| wanted(link)).map(|(number, _)| number).collect()
        };
        let fifo = |link: &takt_system::Link| matches!(link.kind, LinkKind::Fifo { .. });
        Host {
            inputs: description.inputs(),
            snapshots: links(&|link| link.is_snapshot() && link.from == End::Host),
            pushes: links(&|link| fifo(link) && link.from == End::Host),
            pops: links(&|link| fifo(link) && link.to == End::Host),
            outputs: description.outputs(),
        }
    }

    /// Input columns, in the order of their values.
    pub(crate) fn columns(&self, description: &Description) -> Vec<Port> {
        // The table needs a register for each column; which one does not matter.
        let port = |name, ty| Port { name, register: Register::ZERO, ty };
        let inputs = self.inputs.iter().map(|input| port(input.name.clone(), input.ty));
        let pushes = self.pushes.iter().map(|link| port(Host::push_column(description, *link), Type::I));
        inputs.chain(pushes).collect()
    }

    /// Name of the push column of a FIFO.
    pub(crate) fn push_column(description: &Description, link: usize) -> String {
        format!("{}.{PUSH}", description.links[link].name)
    }

    /// Executes the actions of a row; returns the number of rejected entries.
    pub(crate) fn write(&self, system: &mut impl HostSide, row: &takt_emu::Row) -> Result<u64> {
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

    /// Actions of a row, for a debugger.
    pub(crate) fn turn(&self, row: &takt_emu::Row) -> TickActions {
        let (inputs, pushes) = row.split_at(self.inputs.len());
        let inputs = self.inputs.iter().zip(inputs);
        let pushes = self.pushes.iter().zip(pushes).filter(|(_, (_, push))| *push != 0);
        TickActions {
            inputs: inputs.map(|(input, (_, bits))| (input.name.clone(), *bits)).collect(),
            publish: self.snapshots.clone(),
            push: pushes.map(|(link, _)| *link).collect(),
        }
    }

    /// Outputs as the host sees them now. Pops one entry from each FIFO; `None` if the FIFO is empty.
    pub(crate) fn read(&self, system: &mut impl HostSide) -> Result<Vec<Option<u32>>> {
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
