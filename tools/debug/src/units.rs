// SPDX-License-Identifier: MIT OR Apache-2.0
//! Units of ports and constants. The language has none; by convention, the comment of a declaration begins with them, as in
//! `.output u ; V`.

use takt_asm::expr::Value as Number;

/// Maximum length of a unit in characters.
const UNIT: usize = 12;

/// Unit at the beginning of the comment on a port's declaration; `None` if the comment does not begin with one. `directive` is `.input`
/// or `.output`.
pub fn unit(sources: &[(String, String)], directive: &str, port: &str) -> Option<String> {
    let (at, names, comment) = declaration(sources, directive, port)?;
    let comment = comment?;
    let units: Vec<&str> = comment.split([':', ';']).next()?.split(',').map(str::trim).collect();
    // If there are as many units as names, they correspond one to one; otherwise the first unit applies to all names.
    let own =
        units.len() > 1 && units.len() == names.split(',').count() && units.iter().all(|one| is_unit(one));
    let unit = if own { units[at] } else { units[0] };
    is_unit(unit).then(|| unit.to_owned())
}

/// Names that are declared with a port, as written: ports without a unit share an axis with these.
pub fn declared_together(sources: &[(String, String)], directive: &str, port: &str) -> Option<String> {
    declaration(sources, directive, port).map(|(_, names, _)| names.trim().to_owned())
}

/// Declaration of a port: position among the names, the names, and the comment.
fn declaration<'s>(
    sources: &'s [(String, String)],
    directive: &str,
    port: &str,
) -> Option<(usize, &'s str, Option<&'s str>)> {
    let lines = sources.iter().flat_map(|(_, text)| text.lines());
    let mut declared = lines.filter_map(|line| line.trim_start().strip_prefix(directive));
    declared.find_map(|rest| {
        let (names, comment) =
            rest.split_once(';').map_or((rest, None), |(names, comment)| (names, Some(comment.trim())));
        let at = names.split(',').map(str::trim).position(|name| names_it(name, port))?;
        Some((at, names, comment))
    })
}

/// Sampling period in seconds: the constant `T` or `Ts` whose comment begins with `s`, or the reciprocal of `FS` or `fs` in Hz.
pub fn sampling_period(sources: &[(String, String)], constants: &[(String, Number)]) -> Option<f64> {
    const NAMES: [(&str, &str); 4] = [("T", "s"), ("Ts", "s"), ("FS", "Hz"), ("fs", "Hz")];
    let of = |(name, wanted): (&str, &str)| {
        let lines = sources.iter().flat_map(|(_, text)| text.lines());
        let mut declared = lines.filter_map(|line| line.trim_start().strip_prefix(".const"));
        let comment = declared.find_map(|rest| {
            let (named, value) = rest.split_once('=')?;
            if named.trim() == name { value.split_once(';').map(|(_, comment)| comment) } else { None }
        })?;
        if leading_unit(comment)? != wanted {
            return None;
        }
        let value = constants.iter().find(|(known, _)| known == name)?.1.real();
        let seconds = if wanted == "Hz" { value.recip() } else { value };
        Some(seconds).filter(|seconds| seconds.is_finite() && *seconds > 0.0)
    };
    NAMES.into_iter().find_map(of)
}

/// A declared name, such as `x:int`, `y[3]` or `x{i}`, includes the port.
fn names_it(declared: &str, port: &str) -> bool {
    let name = declared.split([':', ' ', '[', '{']).next().unwrap_or_default();
    let whole = declared.split([':', ' ']).next() == Some(name);
    if whole {
        return name == port;
    }
    let rest = port.strip_prefix(name);
    rest.is_some_and(|rest| {
        !rest.is_empty() && rest.chars().all(|one| one.is_ascii_digit() || "[]".contains(one))
    })
}

/// The word is a product or quotient of powers of known unit symbols, at most [`UNIT`] characters long.
fn is_unit(word: &str) -> bool {
    const BASE: [&str; 22] = [
        "m", "mm", "um", "µm", "s", "ms", "µs", "g", "kg", "A", "mA", "V", "mV", "W", "N", "J", "Hz", "rad",
        "°", "°C", "K", "Ω",
    ];
    let powers = |one: char| "²³⁴-0123456789^".contains(one);
    !word.is_empty()
        && word.chars().count() <= UNIT
        && word.split(['/', '·', '*']).all(|factor| {
            let factor = factor.trim_end_matches(powers);
            BASE.contains(&factor)
        })
}

/// Unit at the beginning of a comment.
pub fn leading_unit(comment: &str) -> Option<String> {
    let unit = comment.split([':', ';', ',']).next()?.trim();
    is_unit(unit).then(|| unit.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_stand_first_in_a_comment() {
        let source = ".input  w_ref, w   ; rad/s: wanted, measured\n.input n1:int, n2:int ; counts of 0.25 µm\n.input i{i}, y[3] ; A, measured\n\
                      .output x1, x2 ; m, m/s: position, velocity\n.output tau4 ; N·m\n.output d ; duties, 0 to 1\n.output a ; m/s²\n.output temp ; °C; outside of the table its ends\n";
        let sources = [("a.s".to_owned(), source.to_owned())];
        let of = |what, name| unit(&sources, what, name);
        assert_eq!(of(".input", "w").as_deref(), Some("rad/s"));
        assert_eq!((of(".input", "n1"), of(".input", "u"), of(".output", "d")), (None, None, None));
        assert_eq!((of(".input", "i12").as_deref(), of(".input", "y[2]").as_deref()), (Some("A"), Some("A")));
        assert_eq!(
            (of(".output", "x1").as_deref(), of(".output", "x2").as_deref()),
            (Some("m"), Some("m/s"))
        );
        assert_eq!((of(".output", "temp").as_deref(), of(".output", "tau5").as_deref()), (Some("°C"), None));
        assert_eq!(
            (of(".output", "tau4").as_deref(), of(".output", "a").as_deref()),
            (Some("N·m"), Some("m/s²"))
        );
    }
}
