// SPDX-License-Identifier: MIT OR Apache-2.0
//! Export of a machine's complete circuit as Verilog files.
//!
//! The fixed parts are the modules in `rtl/core/` and `rtl/units/`. The rest is generated from the tables: [`Plan`] holds all sizes and
//! names, and the modules in `src/parts/` write the text.

use crate::circuit::Library;
use crate::files::{CORE, ECC, File, PAIR};
use crate::parts;
use crate::plan::names::net;
use crate::plan::{Plan, PlanError};
use crate::verilog::{ModuleError, Net};
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

/// Mechanisms against random faults of the circuit (docs/safety.md); by default there are none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Safety {
    /// Memories have codes that detect and correct errors, and a scrubber.
    pub ecc: bool,
    /// Cycles by which a second core is later, whose outputs are compared with the first one's; `None` without one.
    pub second_core: Option<u32>,
}

impl Safety {
    /// The mechanisms in words, behind a machine's name; empty without any.
    pub fn text(self) -> String {
        let ecc = if self.ecc { " with error correction" } else { "" };
        let second = self.second_core.map(|delay| format!(" and a second core, {delay} cycles later"));
        format!("{ecc}{}", second.unwrap_or_default())
    }

    /// Ports that a core has for the mechanisms, behind its other ones.
    pub fn ports(self) -> Vec<Net> {
        let differs = self.second_core.map(|_| net::DIFFERS);
        let ecc = self.ecc.then_some([net::CORRECTIONS, net::UPSET]);
        differs.into_iter().chain(ecc.into_iter().flatten()).collect()
    }

    /// Declarations, on lines of a module, of nets around a core for the ports of all mechanisms, `suffix` behind the ports' names: 0
    /// without the mechanism.
    pub fn nets(self, suffix: &str) -> String {
        let (all, has) = (Safety { ecc: true, second_core: Some(1) }.ports(), self.ports());
        let nets = all.iter().map(|net| {
            let (name, width) = (net.name(), net.width());
            let range = if width > 1 { format!("[{}:0]", width - 1) } else { String::new() };
            let value = if has.contains(net) { String::new() } else { format!(" = {width}'d0") };
            format!("wire {range:6} {name}{suffix}{value};")
        });
        nets.collect::<Vec<_>>().join("\n    ")
    }

    /// Connections of a core's ports for mechanisms to those nets, behind its other ports.
    pub fn connections(self, suffix: &str) -> String {
        self.ports().iter().map(|net| format!(", .{0}({0}{suffix})", net.name())).collect()
    }
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
    /// Mechanisms of the circuit. [`export`] adds none, [`Design::with`] adds them.
    pub safety: Safety,
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
        if let Some(delay) = self.safety.second_core {
            self.put(&self.plan.pair(), parts::pair(&self.plan, latched, delay)?);
        }
        Ok(Design { latched, ..self })
    }

    /// Adds mechanisms: with a second core, the top becomes the pair.
    ///
    /// # Errors
    /// See [`export`].
    pub fn with(mut self, safety: Safety) -> Result<Design, ExportError> {
        let files = |folder: &str, modules: &[File]| {
            let file =
                |&(name, text): &File| DesignFile { name: format!("{folder}/{name}"), text: text.to_owned() };
            modules.iter().map(file).collect::<Vec<_>>()
        };
        if safety.ecc {
            self.plan.ecc = true;
            self.files.retain(|file| file.base() != "takt_program.v");
            self.files.extend(files("ecc", ECC));
        }
        if safety.second_core.is_some() {
            self.top = self.plan.pair();
            self.files.extend(files("pair", PAIR));
        }
        self.safety = safety;
        let latched = self.latched;
        self.latching(latched)
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
    Ok(Design { machine, top: plan.top(), files, latched: 0, safety: Safety::default(), plan })
}
