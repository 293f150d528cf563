// SPDX-License-Identifier: MIT OR Apache-2.0
//! Parameters (`.param`): values at the start, from options or from a file.

use crate::run::application::Application;
use crate::run::system::LoadedSystem;
use crate::terminal::files;
use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use takt_debug::parameters::{bits, parse};
use takt_isa::Program;

/// Largest file of parameters, in bytes.
const FILE_BYTES: usize = 1 << 20;

/// Options that set parameters.
#[derive(Args, Clone, Default)]
pub(crate) struct ParameterArguments {
    /// Start with another value of a parameter (`.param`): `kp=3`, an element `K[1,2]=3`, in a system `core.kp=3`. May be given several
    /// times.
    #[arg(id = "param", long = "param", value_name = "NAME=VALUE", allow_hyphen_values = true)]
    pub(crate) settings: Vec<String>,
    /// Start with the parameters in this file, lines `kp = 3.0` in TOML, as `takt live PORT param --save` writes them; --param comes
    /// after it.
    #[arg(id = "params", long = "params", value_name = "TOML")]
    pub(crate) file: Option<PathBuf>,
}

impl ParameterArguments {
    /// Names and texts of values, in the order in which they are set.
    pub(crate) fn settings(&self) -> Result<Vec<(String, String)>> {
        let mut settings = self.file.as_deref().map_or(Ok(Vec::new()), read)?;
        let from_file = settings.len();
        for setting in &self.settings {
            let (name, text) =
                setting.split_once('=').with_context(|| format!("`{setting}` is not `name=value`"))?;
            let (name, text) = (name.trim(), text.trim());
            if settings[from_file..].iter().any(|(known, _)| known == name) {
                bail!("--param sets `{name}` twice");
            }
            settings.push((name.to_owned(), text.to_owned()));
        }
        Ok(settings)
    }

    /// Sets the parameters of a program.
    pub(crate) fn set(&self, program: &mut Program) -> Result<()> {
        for (name, text) in self.settings()? {
            let bits = bits(program.parameter(&name)?, &text).map_err(|text| anyhow!("{text}"))?;
            program.set_parameter(&name, bits)?;
        }
        Ok(())
    }

    /// Sets the parameters of a program, or of the cores of a system.
    pub(crate) fn apply(&self, application: &mut Application) -> Result<()> {
        match application {
            Application::Program(loaded) => self.set(&mut loaded.program),
            Application::System(system) => self.apply_to_system(system),
        }
    }

    /// Sets the parameters of a system's cores.
    pub(crate) fn apply_to_system(&self, system: &mut LoadedSystem) -> Result<()> {
        for (name, text) in self.settings()? {
            let cores = &mut system.description.cores;
            let found = name.split_once('.').and_then(|(core, own)| {
                Some((cores.iter().position(|known| known.name == core)?, own.to_owned()))
            });
            let Some((core, own)) = found else {
                let names: Vec<String> = cores.iter().map(|core| format!("`{}.", core.name)).collect();
                bail!(
                    "`{name}` names no core's parameter: in a system it begins with {}`",
                    names.join("`, ")
                );
            };
            for program in [Arc::make_mut(&mut cores[core].program), &mut system.programs[core].program] {
                let bits = bits(program.parameter(&own)?, &text).map_err(|text| anyhow!("{text}"))?;
                program.set_parameter(&own, bits)?;
            }
        }
        Ok(())
    }
}

/// Names and texts of values in a file of parameters.
pub(crate) fn read(path: &Path) -> Result<Vec<(String, String)>> {
    let name = files::input_name(path);
    let text = String::from_utf8(files::read(path, FILE_BYTES)?)
        .map_err(|_| anyhow!("{name} is not text: parameters are lines `name = value`"))?;
    parse(&name, &text).map_err(|text| anyhow!("{text}"))
}
