// SPDX-License-Identifier: MIT OR Apache-2.0
//! Conversion between paths and the protocol's URIs.

use lsp_types::Uri;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Path of a `file:` URI. For a document without a file, the URI itself serves as path.
pub(crate) fn path(uri: &Uri) -> PathBuf {
    let text = uri.as_str();
    let Some(rest) = text.strip_prefix("file://") else { return PathBuf::from(text) };
    // Skip the host, which precedes the path.
    let path = rest.find('/').map_or("", |at| &rest[at..]);
    let path = decoded(path);
    // On Windows, `/c:/x` means `c:/x`.
    let drive = path.as_bytes();
    let is_drive = drive.len() > 2 && drive[1].is_ascii_alphabetic() && drive[2] == b':' && cfg!(windows);
    crate::lsp::workspace::normal(Path::new(if is_drive { &path[1..] } else { &path }))
}

/// URI of a path.
pub(crate) fn of_path(path: &Path) -> Option<Uri> {
    let text = path.to_str()?;
    if !path.is_absolute() {
        return Uri::from_str(text).ok();
    }
    let text = text.replace('\\', "/");
    let mut uri = "file://".to_owned();
    if !text.starts_with('/') {
        uri.push('/');
    }
    uri.push_str(&encoded(&text));
    Uri::from_str(&uri).ok()
}

/// Relative URI of a file that has only a name, for clients that resolve names.
pub(crate) fn of_name(name: &str) -> Option<Uri> {
    Uri::from_str(&encoded(name)).ok()
}

fn encoded(text: &str) -> String {
    let mut uri = String::with_capacity(text.len());
    for byte in text.bytes() {
        if byte.is_ascii_alphanumeric() || b"/-._~:".contains(&byte) {
            uri.push(char::from(byte));
        } else {
            uri.push_str(&format!("%{byte:02X}"));
        }
    }
    uri
}

fn decoded(text: &str) -> String {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let [first, more @ ..] = rest {
        let code = more.get(..2).and_then(|two| u8::from_str_radix(std::str::from_utf8(two).ok()?, 16).ok());
        match code.filter(|_| *first == b'%') {
            Some(byte) => {
                bytes.push(byte);
                rest = &more[2..];
            }
            None => {
                bytes.push(*first);
                rest = more;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_survive() {
        for text in ["/a/b.s", "/with blank/µ%41.s", "/a#b?c[d].s"] {
            let uri = of_path(Path::new(text)).expect("it is one");
            assert_eq!(path(&uri), Path::new(text), "{}", uri.as_str());
        }
        let unnamed = Uri::from_str("untitled:Untitled-1").expect("it is one");
        assert_eq!(of_path(&path(&unnamed)), Some(unnamed));
    }
}
