// SPDX-License-Identifier: MIT OR Apache-2.0
//! Pins of a family's devices, and the constraints that place a design's ports there.

/// Packages and pins of a family's devices.
#[derive(Clone, Copy, Debug)]
pub struct Pinout {
    /// Packages, as place and route names them.
    pub packages: &'static [&'static str],
    /// I/O standards of inputs and outputs.
    pub standards: &'static [&'static str],
    /// Form of the pins' names.
    pub sites: Sites,
    /// Name of the constraints file in the folder of a build.
    pub file: &'static str,
    /// Writes the text of the constraints file.
    pub constraints: fn(&Constraints<'_>) -> String,
}

/// Names of a device's pins.
#[derive(Clone, Copy, Debug)]
pub struct Sites {
    /// Form of a name, for messages: `a letter or two and a number, as in "A10"`.
    pub form: &'static str,
    /// Tests the form of a site's name.
    pub is_site: fn(&str) -> bool,
}

/// Places of a design's ports.
#[derive(Clone, Debug)]
pub struct Constraints<'a> {
    /// Ports, each with its pin.
    pub pins: Vec<Pin<'a>>,
    /// I/O standard of all ports.
    pub standard: &'a str,
    /// Port of the clock, and its frequency in MHz.
    pub clock: (&'a str, f64),
}

/// Placement of a port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pin<'a> {
    /// Port of the top module.
    pub port: String,
    /// Name of the device's pin.
    pub site: &'a str,
    /// Resistor within the device.
    pub pull: Pull,
    /// Circuit at the port.
    pub role: PinRole,
}

/// Circuit at a port of the top module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PinRole {
    /// Clock of the board.
    Clock,
    /// Input at any time, which a synchroniser follows.
    Input,
    /// Output of logic, or of a register that the circuit reads.
    Output,
    /// Output of a register that nothing else reads, which may lie at the pin.
    Register,
}

impl Constraints<'_> {
    /// Ports with these roles, in order, separated by blanks.
    pub fn ports(&self, roles: &[PinRole]) -> String {
        let ports = self.pins.iter().filter(|pin| roles.contains(&pin.role)).map(|pin| pin.port.as_str());
        ports.collect::<Vec<_>>().join(" ")
    }
}

/// Pull resistor of a pin, within the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pull {
    /// Resistor to the I/O supply.
    Up,
    /// Resistor to ground.
    Down,
    /// No resistor.
    None,
}

/// The name consists of letters and a number, like a ball of a grid: `A10` or `AB12`.
pub(crate) fn is_ball(site: &str) -> bool {
    let letters = site.chars().take_while(char::is_ascii_uppercase).count();
    let digits = &site[letters..];
    (1..=2).contains(&letters)
        && (1..=2).contains(&digits.len())
        && digits.chars().all(|c| c.is_ascii_digit())
}

/// The name is a number, like a pin of a package with pins at its edges: `88`.
pub(crate) fn is_number(site: &str) -> bool {
    (1..=3).contains(&site.len()) && !site.starts_with('0') && site.bytes().all(|c| c.is_ascii_digit())
}

/// Sites of a ball grid.
pub(crate) const BALLS: Sites =
    Sites { form: "a letter or two and a number, as in \"A10\"", is_site: is_ball };
