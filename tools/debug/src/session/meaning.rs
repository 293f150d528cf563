// SPDX-License-Identifier: MIT OR Apache-2.0
//! Meaning of a name in the source at a position: the value that the current line would read.
//!
//! The assembler allocates separate registers to the values of one name, shares a register between successive values, and renames a
//! macro's names in each use: see [`takt_asm::names`].

use super::machine::Machine;
use std::collections::HashMap;
use takt_asm::expr::Value;
use takt_asm::names::{NamedValue, Names};
use takt_isa::program::Port;
use takt_isa::{BundleAddress, Program, Register, Type};

/// Meaning of a name in one scope.
#[derive(Clone, Debug)]
pub(super) enum Meaning {
    /// A constant or an address.
    Constant(Value),
    /// Registers: one for all values of the name, or one for each.
    Values(Vec<NameValue>),
}

/// A value of a name, with its register.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct NameValue {
    /// Unique name of the value (`t.1`), or the name in the source if that has only one value.
    pub(crate) label: String,
    pub(crate) register: Register,
    pub(crate) ty: Type,
    /// Order numbers in the source; see [`NamedValue::orders`].
    pub(crate) orders: Option<(u32, u32)>,
    /// First and last bundle of the value's life; see [`NamedValue::bundles`].
    pub(crate) bundles: Option<(BundleAddress, BundleAddress)>,
    /// Bundles that write another value to the register first, with that value's name.
    rivals: Vec<(BundleAddress, String)>,
}

impl NameValue {
    pub(super) fn always(port: &Port) -> NameValue {
        let Port { name, register, ty } = port;
        let (label, register, ty) = (name.clone(), *register, *ty);
        NameValue { label, register, ty, orders: None, bundles: None, rivals: Vec::new() }
    }

    fn of(value: &NamedValue, names: &Names) -> NameValue {
        let rivals = names.values.iter().filter(|other| other.register == value.register && *other != value);
        let rivals = rivals.filter_map(|rival| Some((rival.bundles?.0, rival.label.clone())));
        NameValue {
            label: value.label.clone(),
            register: value.register,
            ty: value.ty,
            orders: value.orders,
            bundles: value.bundles,
            rivals: rivals.collect(),
        }
    }

    /// The register never holds another value.
    pub(crate) fn is_alone(&self) -> bool {
        self.rivals.is_empty()
    }

    /// Range of addresses of the next bundle within which the register holds the value: after the first, up to and including the second.
    /// `None`: everywhere.
    pub(crate) fn range(&self) -> Option<(BundleAddress, BundleAddress)> {
        let (first, _) = self.bundles.filter(|_| self.orders.is_some() || !self.is_alone())?;
        let rivals = self.rivals.iter().map(|(at, _)| *at).filter(|at| first < *at);
        Some((first, rivals.min().unwrap_or(BundleAddress::new(u32::MAX))))
    }

    /// Checks that the register holds the value, or that the value is about to arrive.
    ///
    /// # Errors
    /// If the register holds another value; the message names it.
    pub(crate) fn is_there(&self, machine: &Machine<'_>, program: &Program) -> Result<(), String> {
        let Some((first, _)) = self.bundles else { return Ok(()) };
        let next = machine.emulator.next_address();
        if next <= first && (self.orders.is_some() || !self.is_alone()) {
            return Err(format!("{} is not computed yet: {} does", self.label, program.bundle_text(first)));
        }
        let later = self.rivals.iter().filter(|(at, _)| first < *at && *at < next).max();
        match later {
            Some((at, rival)) => {
                let place = program.machine.register_name(self.register).unwrap_or_default();
                let at = program.bundle_text(*at);
                Err(format!("{} is gone: its register {place} has {rival} since {at}", self.label))
            }
            None if self.is_alone() || machine.ahead => Ok(()),
            // Until the value arrives, the register holds the previous one.
            None => match machine.arrives(self.register) {
                None => Ok(()),
                Some(left) => Err(format!("{} is in flight: it arrives in {left} cycles", self.label)),
            },
        }
    }
}

/// A register that a name may denote, with the range of the value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LiveRange {
    /// Unique name of the value: `t.1`, or the name in the source.
    pub label: String,
    /// Register that holds the value.
    pub register: Register,
    /// Type in which the bits are interpreted.
    pub ty: Type,
    /// Bundle of the first write, and of the last read; `None` if the value lives everywhere.
    pub bundles: Option<(BundleAddress, BundleAddress)>,
    /// The current line would read this value.
    pub at_hand: bool,
}

/// A name whose meaning depends on the position.
#[derive(Clone, Debug)]
pub(super) struct Name {
    name: String,
    /// Meaning in scopes that do not redefine the name.
    global: Option<Meaning>,
    /// Meanings by scope number, ascending.
    scoped: Vec<(u32, Meaning)>,
}

impl Name {
    /// Meanings of a name; `None` if the name is unknown.
    pub(super) fn find(
        name: &str,
        global: Option<Meaning>,
        program: &Program,
        names: &Names,
    ) -> Option<Name> {
        let mut known: HashMap<&str, &Port> = HashMap::new();
        let mut symbols: HashMap<&str, u32> = HashMap::new();
        if names.scopes.len() > 1 {
            known.extend(program.named_registers().map(|port| (port.name.as_str(), port)));
            symbols.extend(program.symbols.iter().map(|symbol| (symbol.name.as_str(), symbol.address)));
        }
        let register = |name: &str| {
            held(name, names)
                .or_else(|| known.get(name).map(|port| vec![NameValue::always(port)]))
                .map(Meaning::Values)
        };
        let scoped = (0..).zip(&names.scopes).skip(1).filter_map(|(number, scope)| {
            let parameter = scope.parameters.iter().find(|(parameter, _)| parameter == name);
            let meaning = match parameter {
                Some((_, argument)) => register(argument),
                None => {
                    let full = format!("{}.{name}", scope.name);
                    let symbol = || symbols.get(full.as_str());
                    register(&full).or_else(|| Some(Meaning::Constant(Value::Int((*symbol()?).into()))))
                }
            };
            Some((number, meaning?))
        });
        let scoped: Vec<(u32, Meaning)> = scoped.collect();
        let name = Name { name: name.to_owned(), global, scoped };
        (name.global.is_some() || !name.scoped.is_empty()).then_some(name)
    }

    /// The name's meaning, if it is the same at all positions.
    pub(super) fn fixed(&self) -> Option<&Meaning> {
        match &self.global {
            Some(Meaning::Values(values)) if !matches!(&values[..], [only] if only.is_alone()) => None,
            global if self.scoped.is_empty() => global.as_ref(),
            _ => None,
        }
    }

    /// The name's meaning at the machine's position.
    ///
    /// # Errors
    /// If the name is unknown in the scope at that position.
    pub(super) fn at(&self, machine: &Machine<'_>) -> Result<NameMeaning<'_>, String> {
        let names = machine.names;
        let position = machine.at_hand();
        let scope = self.scoped.binary_search_by_key(&position.scope(), |(number, _)| *number);
        let meaning = scope.ok().map(|index| &self.scoped[index].1).or(self.global.as_ref());
        match meaning {
            Some(Meaning::Constant(value)) => Ok(NameMeaning::Constant(*value)),
            Some(Meaning::Values(values)) => {
                let reads =
                    |(after, through): (u32, u32)| after < position.order && position.order <= through;
                let at_hand = values.iter().find(|value| value.orders.is_some_and(reads));
                let at_hand = at_hand.or_else(|| values.iter().find(|value| value.orders.is_none()));
                at_hand.map(NameMeaning::Value).ok_or_else(|| format!("no line here reads `{}`", self.name))
            }
            None => {
                let full = self.scoped.iter().filter_map(|(number, _)| names.scopes.get(*number as usize));
                let mut full: Vec<String> =
                    full.map(|scope| format!("{}.{}", scope.name, self.name)).collect();
                let more = if full.len() > 4 { " …" } else { "" };
                full.truncate(4);
                Err(format!(
                    "`{}` is a macro's, and this line is in no use of it ({}{more})",
                    self.name,
                    full.join(" ")
                ))
            }
        }
    }

    /// All values that the name may denote.
    pub(super) fn values(&self) -> impl Iterator<Item = &NameValue> {
        let all = self.global.iter().chain(self.scoped.iter().map(|(_, meaning)| meaning));
        all.flat_map(|meaning| match meaning {
            Meaning::Values(values) => &values[..],
            Meaning::Constant(_) => &[],
        })
    }
}

/// Meaning of a name at a position.
#[derive(Clone, Copy, Debug)]
pub(super) enum NameMeaning<'n> {
    Constant(Value),
    Value(&'n NameValue),
}

/// Values of a name that has several values or a shared register; also the single value that has this unique name.
pub(super) fn held(name: &str, names: &Names) -> Option<Vec<NameValue>> {
    let of = |wanted: &dyn Fn(&NamedValue) -> bool| {
        let values = names.values.iter().filter(|value| wanted(value));
        let values: Vec<NameValue> = values.map(|value| NameValue::of(value, names)).collect();
        (!values.is_empty()).then_some(values)
    };
    of(&|value| value.name == name).or_else(|| {
        // The unique name of a value means the same everywhere.
        let mut values = of(&|value| value.label == name)?;
        values.truncate(1);
        values[0].orders = None;
        Some(values)
    })
}
