// SPDX-License-Identifier: MIT OR Apache-2.0
//! The complete circuit of a machine, as Verilog files.
//!
//! The fixed parts are the modules in `rtl/core/` and `rtl/units/`. The rest is generated from the tables: [`Plan`] has all sizes and
//! names, and the modules in `src/parts/` write the text.

use crate::circuit::Library;
use crate::files::{CORE, ECP5};
use crate::parts;
use crate::plan::{Plan, PlanError};
use crate::verilog::ModuleError;
use takt_isa::Machine;
use thiserror::Error;

pub use crate::plan::synthesis_top;
pub use takt_isa::timing::{ENDED_DELAY, INPUT_DELAY, LATCHED_INPUT_DELAY, TICK_DELAY};

/// The reason why a machine has no circuit.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ExportError {
    /// Its row is invalid, or the circuit does not support it.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// Names in the row give a name in the circuit that is already used.
    #[error(transparent)]
    Module(#[from] ModuleError),
}

/// A file of the design.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DesignFile {
    /// Path inside the design's folder.
    pub name: String,
    /// Contents.
    pub text: String,
}

/// The circuit of a machine.
#[derive(Clone, Debug)]
pub struct Design {
    /// The machine.
    pub machine: &'static Machine,
    /// The plan: all that was generated, by name.
    pub plan: Plan,
    /// Name of the core's module.
    pub top: String,
    /// Verilog files, each with the one module of its name.
    pub files: Vec<DesignFile>,
    /// Modules that replace those of the same name on Lattice ECP5.
    pub ecp5: Vec<DesignFile>,
    /// The core's parameter `LATCHED`: 0 or, for a program whose ports are latched, its
    /// [`latched_inputs`](takt_isa::Program::latched_inputs). Its default is 0 unless [`Design::latching`] changes it.
    pub latched: u16,
}

/// Cycles for which reset must be held, so that every pipeline is empty afterwards.
pub const RESET_CYCLES: u64 = takt_isa::spec::units::MAX_LATENCY as u64;

impl Design {
    /// The design for programs with `latched` latched inputs, which becomes the default of the core's parameter.
    ///
    /// # Errors
    /// Those of [`export`].
    pub fn latching(mut self, latched: u16) -> Result<Design, ExportError> {
        let name = format!("{}.v", self.top);
        let text = parts::core(&self.plan, latched)?;
        self.files.iter_mut().filter(|file| file.name == name).for_each(|file| file.text.clone_from(&text));
        Ok(Design { latched, ..self })
    }
}

/// The circuit of a machine.
///
/// # Errors
/// If the core's modules do not support the machine, or a unit has no circuit.
pub fn export(machine: &'static Machine, library: &Library) -> Result<Design, ExportError> {
    let plan = Plan::new(machine, library)?;
    let mut files = Vec::new();
    let mut put = |name: String, text: String| {
        if !files.iter().any(|file: &DesignFile| file.name == name) {
            files.push(DesignFile { name, text });
        }
    };
    put(format!("{}.v", plan.top()), parts::core(&plan, 0)?);
    for slot in &plan.slots {
        put(format!("{}.v", plan.decoder(slot)), parts::decoder(&plan, slot)?);
    }
    for &(name, text) in CORE {
        put(format!("core/{name}"), text.to_owned());
    }
    for circuit in plan.slots.iter().flat_map(|slot| &slot.circuits) {
        for file in &circuit.files {
            let text = library.text(file).unwrap_or_default().to_owned();
            let name = file.rsplit('/').next().unwrap_or(file);
            let name = if name.starts_with("takt_") { name.to_owned() } else { format!("takt_{name}") };
            put(format!("units/{name}"), text);
        }
    }
    let ecp5 =
        ECP5.iter().map(|&(name, text)| DesignFile { name: format!("ecp5/{name}"), text: text.to_owned() });
    Ok(Design { machine, top: plan.top(), files, ecp5: ecp5.collect(), latched: 0, plan })
}
