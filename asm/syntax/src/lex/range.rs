// SPDX-License-Identifier: MIT OR Apache-2.0
//! Diagnostics for a range in place of a number, such as `1..3` of other languages.

use takt_diagnostics::diag::Diagnostic;
use takt_diagnostics::source::Span;

/// Diagnostic for a range in place of a number; `before` holds the tokens before it on its line, with the text of names.
pub(super) fn describe(before: &[Option<(&str, Span)>], text: &str, span: Span) -> Option<Diagnostic> {
    let (first, last) = text.split_once("..")?;
    let end = |text: &str| {
        !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
    };
    let error = |span, message: String| Diagnostic::error("token", span, message);
    if let [.., Some(("for", start)), Some((variable, _)), Some(("in", _))] = before {
        let error = error(start.to(span), "`for` is not part of the language".to_owned());
        return Some(if end(first) && end(last) {
            let rep = format!(".rep {variable}, {first}, {last}");
            error.mend(format!("write `{rep}` … `.endr`: its lines for {variable} = {first} to {last}"), rep)
        } else {
            error.help(format!(
                "write `.rep {variable}, FIRST, LAST` … `.endr`: its lines for each {variable}, LAST included"
            ))
        });
    }
    Some(
        error(span, format!("`{text}` is not a number"))
            .help("a range is two operands, as in `.rep i, 1, 3`"),
    )
}
