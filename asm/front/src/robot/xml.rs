// SPDX-License-Identifier: MIT OR Apache-2.0
//! XML with limits, for URDF and MJCF.

use super::nesting::{Excess, excess};
use crate::Error;
use roxmltree::{Document, Node};
use std::borrow::Cow;

/// Maximum length of a description, in bytes.
pub const MAX_BYTES: usize = 64 << 20;
/// Maximum nesting depth of elements. (URDF has 6, MJCF one for each joint of a chain; the parser recurses into each.)
pub const MAX_DEPTH: usize = 64;
/// Maximum number of elements, and of texts between them.
pub const MAX_NODES: u32 = 1 << 20;
/// Maximum number of attributes of an element: the parser compares each with all others. (MJCF has elements of 40.)
pub const MAX_ATTRIBUTES: usize = 256;

/// Parses a text within the limits.
///
/// # Errors
/// If the text is not XML or exceeds a limit, with the line if known.
pub(super) fn parse(source: &str) -> Result<Document<'_>, Error> {
    if source.len() > MAX_BYTES {
        return Err(Error::plain(format!("the file is longer than {} MiB", MAX_BYTES >> 20)));
    }
    match excess(source, MAX_DEPTH, MAX_ATTRIBUTES) {
        Some(Excess::Depth(line)) => {
            let text =
                format!("more than {MAX_DEPTH} elements are within one another here; a robot needs fewer");
            return Err(Error::on(line, text));
        }
        Some(Excess::Attributes(line)) => {
            return Err(Error::on(line, format!("an element has more than {MAX_ATTRIBUTES} attributes")));
        }
        None => {}
    }
    if let Some(line) = declarations(source) {
        return Err(Error::on(
            line,
            "a document type with declarations is not read: leave `<!DOCTYPE …>` out",
        ));
    }
    // Errors of this parser carry their position.
    let options = roxmltree::ParsingOptions { nodes_limit: MAX_NODES, allow_dtd: true };
    Document::parse_with_options(source, options).map_err(|error| {
        let text = format!("this is not XML: {error}");
        match error {
            roxmltree::Error::NodesLimitReached => {
                Error::plain(format!("the file has more than {MAX_NODES} elements and texts"))
            }
            roxmltree::Error::UnknownNamespace(prefix, place) => {
                let text = format!("{text}: write `xmlns:{prefix}=\"{prefix}\"` into the first element");
                Error::on(place.row as usize, text)
            }
            // The parser reports these at the first line, which would mislead.
            roxmltree::Error::UnclosedRootNode | roxmltree::Error::NoRootNode => Error::plain(text),
            error => Error::on(error.pos().row as usize, text),
        }
    })
}

/// Replaces the XML declaration by blanks: it may then stand anywhere, and its encoding does not matter.
pub(super) fn without_declaration(source: &str) -> Cow<'_, str> {
    let source = source.trim_start_matches('\u{feff}');
    let (Some(start), Some(end)) = (source.find("<?xml "), source.find("?>")) else {
        return Cow::Borrowed(source);
    };
    // Only a declaration before the root element counts.
    if start > end || source[..start].contains("<robot") || source[..start].contains("<mujoco") {
        return Cow::Borrowed(source);
    }
    let blanks = source[start..end + 2].chars().map(|c| if c == '\n' { c } else { ' ' });
    Cow::Owned(source[..start].chars().chain(blanks).chain(source[end + 2..].chars()).collect())
}

/// Line of a document type with declarations: entities can expand to texts of any length.
fn declarations(source: &str) -> Option<usize> {
    let at = source.find("<!DOCTYPE")?;
    let end = source[at..].find('>')?;
    source[at..at + end].contains('[').then(|| 1 + source[..at].matches('\n').count())
}

/// Line starts of a text, for looking up the lines of many elements by binary search.
pub(super) struct Lines(Vec<usize>);

impl Lines {
    pub(super) fn of(text: &str) -> Lines {
        Lines(text.match_indices('\n').map(|(at, _)| at).collect())
    }

    /// Line on which an element begins, from 1.
    pub(super) fn at(&self, node: Node<'_, '_>) -> usize {
        1 + self.0.partition_point(|end| *end < node.range().start)
    }
}

/// Numbers of an attribute: 1 to `most` of them, all finite.
pub(super) fn some(node: Node<'_, '_>, name: &str, value: &str, most: usize) -> Result<Vec<f64>, Error> {
    let numbers: Option<Vec<f64>> = value.split_ascii_whitespace().map(|word| word.parse().ok()).collect();
    let numbers = numbers.filter(|numbers| numbers.iter().all(|x| x.is_finite()));
    numbers.filter(|numbers| (1..=most).contains(&numbers.len())).ok_or_else(|| {
        let count = if most == 1 { "a number is".to_owned() } else { format!("{most} numbers are") };
        Error::on(
            line(node),
            format!("`{name}` is `{value}`: {count} expected, finite and separated by spaces"),
        )
    })
}

/// Exactly `N` numbers of an attribute.
pub(super) fn numbers<const N: usize>(
    node: Node<'_, '_>,
    name: &str,
    value: &str,
) -> Result<[f64; N], Error> {
    let numbers = some(node, name, value, N)?;
    let count = numbers.len();
    numbers.try_into().map_err(|_| {
        Error::on(line(node), format!("`{name}` is `{value}`: it has {count} numbers, expected {N}"))
    })
}

/// Line on which an element begins, from 1.
pub(super) fn line(node: Node<'_, '_>) -> usize {
    node.document().text_pos_at(node.range().start).row as usize
}
