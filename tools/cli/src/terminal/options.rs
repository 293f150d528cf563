// SPDX-License-Identifier: MIT OR Apache-2.0
//! Options shared by several commands, and suggestions for misspelt names.

use clap::builder::{PathBufValueParser, TypedValueParser};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};
use takt_asm::Contract;
use takt_asm::levels::LevelSetting;
use takt_asm::nearest;
use takt_isa::{MACHINES, Machine, Op, ROWS, Row};

/// `--machine`.
#[derive(Args, Clone)]
pub(crate) struct MachineArgument {
    /// The machine, as `takt machines` lists them, or a file with its row (`my.toml`), perhaps with memories of other depths:
    /// `t3,data=32768`.
    #[arg(long = "machine", short = 'm', value_name = "MACHINE", default_value = MACHINES[0].name, value_parser = machine)]
    pub(crate) machine: &'static Machine,
}

/// `--machine`, where a file may decide.
#[derive(Args, Clone)]
pub(crate) struct OptionalMachine {
    /// The machine, as `takt machines` lists them, or a file with its row (`my.toml`), perhaps with memories of other depths, as
    /// `t3,data=32768` [default: the image's or the source's (`.machine`); t3 for a source that names none].
    #[arg(long = "machine", short = 'm', value_name = "MACHINE", value_parser = machine)]
    pub(crate) machine: Option<&'static Machine>,
}

/// Scope of a transformation of the assembler: as stated in the source, everywhere or nowhere.
#[derive(Clone, Copy, Default, ValueEnum)]
pub(crate) enum TransformMode {
    /// As stated in the source.
    #[default]
    Source,
    /// Everywhere, regardless of the source.
    On,
    /// Nowhere, regardless of the source.
    Off,
}

/// `--contract`.
#[derive(Args, Clone, Copy, Default)]
pub(crate) struct ContractArgument {
    /// Fuse a product and the only sum that uses it into one operation (fused multiply-add), on machines that have it: where the
    /// source says `.contract on`, everywhere, or nowhere. This changes the last bits of results.
    #[arg(long, value_enum, value_name = "WHEN", default_value_t = TransformMode::Source)]
    pub(crate) contract: TransformMode,
}

impl From<ContractArgument> for Contract {
    fn from(argument: ContractArgument) -> Contract {
        match argument.contract {
            TransformMode::Source => Contract::AsWritten,
            TransformMode::On => Contract::All,
            TransformMode::Off => Contract::None,
        }
    }
}

/// Options of every command that assembles a source.
#[derive(Args, Clone, Default)]
pub(crate) struct SourceArguments {
    #[command(flatten)]
    pub(crate) contract: ContractArgument,
    /// Also search this folder for included files; may be given several times.
    #[arg(short = 'I', long = "include", value_name = "DIR", value_parser = folder)]
    pub(crate) folders: Vec<PathBuf>,
    /// Turn warnings into errors: `error` for all, `error=NAME` for one; `allow=NAME` suppresses one.
    #[arg(short = 'W', long = "warnings", value_name = "LEVEL")]
    pub(crate) warnings: Vec<LevelSetting>,
}

/// Parses an existing folder, for clap.
fn folder(path: &str) -> Result<PathBuf, String> {
    match Path::new(path) {
        path if path.is_dir() => Ok(path.to_owned()),
        path if path.exists() => Err("it is a file, not a folder".to_owned()),
        _ => Err("there is no such folder".to_owned()),
    }
}

/// Parser of the file of a picture, for clap: every picture is an SVG, so that other endings are refused.
pub(crate) fn picture() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| match path.extension() {
        Some(ending) if !ending.eq_ignore_ascii_case("svg") => {
            Err(format!("the picture is an SVG: write `{}`", path.with_extension("svg").display()))
        }
        _ => Ok(path),
    })
}

/// Parses the name of a machine, for clap.
pub(crate) fn machine(name: &str) -> Result<&'static Machine, String> {
    takt_asm::machine(name)
}

/// Parses a mnemonic, for clap.
pub(crate) fn instruction(mnemonic: &str) -> Result<&'static Row, String> {
    Op::from_mnemonic(mnemonic).map(Op::row).ok_or_else(|| {
        let near = suggest(mnemonic, ROWS.iter().map(|row| row.mnemonic));
        format!("there is no such instruction{near} (`takt isa` lists them)")
    })
}

/// Clock of the paper's FPGA3, MHz.
pub(crate) const PAPER_CLOCK: f64 = 125.0;

/// Suffix `; did you mean …?` if a similar name exists.
pub(crate) fn suggest<'a>(name: &str, names: impl IntoIterator<Item = &'a str>) -> String {
    nearest(name, names).map_or(String::new(), |near| format!("; did you mean `{near}`?"))
}
