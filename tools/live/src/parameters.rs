// SPDX-License-Identifier: MIT OR Apache-2.0
//! Parameters (`.param`) of a program on a board: values to set at once, and a file of all of them.

use anyhow::{Result, anyhow, bail};
use std::fmt::Write as _;
use takt_board::protocol::{Line, LinkError, WORDS};
use takt_board::{Application, Host};
use takt_debug::parameters::bits;
use takt_debug::value;
use takt_isa::Type;

/// Parameter of the program on the board.
pub struct Parameter {
    /// Name; in a system `core.name`.
    pub name: String,
    /// Address on the board.
    pub address: u16,
    /// Type of the value.
    pub ty: Type,
    /// Range of the source in words; empty without one.
    pub range: String,
}

/// Parameters of the program, or the system's cores, on a board.
pub struct Parameters(Vec<Parameter>);

/// Values to set: addresses and bits, ascending.
pub type Settings = Vec<(u16, u32)>;

impl Parameters {
    /// Parameters of an application.
    ///
    /// # Errors
    /// If one has no place on the board.
    pub fn of(application: &Application<'_>) -> Result<Parameters> {
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

    /// The parameters in the order of the cores and their sources.
    pub fn all(&self) -> &[Parameter] {
        &self.0
    }

    /// Checks values before anything is sent: names, types, ranges, and that one request holds them.
    ///
    /// # Errors
    /// For the first value that is wrong.
    pub fn check(&self, application: &Application<'_>, given: Vec<(String, String)>) -> Result<Settings> {
        let mut settings = Settings::new();
        for (name, text) in given {
            let (program, port) = application.parameter(&name)?;
            let bits = bits(port, &text).map_err(|text| anyhow!("{text}"))?;
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
    ///
    /// # Errors
    /// If the board is gone.
    pub fn read<L: Line>(&self, host: &mut Host<L>) -> Result<Vec<u32>> {
        let addresses: Vec<u16> = self.0.iter().map(|parameter| parameter.address).collect();
        Ok(host.read_each(&addresses)?)
    }

    /// A file of all parameters with their values on the board.
    ///
    /// # Errors
    /// If the board is gone.
    pub fn file<L: Line>(&self, host: &mut Host<L>) -> Result<String> {
        let values = self.read(host)?;
        Ok(self.0.iter().zip(values).map(|(known, bits)| line(&known.name, known.ty, bits)).collect())
    }
}

/// Sets parameters by one request: those in between keep their values.
///
/// # Errors
/// If the board refuses, or is gone.
pub fn set<L: Line>(host: &mut Host<L>, settings: &Settings) -> Result<()> {
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
    use takt_debug::inputs;
    use takt_debug::parameters::parse;

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
