// SPDX-License-Identifier: MIT OR Apache-2.0
//! Export of a machine's complete circuit as Verilog files.
//!
//! The fixed parts are the modules in `rtl/core/` and `rtl/units/`. The rest is generated from the tables: [`Plan`] holds all sizes and
//! names, and the modules in `src/parts/` write the text.

use crate::circuit::Library;
use crate::files::{CORE, PAIR};
use crate::parts;
use crate::plan::{Plan, PlanError};
use crate::verilog::ModuleError;
use takt_family::{FAMILIES, Family};
use takt_isa::Machine;
use thiserror::Error;

pub use crate::plan::{RESET_CYCLES, synthesis_top};
pub use takt_isa::timing::{ENDED_DELAY, INPUT_DELAY, LATCHED_INPUT_DELAY, TICK_DELAY};

/// Reason why a machine has no circuit.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ExportError {
    /// Invalid row, or one that the circuit does not support.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// Names in the row that collide with names in the circuit.
    #[error(transparent)]
    Module(#[from] ModuleError),
}

/// A file of the design.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DesignFile {
    /// Path inside the design's folder.
    pub name: String,
    /// Verilog text of the module.
    pub text: String,
}

/// Circuit of a machine, as Verilog.
#[derive(Clone, Debug)]
pub struct Design {
    /// Row from which the circuit is generated.
    pub machine: &'static Machine,
    /// Sizes and names of everything generated.
    pub plan: Plan,
    /// Module name of the core, or of the pair.
    pub top: String,
    /// Verilog files, each with one module of the same name.
    pub files: Vec<DesignFile>,
    /// Default of the core's parameter `LATCHED`: 0 or, for a program with latched ports, its
    /// [`latched_inputs`](takt_isa::Program::latched_inputs). [`export`] sets 0, [`Design::latching`] changes it.
    pub latched: u16,
    /// Cycles by which a second core is later; `None` without one. [`Design::paired`] adds it.
    pub second: Option<u32>,
}

impl DesignFile {
    /// Name without the folder.
    pub fn base(&self) -> &str {
        self.name.rsplit('/').next().unwrap_or(&self.name)
    }
}

/// Modules of a family's own cells, in the folder of its name.
pub fn modules(family: &Family) -> Vec<DesignFile> {
    let file = |&(name, text): &(&str, &str)| DesignFile {
        name: format!("{}/{name}", family.name),
        text: text.to_owned(),
    };
    family.modules.iter().map(file).collect()
}

/// A design's files for a family: its own modules in place of the general ones of the same name.
pub fn on_family(files: &[DesignFile], family: &Family) -> Vec<DesignFile> {
    let own = modules(family);
    let general = files.iter().filter(|file| own.iter().all(|module| module.base() != file.base()));
    general.cloned().chain(own.iter().cloned()).collect()
}

/// Modules and lists of files of every family that has modules of its own: `takt_t3_NAME.f`, in which they replace the general ones.
pub(crate) fn family_files(top: &str, files: &[DesignFile]) -> Vec<DesignFile> {
    let mut more = Vec::new();
    for family in FAMILIES.iter().filter(|family| !family.modules.is_empty()) {
        more.extend(modules(family));
        let text = on_family(files, family).iter().map(|file| format!("{}\n", file.name)).collect();
        more.push(DesignFile { name: format!("{top}_{}.f", family.name), text });
    }
    more
}

impl Design {
    /// Changes the default of the core's parameter `LATCHED` to `latched`.
    ///
    /// # Errors
    /// See [`export`].
    pub fn latching(mut self, latched: u16) -> Result<Design, ExportError> {
        self.put(&self.plan.top(), parts::core(&self.plan, latched)?);
        if let Some(delay) = self.second {
            self.put(&self.plan.pair(), parts::pair(&self.plan, latched, delay)?);
        }
        Ok(Design { latched, ..self })
    }

    /// Adds a second core, `delay` cycles later, whose outputs are compared with the first one's: the top becomes the pair.
    ///
    /// # Errors
    /// See [`export`].
    pub fn paired(mut self, delay: u32) -> Result<Design, ExportError> {
        self.put(&self.plan.pair(), parts::pair(&self.plan, self.latched, delay)?);
        let modules = PAIR.iter().map(|&(name, text)| (format!("pair/{name}"), text.to_owned()));
        self.files.extend(modules.map(|(name, text)| DesignFile { name, text }));
        Ok(Design { top: self.plan.pair(), second: Some(delay), ..self })
    }

    /// Declaration of the net `differs` around the top: 0 without a second core.
    pub(crate) fn differs_net(&self) -> &'static str {
        if self.second.is_some() { "wire        differs;" } else { "wire        differs = 1'b0;" }
    }

    /// Connection of the top's port `differs` behind its other ports, if it has one.
    pub fn differs_port(&self) -> &'static str {
        if self.second.is_some() { ", .differs(differs)" } else { "" }
    }

    /// Sets the text of a generated module.
    fn put(&mut self, module: &str, text: String) {
        let name = format!("{module}.v");
        match self.files.iter_mut().find(|file| file.name == name) {
            Some(file) => file.text = text,
            None => self.files.insert(0, DesignFile { name, text }),
        }
    }
}

/// Generates the circuit of a machine.
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
    Ok(Design { machine, top: plan.top(), files, latched: 0, second: None, plan })
}
