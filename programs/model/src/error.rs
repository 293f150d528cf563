// SPDX-License-Identifier: MIT OR Apache-2.0
//! Errors of descriptions and expressions.

/// The reason why there are no equations.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[error("{text}")]
pub struct Error {
    /// The line of the file, from 1, where it is known.
    pub line: Option<usize>,
    /// The mistake, and what would mend it.
    pub text: String,
    /// The joint, link or key that it is about, from which the line follows.
    pub(crate) place: Option<String>,
}

impl Error {
    /// About nothing that has a place.
    pub(crate) fn plain(text: impl Into<String>) -> Error {
        Error { line: None, text: text.into(), place: None }
    }

    /// About a joint or link of this name.
    pub(crate) fn at(name: &str, text: impl std::fmt::Display) -> Error {
        Error { line: None, text: format!("`{name}`: {text}"), place: Some(name.to_owned()) }
    }

    /// About a key of an object in JSON.
    pub(crate) fn key(key: &str, text: impl std::fmt::Display) -> Error {
        Error { line: None, text: format!("`{key}`: {text}"), place: Some(key.to_owned()) }
    }

    /// About a line.
    pub(crate) fn on(line: usize, text: impl Into<String>) -> Error {
        Error { line: Some(line), text: text.into(), place: None }
    }

    /// With the line on which the source names the place, as an attribute `name`.
    pub fn located(mut self, source: &str) -> Error {
        if self.line.is_none()
            && let Some(name) = &self.place
        {
            let quoted = [format!("name=\"{name}\""), format!("name='{name}'"), format!("\"{name}\":")];
            let at = quoted.iter().filter_map(|text| source.find(text.as_str())).min();
            self.line = at.map(|at| 1 + source[..at].matches('\n').count());
        }
        self
    }
}
