// SPDX-License-Identifier: MIT OR Apache-2.0
//! The file `modelDescription.xml` of an FMU.

use crate::model::Model;
use crate::variables::{Causality, TIME, Variable, free_name};
use std::collections::BTreeSet;
use std::fmt::Write as _;
use takt_asm::units::{self, SI, SiUnit};
use takt_isa::Type;

/// Version of the standard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fmi {
    /// FMI 2.0.
    Two,
    /// FMI 3.0.
    Three,
}

/// Category of errors in the log.
pub(crate) const ERROR: &str = "logStatusError";
/// Category of warnings in the log.
pub(crate) const WARNING: &str = "logStatusWarning";
/// Categories of the log, each with its meaning.
const CATEGORIES: [(&str, &str); 2] =
    [(ERROR, "Calls that failed, with the reason"), (WARNING, "Missed ticks, and NaNs on outputs")];

/// Text as XML in an attribute. Characters that XML cannot have are left out.
fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\u{fffe}' | '\u{ffff}' => {}
            c if c.is_control() => {}
            c => escaped.push(c),
        }
    }
    escaped
}

/// Bits as a number of XML Schema. FMI 2.0 has binary64 only: there a binary32 number has all its digits.
fn number(ty: Type, bits: u32, fmi: Fmi) -> String {
    let value = f32::from_bits(bits);
    match (ty, fmi) {
        (Type::F, _) if value.is_nan() => "NaN".to_owned(),
        (Type::F, _) if value.is_infinite() => if value > 0.0 { "INF" } else { "-INF" }.to_owned(),
        (Type::F, Fmi::Two) => format!("{:?}", f64::from(value)),
        (Type::F, Fmi::Three) => format!("{value:?}"),
        (Type::B, Fmi::Three) => bits.to_string(),
        (Type::I | Type::B, _) => bits.cast_signed().to_string(),
    }
}

/// Unit of the time.
const SECOND: &str = "s";

/// Unit of a variable; integers have none in FMI.
fn unit(variable: &Variable) -> Option<&str> {
    variable.unit.as_deref().filter(|_| variable.ty == Type::F)
}

/// Definitions of all units, in SI base units where their meaning is known.
fn unit_definitions(out: &mut String, model: &Model) {
    let names: BTreeSet<&str> = model.variables.iter().filter_map(unit).chain([SECOND]).collect();
    out.push_str("  <UnitDefinitions>\n");
    for name in names {
        let _ = match units::si(name) {
            None => writeln!(out, "    <Unit name=\"{}\"/>", escape(name)),
            Some(si) => {
                writeln!(out, "    <Unit name=\"{}\"><BaseUnit{}/></Unit>", escape(name), base_unit(&si))
            }
        };
    }
    out.push_str("  </UnitDefinitions>\n");
}

/// Attributes of a unit in SI base units, without those that have their defaults.
fn base_unit(si: &SiUnit) -> String {
    let mut text = String::new();
    for (name, exponent) in SI.iter().zip(si.exponents).filter(|(_, exponent)| *exponent != 0) {
        let _ = write!(text, " {name}=\"{exponent}\"");
    }
    for (name, value, default) in [("factor", si.factor, 1.0), ("offset", si.offset, 0.0)] {
        if value != default {
            let _ = write!(text, " {name}=\"{value:?}\"");
        }
    }
    text
}

/// Attributes of the value: its unit, its start, and its range.
fn value_attributes(variable: &Variable, fmi: Fmi) -> String {
    let mut text = String::new();
    if let Some(unit) = unit(variable) {
        let _ = write!(text, " unit=\"{}\"", escape(unit));
    }
    if let Some((low, high)) = variable.range {
        let (low, high) = (number(variable.ty, low, fmi), number(variable.ty, high, fmi));
        let _ = write!(text, " min=\"{low}\" max=\"{high}\"");
    }
    if variable.causality != Causality::Output {
        let start = match variable.is_boolean {
            true => (variable.start != 0).to_string(),
            false => number(variable.ty, variable.start, fmi),
        };
        let _ = write!(text, " start=\"{start}\"");
    }
    text
}

/// One variable as an element.
fn element(out: &mut String, reference: usize, variable: &Variable, fmi: Fmi) {
    let (causality, variability) = match variable.causality {
        Causality::Input => ("input", "discrete"),
        Causality::Parameter => ("parameter", "tunable"),
        Causality::Output => ("output", "discrete"),
    };
    let mut common = format!("name=\"{}\" valueReference=\"{reference}\"", escape(&variable.name));
    if !variable.description.is_empty() {
        let _ = write!(common, " description=\"{}\"", escape(variable.description));
    }
    let _ = write!(common, " causality=\"{causality}\" variability=\"{variability}\"");
    let values = value_attributes(variable, fmi);
    let _ = match (fmi, variable.ty) {
        (Fmi::Two, ty) => {
            let tag = match ty {
                _ if variable.is_boolean => "Boolean",
                Type::F => "Real",
                Type::I | Type::B => "Integer",
            };
            writeln!(out, "    <ScalarVariable {common}><{tag}{values}/></ScalarVariable>")
        }
        (Fmi::Three, _) if variable.is_boolean => writeln!(out, "    <Boolean {common}{values}/>"),
        (Fmi::Three, Type::F) => writeln!(out, "    <Float32 {common}{values}/>"),
        (Fmi::Three, Type::I) => writeln!(out, "    <Int32 {common}{values}/>"),
        (Fmi::Three, Type::B) => writeln!(out, "    <UInt32 {common}{values}/>"),
    };
}

/// The variables; the time is the first.
fn variables(out: &mut String, model: &Model, fmi: Fmi) {
    let time = free_name(&model.variables, "time");
    let attributes = format!(
        "name=\"{time}\" valueReference=\"{TIME}\" description=\"Time\" causality=\"independent\" variability=\"continuous\""
    );
    out.push_str("  <ModelVariables>\n");
    let _ = match fmi {
        Fmi::Two => {
            writeln!(out, "    <ScalarVariable {attributes}><Real unit=\"{SECOND}\"/></ScalarVariable>")
        }
        Fmi::Three => writeln!(out, "    <Float64 {attributes} unit=\"{SECOND}\"/>"),
    };
    for (index, variable) in model.variables.iter().enumerate() {
        element(out, index + 1, variable, fmi);
    }
    out.push_str("  </ModelVariables>\n");
}

/// The outputs, all unknown at the start. Without dependencies each may depend on all inputs.
fn structure(out: &mut String, model: &Model, fmi: Fmi) {
    let outputs = model.variables.iter().enumerate();
    let outputs: Vec<usize> = outputs
        .filter(|(_, variable)| variable.causality == Causality::Output)
        // FMI 2.0 counts variables from 1, the time included.
        .map(|(index, _)| if fmi == Fmi::Two { index + 2 } else { index + 1 })
        .collect();
    out.push_str("  <ModelStructure>\n");
    match fmi {
        Fmi::Two => {
            for list in ["Outputs", "InitialUnknowns"] {
                let _ = writeln!(out, "    <{list}>");
                for index in &outputs {
                    let _ = writeln!(out, "      <Unknown index=\"{index}\"/>");
                }
                let _ = writeln!(out, "    </{list}>");
            }
        }
        Fmi::Three => {
            for tag in ["Output", "InitialUnknown"] {
                for reference in &outputs {
                    let _ = writeln!(out, "    <{tag} valueReference=\"{reference}\"/>");
                }
            }
        }
    }
    out.push_str("  </ModelStructure>\n");
}

/// The description of an FMU with this name, whose library has the name `identifier`.
pub fn write(model: &Model, name: &str, identifier: &str, fmi: Fmi) -> String {
    let (version, token, state, step) = match fmi {
        Fmi::Two => ("2.0", "guid", "FMUstate", String::new()),
        Fmi::Three => (
            "3.0",
            "instantiationToken",
            "FMUState",
            format!(" fixedInternalStepSize=\"{:?}\"", model.settings.period),
        ),
    };
    let states = model.has_states();
    let memory = if fmi == Fmi::Two { " canNotUseMemoryManagementFunctions=\"true\"" } else { "" };
    let mut out = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <fmiModelDescription fmiVersion=\"{version}\" modelName=\"{}\" {token}=\"{}\" generationTool=\"Takt {}\" \
         variableNamingConvention=\"structured\">\n  \
         <CoSimulation modelIdentifier=\"{identifier}\" canHandleVariableCommunicationStepSize=\"false\"{memory} \
         canGetAndSet{state}=\"{states}\" canSerialize{state}=\"{states}\"{step}/>\n",
        escape(name),
        model.token(),
        env!("CARGO_PKG_VERSION"),
    );
    unit_definitions(&mut out, model);
    out.push_str("  <LogCategories>\n");
    for (category, meaning) in CATEGORIES {
        let _ = writeln!(out, "    <Category name=\"{category}\" description=\"{meaning}\"/>");
    }
    let _ = write!(
        out,
        "  </LogCategories>\n  <DefaultExperiment startTime=\"0\" stepSize=\"{:?}\"/>\n",
        model.settings.period
    );
    variables(&mut out, model, fmi);
    structure(&mut out, model, fmi);
    out.push_str("</fmiModelDescription>\n");
    out
}
