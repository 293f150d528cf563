// SPDX-License-Identifier: MIT OR Apache-2.0
//! Register bits as text and as JSON, in the notation of their type.

use serde_json::{Number, Value};
use takt_isa::Type;

/// Formats bits in the notation of their type: the shortest decimal that reads back as the same binary32, an integer, or hexadecimal.
pub fn text(ty: Type, bits: u32) -> String {
    match ty {
        Type::F => format!("{:?}", f32::from_bits(bits)),
        Type::I => bits.cast_signed().to_string(),
        Type::B => format!("0x{bits:08x}"),
    }
}

/// JSON number; values without one (NaN, infinities, hexadecimal) become a string with their [`text`].
pub fn json(ty: Type, bits: u32) -> Value {
    let text = text(ty, bits);
    serde_json::from_str::<Number>(&text).map_or_else(|_| Value::from(text), Value::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_numbers() {
        for (ty, bits, expected) in [
            (Type::F, 0.1f32.to_bits(), "0.1"),
            (Type::F, (-0.0f32).to_bits(), "-0.0"),
            (Type::F, f32::NEG_INFINITY.to_bits(), "\"-inf\""),
            (Type::F, f32::NAN.to_bits(), "\"NaN\""),
            (Type::I, u32::MAX, "-1"),
            (Type::B, 16, "\"0x00000010\""),
        ] {
            assert_eq!(json(ty, bits).to_string(), expected);
        }
    }
}
