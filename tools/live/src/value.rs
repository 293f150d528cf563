// SPDX-License-Identifier: MIT OR Apache-2.0
//! Ports of an application by name, and their values as text.

use anyhow::{Result, anyhow};
use takt_board::Application;
use takt_isa::Type;

/// Address and type of a port.
///
/// # Errors
/// If there is no such port.
pub fn find(application: &Application<'_>, name: &str) -> Result<(u16, Type)> {
    let place = application.find(name).map_err(|text| anyhow!("{text}"))?;
    Ok((place.read, place.ty))
}

/// Text of a port's value.
pub fn value_text(bits: u32, ty: Type) -> String {
    match ty {
        Type::F => f32::from_bits(bits).to_string(),
        Type::I => (bits as i32).to_string(),
        Type::B => format!("{bits:#x}"),
    }
}

/// Bits of a value in text; `None` if it is none of the type.
pub fn bits(text: &str, ty: Type) -> Option<u32> {
    match ty {
        Type::F => text.parse::<f32>().ok().map(f32::to_bits),
        Type::I => text.parse::<i32>().ok().map(|n| n as u32),
        Type::B => {
            text.strip_prefix("0x").map_or_else(|| text.parse().ok(), |hex| u32::from_str_radix(hex, 16).ok())
        }
    }
}
