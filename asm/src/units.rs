// SPDX-License-Identifier: MIT OR Apache-2.0
//! Units of ports and constants. The language has none; by convention, the comment of a declaration begins with them, as in
//! `.output u ; V`.

use crate::expr::Value as Number;
use std::borrow::Cow;

/// Maximum length of a unit in characters.
const UNIT: usize = 12;

/// Unit at the beginning of the comment on a port's declaration; `None` if the comment does not begin with one. `directive` is `.input`,
/// `.output` or `.param`.
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

/// Names and units of the constants that state the sampling period.
pub const PERIODS: [(&str, &str); 4] = [("T", "s"), ("Ts", "s"), ("FS", "Hz"), ("fs", "Hz")];

/// Sampling period in seconds: the constant `T` or `Ts` whose comment begins with `s`, or the reciprocal of `FS` or `fs` in Hz.
pub fn sampling_period(sources: &[(String, String)], constants: &[(String, Number)]) -> Option<f64> {
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
    PERIODS.into_iter().find_map(of)
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
        !rest.is_empty() && rest.chars().all(|one| one.is_ascii_digit() || "[,]".contains(one))
    })
}

/// SI base units in which [`SiUnit`] states units; the radian counts as one, as FMI has it.
pub const SI: [&str; 6] = ["kg", "m", "s", "A", "K", "rad"];

/// Unit in SI base units: a value `x` in it is `factor * x + offset` in these.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SiUnit {
    /// Size of the unit.
    pub factor: f64,
    /// Value of its zero, other than 0 for a temperature alone.
    pub offset: f64,
    /// Exponents of the units of [`SI`].
    pub exponents: [i8; SI.len()],
}

/// Zero of the Celsius scale, in K.
const CELSIUS: f64 = 273.15;

/// Unit symbols, each with its size and its exponents in [`SI`].
const BASE: [(&str, f64, [i8; SI.len()]); 32] = [
    ("m", 1.0, [0, 1, 0, 0, 0, 0]),
    ("mm", 1e-3, [0, 1, 0, 0, 0, 0]),
    ("um", 1e-6, [0, 1, 0, 0, 0, 0]),
    ("µm", 1e-6, [0, 1, 0, 0, 0, 0]),
    ("s", 1.0, [0, 0, 1, 0, 0, 0]),
    ("ms", 1e-3, [0, 0, 1, 0, 0, 0]),
    ("µs", 1e-6, [0, 0, 1, 0, 0, 0]),
    ("g", 1e-3, [1, 0, 0, 0, 0, 0]),
    ("kg", 1.0, [1, 0, 0, 0, 0, 0]),
    ("A", 1.0, [0, 0, 0, 1, 0, 0]),
    ("mA", 1e-3, [0, 0, 0, 1, 0, 0]),
    ("V", 1.0, [1, 2, -3, -1, 0, 0]),
    ("mV", 1e-3, [1, 2, -3, -1, 0, 0]),
    ("W", 1.0, [1, 2, -3, 0, 0, 0]),
    ("N", 1.0, [1, 1, -2, 0, 0, 0]),
    ("J", 1.0, [1, 2, -2, 0, 0, 0]),
    ("Hz", 1.0, [0, 0, -1, 0, 0, 0]),
    ("kHz", 1e3, [0, 0, -1, 0, 0, 0]),
    ("MHz", 1e6, [0, 0, -1, 0, 0, 0]),
    ("H", 1.0, [1, 2, -2, -2, 0, 0]),
    ("mH", 1e-3, [1, 2, -2, -2, 0, 0]),
    ("F", 1.0, [-1, -2, 4, 2, 0, 0]),
    ("µF", 1e-6, [-1, -2, 4, 2, 0, 0]),
    ("T", 1.0, [1, 0, -2, -1, 0, 0]),
    ("Wb", 1.0, [1, 2, -2, -1, 0, 0]),
    ("Pa", 1.0, [1, -1, -2, 0, 0, 0]),
    ("kΩ", 1e3, [1, 2, -3, -2, 0, 0]),
    ("rad", 1.0, [0, 0, 0, 0, 0, 1]),
    ("°", std::f64::consts::PI / 180.0, [0, 0, 0, 0, 0, 1]),
    ("°C", 1.0, [0, 0, 0, 0, 1, 0]),
    ("K", 1.0, [0, 0, 0, 0, 1, 0]),
    ("Ω", 1.0, [1, 2, -3, -2, 0, 0]),
];

/// Characters of a factor's power.
const POWERS: &str = "²³⁴-0123456789^";

/// A unit without parentheses: `N/(m·s)` is `N/m/s`. Other parentheses stay, and no symbol has any.
fn without_parentheses(unit: &str) -> Cow<'_, str> {
    match unit.strip_suffix(')').and_then(|unit| unit.split_once("/(")) {
        Some((above, below)) => Cow::Owned(format!("{above}/{}", below.replace(['·', '*'], "/"))),
        None => Cow::Borrowed(unit),
    }
}

/// The word is a product or quotient of powers of known unit symbols, at most [`UNIT`] characters long.
fn is_unit(word: &str) -> bool {
    !word.is_empty()
        && word.chars().count() <= UNIT
        && without_parentheses(word).split(['/', '·', '*']).all(|factor| {
            let factor = factor.trim_end_matches(|one| POWERS.contains(one));
            BASE.iter().any(|(symbol, ..)| *symbol == factor)
        })
}

/// Power as written behind a symbol: `²`, `2`, `^2`, `-1`, or nothing for 1.
fn power(text: &str) -> Option<i8> {
    let digits = match text.strip_prefix('^') {
        Some("") => return None,
        digits => digits.unwrap_or(text),
    };
    let plain = digits.replace('²', "2").replace('³', "3").replace('⁴', "4");
    // Exponents are -127 to 127: each has an opposite.
    if plain.is_empty() { Some(1) } else { plain.parse().ok().filter(|power| *power > i8::MIN) }
}

/// A unit, as [`unit`] reads it, in SI base units; `None` if its meaning is not clear, as that of `V/rad·s`.
pub fn si(unit: &str) -> Option<SiUnit> {
    if unit == "°C" {
        return Some(SiUnit { factor: 1.0, offset: CELSIUS, exponents: [0, 0, 0, 0, 1, 0] });
    }
    let mut si = SiUnit { factor: 1.0, offset: 0.0, exponents: [0; SI.len()] };
    let mut is_below = false;
    let unit = without_parentheses(unit);
    let mut rest = &*unit;
    loop {
        let end = rest.find(['/', '·', '*']).unwrap_or(rest.len());
        let symbol = rest[..end].trim_end_matches(|one| POWERS.contains(one));
        let (_, factor, exponents) = BASE.iter().find(|(known, ..)| *known == symbol)?;
        let power = power(&rest[symbol.len()..end])?;
        let power = if is_below { power.checked_neg()? } else { power };
        si.factor *= factor.powi(i32::from(power));
        for (sum, exponent) in si.exponents.iter_mut().zip(exponents) {
            *sum = sum.checked_add(exponent.checked_mul(power)?)?;
        }
        let mut after = rest[end..].chars();
        match after.next() {
            None => return Some(si),
            Some('/') => is_below = true,
            Some(_) if is_below => return None,
            Some(_) => {}
        }
        rest = after.as_str();
    }
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
                      .output x1, x2 ; m, m/s: position, velocity\n.output tau4 ; N·m\n.output d ; duties, 0 to 1\n.output a ; m/s²\n.output k ; N/(m·s)\n.output temp ; °C; outside of the table its ends\n";
        let sources = [("a.s".to_owned(), source.to_owned())];
        let of = |what, name| unit(&sources, what, name);
        assert_eq!(of(".input", "w").as_deref(), Some("rad/s"));
        assert_eq!((of(".input", "n1"), of(".input", "u"), of(".output", "d")), (None, None, None));
        assert_eq!((of(".input", "i12").as_deref(), of(".input", "y[2]").as_deref()), (Some("A"), Some("A")));
        assert_eq!(
            (of(".output", "x1").as_deref(), of(".output", "x2").as_deref()),
            (Some("m"), Some("m/s"))
        );
        assert_eq!(of(".output", "k").as_deref(), Some("N/(m·s)"));
        assert_eq!((of(".output", "temp").as_deref(), of(".output", "tau5").as_deref()), (Some("°C"), None));
        assert_eq!(
            (of(".output", "tau4").as_deref(), of(".output", "a").as_deref()),
            (Some("N·m"), Some("m/s²"))
        );
    }
    #[test]
    fn units_in_si_units() {
        let of = |unit| si(unit).map(|si| (si.factor, si.offset, si.exponents));
        assert_eq!(of("rad/s"), Some((1.0, 0.0, [0, 0, -1, 0, 0, 1])));
        assert_eq!(of("N·m"), Some((1.0, 0.0, [1, 2, -2, 0, 0, 0])));
        assert_eq!(of("m/s²"), of("m*s^-2"));
        assert_eq!(of("mm2"), Some((1e-3 * 1e-3, 0.0, [0, 2, 0, 0, 0, 0])));
        assert_eq!(of("V/A"), of("Ω"));
        assert_eq!((of("H"), of("F"), of("T"), of("Wb")), (of("V·s/A"), of("A·s/V"), of("N/A/m"), of("V·s")));
        assert_eq!(of("N/(m·s)"), of("N/m/s"));
        assert_eq!((of("°C"), of("W/°C")), (Some((1.0, 273.15, [0, 0, 0, 0, 1, 0])), of("W/K")));
        for unclear in ["V/rad·s", "(m/s", "N/(m)/s", "m^", "m2-", "m99999", "s-128", "m/", "", "1/s"] {
            assert_eq!(of(unclear), None, "{unclear}");
        }
        // 128 is no exponent, and no sum of exponents either.
        assert_eq!((of("m64·m64"), of("V64")), (None, None));
    }

    #[test]
    fn parameters_have_units() {
        let source =
            ".param kp = 2.0 range 0..50 ; V/rad\n.param K[2,2] = 1, 2, 3, 4 ; A: gains\n.param free = 1\n";
        let sources = [("a.s".to_owned(), source.to_owned())];
        let of = |name| unit(&sources, ".param", name);
        assert_eq!(
            (of("kp").as_deref(), of("K[1,2]").as_deref(), of("free")),
            (Some("V/rad"), Some("A"), None)
        );
    }
}
