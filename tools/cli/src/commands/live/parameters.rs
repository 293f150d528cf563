// SPDX-License-Identifier: MIT OR Apache-2.0
//! Subcommand `param` of `takt live`: shows, sets, saves and loads the parameters of a program on a board.

use crate::run::parameters::{ParameterArguments, bits};
use crate::terminal::files::Out;
use anyhow::{Result, anyhow, bail};
use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;
use takt_board::protocol::{LinkError, WORDS};
use takt_board::serial::Serial;
use takt_board::{Application, Host};
use takt_debug::value;
use takt_isa::Type;

/// Parameter of the program on the board.
struct Parameter {
    name: String,
    address: u16,
    ty: Type,
    /// Range of the source in words; empty without one.
    range: String,
}

/// Parameters of the program, or the system's cores, on a board.
pub(super) struct Parameters(Vec<Parameter>);

/// Values to set: addresses and bits, ascending.
pub(super) type Settings = Vec<(u16, u32)>;

impl Parameters {
    pub(super) fn of(application: &Application<'_>) -> Result<Parameters> {
        let mut all = Vec::new();
        for (core, known) in application.description().cores.iter().enumerate() {
            for port in &known.program.parameters {
                let name = application.name(core, &port.name);
                let place = application.find(&name).map_err(|text| anyhow!("{text}"))?;
                let range = known.program.range(port.register).map_or(String::new(), |range| {
                    let (low, high) = range.ends();
                    format!("   {low} to {high}")
                });
                all.push(Parameter { name, address: place.read, ty: port.ty, range });
            }
        }
        Ok(Parameters(all))
    }

    /// Checks values before anything is sent: names, types, ranges, and that one request holds them.
    pub(super) fn check(
        &self,
        application: &Application<'_>,
        given: Vec<(String, String)>,
    ) -> Result<Settings> {
        let mut settings = Settings::new();
        for (name, text) in given {
            let (program, port) = application.parameter(&name)?;
            let bits = bits(port, &text)?;
            program.check_parameter(port, bits)?;
            let (address, _) = application.settable(&name).map_err(|text| anyhow!("{text}"))?;
            // A value on the command line replaces that of the file.
            settings.retain(|(known, _)| *known != address);
            settings.push((address, bits));
        }
        settings.sort_unstable();
        if let [(first, _), .., (last, _)] = settings[..]
            && usize::from(last - first) >= WORDS
        {
            let known = |address| self.0.iter().find(|known| known.address == address);
            let name = |address| known(address).map_or("", |known| &known.name);
            bail!(
                "`{}` and `{}` cannot change at once: the board sets {WORDS} consecutive ports between two periods, and their \
                 numbers are {} apart; set them by two commands",
                name(first),
                name(last),
                last - first
            );
        }
        Ok(settings)
    }

    /// Values on the board, in the order of the parameters.
    fn read(&self, host: &mut Host<Serial>) -> Result<Vec<u32>> {
        let addresses: Vec<u16> = self.0.iter().map(|parameter| parameter.address).collect();
        Ok(host.read_each(&addresses)?)
    }

    /// A file of all parameters with their values on the board.
    pub(super) fn file(&self, host: &mut Host<Serial>) -> Result<String> {
        let values = self.read(host)?;
        Ok(self.0.iter().zip(values).map(|(known, bits)| line(&known.name, known.ty, bits)).collect())
    }
}

/// Sets parameters by one request: those in between keep their values.
pub(super) fn set(host: &mut Host<Serial>, settings: &Settings) -> Result<()> {
    let ([(first, _), ..], Some((last, _))) = (&settings[..], settings.last()) else { return Ok(()) };
    let mut words = host.read(*first, usize::from(last - first) + 1)?;
    for (address, bits) in settings {
        words[usize::from(address - first)] = *bits;
    }
    let settings: Vec<(u16, u32)> = (*first..).zip(words).collect();
    host.set_ports(&settings).map_err(|error| match error {
        LinkError::ReadOnly { .. } => {
            anyhow!("the board sets none of them: a port between them is a peripheral's; set them by several commands")
        }
        error => error.into(),
    })
}

/// Parameters, and the values to set.
pub(super) struct Changes {
    all: Parameters,
    settings: Settings,
}

/// Checks values before the serial port is opened.
pub(super) fn prepare(application: &Application<'_>, given: &ParameterArguments) -> Result<Changes> {
    let all = Parameters::of(application)?;
    if all.0.is_empty() {
        bail!("the {} has no parameters: `.param kp = 2.0 range 0..50` declares one", application.kind());
    }
    let settings = all.check(application, given.settings()?)?;
    Ok(Changes { all, settings })
}

/// Sets parameters, then shows them, or writes them to a file.
pub(super) fn run(
    host: &mut Host<Serial>,
    changes: &Changes,
    save: Option<&Path>,
    out: &mut Out,
) -> Result<()> {
    let Changes { all, settings } = changes;
    set(host, settings)?;
    if let Some(path) = save {
        let text = all.file(host)?;
        let mut file = Out::create(path)?;
        file.write_all(text.as_bytes())?;
        return file.finish();
    }
    let is_set = |address: u16| settings.iter().any(|(known, _)| *known == address);
    for (Parameter { name, address, ty, range }, bits) in all.0.iter().zip(all.read(host)?) {
        if settings.is_empty() || is_set(*address) {
            writeln!(out, "{name} = {}{range}", value::text(*ty, bits))?;
        }
    }
    Ok(())
}

/// A line of a file of parameters. Bits are written as text, which TOML's integers would not hold in hexadecimal.
fn line(name: &str, ty: Type, bits: u32) -> String {
    let mut line = String::new();
    // `K[1,2]` is no bare key.
    let bare = name.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '.'));
    let quote = if bare { "" } else { "\"" };
    let value = value::text(ty, bits);
    let value = if ty == Type::B { format!("\"{value}\"") } else { value };
    let _ = writeln!(line, "{quote}{name}{quote} = {value}");
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::parameters::parse;
    use takt_debug::inputs;

    #[test]
    fn lines_read_back_as_the_same_bits() {
        let values = [
            ("kp", Type::F, 0.1f32.to_bits()),
            ("K[1,2]", Type::F, (-1.5e-42f32).to_bits()),
            ("n", Type::I, (-7i32).cast_unsigned()),
            ("mask", Type::B, 0xffff_fff0),
            ("servo.ki", Type::F, 3.0f32.to_bits()),
        ];
        let text: String = values.iter().map(|(name, ty, bits)| line(name, *ty, *bits)).collect();
        let read = parse("p.toml", &text).expect("it is TOML");
        assert_eq!(read.len(), values.len());
        for (name, ty, expected) in values {
            let (_, text) = read.iter().find(|(known, _)| known == name).expect(name);
            assert_eq!(inputs::parse(ty, text), Ok(expected), "{name} = {text}");
        }
    }
}
