// SPDX-License-Identifier: MIT OR Apache-2.0
//! Framing of the language server and debug adapter protocols: a header with the length, followed by JSON.
//!
//! `lsp_server` provides the same framing, but ends at the first malformed message and accepts any length. An editor's session should
//! survive a malformed message.

use serde_json::Value;
use std::io::{self, BufRead, Read, Write};

/// Maximum size of a message in bytes; the largest source fits.
pub const MESSAGE_BYTES: usize = 256 << 20;
/// Maximum size of a header line in bytes.
const HEADER_BYTES: u64 = 4096;

/// Errors while reading a message.
#[derive(Debug, thiserror::Error)]
pub enum WireError {
    /// The stream is broken, or the header is malformed: the start of the next message cannot be found.
    #[error("{0}")]
    Lost(String),
    /// One message is malformed; the next one can be read.
    #[error("{0}")]
    Message(String),
}

impl From<io::Error> for WireError {
    fn from(error: io::Error) -> WireError {
        WireError::Lost(format!("the client's stream: {error}"))
    }
}

/// Reads a message; `None` at the end of the stream.
///
/// # Errors
/// If the stream or the message is malformed: see [`WireError`].
pub fn read(stream: &mut impl BufRead) -> Result<Option<Value>, WireError> {
    let mut length = None;
    let mut first = true;
    loop {
        let mut line = Vec::new();
        stream.by_ref().take(HEADER_BYTES).read_until(b'\n', &mut line)?;
        if line.is_empty() && first {
            return Ok(None);
        }
        first = false;
        if !line.ends_with(b"\n") {
            return Err(WireError::Lost("the stream ends within a header, or no header ends".to_owned()));
        }
        let line = String::from_utf8_lossy(&line);
        let line = line.trim_end_matches(['\r', '\n']);
        if line.is_empty() {
            break;
        }
        let Some((name, value)) = line.split_once(':') else {
            return Err(WireError::Lost(format!(
                "a message begins with `Content-Length: …`, not with `{line}`"
            )));
        };
        if name.trim().eq_ignore_ascii_case("content-length") {
            let value = value.trim();
            let number = value
                .parse()
                .map_err(|_| WireError::Lost(format!("`{value}` is not the length of a message")))?;
            length = Some(number);
        }
    }
    let length: usize =
        length.ok_or_else(|| WireError::Lost("a header without `Content-Length`".to_owned()))?;
    if length > MESSAGE_BYTES {
        // Skip the announced number of bytes, so that the next message can be read.
        io::copy(&mut stream.take(length as u64), &mut io::sink())?;
        let most = MESSAGE_BYTES >> 20;
        return Err(WireError::Message(format!("a message of {length} bytes: more than {most} MiB")));
    }
    let mut bytes = Vec::new();
    stream.take(length as u64).read_to_end(&mut bytes)?;
    if bytes.len() < length {
        return Err(WireError::Lost("the stream ends within a message".to_owned()));
    }
    serde_json::from_slice(&bytes)
        .map(Some)
        .map_err(|error| WireError::Message(format!("a message is not JSON: {error}")))
}

/// Writes a message with its header.
///
/// # Errors
/// If writing to the stream fails.
pub fn write(stream: &mut impl Write, message: &impl serde::Serialize) -> io::Result<()> {
    let text = serde_json::to_string(message)?;
    write!(stream, "Content-Length: {}\r\n\r\n{text}", text.len())?;
    stream.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &str) -> Vec<Result<Option<Value>, String>> {
        let mut stream = text.as_bytes();
        let mut found = Vec::new();
        loop {
            let message = read(&mut stream);
            let ends = matches!(message, Ok(None) | Err(WireError::Lost(_)));
            found.push(message.map_err(|error| error.to_string()));
            if ends {
                return found;
            }
        }
    }

    #[test]
    fn one_broken_message_is_not_the_end() {
        let found = all("Content-Length: 2\r\n\r\n{]Content-Length: 2\r\nX: y\r\n\r\n{}");
        assert!(
            found[0].as_ref().is_err_and(|error| error.starts_with("a message is not JSON")),
            "{found:?}"
        );
        assert_eq!(found[1..], [Ok(Some(serde_json::json!({}))), Ok(None)]);
    }

    #[test]
    fn reports_invalid_headers() {
        for (text, told) in [
            ("{}\r\n\r\n", "a message begins with `Content-Length: …`, not with `{}`"),
            ("Content-Length: x\r\n\r\n", "`x` is not the length of a message"),
            ("X: y\r\n\r\n", "a header without `Content-Length`"),
            ("Content-Length: 9\r\n\r\n{}", "the stream ends within a message"),
            ("Content-Le", "the stream ends within a header, or no header ends"),
        ] {
            assert_eq!(all(text), [Err(told.to_owned())]);
        }
        let huge = all("Content-Length: 99999999999\r\n\r\n{}");
        assert!(huge[0].as_ref().is_err_and(|error| error.contains("more than 256 MiB")), "{huge:?}");
    }

    #[test]
    fn written_data_is_read_back() {
        let mut bytes = Vec::new();
        let message = serde_json::json!({ "method": "µ" });
        write(&mut bytes, &message).expect("a vector takes all");
        assert_eq!(read(&mut bytes.as_slice()).expect("it is one"), Some(message));
    }
}
