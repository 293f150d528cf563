// SPDX-License-Identifier: MIT OR Apache-2.0
//! Text of a file's bytes, in the encodings that other programs write.

/// Byte order mark of UTF-8.
const UTF8_MARK: &[u8] = b"\xef\xbb\xbf";
/// The characters of Windows-1252 at 0x80 to 0x9f, where Latin-1 has control characters.
const WINDOWS: &str = "€\u{81}‚ƒ„…†‡ˆ‰Š‹Œ\u{8d}Ž\u{8f}\u{90}‘’“”•–—˜™š›œ\u{9d}žŸ";

/// A text, and the assumption about its encoding.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct DecodedText {
    /// The text, without a byte order mark.
    pub text: String,
    /// Note about an assumed encoding, for the user; `None` if the encoding is known.
    pub note: Option<String>,
}

/// Decodes UTF-8 and UTF-16, with or without a byte order mark, and Latin-1 if an XML declaration names it or nothing else fits.
///
/// # Errors
/// If the bytes are not text.
pub fn decode(bytes: Vec<u8>) -> Result<DecodedText, String> {
    let known = |text: String| Ok(DecodedText { text, note: None });
    match bytes[..] {
        [0xff, 0xfe, ref rest @ ..] => return wide(rest, u16::from_le_bytes).and_then(known),
        [0xfe, 0xff, ref rest @ ..] => return wide(rest, u16::from_be_bytes).and_then(known),
        _ => {}
    }
    let bytes = match bytes.strip_prefix(UTF8_MARK) {
        Some(rest) => rest.to_vec(),
        None => bytes,
    };
    if bytes.contains(&0) {
        return Err("it has zero bytes: it is not text".to_owned());
    }
    if declared(&bytes).is_some_and(|name| is_latin(&name)) {
        return known(latin(&bytes));
    }
    match String::from_utf8(bytes) {
        Ok(text) => known(text),
        Err(error) => {
            let bytes = error.as_bytes();
            let line = 1 + bytes[..error.utf8_error().valid_up_to()].iter().filter(|b| **b == b'\n').count();
            let note = format!("line {line} is not UTF-8: the file was taken for Latin-1 (Windows-1252)");
            Ok(DecodedText { text: latin(bytes), note: Some(note) })
        }
    }
}

fn wide(bytes: &[u8], word: fn([u8; 2]) -> u16) -> Result<String, String> {
    let (words, rest) = bytes.as_chunks::<2>();
    let words: Vec<u16> = words.iter().map(|pair| word(*pair)).collect();
    match String::from_utf16(&words) {
        Ok(text) if rest.is_empty() => Ok(text),
        _ => Err("it begins as UTF-16, but is not valid UTF-16".to_owned()),
    }
}

/// The encoding that an XML declaration names, in small letters.
fn declared(bytes: &[u8]) -> Option<String> {
    let head = bytes.strip_prefix(b"<?xml")?;
    let end = head.windows(2).position(|pair| pair == b"?>")?;
    let head = std::str::from_utf8(&head[..end]).ok()?;
    let (_, value) = head.split_once("encoding")?;
    let value = value.trim_start().strip_prefix('=')?.trim_start();
    let quote = value.chars().next().filter(|c| matches!(c, '"' | '\''))?;
    value[1..].split(quote).next().map(str::to_ascii_lowercase)
}

fn is_latin(name: &str) -> bool {
    ["iso-8859-1", "iso8859-1", "iso_8859-1", "iso-8859-15", "latin1", "latin-1", "windows-1252", "cp1252"]
        .contains(&name)
}

fn latin(bytes: &[u8]) -> String {
    let windows: Vec<char> = WINDOWS.chars().collect();
    let letter = |byte: &u8| match byte {
        0x80..=0x9f => windows[usize::from(byte - 0x80)],
        byte => char::from(*byte),
    };
    bytes.iter().map(letter).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_usual_encoding_is_read() {
        let text = "größe\n5 €";
        let utf16 = |bytes: fn(u16) -> [u8; 2], mark: &[u8]| {
            let words = text.encode_utf16().flat_map(bytes);
            mark.iter().copied().chain(words).collect::<Vec<u8>>()
        };
        for bytes in [
            text.as_bytes().to_vec(),
            [UTF8_MARK, text.as_bytes()].concat(),
            utf16(u16::to_le_bytes, b"\xff\xfe"),
            utf16(u16::to_be_bytes, b"\xfe\xff"),
        ] {
            assert_eq!(decode(bytes), Ok(DecodedText { text: text.to_owned(), note: None }));
        }
        let decoded = decode(b"a\ngr\xf6\xdfe\n5 \x80".to_vec()).expect("text");
        assert_eq!(decoded.text, "a\ngröße\n5 €");
        let note = "line 2 is not UTF-8: the file was taken for Latin-1 (Windows-1252)";
        assert_eq!(decoded.note.as_deref(), Some(note));
    }

    #[test]
    fn an_xml_declaration_names_the_encoding() {
        for quote in ["\"", "'"] {
            let xml = format!("<?xml version=\"1.0\" encoding={quote}ISO-8859-1{quote}?><a/>");
            // These two bytes would also be one letter of UTF-8.
            let decoded = decode([xml.as_bytes(), b"\xc3\xa4"].concat()).expect("text");
            assert!(decoded.text.ends_with("Ã¤") && decoded.note.is_none(), "{decoded:?}");
        }
    }

    #[test]
    fn rejects_bytes_that_are_not_text() {
        assert!(decode(b"a\0b".to_vec()).is_err());
        assert!(decode(b"\xff\xfea".to_vec()).is_err());
        assert!(decode(b"\xff\xfe\x00\xd8".to_vec()).is_err());
    }
}
