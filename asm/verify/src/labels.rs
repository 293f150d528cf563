// SPDX-License-Identifier: MIT OR Apache-2.0
//! Labels. Labels of data memory are compared word by word; labels of code by order, by section and, while both programs run, by the
//! effects that precede them.

use crate::Difference;
use crate::code::refuse;
use crate::fields::is_name_of;
use foldhash::HashMap;
use takt_asm::plain::PlainProgram;
use takt_isa::Effect;
use takt_isa::program::{Space, Symbol};

/// Labels of both programs: by bundle, the numbers of the first and the last label before it.
#[derive(Default)]
pub(crate) struct Labels {
    pub(crate) source: HashMap<u32, (u32, u32)>,
    pub(crate) image: HashMap<u32, (u32, u32)>,
    pub(crate) names: Vec<String>,
}

/// Compares the labels, and numbers the common ones.
pub(crate) fn compare(symbols: &[Symbol], period: u32, plain: &PlainProgram) -> Result<Labels, Difference> {
    let (code, data): (Vec<&Symbol>, Vec<&Symbol>) =
        symbols.iter().partition(|symbol| symbol.space == Space::Code);
    let of_source = |space: Space| {
        let mut labels: Vec<(&str, u32)> = plain
            .labels
            .iter()
            .filter(|label| label.1 == space)
            .map(|(name, _, position)| (name.as_str(), *position))
            .collect();
        labels.sort_by_key(|label| label.1);
        labels
    };
    let known = of_source(Space::Data);
    for at in 0..known.len().max(data.len()) {
        let is_same = |symbol: &Symbol, (name, word): (&str, u32)| {
            let Symbol { name: found, space: _, address } = symbol;
            is_name_of(found, name) && *address == word
        };
        match (data.get(at), known.get(at)) {
            (Some(symbol), Some(label)) if is_same(symbol, *label) => {}
            (Some(_), Some((name, _))) | (None, Some((name, _))) => {
                return Err(refuse(format!("label `{name}` names another data word in the image")));
            }
            (Some(symbol), None) => return Err(unknown(symbol)),
            (None, None) => {}
        }
    }
    let mut labels = Labels::default();
    let mut found = code.into_iter().peekable();
    for (name, position) in of_source(Space::Code) {
        let Some(Symbol { name: _, space: _, address }) =
            found.next_if(|symbol| is_name_of(&symbol.name, name))
        else {
            if is_passed_over(plain, position) {
                continue;
            }
            return Err(refuse(format!("label `{name}` is missing in the image, or in another place")));
        };
        // The end of the last bundle belongs to no section.
        let sections = [(position, plain.period, plain.bundles.len() as u32), (*address, period, period)];
        let [source, image] = sections.map(|(at, period, _)| at >= period);
        let is_behind = position >= plain.bundles.len() as u32;
        if source != image && !is_behind {
            return Err(refuse(format!("label `{name}` is in another section in the image")));
        }
        let number = labels.names.len() as u32;
        labels.names.push(name.to_owned());
        labels.source.entry(position).or_insert((number, number)).1 = number;
        labels.image.entry(*address).or_insert((number, number)).1 = number;
    }
    found.next().map_or(Ok(labels), |symbol| Err(unknown(symbol)))
}

fn unknown(symbol: &Symbol) -> Difference {
    refuse(format!(
        "the image has a label `{}` in {} that the source does not, or in another place",
        symbol.name,
        crate::fields::memory(symbol.space)
    ))
}

/// All transfers to the label are short branches: the image may select instead, and then has no use for the label.
fn is_passed_over(plain: &PlainProgram, position: u32) -> bool {
    let mut leads = plain.bundles.iter().flat_map(|bundle| &bundle.operations).filter(|operation| {
        let effect = operation.op.row().effect;
        effect.redirects()
            && effect != Effect::Return
            && effect != Effect::Halt
            && effect != Effect::Publish
            && operation.constant == position
    });
    let mut any = false;
    leads.all(|operation| {
        any = true;
        operation.op.row().effect.is_conditional()
    }) && any
}
