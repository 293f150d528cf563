// SPDX-License-Identifier: MIT OR Apache-2.0
//! Start, stop and hold of a program, and values that the host sets.

use crate::value::bits;
use anyhow::{Context, Result, anyhow, bail, ensure};
use serde::Deserialize;
use takt_board::protocol::{ENABLE, HOLD, Line, LinkError, RESTART, RUN};
use takt_board::{Application, Host, Wiring};

/// Command that starts, stops or holds the program.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Control {
    /// From its beginning; outputs drive.
    Start,
    /// Outputs are safe.
    Stop,
    /// No more ticks.
    Hold,
    /// A period while it is held.
    Step,
    /// On, after a hold.
    Go,
}

impl Control {
    /// Sends the command.
    ///
    /// # Errors
    /// If the board refuses, or is gone; for a step, if the program is not held.
    pub fn send<L: Line>(self, host: &mut Host<L>) -> Result<()> {
        let control = match self {
            Control::Start => RUN | ENABLE | RESTART,
            Control::Stop => 0,
            Control::Hold => host.register("control")? | HOLD,
            Control::Go => host.register("control")? & !HOLD,
            Control::Step => {
                let held = host.register("control")? & HOLD != 0;
                ensure!(held, "the program is not held: `takt live PORT hold` first");
                return Ok(host.set("step", 1)?);
            }
        };
        Ok(host.set("control", control)?)
    }
}

/// Address and bits of a value that the host is to set.
///
/// # Errors
/// If there is no such port, the text is no value of it, or a peripheral drives it.
pub fn setting(
    application: &Application<'_>,
    wiring: Option<&Wiring>,
    name: &str,
    text: &str,
) -> Result<(u16, u32)> {
    let (address, ty) = application.settable(name).map_err(|text| anyhow!("{text}"))?;
    let bits = bits(text, ty).with_context(|| format!("`{text}` is not a value of `{name}`"))?;
    application.check_parameter(name, bits)?;
    if let Some(driver) = wiring.and_then(|wiring| wiring.driver(application, address)) {
        bail!("`{name}` cannot be set: the wiring connects it to {driver}, which drives it");
    }
    Ok((address, bits))
}

/// Sets ports; the error names ports that the board does not let the host set.
///
/// # Errors
/// If the board refuses, or is gone.
pub fn set<L: Line>(host: &mut Host<L>, settings: &[(u16, u32)], names: &[(u16, String)]) -> Result<()> {
    host.set_ports(settings).map_err(|error| {
        let LinkError::ReadOnly { address, words } = error else { return error.into() };
        let refused = names.iter().filter(|(at, _)| (address..).take(words).any(|refused| refused == *at));
        let refused: Vec<String> = refused.map(|(_, name)| format!("`{name}`")).collect();
        anyhow!(
            "the board refuses to set {}: a peripheral of its wiring drives it (`--wiring FILE` says which)",
            refused.join(" or ")
        )
    })
}
