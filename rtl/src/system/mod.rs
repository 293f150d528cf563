// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of the circuit of a multi-core system: one top with the cores, a boot memory with their initial contents, the base ticks, the
//! links and the gates, as docs/system.md defines them.
//!
//! The fixed parts are the modules in `rtl/system/` and the cores that [`export()`] generates. The rest is generated from the description:
//! [`SystemPlan`] holds every name, and there is a module here for each part.

mod core;
mod image;
mod links;
mod plan;
mod top;

pub use plan::{Driver, Pin, PinKind, SystemPlan};

use crate::circuit::Library;
use crate::export::{Design, DesignFile, ExportError, Safety, export, family_files};
use crate::files::SYSTEM;
use crate::verilog::ModuleError;
use takt_isa::load::LoadRecord;
use takt_isa::system::Description;
use thiserror::Error;

/// Reason why a system has no circuit.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum SystemError {
    /// A core's machine has no circuit.
    #[error("core {core}: {error}")]
    Core {
        /// Name of the core.
        core: String,
        /// Error of the core's export.
        error: Box<ExportError>,
    },
    /// Names in the file that collide in the circuit.
    #[error(
        "the circuit would have two modules or nets named `{name}`: rename one of the ports, links or cores that form this name"
    )]
    Name {
        /// Name in the circuit.
        name: String,
    },
    /// Invalid Verilog in a generated module.
    #[error(transparent)]
    Module(ModuleError),
}

impl From<ModuleError> for SystemError {
    fn from(error: ModuleError) -> SystemError {
        match error {
            ModuleError::Twice { name, .. } => SystemError::Name { name },
            other => SystemError::Module(other),
        }
    }
}

/// Records that are written into the cores in reset, after their memories have been cleared, each with the index of its core.
pub fn system_records(description: &Description) -> Vec<(usize, LoadRecord)> {
    let mailboxes: Vec<_> = (0..description.cores.len()).map(|core| description.mailboxes(core)).collect();
    image::records(description, &mailboxes)
}

/// Circuit of a system, as Verilog.
#[derive(Clone, Debug)]
pub struct SystemDesign {
    /// Names of everything generated.
    pub plan: SystemPlan,
    /// Module name of the top.
    pub top: String,
    /// Verilog files, each with one module of the same name.
    pub files: Vec<DesignFile>,
    /// Initial contents of all cores, read by the top's loader: not Verilog.
    pub image: DesignFile,
    /// Number of records in the image, which the top's loader counts.
    pub records: usize,
}

/// Generates the circuit of a system. Its top is named after `name`, with `_` for characters that a name cannot have.
///
/// # Errors
/// If a core's machine has no circuit, or names in the file collide in the circuit.
pub fn export_system(
    description: &Description,
    name: &str,
    library: &Library,
) -> Result<SystemDesign, SystemError> {
    export_driven(description, name, library, Driver::Itself, Safety::default())
}

/// Generates the circuit of a system whose loader and ticks are in the top, as in [`export_system`], or outside.
/// Every core has the mechanisms of `safety`.
///
/// # Errors
/// See [`export_system`].
pub fn export_driven(
    description: &Description,
    name: &str,
    library: &Library,
    driver: Driver,
    safety: Safety,
) -> Result<SystemDesign, SystemError> {
    let mut designs: Vec<Design> = Vec::new();
    let mut cores = Vec::new();
    for core in &description.cores {
        let machine = core.program.machine;
        let design = match designs.iter().find(|design| design.machine == machine) {
            Some(design) => design,
            None => {
                let design = export(machine, library)
                    .and_then(|design| design.with(safety))
                    .map_err(|error| SystemError::Core { core: core.name.clone(), error: Box::new(error) })?;
                designs.push(design);
                &designs[designs.len() - 1]
            }
        };
        cores.push(design.plan.clone());
    }
    let plan = SystemPlan { safety, ..SystemPlan::new(description.clone(), cores, name, driver) };
    let records = image::records(&plan.description, &plan.mailboxes);
    let image = image::file(&plan, &records, records.len());
    let mut files = vec![DesignFile { name: format!("{}.v", plan.top), text: top::module(&plan, &records)? }];
    for core in 0..plan.cores.len() {
        files.push(DesignFile {
            name: format!("{}.v", plan.core_module(core)),
            text: core::module(&plan, core)?,
        });
    }
    for &(name, text) in SYSTEM {
        files.push(DesignFile { name: format!("system/{name}"), text: text.to_owned() });
    }
    for file in designs.into_iter().flat_map(|design| design.files) {
        if !files.iter().any(|known| known.name == file.name) {
            files.push(file);
        }
    }
    Ok(SystemDesign { top: plan.top.clone(), plan, files, image, records: records.len() })
}

impl SystemDesign {
    /// Image for this circuit of a description that differs only in its programs; `None` if it has more records than this circuit's image.
    pub fn image_of(&self, description: &Description) -> Option<String> {
        let plan = SystemPlan { description: description.clone(), ..self.plan.clone() };
        let records = image::records(&plan.description, &plan.mailboxes);
        (records.len() <= self.records).then(|| image::file(&plan, &records, self.records).text)
    }

    /// Generates every file of an exported folder.
    pub fn folder(&self) -> Vec<DesignFile> {
        let list = self.files.iter().map(|file| format!("{}\n", file.name)).collect();
        let mut files = self.files.clone();
        files.extend(family_files(&self.top, &self.files));
        files.push(self.image.clone());
        files.push(DesignFile { name: format!("{}.f", self.top), text: list });
        files
    }
}
