// SPDX-License-Identifier: MIT OR Apache-2.0
//! Errors of descriptions and expressions.

/// Error of a reader or writer: the reason why a file yields no source.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[error("{text}")]
pub struct Error {
    /// Name of an included file that holds the mistake; `None` for the file that was read.
    pub file: Option<String>,
    /// Line of the file, from 1; `None` if unknown.
    pub line: Option<usize>,
    /// The mistake and its remedy.
    pub text: String,
    /// Joint, link or key at fault, from which [`Error::located`] finds the line.
    pub(crate) place: Option<String>,
}

impl Error {
    /// An error without a place.
    pub(crate) fn plain(text: impl Into<String>) -> Error {
        Error { file: None, line: None, text: text.into(), place: None }
    }

    /// An error of the joint or link of this name.
    pub(crate) fn at(name: &str, text: impl std::fmt::Display) -> Error {
        Error { file: None, line: None, text: format!("`{name}`: {text}"), place: Some(name.to_owned()) }
    }

    /// An error of a key of a JSON object.
    pub(crate) fn key(key: &str, text: impl std::fmt::Display) -> Error {
        Error { file: None, line: None, text: format!("`{key}`: {text}"), place: Some(key.to_owned()) }
    }

    /// An error at a line, from 1.
    pub(crate) fn on(line: usize, text: impl Into<String>) -> Error {
        Error { file: None, line: Some(line), text: text.into(), place: None }
    }

    /// The message with its place, `name` being the file that was read.
    pub fn located_text(&self, name: &str) -> String {
        let name = self.file.as_deref().unwrap_or(name);
        match self.line {
            Some(line) => format!("{name}:{line}: {self}"),
            None => format!("{name}: {self}"),
        }
    }

    /// Adds the line on which the source first names the place: as an attribute `name` of XML or a key of JSON.
    pub fn located(mut self, source: &str) -> Error {
        if self.line.is_none()
            && let Some(name) = &self.place
        {
            let quoted = [
                format!("name=\"{name}\""),
                format!("name='{name}'"),
                format!("\"{name}\":"),
                format!("\"{name}\" :"),
            ];
            let at = quoted.iter().filter_map(|text| source.find(text.as_str())).min();
            self.line = at.map(|at| 1 + source[..at].matches('\n').count());
        }
        self
    }
}

impl From<String> for Error {
    fn from(text: String) -> Error {
        Error::plain(text)
    }
}
