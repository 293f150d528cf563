// SPDX-License-Identifier: MIT OR Apache-2.0
//! Parsers for numbers on the command line, with and without units, with uniform error messages.
//!
//! Numeric options accept a leading `-`, so that `--tick -5us` is reported as a wrong number instead of an unknown option.

use std::num::NonZeroU64;
use std::ops::RangeInclusive;
use takt_emu::LONGEST_TICK;

/// Default baud rate, if the wiring does not state one.
pub(crate) const BAUD: u32 = 115_200;

/// Splits a text into a leading number and the rest. Words such as `nan` and `inf` are not numbers.
fn split(text: &str) -> (&str, &str) {
    let text = text.trim();
    let sign = usize::from(text.starts_with(['+', '-']));
    let is_number = |end: usize| text[..end].parse::<f64>().is_ok();
    let is_digit = |c: char| c.is_ascii_digit() || ".eE+-".contains(c);
    // Longest numeric prefix: it includes the `e` of `5e3`, but not the `e` of `5em`.
    let most = text.find(|c| !is_digit(c)).unwrap_or(text.len());
    let end = (sign + 1..=most).rev().find(|&end| is_number(end)).unwrap_or(0);
    (&text[..end], text[end..].trim_start())
}

/// Bound below which binary64 represents all integers exactly.
const EXACT: f64 = 9_007_199_254_740_992.0;

/// Parses an integer within a range.
fn whole(text: &str, range: RangeInclusive<u64>) -> Result<u64, String> {
    let (number, rest) = split(text);
    if number.is_empty() {
        return Err("not a whole number".to_owned());
    }
    if !rest.is_empty() {
        return Err(format!("expected a whole number without a unit; `{rest}` follows it"));
    }
    let (first, last) = (range.start(), range.end());
    match number.parse::<u64>() {
        Ok(count) if range.contains(&count) => Ok(count),
        Ok(count) if count < *first => Err(format!("less than {first}")),
        Ok(_) => Err(format!("more than {last}")),
        Err(_) if number.starts_with('-') => Err(format!("less than {first}")),
        Err(_) if number.contains(|c: char| !c.is_ascii_digit() && c != '+') => {
            let digits = number.parse::<f64>().ok().filter(|value| value.fract() == 0.0 && *value < EXACT);
            let digits = digits.map_or(String::new(), |value| format!(" (`{value}`)"));
            Err(format!("not a whole number in digits{digits}"))
        }
        Err(_) => Err(format!("more than {last}")),
    }
}

/// Cycles from the least to the most: one number if they are equal.
pub(crate) fn least_to_most(least: u64, most: u64) -> String {
    if least == most { most.to_string() } else { format!("{least} to {most}") }
}

/// A number as text, rounded to some significant digits, without trailing zeros: plain from 0.001 to a million, else with an exponent.
pub(crate) fn rounded(value: f64, digits: usize) -> String {
    let scientific = format!("{value:.*e}", digits.saturating_sub(1));
    let Some((mantissa, exponent)) = scientific.split_once('e') else { return scientific };
    let without_zeros = |text: &str| match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text.to_owned(),
    };
    match exponent.parse::<i32>() {
        Ok(exponent @ -3..6) => {
            let places = usize::try_from(digits as i32 - 1 - exponent).unwrap_or(0);
            let text = without_zeros(&format!("{value:.places$}"));
            if text == "-0" { "0".to_owned() } else { text }
        }
        _ => format!("{}e{exponent}", without_zeros(mantissa)),
    }
}

/// Parses a count of at least 1, for clap.
pub(crate) fn count(text: &str) -> Result<u64, String> {
    whole(text, 1..=u64::MAX)
}

/// Parses a natural number including 0, for clap.
pub(crate) fn natural(text: &str) -> Result<u64, String> {
    whole(text, 0..=u64::MAX)
}

/// Maximum number of robots in `takt track --monte-carlo`.
const ROBOTS: u64 = 1_000_000;

/// Parses a number of robots, for clap.
pub(crate) fn robots(text: &str) -> Result<u64, String> {
    whole(text, 1..=ROBOTS)
}

/// Parses cycles from tick to tick, for clap.
pub(crate) fn tick(text: &str) -> Result<NonZeroU64, String> {
    NonZeroU64::new(whole(text, 1..=LONGEST_TICK)?).ok_or_else(|| "less than 1".to_owned())
}

/// Units of a quantity, each as a multiple of the first.
type Units = &'static [(&'static str, f64)];
const FREQUENCY: Units = &[("MHz", 1.0), ("Hz", 1e-6), ("kHz", 1e-3), ("GHz", 1e3)];
const TIME: Units = &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("µs", 1e-6), ("ns", 1e-9)];

/// Parses a number with a unit, and converts it to the first of `units`; with `bare`, that unit may be omitted.
fn quantity(text: &str, units: Units, bare: bool, range: RangeInclusive<f64>) -> Result<f64, String> {
    let base = units[0].0;
    let names = || units.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
    let (number, unit) = split(text);
    let value: f64 = number.parse().map_err(|_| "not a number".to_owned())?;
    let scale = match units.iter().find(|(name, _)| *name == unit) {
        Some((_, scale)) => *scale,
        None if unit.is_empty() && bare => 1.0,
        None if unit.is_empty() => return Err(format!("expected a unit: {}", names())),
        None => return Err(format!("`{unit}` is not one of the units {}", names())),
    };
    let value = value * scale;
    if value <= 0.0 {
        Err("not more than 0".to_owned())
    } else if !range.contains(&value) {
        Err(format!("not between {} and {} {base}", range.start(), range.end()))
    } else {
        Ok(value)
    }
}

/// Parses a clock in MHz or with another unit, for clap.
pub(crate) fn clock(text: &str) -> Result<f64, String> {
    quantity(text, FREQUENCY, true, 0.01..=100_000.0)
}

/// A duration in cycles or in seconds, which can be converted to cycles at a clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Time {
    Cycles(u64),
    Seconds(f64),
}

/// Formats a time in the largest unit in which it is at least one.
fn with_unit(seconds: f64) -> String {
    let (name, size) = TIME.iter().find(|(_, size)| seconds >= *size).unwrap_or(&TIME[TIME.len() - 1]);
    let value = seconds / size;
    // Round off the error of the division.
    let value = format!("{value:.9}");
    format!("{}{name}", value.trim_end_matches('0').trim_end_matches('.'))
}

/// Parses a time with a unit, or a number of cycles, for clap.
pub(crate) fn time(text: &str) -> Result<Time, String> {
    let (number, unit) = split(text);
    if number.is_empty() {
        return Err("neither a time (`100us`, `0.1ms`) nor a number of cycles".to_owned());
    }
    if unit.is_empty() {
        count(text).map(Time::Cycles).map_err(|error| match number.parse::<f64>() {
            Ok(seconds) if number.contains(['.', 'e', 'E']) && seconds > 0.0 => {
                let units = TIME.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
                format!(
                    "neither a whole number of cycles nor a time with its unit ({units}): for seconds, write `{}`",
                    with_unit(seconds)
                )
            }
            _ => error,
        })
    } else {
        quantity(text, TIME, false, 1e-9..=1e6).map(Time::Seconds)
    }
}

/// Parses a time with a unit into seconds, for clap.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    quantity(text, TIME, false, 1e-9..=1e6).map(shortest)
}

/// Removes the last binary digits, which come from the unit: 50us are 50·10⁻⁶ s, a number that binary64 prints with five digits more.
pub(crate) fn shortest(seconds: f64) -> f64 {
    format!("{seconds:.14e}").parse().unwrap_or(seconds)
}

impl Time {
    /// Number of cycles at a clock in MHz, rounded to a whole number if it is within rounding error of one.
    pub(crate) fn cycles(self, clock: f64) -> u64 {
        match self {
            Time::Cycles(cycles) => cycles,
            Time::Seconds(seconds) => (seconds * clock * 1e6 + 1e-6).floor() as u64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_numbers() {
        for (value, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (1.0, "1"),
            (58.09, "58.09"),
            (-128.0, "-128"),
            (0.001, "0.001"),
            (9.9999e-4, "0.001"),
            (9.99e-4, "9.99e-4"),
            (2.572e-2, "0.02572"),
            (999_949.0, "999949"),
            (999_960.0, "1e6"),
            (123_456.7, "123457"),
            (6.25e-7, "6.25e-7"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(rounded(value, 4), text, "{value}");
        }
        assert_eq!(rounded(1_343.309_12, 7), "1343.309");
        assert_eq!(rounded(-2.012_345_678, 7), "-2.012346");
    }

    #[test]
    fn whole_numbers() {
        assert_eq!(count("1"), Ok(1));
        assert_eq!(count(" +7 "), Ok(7));
        assert_eq!(count("18446744073709551615"), Ok(u64::MAX));
        assert_eq!(natural("0"), Ok(0));
        assert_eq!(tick("100000000").map(NonZeroU64::get), Ok(LONGEST_TICK));
        for (text, reason) in [
            ("", "not a whole number"),
            ("nan", "not a whole number"),
            ("--json", "not a whole number"),
            ("-", "not a whole number"),
            ("0", "less than 1"),
            ("-1", "less than 1"),
            ("-0.5", "less than 1"),
            ("1.5", "not a whole number in digits"),
            ("1e3", "not a whole number in digits (`1000`)"),
            ("18446744073709551616", "more than 18446744073709551615"),
            ("100us", "expected a whole number without a unit; `us` follows it"),
            ("-100us", "expected a whole number without a unit; `us` follows it"),
            ("0x10", "expected a whole number without a unit; `x10` follows it"),
            ("1 000", "expected a whole number without a unit; `000` follows it"),
        ] {
            assert_eq!(count(text), Err(reason.to_owned()), "{text:?}");
        }
        assert_eq!(tick("100000001"), Err("more than 100000000".to_owned()));
        assert_eq!(natural("-1"), Err("less than 0".to_owned()));
    }

    #[test]
    fn clocks() {
        for (text, mhz) in
            [("125", 125.0), ("125MHz", 125.0), ("1.5 GHz", 1500.0), ("20kHz", 0.02), ("1e3", 1e3)]
        {
            assert_eq!(clock(text), Ok(mhz), "{text}");
        }
        let units = "MHz, Hz, kHz, GHz";
        let range = "not between 0.01 and 100000 MHz";
        for (text, reason) in [
            ("", "not a number"),
            ("fast", "not a number"),
            ("nan", "not a number"),
            ("infMHz", "not a number"),
            ("MHz", "not a number"),
            ("0", "not more than 0"),
            ("-5", "not more than 0"),
            ("-5MHz", "not more than 0"),
            ("-0", "not more than 0"),
            ("1Hz", range),
            ("1e400", range),
            ("1e-400", "not more than 0"),
            ("1000GHz", range),
            ("5mhz", &format!("`mhz` is not one of the units {units}")),
            ("5 us", &format!("`us` is not one of the units {units}")),
        ] {
            assert_eq!(clock(text), Err(reason.to_owned()), "{text:?}");
        }
    }

    #[test]
    fn times() {
        let cycles = |text| time(text).map(|time| time.cycles(125.0));
        for (text, expected) in [
            ("12500", 12500),
            ("100us", 12500),
            ("100 µs", 12500),
            ("0.1ms", 12500),
            ("1e-4s", 12500),
            ("8ns", 1),
        ] {
            assert_eq!(cycles(text), Ok(expected), "{text}");
        }
        let neither = "neither a time (`100us`, `0.1ms`) nor a number of cycles";
        for (text, reason) in [
            ("", neither),
            ("nan", neither),
            ("infs", neither),
            ("us", neither),
            ("--json", neither),
            ("-5us", "not more than 0"),
            ("0us", "not more than 0"),
            ("0", "less than 1"),
            ("-5", "less than 1"),
            ("-1e3", "less than 1"),
            (
                "1.5",
                "neither a whole number of cycles nor a time with its unit (s, ms, us, µs, ns): for seconds, write `1.5s`",
            ),
            (
                "1e-3",
                "neither a whole number of cycles nor a time with its unit (s, ms, us, µs, ns): for seconds, write `1ms`",
            ),
            (
                "0.0000125",
                "neither a whole number of cycles nor a time with its unit (s, ms, us, µs, ns): for seconds, write `12.5us`",
            ),
            ("100kg", "`kg` is not one of the units s, ms, us, µs, ns"),
            ("100MHz", "`MHz` is not one of the units s, ms, us, µs, ns"),
            ("1e400s", "not between 0.000000001 and 1000000 s"),
            ("0.1ns", "not between 0.000000001 and 1000000 s"),
        ] {
            assert_eq!(time(text).map(|_| ()), Err(reason.to_owned()), "{text:?}");
        }
    }
}
