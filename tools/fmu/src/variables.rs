// SPDX-License-Identifier: MIT OR Apache-2.0
//! Variables of an FMU: ports and parameters of a program or a system, and what became of the last period.

use takt_isa::program::{Port, Range};
use takt_isa::system::{Description, End, SystemPort};
use takt_isa::{Program, Register, Type};
use takt_system::Host;

/// Value reference of the time.
pub(crate) const TIME: u32 = 0;

/// Role of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Causality {
    /// Input port.
    Input,
    /// Parameter (`.param`), which may be set between any two steps.
    Parameter,
    /// Output port, or a result of the period.
    Output,
}

/// Origin of a variable's value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    /// Port of a program, or parameter, in this register of a core.
    Port { core: usize, register: Register },
    /// Column of a system's row of inputs.
    Column(usize),
    /// Column of a system's row of outputs.
    Output(usize),
    /// The step took an entry out of a FIFO of a system.
    Popped(usize),
    /// Cycles of a core's last period.
    Cycles(usize),
    /// Missed ticks of a core so far.
    Missed(usize),
    /// Sticky exception flags of a core.
    Flags(usize),
    /// Level of an input pin of a circuit.
    Level(usize),
    /// Count of an encoder at a circuit.
    Count(usize),
    /// Port of the program at a circuit that the host sets.
    HostPort(usize),
    /// Part of a period in which an output pin of a circuit was 1.
    Part(usize),
}

/// Declaration of a port or parameter in a core's source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Declaration {
    pub(crate) core: usize,
    /// `.input`, `.output` or `.param`.
    pub(crate) directive: &'static str,
    pub(crate) name: String,
}

/// Variable of an FMU. Its value reference is its index plus 1; 0 is the time.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Name: that of the port or parameter.
    pub name: String,
    /// Type of the port.
    pub ty: Type,
    /// Role of the variable.
    pub causality: Causality,
    /// Range that the source states, as bits of the least and the largest value.
    pub range: Option<(u32, u32)>,
    /// Value at the start, as bits.
    pub start: u32,
    /// Unit with which the comment of the declaration begins.
    pub unit: Option<String>,
    /// Meaning in words; empty for ports and parameters.
    pub description: &'static str,
    pub(crate) declaration: Option<Declaration>,
    pub(crate) source: Source,
    /// The variable is a Boolean: 0 or 1. A field, since each access of a master asks for it.
    pub(crate) is_boolean: bool,
}

impl Variable {
    pub(crate) fn new(name: String, ty: Type, causality: Causality, source: Source) -> Variable {
        let (range, unit, declaration) = (None, None, None);
        let is_boolean = matches!(source, Source::Level(_));
        Variable {
            name,
            ty,
            causality,
            range,
            start: 0,
            unit,
            description: "",
            declaration,
            source,
            is_boolean,
        }
    }

    /// Port or parameter of a core's program, under its own name.
    fn of_port(core: usize, program: &Program, port: &Port, causality: Causality) -> Variable {
        let Port { name, register, ty } = port.clone();
        let directive = match causality {
            Causality::Input => ".input",
            Causality::Parameter => ".param",
            Causality::Output => ".output",
        };
        let mut variable = Variable::new(name.clone(), ty, causality, Source::Port { core, register });
        variable.declaration = Some(Declaration { core, directive, name });
        if causality != Causality::Output {
            let start = program.initial(register).unwrap_or(0);
            variable.bound(program.range(register), start);
        }
        variable
    }

    /// States a range and a start, or, if that lies outside, the end next to zero.
    pub(crate) fn bound(&mut self, range: Option<&Range>, start: u32) {
        self.start = match range {
            Some(range) if !range.holds(start) => match range.ends().0 > 0.0 {
                true => range.low,
                false => range.high,
            },
            _ => start,
        };
        self.range = range.map(|range| (range.low, range.high));
    }

    /// Value in words.
    pub(crate) fn text(&self, bits: u32) -> String {
        match self.ty {
            Type::F => format!("{:?}", f32::from_bits(bits)),
            Type::I => bits.cast_signed().to_string(),
            Type::B => bits.to_string(),
        }
    }

    /// The range that the source states has the value; so has no range at all.
    pub(crate) fn holds(&self, bits: u32) -> bool {
        let Some((low, high)) = self.range else { return true };
        match self.ty {
            Type::F => (f32::from_bits(low)..=f32::from_bits(high)).contains(&f32::from_bits(bits)),
            Type::I | Type::B => (low.cast_signed()..=high.cast_signed()).contains(&bits.cast_signed()),
        }
    }
}

/// A name that no variable has: `name`, or else `takt.name`.
pub(crate) fn free_name(taken: &[Variable], name: &str) -> String {
    let mut free = name.to_owned();
    while taken.iter().any(|variable| variable.name == free) {
        free.insert_str(0, "takt.");
    }
    free
}

/// Adds what became of a core's last period. Names begin with `prefix`.
fn add_results(variables: &mut Vec<Variable>, core: usize, prefix: &str) {
    let results = [
        ("cycles", Source::Cycles(core), "Cycles of the last period, from its tick to its wait"),
        ("missed", Source::Missed(core), "Periods so far that did not end before the next tick"),
        (
            "flags",
            Source::Flags(core),
            "Sticky exception flags: 4 overflow, 8 division by zero, 16 invalid operation",
        ),
    ];
    for (name, source, description) in results {
        let name = free_name(variables, &format!("{prefix}{name}"));
        let variable = Variable::new(name, Type::I, Causality::Output, source);
        variables.push(Variable { description, ..variable });
    }
}

/// Variables of a program, in the order of their value references.
pub(crate) fn of_program(program: &Program) -> Vec<Variable> {
    let of = |ports: &[Port], causality| -> Vec<Variable> {
        ports.iter().map(|port| Variable::of_port(0, program, port, causality)).collect()
    };
    let mut variables = of(&program.inputs, Causality::Input);
    variables.extend(of(&program.parameters, Causality::Parameter));
    variables.extend(of(&program.outputs, Causality::Output));
    add_results(&mut variables, 0, "");
    variables
}

/// Input of a system: a value that one core or several receive, each with its range.
///
/// # Errors
/// If the ranges of the receivers have no value in common.
fn system_input(description: &Description, column: usize, input: &SystemPort) -> Result<Variable, String> {
    let SystemPort { name, ty, .. } = input.clone();
    let mut variable = Variable::new(name, ty, Causality::Input, Source::Column(column));
    let mut common: Option<Range> = None;
    for (core, register) in description.receivers(input) {
        let program = &description.cores[core].program;
        if let (None, Some(port)) =
            (&variable.declaration, program.inputs.iter().find(|port| port.register == register))
        {
            let (directive, name) = (".input", port.name.clone());
            variable.declaration = Some(Declaration { core, directive, name });
        }
        let Some(range) = program.range(register).filter(|range| range.ty == ty) else { continue };
        let both = common.get_or_insert(*range);
        if range.ends().0 > both.ends().0 {
            both.low = range.low;
        }
        if range.ends().1 < both.ends().1 {
            both.high = range.high;
        }
        if both.ends().0 > both.ends().1 {
            return Err(variable.name);
        }
    }
    variable.bound(common.as_ref(), 0);
    Ok(variable)
}

/// Output of a system, as a core sends it.
fn system_output(description: &Description, column: usize, output: &SystemPort) -> Variable {
    let SystemPort { name, ty, link, field } = output.clone();
    let mut variable = Variable::new(name, ty, Causality::Output, Source::Output(column));
    let link = &description.links[link];
    if let End::Core(core) = link.from {
        let (directive, name) = (".output", link.fields[field].from.clone());
        variable.declaration = Some(Declaration { core, directive, name });
    }
    variable
}

/// Variables of a system, in the order of their value references.
///
/// # Errors
/// Name of an input whose receivers state ranges without a common value.
pub(crate) fn of_system(description: &Description) -> Result<Vec<Variable>, String> {
    let host = Host::new(description);
    let mut variables = Vec::new();
    for (column, input) in host.inputs.iter().enumerate() {
        variables.push(system_input(description, column, input)?);
    }
    for (column, push) in host.columns(description).into_iter().enumerate().skip(host.inputs.len()) {
        let variable = Variable::new(push.name, push.ty, Causality::Input, Source::Column(column));
        let description = "Not 0: each base tick of the step puts an entry into the FIFO";
        variables.push(Variable { description, ..variable });
    }
    for (number, core) in description.cores.iter().enumerate() {
        for parameter in &core.program.parameters {
            let variable = Variable::of_port(number, &core.program, parameter, Causality::Parameter);
            variables.push(Variable { name: format!("{}.{}", core.name, parameter.name), ..variable });
        }
    }
    for (column, output) in host.outputs.iter().enumerate() {
        variables.push(system_output(description, column, output));
    }
    for (number, &link) in host.pops.iter().enumerate() {
        let name = free_name(&variables, &format!("{}.popped", description.links[link].name));
        let variable = Variable::new(name, Type::I, Causality::Output, Source::Popped(number));
        let description = "1: the last base tick took an entry out of the FIFO; 0: the FIFO was empty, and its fields are 0";
        variables.push(Variable { description, ..variable });
    }
    for (number, core) in description.cores.iter().enumerate() {
        add_results(&mut variables, number, &format!("{}.", core.name));
    }
    Ok(variables)
}
