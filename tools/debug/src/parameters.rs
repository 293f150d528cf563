// SPDX-License-Identifier: MIT OR Apache-2.0
//! Parameters (`.param`) as text: a value, and a file of values in TOML.

use crate::inputs;
use takt_isa::program::Port;
use toml::Value;

/// Bits of a parameter's value in text.
///
/// # Errors
/// A message, if the text is no value of the parameter's type.
pub fn bits(parameter: &Port, text: &str) -> Result<u32, String> {
    inputs::parse(parameter.ty, text).map_err(|error| format!("parameter `{}`: {error}", parameter.name))
}

/// Names and texts of values in the text of a file of parameters, which messages call `name`.
///
/// # Errors
/// A message, if the text is no such file.
pub fn parse(name: &str, text: &str) -> Result<Vec<(String, String)>, String> {
    let table: toml::Table = toml::from_str(text).map_err(|error| format!("{name}: {error}"))?;
    let mut settings = Vec::new();
    let mut put = |parameter: String, value: &Value| {
        let text = match value {
            Value::Integer(value) => value.to_string(),
            Value::Float(value) => value.to_string(),
            Value::String(text) => text.clone(),
            _ => return Err(format!("{name}: `{parameter}` is {}, not a number", value.type_str())),
        };
        settings.push((parameter, text));
        Ok(())
    };
    for (key, value) in &table {
        match value {
            // `servo.kp = 3` is a table in TOML: a core with its parameters.
            Value::Table(own) => {
                own.iter().try_for_each(|(own, value)| put(format!("{key}.{own}"), value))?;
            }
            _ => put(key.clone(), value)?,
        }
    }
    Ok(settings)
}
