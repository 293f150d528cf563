// SPDX-License-Identifier: MIT OR Apache-2.0
//! Design of the cores that a board carries, and the number by which a host recognises it.

use super::error::TopError;
use crate::application::Application;
use takt_isa::Program;
use takt_rtl::export::DesignFile;
use takt_rtl::system::SystemPlan;
use takt_rtl::{Driver, Library, Safety, SystemDesign, export, export_driven};
use takt_system::Description;

/// The cores, with their links.
pub(super) struct Design {
    pub(super) files: Vec<DesignFile>,
    /// The module of the core, or of the system.
    pub(super) top: String,
    /// Number by which the host recognises the design.
    pub(super) number: u32,
    /// The plan of a system.
    pub(super) plan: Option<SystemPlan>,
}

impl Design {
    /// The design of an application, whose cores have the mechanisms of `safety`.
    pub(super) fn of(
        application: &Application<'_>,
        library: &Library,
        safety: Safety,
    ) -> Result<Design, TopError> {
        if application.is_program() {
            let program = &application.description().cores[0].program;
            let design = export(program.machine, library)?.with(safety)?;
            let takt_rtl::Design { files, top, .. } = design.latching(program.latched_inputs())?;
            return Ok(Design { files, top, number: number_of_program(program), plan: None });
        }
        // A host loads the same images, with the mechanisms and without.
        let alone = system(application.description(), library, Safety::default())?;
        let number = number_of_system(&alone);
        let design = match safety == Safety::default() {
            true => alone,
            false => system(application.description(), library, safety)?,
        };
        let SystemDesign { files, top, plan, .. } = design;
        Ok(Design { files, top, number, plan: Some(plan) })
    }
}

fn system(description: &Description, library: &Library, safety: Safety) -> Result<SystemDesign, TopError> {
    let mut design = export_driven(description, "board", library, Driver::Board, safety)?;
    // The board has its own modules for loading and ticks.
    let others = ["takt_loader.v", "takt_start.v", "takt_pace.v"];
    design.files.retain(|file| !others.iter().any(|name| file.name.ends_with(name)));
    Ok(design)
}

/// Number by which a host recognises a circuit.
///
/// # Errors
/// If the system has no circuit.
pub fn circuit_number<'a>(application: impl Into<Application<'a>>) -> Result<u32, TopError> {
    let application = application.into();
    let description = application.description();
    match application.is_program() {
        true => Ok(number_of_program(&description.cores[0].program)),
        false => Ok(number_of_system(&system(description, &Library::builtin(), Safety::default())?)),
    }
}

/// The hash of the machine's name, the number of its latched inputs and, of a machine that no table has, its row.
fn number_of_program(program: &Program) -> u32 {
    let machine = program.machine;
    let row = if machine.is_builtin() { String::new() } else { machine.to_toml() };
    hash(format!("{} {}{row}", machine.name, program.latched_inputs()).bytes())
}

/// The hash of the Verilog that is generated for cores and links, without comments, which name programs.
fn number_of_system(design: &SystemDesign) -> u32 {
    let own = design.files.iter().filter(|file| file.name.starts_with(&design.top));
    let lines =
        own.flat_map(|file| file.text.lines()).map(|line| line.split("//").next().unwrap_or(line).trim());
    hash(lines.flat_map(str::bytes))
}

/// FNV-1a, 32 bits.
fn hash(bytes: impl Iterator<Item = u8>) -> u32 {
    bytes.fold(0x811c_9dc5, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}
