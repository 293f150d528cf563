// SPDX-License-Identifier: MIT OR Apache-2.0
//! Machines by name: a row of the table, with memories of other depths if options follow its name.
//!
//! The name `t3,code=4096,data=32768` is the machine t3 with 4,096 bundles of program memory and 32,768 words of data memory.
//! Names are canonical: options stand in the order of [`OPTIONS`], and an option that states the row's own depth is left out.
//! Equal names denote the same machine: each is made once and lives as long as the process.

use super::check::{MAX_CODE, MAX_DATA};
use super::machines::{MACHINES, Machine};
use super::row::builtin;
use std::fmt::Write as _;
use std::sync::{Mutex, PoisonError};

/// A number of a machine's row that a program may set.
pub struct MachineOption {
    /// Name of the option, after the machine's.
    pub name: &'static str,
    /// Meaning in words, for lists of options.
    pub text: &'static str,
    /// The greatest value. Every power of two from 2 up to it is possible: the circuit addresses memories by bit fields.
    pub most: u32,
    get: fn(&Machine) -> u32,
    set: fn(&mut Machine, u32),
}

/// The options of every machine, in the order of canonical names.
pub static OPTIONS: [MachineOption; 2] = [
    MachineOption {
        name: "code",
        text: "bundles of program memory",
        most: MAX_CODE,
        get: |machine| machine.code_depth,
        set: |machine, depth| machine.code_depth = depth,
    },
    MachineOption {
        name: "data",
        text: "words of data memory",
        most: MAX_DATA,
        get: |machine| machine.data_depth,
        set: |machine, depth| machine.data_depth = depth,
    },
];

/// The reason why a text does not name a machine.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum MachineNameError {
    /// No row of the table has this name.
    #[error("there is no machine `{0}`")]
    Machine(String),
    /// No option has this name.
    #[error("a machine has no option `{0}`")]
    Option(String),
    /// An option without a number.
    #[error("`{option}` needs a number, as `{option}=4096`")]
    NoNumber {
        /// Name of the option.
        option: &'static str,
    },
    /// An option's value is not a number.
    #[error("`{option}={value}`: `{value}` is not a number")]
    Number {
        /// Name of the option.
        option: &'static str,
        /// Text given as the value.
        value: String,
    },
    /// A depth is not a power of two, or out of range.
    #[error(
        "`{option}={value}`: a depth is a power of two from 2 to {most}{}",
        match .next { Some(next) => format!("; the next is {next}"), None => String::new() }
    )]
    Depth {
        /// Name of the option.
        option: &'static str,
        /// The requested depth.
        value: u64,
        /// The greatest depth possible.
        most: u32,
        /// The next larger depth, if there is one.
        next: Option<u32>,
    },
    /// An option is given more than once.
    #[error("`{option}` is given twice")]
    Twice {
        /// Name of the option.
        option: &'static str,
    },
}

impl MachineNameError {
    /// The unknown name, and the known names of its kind; `None` for other errors.
    pub fn unknown(&self) -> Option<(&str, Vec<&'static str>)> {
        match self {
            MachineNameError::Machine(name) => {
                Some((name, MACHINES.iter().map(|machine| machine.name).collect()))
            }
            MachineNameError::Option(name) => {
                Some((name, OPTIONS.iter().map(|option| option.name).collect()))
            }
            _ => None,
        }
    }

    /// Kind of the names that [`MachineNameError::unknown`] lists: `machines` or `options`.
    pub fn kind(&self) -> &'static str {
        if matches!(self, MachineNameError::Machine(_)) { "machines" } else { "options" }
    }
}

/// Machines with options, each once, paired with the machine of their row.
static CONFIGURED: Mutex<Vec<[&'static Machine; 2]>> = Mutex::new(Vec::new());

/// Returns the machine of a row and a name, adding it if it is new. The names that [`Machine::from_name`] can make are
/// finite: a few hundred for each row.
fn intern(row: &'static Machine, machine: Machine, name: String) -> &'static Machine {
    let mut known = CONFIGURED.lock().unwrap_or_else(PoisonError::into_inner);
    let is_it = |[of, known]: &&[&Machine; 2]| std::ptr::eq(*of, row) && known.name == name;
    if let Some([_, found]) = known.iter().find(is_it) {
        return found;
    }
    let machine = Box::leak(Box::new(Machine { name: Box::leak(name.into_boxed_str()), ..machine }));
    known.push([row, machine]);
    machine
}

/// Parses and checks a depth.
fn depth(option: &MachineOption, text: &str) -> Result<u32, MachineNameError> {
    let (name, most) = (option.name, option.most);
    if text.is_empty() {
        return Err(MachineNameError::NoNumber { option: name });
    }
    // A number beyond 64 bits saturates: it is out of range in any case.
    let value = match text.bytes().all(|byte| byte.is_ascii_digit()) {
        true => text.parse().unwrap_or(u64::MAX),
        false => return Err(MachineNameError::Number { option: name, value: text.to_owned() }),
    };
    match u32::try_from(value) {
        Ok(depth) if depth.is_power_of_two() && (2..=most).contains(&depth) => Ok(depth),
        _ => {
            let next = u32::try_from(value).ok().and_then(|depth| depth.max(2).checked_next_power_of_two());
            Err(MachineNameError::Depth {
                option: name,
                value,
                most,
                next: next.filter(|next| *next <= most),
            })
        }
    }
}

impl Machine {
    /// Finds a machine by name: a row of the table or a fixture of the tests, perhaps with options, such as `t3,data=32768`. Spaces
    /// around commas are ignored.
    ///
    /// # Errors
    /// If there is no such machine or option, or a circuit cannot have a requested depth.
    pub fn from_name(name: &str) -> Result<&'static Machine, MachineNameError> {
        let mut parts = name.split(',').map(str::trim);
        let row = parts.next().unwrap_or_default();
        let row = builtin(row).ok_or_else(|| MachineNameError::Machine(row.to_owned()))?;
        row.with_option_list(parts)
    }

    /// The machine with the options after the first comma of a name: `data=32768`, `code=4096,data=32768`.
    ///
    /// # Errors
    /// As [`Machine::with_options`].
    pub fn with_option_list<'a>(
        &'static self,
        options: impl IntoIterator<Item = &'a str>,
    ) -> Result<&'static Machine, MachineNameError> {
        self.with_options(options.into_iter().map(|part| part.trim().split_once('=').unwrap_or((part, ""))))
    }

    /// The machine with options, each a name and a number.
    ///
    /// # Errors
    /// If there is no such option, or a circuit cannot have a requested depth.
    pub fn with_options<'a>(
        &'static self,
        options: impl IntoIterator<Item = (&'a str, &'a str)>,
    ) -> Result<&'static Machine, MachineNameError> {
        let mut set = [None; OPTIONS.len()];
        for (name, value) in options {
            let index = OPTIONS.iter().position(|option| option.name == name.trim());
            let index = index.ok_or_else(|| MachineNameError::Option(name.trim().to_owned()))?;
            if set[index].is_some() {
                return Err(MachineNameError::Twice { option: OPTIONS[index].name });
            }
            set[index] = Some(depth(&OPTIONS[index], value.trim())?);
        }
        Ok(self.configured(set))
    }

    /// The machine with other depths, indexed like [`OPTIONS`] and already checked; `None` keeps a depth.
    fn configured(&'static self, depths: [Option<u32>; OPTIONS.len()]) -> &'static Machine {
        let row = self.row();
        let (mut machine, mut name) = (*self, row.name.to_owned());
        for (option, depth) in OPTIONS.iter().zip(depths) {
            (option.set)(&mut machine, depth.unwrap_or((option.get)(self)));
            let depth = (option.get)(&machine);
            if depth != (option.get)(row) {
                let _ = write!(name, ",{}={depth}", option.name);
            }
        }
        if name == self.name {
            self
        } else if name == row.name {
            row
        } else {
            intern(row, machine, name)
        }
    }

    /// Name of the machine's row, without options.
    pub const fn row_name(&self) -> &'static str {
        let (bytes, mut end) = (self.name.as_bytes(), 0);
        while end < bytes.len() && bytes[end] != b',' {
            end += 1;
        }
        self.name.split_at(end).0
    }

    /// The machine of the row, without options.
    pub fn row(&'static self) -> &'static Machine {
        if self.row_name() == self.name {
            return builtin(self.name).filter(|row| *row == self).unwrap_or(self);
        }
        let known = CONFIGURED.lock().unwrap_or_else(PoisonError::into_inner);
        match known.iter().find(|[_, known]| std::ptr::eq(*known, self)) {
            Some([row, _]) => row,
            None => builtin(self.row_name()).unwrap_or(self),
        }
    }

    /// The name as a part of names in Verilog and C and of files: `t3_data_32768` for `t3,data=32768`.
    pub fn identifier(&self) -> String {
        self.name.replace([',', '='], "_")
    }

    /// The directive that names the machine in a source, `.machine t3 data=32768`. For a file's machine a description in words: the
    /// file's name is not known here.
    pub fn directive(&self) -> String {
        let (row, options) = (self.row_name(), self.options());
        match self.is_builtin() {
            true => format!(".machine {row}{options}"),
            false if options.is_empty() => format!("machine {row}"),
            false => format!("machine {row} with{options}"),
        }
    }

    /// The options as a source states them after the row's name, with a space before each: ` data=32768`.
    pub fn options(&self) -> String {
        self.name.replace(self.row_name(), "").replace(',', " ")
    }

    /// The machine of this row with the smallest memories that hold `bundles` and `words` and are no smaller than the current ones;
    /// `None` if no depth is large enough.
    pub fn holding(&'static self, bundles: u64, words: u64) -> Option<&'static Machine> {
        let depth = |of: u32, wanted: u64, most: u32| {
            let depth = u32::try_from(wanted).ok()?.checked_next_power_of_two()?.max(of);
            (depth <= most).then_some(depth)
        };
        // The last bundle of the deepest program memory stays free: [`Machine::most_bundles`].
        let bundles = if bundles == u64::from(MAX_CODE) { bundles + 1 } else { bundles };
        let code = depth(self.code_depth, bundles, MAX_CODE)?;
        Some(self.configured([Some(code), Some(depth(self.data_depth, words, MAX_DATA)?)]))
    }
}
