// SPDX-License-Identifier: MIT OR Apache-2.0
//! Fields of an image other than its words: all compared with the source's here, one by one.
//!
//! Path-dependent facts are compared while both programs run, with the [`Layout`] found here: bounds where loops begin and iterate, labels
//! where they are passed, named registers at each tick.

use crate::Difference;
use crate::code::{inputs_of, named, refuse};
use crate::labels::{self, Labels};
use foldhash::{HashMap, HashMapExt as _, HashSet, HashSetExt as _};
use takt_asm::plain::{PlainKind, PlainProgram, PlainRegister};
use takt_isa::program::{ArrayRange, Assumption, LoopBound, Port, Range, Section, Space};
use takt_isa::{Instruction, Machine, Program, Register, Type};

/// Locations in the image of the source's declarations.
pub(crate) struct Layout {
    /// Register of each output of the source.
    pub(crate) outputs: Vec<Register>,
    /// Register of each input of the source, then of each parameter.
    pub(crate) inputs: Vec<Register>,
    /// Named registers other than ports: index in the source, and register in the image.
    pub(crate) registers: Vec<(usize, Register)>,
    /// Labels of both programs.
    pub(crate) labels: Labels,
    /// First bundle of `period` in the image.
    pub(crate) period: u32,
    /// Bounds of the image's loops, by first bundle.
    pub(crate) bounds: HashMap<u32, Bound>,
}

/// Maximum number of iterations of a loop per run, and per section.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Bound {
    pub(crate) most: u32,
    pub(crate) total: Option<u32>,
}

impl Bound {
    /// Bound of two loops whose bodies vanished, so that both begin at one bundle.
    pub(crate) fn merged(self, other: Bound) -> Bound {
        let total = self.total.zip(other.total).map(|(one, other)| one.saturating_add(other));
        Bound { most: self.most.max(other.most), total }
    }

    pub(crate) fn text(self) -> String {
        match self.total {
            Some(total) => format!("{} iterations, {total} in a section", self.most),
            None => format!("{} iterations", self.most),
        }
    }
}

/// Compares all fields of an image except the words of its code.
pub(crate) fn compare(program: &Program, plain: &PlainProgram) -> Result<Layout, Difference> {
    // Exhaustive: a new field does not compile until it is handled.
    let Program {
        machine,
        code: _, // is executed: crate::code, crate::run
        data,
        constants,
        inputs,
        outputs,
        parameters,
        latched,
        registers,
        symbols,
        sections,
        loop_bounds,
        ranges,
        array_ranges,
        results,
        assumptions,
        // File names and line numbers serve messages only.
        files: _,
        lines: _,
        parts: _,
        origins: _,
    } = program;
    if *machine != plain.machine {
        let (image, source) = (machine.name, plain.machine.name);
        return Err(refuse(format!("the image is for {image}, the source for {source}")));
    }
    if *latched != plain.latched {
        return Err(refuse("image and source differ in whether ports are latched".to_owned()));
    }
    compare_data(program, data, plain)?;
    let mut inputs = compare_ports(inputs, plain, PlainKind::Input)?;
    inputs.extend(compare_ports(parameters, plain, PlainKind::Parameter)?);
    let outputs = compare_ports(outputs, plain, PlainKind::Output)?;
    let registers = compare_registers(registers, plain)?;
    let period = compare_sections(sections, program.bundles(), plain)?;
    let layout = Layout {
        outputs,
        inputs,
        registers,
        labels: labels::compare(symbols, period, plain)?,
        period,
        bounds: bounds(loop_bounds),
    };
    compare_constants(program, constants, plain, &layout)?;
    compare_ranges(ranges, plain, &layout)?;
    compare_array_ranges(program, array_ranges, plain)?;
    if *results != plain.results {
        return Err(refuse("image and source differ in the arrays that are results".to_owned()));
    }
    let is_said =
        |&&Assumption { ty, low, high, .. }: &&Assumption| plain.assumptions.contains(&(ty, [low, high]));
    if let Some(assumption) = assumptions.iter().find(|assumption| !is_said(assumption)) {
        let place = program.word_text(assumption.word as usize);
        return Err(refuse(format!("the image assumes a range at {place} that the source does not")));
    }
    Ok(layout)
}

fn differ(what: String, source: impl Into<Option<String>>, image: impl Into<Option<String>>) -> Difference {
    Difference { place: None, what, source: source.into(), image: image.into() }
}

fn compare_data(program: &Program, data: &[u32], plain: &PlainProgram) -> Result<(), Difference> {
    let word = |data: &[u32], at: usize| data.get(at).copied().unwrap_or(0);
    let length = data.len().max(plain.data.len());
    let Some(at) = (0..length).find(|at| word(data, *at) != word(&plain.data, *at)) else { return Ok(()) };
    let name = program.data_text(at as u32);
    let text = |data: &[u32]| format!("{:?} (0x{:08x})", f32::from_bits(word(data, at)), word(data, at));
    Err(differ(format!("{name} differs from the source's"), text(&plain.data), text(data)))
}

/// The image's name may differ from the source's: the assembler renames its own names (which contain a point) if they collide or are too
/// long.
pub(crate) fn is_name_of(image: &str, source: &str) -> bool {
    image == source || source.contains('.') && image.contains("._")
}

/// Number of each input or output of a source, in order of declaration: the stated number, or else the first free one (docs/language.md,
/// Numbers of ports).
fn numbers(plain: &PlainProgram, kind: PlainKind) -> Vec<u32> {
    let machine = plain.machine;
    let of = |register: Register| number_of(machine, kind, register);
    let given = |register: &PlainRegister| {
        let own = register.number.filter(|_| register.kind == kind);
        own.or_else(|| register.pinned.and_then(of)).map(u32::from)
    };
    // Parameters are numbered behind the inputs.
    let before = if kind == PlainKind::Parameter { numbers(plain, PlainKind::Input) } else { Vec::new() };
    let mut taken: HashSet<u32> = plain.registers.iter().filter_map(given).chain(before).collect();
    let mut number = |register: &PlainRegister| {
        given(register).unwrap_or_else(|| {
            let free = (0..).find(|number| !taken.contains(number)).unwrap_or(u32::MAX);
            taken.insert(free);
            free
        })
    };
    plain.registers.iter().filter(|register| register.kind == kind).map(&mut number).collect()
}

/// Number of a port of a kind.
fn number_of(machine: &Machine, kind: PlainKind, register: Register) -> Option<u16> {
    match kind {
        PlainKind::Input | PlainKind::Parameter => machine.input_number(register),
        _ => machine.output_number(register),
    }
}

/// Kind of a named register in messages.
fn kind_text(kind: PlainKind) -> &'static str {
    match kind {
        PlainKind::Input => "input",
        PlainKind::Output => "output",
        PlainKind::Parameter => "parameter",
        PlainKind::Plain | PlainKind::State => "register",
    }
}

fn compare_ports(ports: &[Port], plain: &PlainProgram, kind: PlainKind) -> Result<Vec<Register>, Difference> {
    let machine: &Machine = plain.machine;
    let what = kind_text(kind);
    let mut places = Vec::new();
    let mut ports = ports.iter();
    for ((id, known), number) in named(plain, kind).zip(numbers(plain, kind)) {
        let register = &plain.registers[id];
        let Some(Port { name, register: place, ty }) = ports.next() else {
            return Err(refuse(format!("the image has no {what} `{known}`")));
        };
        if !is_name_of(name, known) {
            let what = format!("the image has another {what} in the place of `{known}`");
            return Err(differ(what, known.to_owned(), name.clone()));
        }
        if *ty != register.ty {
            let what = format!("{what} `{known}` has another type in the image");
            return Err(differ(what, register.ty.name().to_owned(), ty.name().to_owned()));
        }
        let Some(found) = number_of(machine, kind, *place) else {
            return Err(refuse(format!("{what} `{known}` is no port of its kind in the image")));
        };
        if u32::from(found) != number || register.pinned.is_some_and(|pinned| pinned != *place) {
            let text = |register| machine.register_name(register).unwrap_or_default();
            let source = register.pinned.map_or_else(|| format!("port {number}"), text);
            let image = register.pinned.map_or_else(|| format!("port {found}"), |_| text(*place));
            return Err(differ(format!("{what} `{known}` is another port in the image"), source, image));
        }
        places.push(*place);
    }
    match ports.next() {
        Some(port) => Err(refuse(format!("the source does not declare {what} `{}` of the image", port.name))),
        None => Ok(places),
    }
}

/// Compares the named registers: each has the source's type and location. Every state that is used must be named.
fn compare_registers(ports: &[Port], plain: &PlainProgram) -> Result<Vec<(usize, Register)>, Difference> {
    let own = |register: &PlainRegister| matches!(register.kind, PlainKind::Plain | PlainKind::State);
    let of_source =
        plain.registers.iter().enumerate().filter(|(_, known)| own(known) && !known.name.is_empty());
    let ids: HashMap<&str, usize> = of_source.map(|(id, register)| (register.name.as_str(), id)).collect();
    let mut found: Vec<(usize, Register)> = Vec::new();
    let mut seen: HashSet<usize> = HashSet::new();
    for Port { name, register, ty } in ports {
        let Some(&id) = ids.get(name.as_str()) else {
            // Names of the assembler's own contain a point: versions of values, loop counters.
            if name.contains('.') {
                continue;
            }
            return Err(refuse(format!("the image has a register `{name}` that the source does not")));
        };
        let known = &plain.registers[id];
        if *ty != known.ty {
            let what = format!("register `{name}` has another type in the image");
            return Err(differ(what, known.ty.name().to_owned(), ty.name().to_owned()));
        }
        if known.pinned.is_some_and(|pinned| pinned != *register) {
            return Err(refuse(format!("register `{name}` has another place in the image")));
        }
        seen.insert(id);
        found.push((id, *register));
    }
    let mut used: HashSet<usize> = HashSet::new();
    for operation in plain.bundles.iter().flat_map(|bundle| &bundle.operations) {
        let reads = &operation.sources[..operation.op.row().shape.sources()];
        used.extend(reads.iter().chain(&operation.dest).map(|register| *register as usize));
    }
    let states = named(plain, PlainKind::State);
    let mut missing =
        states.filter(|(id, name)| used.contains(id) && !seen.contains(id) && !name.contains('.'));
    match missing.next() {
        Some((_, name)) => Err(refuse(format!("the image has no register `{name}`"))),
        None => Ok(found),
    }
}

/// Checks that the sections are `once` and then `period`, covering all bundles. Returns the first bundle of `period`.
fn compare_sections(sections: &[Section], bundles: u32, plain: &PlainProgram) -> Result<u32, Difference> {
    let mut period = bundles;
    let mut at = 0;
    for Section { name, start, end } in sections {
        if start.get() != at || end <= start || !matches!((name.as_str(), at), ("once", 0) | ("period", _)) {
            return Err(refuse(format!("section `{name}` of the image does not follow the one before it")));
        }
        if name == "period" {
            period = at;
        }
        at = end.get();
    }
    let has_once = period > 0 && bundles > 0;
    if at != bundles || sections.len() > 2 || has_once && plain.period == 0 {
        return Err(refuse("the image's sections differ from the source's".to_owned()));
    }
    Ok(period)
}

fn bounds(loop_bounds: &[LoopBound]) -> HashMap<u32, Bound> {
    let bound = |&LoopBound { address, most, total }: &LoopBound| (address.get(), Bound { most, total });
    loop_bounds.iter().map(bound).collect()
}

/// Compares presets. Operands are compared where operations read them, and first values of outputs before anything runs; this covers the
/// other registers.
fn compare_constants(
    program: &Program,
    constants: &[(Register, u32)],
    plain: &PlainProgram,
    layout: &Layout,
) -> Result<(), Difference> {
    let mut left: HashMap<Register, u32> = HashMap::new();
    for &(register, bits) in constants {
        if left.insert(register, bits).is_some() {
            return Err(refuse("the loader writes a register twice".to_owned()));
        }
    }
    let inputs = inputs_of(plain).zip(layout.inputs.iter().copied());
    let outputs = named(plain, PlainKind::Output).map(|(id, _)| id).zip(layout.outputs.iter().copied());
    let own = |register: &PlainRegister| matches!(register.kind, PlainKind::Plain | PlainKind::State);
    let pinned = plain.registers.iter().enumerate().filter(|(_, register)| own(register));
    let pinned = pinned.filter_map(|(id, register)| Some((id, register.pinned?)));
    let pinned = pinned.filter(|(_, place)| *place != Register::ZERO);
    let operations = plain.bundles.iter().flat_map(|bundle| &bundle.operations);
    let written: HashSet<usize> = operations.filter_map(|operation| Some(operation.dest? as usize)).collect();
    for (id, place) in inputs.chain(outputs).chain(layout.registers.iter().copied()).chain(pinned) {
        let known = &plain.registers[id];
        // Several names of the source may share a register.
        let said = known.preset.or_else(|| {
            let same = |other: &&PlainRegister| known.pinned.is_some() && other.pinned == known.pinned;
            plain.registers.iter().filter(same).find_map(|other| other.preset)
        });
        let found = program.initial(place);
        // If an operation writes the register, the loader may preset a constant of `once` there; the tick compares its value.
        if said != found && !written.contains(&id) {
            let text = |bits: Option<u32>| bits.map(|bits| format!("0x{bits:08x}"));
            let kind = kind_text(known.kind);
            let name = program.register_text(place);
            let what = format!("{kind} `{name}` has another value at the start in the image");
            return Err(differ(what, text(said), text(found)));
        }
        left.remove(&place);
    }
    let instructions = program.code.iter().filter_map(|&word| Instruction::decode(word).ok());
    for instruction in instructions {
        for register in instruction.reads() {
            left.remove(register);
        }
    }
    let first = constants.iter().find(|(register, _)| left.contains_key(register));
    first.map_or(Ok(()), |(register, _)| {
        let name = program.register_text(*register);
        Err(refuse(format!("the loader writes {name}, which nothing reads and the source does not preset")))
    })
}

fn compare_ranges(ranges: &[Range], plain: &PlainProgram, layout: &Layout) -> Result<(), Difference> {
    let inputs = inputs_of(plain).zip(layout.inputs.iter().copied());
    let outputs = named(plain, PlainKind::Output).map(|(id, _)| id).zip(layout.outputs.iter().copied());
    let places: HashMap<usize, Register> =
        inputs.chain(outputs).chain(layout.registers.iter().copied()).collect();
    let mut left: Vec<&Range> = ranges.iter().collect();
    let mut done: HashSet<u32> = HashSet::new();
    // The first of several ranges for a register holds.
    for &(id, ends) in plain.ranges.iter().filter(|(id, _)| done.insert(*id)) {
        let known = &plain.registers[id as usize];
        let said = (if known.ty == Type::I { Type::I } else { Type::F }, ends);
        let place = places.get(&(id as usize)).copied().or(known.pinned);
        let is_said = |&Range { register, ty, low, high }: &Range| {
            place.is_none_or(|place| register == place) && (ty, [low, high]) == said
        };
        match left.iter().position(|range| is_said(range)) {
            Some(found) => _ = left.remove(found),
            // An unused register has no location.
            None if place.is_none() => {}
            None => return Err(refuse(format!("the range of `{}` is another in the image", known.name))),
        }
    }
    match left.first() {
        Some(range) => {
            let name = plain.machine.register_name(range.register).unwrap_or_default();
            Err(refuse(format!("the image has a range for {name} that the source does not")))
        }
        None => Ok(()),
    }
}

fn compare_array_ranges(
    program: &Program,
    ranges: &[ArrayRange],
    plain: &PlainProgram,
) -> Result<(), Difference> {
    let lacks = |all: &[ArrayRange], range: &&ArrayRange| !all.contains(range);
    if let Some(range) = plain.array_ranges.iter().find(|range| lacks(ranges, range)) {
        let name = program.data_text(range.first);
        return Err(refuse(format!("the range of {name} is another in the image")));
    }
    match ranges.iter().find(|range| lacks(&plain.array_ranges, range)) {
        Some(range) => {
            let name = program.data_text(range.first);
            Err(refuse(format!("the image has a range for {name} that the source does not")))
        }
        None => Ok(()),
    }
}

/// Name of the memory in messages.
pub(crate) fn memory(space: Space) -> &'static str {
    match space {
        Space::Code => "code",
        Space::Data => "data",
    }
}
