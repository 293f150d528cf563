// SPDX-License-Identifier: MIT OR Apache-2.0
//! The meaning of a source's name at a position: the value that the line at hand would read.
//!
//! The assembler gives values of one name registers of their own, several of them one register one after the other, and a
//! macro's names are other ones in each use: see [`takt_asm::names`].

use super::machine::Machine;
use std::collections::HashMap;
use takt_asm::expr::Value;
use takt_asm::names::{NamedValue, Names};
use takt_isa::program::Port;
use takt_isa::{BundleAddress, Program, Register, Type};

/// The meaning of a name in one scope.
#[derive(Clone, Debug)]
pub(super) enum Meaning {
    /// A constant or an address.
    Constant(Value),
    /// Registers: one, or one for each value.
    Values(Vec<Held>),
}

/// A value in its register.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Held {
    /// Its own name.
    pub(crate) label: String,
    pub(crate) register: Register,
    pub(crate) ty: Type,
    /// As [`NamedValue::orders`].
    pub(crate) orders: Option<(u32, u32)>,
    /// As [`NamedValue::bundles`].
    pub(crate) bundles: Option<(BundleAddress, BundleAddress)>,
    /// Bundles that write the register for the first time for another value, with that value's name.
    rivals: Vec<(BundleAddress, String)>,
}

impl Held {
    pub(super) fn always(port: &Port) -> Held {
        let Port { name, register, ty } = port;
        let (label, register, ty) = (name.clone(), *register, *ty);
        Held { label, register, ty, orders: None, bundles: None, rivals: Vec::new() }
    }

    fn of(value: &NamedValue, names: &Names) -> Held {
        let rivals = names.values.iter().filter(|other| other.register == value.register && *other != value);
        let rivals = rivals.filter_map(|rival| Some((rival.bundles?.0, rival.label.clone())));
        Held {
            label: value.label.clone(),
            register: value.register,
            ty: value.ty,
            orders: value.orders,
            bundles: value.bundles,
            rivals: rivals.collect(),
        }
    }

    /// True if no other value uses its register.
    pub(crate) fn is_alone(&self) -> bool {
        self.rivals.is_empty()
    }

    /// The addresses between which the next bundle must be for it to be there: above the first, up to the second. `None`:
    /// it is there wherever the program is.
    pub(crate) fn range(&self) -> Option<(BundleAddress, BundleAddress)> {
        let (first, _) = self.bundles.filter(|_| self.orders.is_some() || !self.is_alone())?;
        let rivals = self.rivals.iter().map(|(at, _)| *at).filter(|at| first < *at);
        Some((first, rivals.min().unwrap_or(BundleAddress::new(u32::MAX))))
    }

    /// Checks that its register holds it, or is about to.
    ///
    /// # Errors
    /// If the register holds another value; the message says which.
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
            None if self.is_alone() => Ok(()),
            // Until it arrives, the register has what it had before.
            None => match machine.arrives(self.register) {
                None => Ok(()),
                Some(left) => Err(format!("{} is in flight: it arrives in {left} cycles", self.label)),
            },
        }
    }
}

/// A register that a name stands for, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Life {
    /// The value's own name: that of the source, or `t.1`.
    pub label: String,
    /// The register.
    pub register: Register,
    /// The type as which its bits are read.
    pub ty: Type,
    /// The first bundle that writes it and the last one that uses it, if it lives only there.
    pub bundles: Option<(BundleAddress, BundleAddress)>,
    /// True if the line at hand would read it.
    pub at_hand: bool,
}

/// A name that does not stand for the same thing everywhere.
#[derive(Clone, Debug)]
pub(super) struct Name {
    name: String,
    /// The meaning where no scope has one of its own.
    global: Option<Meaning>,
    /// By the number of the scope, ascending.
    scoped: Vec<(u32, Meaning)>,
}

impl Name {
    /// The meanings of a name; `None` if it has none.
    pub(super) fn find(
        name: &str,
        global: Option<Meaning>,
        program: &Program,
        names: &Names,
    ) -> Option<Name> {
        let mut known: HashMap<&str, &Port> = HashMap::new();
        let mut symbols: HashMap<&str, u32> = HashMap::new();
        if names.scopes.len() > 1 {
            let ports = program.inputs.iter().chain(&program.outputs).chain(&program.registers);
            known.extend(ports.map(|port| (port.name.as_str(), port)));
            symbols.extend(program.symbols.iter().map(|symbol| (symbol.name.as_str(), symbol.address)));
        }
        let register = |name: &str| {
            held(name, names)
                .or_else(|| known.get(name).map(|port| vec![Held::always(port)]))
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

    /// Its meaning everywhere, if that is one.
    pub(super) fn fixed(&self) -> Option<&Meaning> {
        match &self.global {
            Some(Meaning::Values(values)) if !matches!(&values[..], [only] if only.is_alone()) => None,
            global if self.scoped.is_empty() => global.as_ref(),
            _ => None,
        }
    }

    /// Its meaning where a bundle is next.
    ///
    /// # Errors
    /// If the line there knows no such name.
    pub(super) fn at(&self, machine: &Machine<'_>) -> Result<At<'_>, String> {
        let names = machine.names;
        let position = machine.at_hand();
        let scope = self.scoped.binary_search_by_key(&position.scope(), |(number, _)| *number);
        let meaning = scope.ok().map(|index| &self.scoped[index].1).or(self.global.as_ref());
        match meaning {
            Some(Meaning::Constant(value)) => Ok(At::Constant(*value)),
            Some(Meaning::Values(values)) => {
                let reads =
                    |(after, through): (u32, u32)| after < position.order && position.order <= through;
                let at_hand = values.iter().find(|value| value.orders.is_some_and(reads));
                let at_hand = at_hand.or_else(|| values.iter().find(|value| value.orders.is_none()));
                at_hand.map(At::Value).ok_or_else(|| format!("no line here reads `{}`", self.name))
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

    /// Every value that it may stand for.
    pub(super) fn values(&self) -> impl Iterator<Item = &Held> {
        let all = self.global.iter().chain(self.scoped.iter().map(|(_, meaning)| meaning));
        all.flat_map(|meaning| match meaning {
            Meaning::Values(values) => &values[..],
            Meaning::Constant(_) => &[],
        })
    }
}

/// The meaning of a name at a position.
#[derive(Clone, Copy, Debug)]
pub(super) enum At<'n> {
    Constant(Value),
    Value(&'n Held),
}

/// The values of a name that has several, or that shares its register; or the one value that has the name for its own.
pub(super) fn held(name: &str, names: &Names) -> Option<Vec<Held>> {
    let of = |wanted: &dyn Fn(&NamedValue) -> bool| {
        let values = names.values.iter().filter(|value| wanted(value));
        let values: Vec<Held> = values.map(|value| Held::of(value, names)).collect();
        (!values.is_empty()).then_some(values)
    };
    of(&|value| value.name == name).or_else(|| {
        // Under its own name a value is the same everywhere.
        let mut values = of(&|value| value.label == name)?;
        values.truncate(1);
        values[0].orders = None;
        Some(values)
    })
}
