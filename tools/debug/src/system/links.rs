// SPDX-License-Identifier: MIT OR Apache-2.0
//! Links as text, and stops at link events.

use super::SystemStop;
use crate::session::ValueNotations;
use takt_asm::nearest;
use takt_system::{Description, End, LinkEventKind, LinkKind, System};

const EVENTS: [LinkEventKind; 8] = [
    LinkEventKind::Value(0),
    LinkEventKind::Published,
    LinkEventKind::Taken,
    LinkEventKind::Skipped,
    LinkEventKind::Pushed,
    LinkEventKind::Popped,
    LinkEventKind::Overflow,
    LinkEventKind::Underflow,
];

impl SystemStop {
    /// Parses `link NAME [EVENT]`; `None` if the text does not begin with `link`.
    ///
    /// # Errors
    /// If the link does not exist.
    pub fn parse(text: &str, description: &Description) -> Option<Result<SystemStop, String>> {
        let rest = text.trim().strip_prefix("link ")?;
        // Names of wires contain blanks.
        let event = rest.rsplit_once(' ').and_then(|(name, event)| {
            let kind = EVENTS.into_iter().find(|kind| kind.name() == event)?;
            Some((name.trim(), kind))
        });
        Some(match event {
            Some((name, kind)) => {
                link_named(name, description).map(|link| SystemStop { link, kind: Some(kind) })
            }
            None => {
                let link = link_named(rest.trim(), description).map_err(|error| {
                    let kinds: Vec<&str> = EVENTS.iter().map(|kind| kind.name()).collect();
                    format!("{error}; events: {}", kinds.join(" "))
                });
                link.map(|link| SystemStop { link, kind: None })
            }
        })
    }
}

/// Index of a link with this name.
pub(crate) fn link_named(name: &str, description: &Description) -> Result<usize, String> {
    description.link_named(name).ok_or_else(|| {
        let names: Vec<&str> = description.links.iter().map(|link| link.name.as_str()).collect();
        let near = nearest(name, names.iter().copied());
        let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
        format!("there is no link `{name}`{near} (links: {})", names.join(", "))
    })
}

/// Contents of a link: values that arrived last, values of a snapshot, or FIFO entries.
pub fn link_text(system: &System, number: usize) -> String {
    let Some(link) = system.description().links.get(number) else { return String::new() };
    let value = |bits: u32, field: usize| ValueNotations::new(link.fields[field].ty, bits).text;
    let values = |bits: &[u32]| {
        let each = bits.iter().enumerate().map(|(field, &bits)| value(bits, field));
        each.collect::<Vec<_>>().join(", ")
    };
    if let LinkKind::Fifo { depth, .. } = link.kind {
        let entries = system.fifo_entries(number);
        let shown: Vec<String> = entries.iter().map(|entry| format!("({})", values(entry))).collect();
        let counts = system.fifo_counts(number).unwrap_or_default();
        return format!(
            "{} of {depth} entries {}; {} refused when full, {} asked for when empty",
            entries.len(),
            shown.join(" "),
            counts.overflows,
            counts.underflows
        );
    }
    // Values that the receiver sees.
    let seen: Vec<u32> = link
        .fields
        .iter()
        .map(|field| match (link.to, field.input) {
            (End::Core(core), Some(register)) => system.core(core).register(register).unwrap_or(0),
            _ => {
                let name = match link.kind {
                    LinkKind::Wire => field.to.clone(),
                    _ => format!("{}.{}", link.name, field.to),
                };
                system.output(&name).unwrap_or(0)
            }
        })
        .collect();
    format!("the receiver has {}", values(&seen))
}
