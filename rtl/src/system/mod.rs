// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of the circuit of a multi-core system: one top with the cores, a boot memory with their first values, the base ticks,
//! the links and the gates, as docs/system.md defines them.
//!
//! The fixed parts are the modules in `rtl/system/` and the cores as [`export()`] makes them. The rest is generated from the
//! description: [`SystemPlan`] has every name, and there is a module here for each part.

mod core;
mod image;
mod links;
mod plan;
mod top;

pub use plan::{Driver, Pin, PinKind, SystemPlan};

use crate::circuit::Library;
use crate::export::{Design, DesignFile, ExportError, export};
use crate::files::SYSTEM;
use crate::verilog::ModuleError;
use takt_isa::load::LoadRecord;
use takt_isa::system::Description;
use thiserror::Error;

/// The reason why a system has no circuit.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum SystemError {
    /// A core's machine has no circuit.
    #[error("core {core}: {error}")]
    Core {
        /// The core.
        core: String,
        /// The reason.
        error: Box<ExportError>,
    },
    /// Names in the file make the same name in the circuit.
    #[error(
        "the circuit would have two things named `{name}`: other names for the ports, links or cores that make it"
    )]
    Name {
        /// The name.
        name: String,
    },
    /// A generated module is invalid.
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

/// The records that are written into the cores in reset, after their memories have been cleared, each with its core's number.
pub fn system_records(description: &Description) -> Vec<(usize, LoadRecord)> {
    let mailboxes: Vec<_> = (0..description.cores.len()).map(|core| description.mailboxes(core)).collect();
    image::records(description, &mailboxes)
}

/// The circuit of a system.
#[derive(Clone, Debug)]
pub struct SystemDesign {
    /// The plan: all that was generated, by name.
    pub plan: SystemPlan,
    /// Name of the top's module.
    pub top: String,
    /// Verilog files, each with the one module of its name.
    pub files: Vec<DesignFile>,
    /// Modules that take the place of those of the same name on Lattice ECP5.
    pub ecp5: Vec<DesignFile>,
    /// Every core's program and first values, which the top's loader reads: not Verilog.
    pub image: DesignFile,
    /// The image's records, which the top's loader counts.
    pub records: usize,
}

/// The circuit of a system. Its top is named after `name`, with `_` for characters that a name cannot have.
///
/// # Errors
/// If a core's machine has no circuit, or names in the file make the same name in the circuit.
pub fn export_system(
    description: &Description,
    name: &str,
    library: &Library,
) -> Result<SystemDesign, SystemError> {
    export_driven(description, name, library, Driver::Itself)
}

/// The circuit of a system whose loader and ticks are in the top, as in [`export_system`], or outside.
///
/// # Errors
/// Those of [`export_system`].
pub fn export_driven(
    description: &Description,
    name: &str,
    library: &Library,
    driver: Driver,
) -> Result<SystemDesign, SystemError> {
    let mut designs: Vec<Design> = Vec::new();
    let mut cores = Vec::new();
    for core in &description.cores {
        let machine = core.program.machine;
        let design = match designs.iter().find(|design| design.machine == machine) {
            Some(design) => design,
            None => {
                let design = export(machine, library)
                    .map_err(|error| SystemError::Core { core: core.name.clone(), error: Box::new(error) })?;
                designs.push(design);
                &designs[designs.len() - 1]
            }
        };
        cores.push(design.plan.clone());
    }
    let plan = SystemPlan::new(description.clone(), cores, name, driver);
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
    let mut ecp5: Vec<DesignFile> = Vec::new();
    for design in designs {
        for (list, more) in [(&mut files, design.files), (&mut ecp5, design.ecp5)] {
            for file in more {
                if !list.iter().any(|known| known.name == file.name) {
                    list.push(file);
                }
            }
        }
    }
    Ok(SystemDesign { top: plan.top.clone(), plan, files, ecp5, image, records: records.len() })
}

impl SystemDesign {
    /// The image, for this circuit, of a description that differs only in its programs; `None` if it has more records than this
    /// one's.
    pub fn image_of(&self, description: &Description) -> Option<String> {
        let plan = SystemPlan { description: description.clone(), ..self.plan.clone() };
        let records = image::records(&plan.description, &plan.mailboxes);
        (records.len() <= self.records).then(|| image::file(&plan, &records, self.records).text)
    }

    /// Every file of an exported folder.
    pub fn folder(&self) -> Vec<DesignFile> {
        let base = |name: &str| name.rsplit('/').next().map(str::to_owned);
        let replaced: Vec<_> = self.ecp5.iter().map(|file| base(&file.name)).collect();
        let list = |ecp5: bool| {
            let files = self.files.iter().filter(|file| !ecp5 || !replaced.contains(&base(&file.name)));
            let more = self.ecp5.iter().filter(|_| ecp5);
            files.chain(more).map(|file| format!("{}\n", file.name)).collect::<String>()
        };
        let put = |name: String, text| DesignFile { name, text };
        let mut files = self.files.clone();
        files.extend(self.ecp5.clone());
        files.push(self.image.clone());
        files.push(put(format!("{}.f", self.top), list(false)));
        files.push(put(format!("{}_ecp5.f", self.top), list(true)));
        files
    }
}
