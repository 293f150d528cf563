// SPDX-License-Identifier: MIT OR Apache-2.0
//! Debugging section of an image, as JSON: sources, constants, bindings of names.

use super::ImageError;
use super::meta::MetaType;
use super::validate::{FILE_NAME, is_spelled, wrong_port};
use crate::limits::ARRAY_INDICES;
use crate::output::names::{DebugInfo, NamedArray, NamedValue, Names, Position, Scope};
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use takt_diagnostics::source::line_feeds;
use takt_isa::{BundleAddress, Program, Register};
use takt_syntax::expr::Value;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Debug {
    sources: Vec<Source>,
    constants: Vec<Constant>,
    positions: Vec<Option<(u32, u32)>>,
    scopes: Vec<Use>,
    values: Vec<NameRecord>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    arrays: Vec<ArrayRecord>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ArrayRecord {
    name: String,
    base: u32,
    sizes: Vec<u32>,
    #[serde(rename = "type")]
    ty: MetaType,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Source {
    name: String,
    text: String,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Constant {
    name: String,
    value: Number,
}

/// A number of the source. Reals are text: JSON has neither infinities nor NaN.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Number {
    Int(i64),
    Real(String),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Use {
    name: String,
    parameters: Vec<(String, String)>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct NameRecord {
    name: String,
    label: String,
    register: u16,
    #[serde(rename = "type")]
    ty: MetaType,
    orders: Option<(u32, u32)>,
    bundles: Option<(BundleAddress, BundleAddress)>,
}

/// The reason why a value's register is refused.
const MISPLACED: &str = "it lies outside the registers of its kind";

pub(super) fn to_json(info: &DebugInfo) -> serde_json::Result<Vec<u8>> {
    let DebugInfo { sources, constants, names } = info;
    let source = |(name, text): &(String, String)| Source { name: name.clone(), text: text.clone() };
    let constant = |(name, value): &(String, Value)| Constant {
        name: name.clone(),
        value: match *value {
            Value::Int(value) => Number::Int(value),
            Value::Real(value) => Number::Real(format!("{value:?}")),
        },
    };
    let scope = |scope: &Scope| Use { name: scope.name.clone(), parameters: scope.parameters.clone() };
    let value = |value: &NamedValue| NameRecord {
        name: value.name.clone(),
        label: value.label.clone(),
        register: value.register.get(),
        ty: value.ty.into(),
        orders: value.orders,
        bundles: value.bundles,
    };
    let array = |NamedArray { name, base, sizes, ty }: &NamedArray| ArrayRecord {
        name: name.clone(),
        base: *base,
        sizes: sizes.clone(),
        ty: (*ty).into(),
    };
    let debug = Debug {
        sources: sources.iter().map(source).collect(),
        constants: constants.iter().map(constant).collect(),
        positions: names.positions.iter().map(|at| at.map(|at| (at.order, at.scope()))).collect(),
        scopes: names.scopes.iter().map(scope).collect(),
        values: names.values.iter().map(value).collect(),
        arrays: names.arrays.iter().map(array).collect(),
    };
    serde_json::to_vec(&debug)
}

pub(super) fn from_json(bytes: &[u8], program: &Program) -> Result<DebugInfo, ImageError> {
    let debug: Debug = serde_json::from_slice(bytes).map_err(|error| ImageError::Debug(error.to_string()))?;
    let constant = |constant: Constant| {
        let value = match constant.value {
            Number::Int(value) => Value::Int(value),
            Number::Real(text) => {
                let wrong = || ImageError::Debug(format!("`{text}` is not a number"));
                Value::Real(text.parse().map_err(|_| wrong())?)
            }
        };
        Ok((constant.name, value))
    };
    let names = Names {
        positions: debug
            .positions
            .iter()
            .map(|position| position.map(|(order, scope)| Position::new(order, scope)))
            .collect(),
        scopes: debug.scopes.into_iter().map(|Use { name, parameters }| Scope { name, parameters }).collect(),
        values: debug
            .values
            .into_iter()
            .map(|NameRecord { name, label, register, ty, orders, bundles }| {
                let known = Register::new(register.into());
                let register = known.ok_or_else(|| wrong_port("value", &label, register, MISPLACED))?;
                Ok(NamedValue { name, label, register, ty: ty.into(), orders, bundles })
            })
            .collect::<Result<_, ImageError>>()?,
        arrays: debug
            .arrays
            .into_iter()
            .map(|ArrayRecord { name, base, sizes, ty }| NamedArray { name, base, sizes, ty: ty.into() })
            .collect(),
    };
    let info = DebugInfo {
        sources: debug.sources.into_iter().map(|of| (of.name, line_feeds(&of.text).into_owned())).collect(),
        constants: debug.constants.into_iter().map(constant).collect::<Result<_, ImageError>>()?,
        names,
    };
    check(&info, program)?;
    Ok(info)
}

/// Checks that the information fits the program, whether it was read or is to be written.
pub(super) fn check(info: &DebugInfo, program: &Program) -> Result<(), ImageError> {
    let DebugInfo { sources, constants, names } = info;
    let mut seen = HashSet::new();
    for (name, _) in sources {
        if name.is_empty() || name.len() > FILE_NAME {
            return Err(ImageError::Name(name.chars().take(80).collect()));
        }
        if !seen.insert(name.as_str()) {
            return Err(ImageError::RepeatedName(name.clone()));
        }
    }
    for (name, _) in constants {
        if !is_spelled(name, FILE_NAME) {
            return Err(ImageError::Name(name.clone()));
        }
    }
    check_names(names, program)
}

fn check_names(names: &Names, program: &Program) -> Result<(), ImageError> {
    let wrong = |message: String| Err(ImageError::Debug(message));
    let spelled = |name: &str| match is_spelled(name, FILE_NAME) {
        true => Ok(()),
        false => Err(ImageError::Name(name.chars().take(80).collect())),
    };
    let Names { positions, scopes, values, arrays } = names;
    let bundles = program.bundles();
    if !positions.is_empty() && positions.len() != program.code.len() {
        return wrong(format!("{} positions for {} words", positions.len(), program.code.len()));
    }
    if let Some(position) =
        positions.iter().flatten().find(|position| position.scope() as usize >= scopes.len())
    {
        return wrong(format!("there is no scope {}", position.scope()));
    }
    for (number, scope) in scopes.iter().enumerate() {
        if number == 0 {
            if *scope != Scope::default() {
                return wrong("the first scope is that outside of macros: it has no name".to_owned());
            }
            continue;
        }
        spelled(&scope.name)?;
        for (parameter, register) in &scope.parameters {
            spelled(parameter)?;
            spelled(register)?;
        }
    }
    for NamedValue { name, label, register, orders, bundles: lives, .. } in values {
        spelled(name)?;
        spelled(label)?;
        let machine = program.machine;
        if !machine.has_register(*register) || machine.is_input(*register) || *register == Register::ZERO {
            return Err(wrong_port("value", label, register.get(), MISPLACED));
        }
        if let Some((after, through)) = orders.filter(|(after, through)| after > through) {
            return wrong(format!("`{label}` is read from {after} to {through}"));
        }
        if let Some((first, last)) = lives.filter(|(first, last)| first > last || last.get() >= bundles) {
            return wrong(format!("`{label}` lives in bundles {first} to {last}, and there are {bundles}"));
        }
    }
    for NamedArray { name, base, sizes, .. } in arrays {
        spelled(name)?;
        let words = sizes.iter().try_fold(1u32, |words, size| words.checked_mul(*size));
        let end = words.filter(|words| *words > 0).and_then(|words| base.checked_add(words));
        if end.is_none_or(|end| end as usize > program.data.len()) || sizes.len() > ARRAY_INDICES {
            return wrong(format!("array `{name}` lies outside of the data"));
        }
    }
    Ok(())
}
