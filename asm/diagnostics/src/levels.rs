// SPDX-License-Identifier: MIT OR Apache-2.0
//! The warnings by name, and the level of each.

use crate::nearest;
use std::str::FromStr;

/// Every warning: name and subject.
pub const WARNINGS: &[(&str, &str)] = &[
    ("grouping", "a comparison stands beside `&`, `|` or another comparison without parentheses"),
    ("never-written", "a register with a place is read, and nothing writes it"),
    (
        "next-head",
        "in a system, a field of a FIFO's entry is read so late after its pop that it may be the next one's",
    ),
    ("no-wait", "`.period` has code that never comes to a `wait` or `halt`"),
    ("table", "an address lies in another table than the one that it names"),
    ("target", "a jump leads past the program's end"),
    ("types", "a value is read as another type than it is"),
    ("underflow", "a constant rounds to zero"),
    ("unreachable", "code is unreachable"),
    ("unused", "a name is declared and not used, or written and not read"),
];

/// The level of a warning.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Level {
    /// The warning is not reported.
    Allow,
    /// The warning is reported, and the program assembled.
    Warn,
    /// The warning counts as an error: the program is not assembled.
    Error,
}

/// A setting of warning levels, as a command line states it: `error`, `error=NAME` or `allow=NAME`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LevelSetting {
    level: Level,
    /// Index of the warning in [`WARNINGS`]; `None` sets all warnings.
    which: Option<usize>,
}

impl FromStr for LevelSetting {
    type Err = String;

    fn from_str(text: &str) -> Result<LevelSetting, String> {
        let (level, name) = text.split_once('=').map_or((text, None), |(level, name)| (level, Some(name)));
        let level = match (level, name) {
            ("error", _) => Level::Error,
            ("allow", Some(_)) => Level::Allow,
            _ => return Err("write `error`, `error=NAME` or `allow=NAME`".to_owned()),
        };
        let names = || WARNINGS.iter().map(|warning| warning.0);
        let which = |name: &str| {
            names().position(|known| known == name).ok_or_else(|| {
                let meant = nearest(name, names());
                let meant = meant.map_or(String::new(), |meant| format!("; did you mean `{meant}`?"));
                let names: Vec<&str> = names().collect();
                format!("there is no warning `{name}`{meant} (warnings: {})", names.join(", "))
            })
        };
        Ok(LevelSetting { level, which: name.map(which).transpose()? })
    }
}

/// The level of each warning. A setting by name overrides a setting of all warnings; otherwise the last setting wins.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Levels {
    all: Option<Level>,
    named: [Option<Level>; WARNINGS.len()],
}

impl Levels {
    /// The level of a warning.
    pub fn of(&self, name: &str) -> Level {
        let named = WARNINGS.iter().position(|warning| warning.0 == name).and_then(|which| self.named[which]);
        named.or(self.all).unwrap_or(Level::Warn)
    }
}

impl FromIterator<LevelSetting> for Levels {
    fn from_iter<I: IntoIterator<Item = LevelSetting>>(wishes: I) -> Levels {
        let mut levels = Levels::default();
        for LevelSetting { level, which } in wishes {
            *which.map_or(&mut levels.all, |which| &mut levels.named[which]) = Some(level);
        }
        levels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn levels(wishes: &[&str]) -> Levels {
        wishes.iter().map(|wish| wish.parse::<LevelSetting>().expect("it is one")).collect()
    }

    #[test]
    fn level_of_a_name_overrides_all_and_the_last_setting_wins() {
        assert_eq!(levels(&[]).of("types"), Level::Warn);
        assert_eq!(levels(&["error"]).of("types"), Level::Error);
        for order in [["error", "allow=types"], ["allow=types", "error"]] {
            assert_eq!(levels(&order).of("types"), Level::Allow);
            assert_eq!(levels(&order).of("unused"), Level::Error);
        }
        assert_eq!(levels(&["allow=types", "error=types"]).of("types"), Level::Error);
        assert_eq!(levels(&["error=types"]).of("unused"), Level::Warn);
    }

    #[test]
    fn rejects_invalid_settings_with_valid_ones() {
        let fails = |text: &str| text.parse::<LevelSetting>().expect_err("it is none");
        for text in ["", "allow", "all", "Error", "warn=types"] {
            assert_eq!(fails(text), "write `error`, `error=NAME` or `allow=NAME`");
        }
        assert!(
            fails("error=type")
                .starts_with("there is no warning `type`; did you mean `types`? (warnings: grouping, never-")
        );
        assert!(fails("allow=").starts_with("there is no warning ``"));
    }
}
