// SPDX-License-Identifier: MIT OR Apache-2.0
//! XML with limits: what URDF and MJCF have in common.

use super::nesting::too_deep;
use crate::Error;
use roxmltree::{Document, Node};

/// The largest description that is read, bytes.
pub const MAX_BYTES: usize = 64 << 20;
/// Elements within one another at most. (A description of URDF has 6, one of MJCF one for each joint of a chain; parsers call
/// themselves for each.)
pub const MAX_DEPTH: usize = 64;
/// Elements, and texts between them, at most.
pub const MAX_NODES: u32 = 1 << 20;

/// The document of a text.
///
/// # Errors
/// If it is no XML or beyond the limits, with the line where there is one.
pub(super) fn parse(source: &str) -> Result<Document<'_>, Error> {
    if source.len() > MAX_BYTES {
        return Err(Error::plain(format!("the file is longer than {} MiB", MAX_BYTES >> 20)));
    }
    if let Some(line) = too_deep(source, MAX_DEPTH) {
        let text = format!("more than {MAX_DEPTH} elements are within one another here; a robot needs fewer");
        return Err(Error::on(line, text));
    }
    // This parser says where it is that a text is no XML.
    let options =
        roxmltree::ParsingOptions { nodes_limit: MAX_NODES, ..roxmltree::ParsingOptions::default() };
    Document::parse_with_options(source, options).map_err(|error| {
        let text = format!("this is no XML: {error}");
        match error {
            roxmltree::Error::NodesLimitReached => {
                Error::plain(format!("the file has more than {MAX_NODES} elements and texts"))
            }
            // It gives these the first line.
            roxmltree::Error::UnclosedRootNode | roxmltree::Error::NoRootNode => Error::plain(text),
            error => Error::on(error.pos().row as usize, text),
        }
    })
}

/// The line on which an element begins.
pub(super) fn line(node: Node<'_, '_>) -> usize {
    node.document().text_pos_at(node.range().start).row as usize
}
