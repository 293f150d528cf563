// SPDX-License-Identifier: MIT OR Apache-2.0
//! A plant's file in TOML (docs/plant.md): every mistake with its place.

use super::models::MODELS;
use super::{Copies, Interface, MOST_STEPS, Model, Quantity, Simulation, SimulationError, indexed_parts};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use takt_diagnostics::diag::{Diagnostic, Diagnostics};
use takt_diagnostics::source::{Sources, Span};
use takt_diagnostics::{nearest, toml_mistake};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Longest file, in bytes.
pub const TEXT_BYTES: usize = 1 << 20;
/// Seconds that an FMU may take for a step, unless its file says otherwise.
pub const STEP_LIMIT: f64 = 10.0;
/// Most copies of a plant.
const MOST_COPIES: u32 = 16;
/// Code of all mistakes.
pub(super) const CODE: &str = "plant";

/// A value over time: steps from value to value, 0 before the first.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Course {
    /// Times in s, increasing, and values from then on.
    steps: Vec<(f64, f64)>,
    /// Step that settings change.
    acting: usize,
}

impl Course {
    /// Course of these steps. Settings change the last step that does not return to 0; what follows it keeps its distance.
    fn new(steps: Vec<(f64, f64)>) -> Course {
        let acting = steps.iter().rposition(|(_, value)| *value != 0.0);
        Course { acting: acting.unwrap_or(steps.len().saturating_sub(1)), steps }
    }

    /// Value in a period of the given length in s. A step acts from the first period on that does not begin before it.
    pub(super) fn at(&self, period: u64, length: f64) -> f64 {
        // Rounding must not put off a step at a multiple of the period.
        self.value((period as f64 + 1e-6) * length)
    }

    /// Times of the steps, in s.
    pub fn times(&self) -> impl Iterator<Item = f64> {
        self.steps.iter().map(|(time, _)| *time)
    }

    /// Value at a time in s.
    pub fn value(&self, time: f64) -> f64 {
        let index = self.steps.partition_point(|(begin, _)| *begin <= time);
        index.checked_sub(1).map_or(0.0, |last| self.steps[last].1)
    }
}

/// A program's port that belongs to a signal of the plant.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct PortOf {
    pub(super) port: String,
    /// Of a sensor the port is signal · scale + offset; of an input the signal is port · scale + offset.
    pub(super) scale: f64,
    pub(super) offset: f64,
    /// Least and greatest value of a sensor's port.
    pub(super) limits: (f64, f64),
}

impl PortOf {
    pub(super) fn named(port: &str) -> PortOf {
        PortOf { port: port.to_owned(), scale: 1.0, offset: 0.0, limits: UNLIMITED }
    }
}

/// Limits of a sensor without any.
pub(super) const UNLIMITED: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

/// Driver of an input pin of a board.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum PinDriver {
    /// A constant level.
    Level(bool),
    /// Source of the signal: a sensor, or a level of 0.
    Sensor,
    /// The same, with one level in 16 inverted.
    Noise,
}

/// An input pin of a board, as a plant's file describes it.
#[derive(Clone, PartialEq, Debug)]
pub enum PinCourse {
    /// Times in s, increasing, and drivers from then on; before them the sensor.
    Steps(Vec<(f64, PinDriver)>),
    /// A comparator: 1 while the magnitude of one of the signals is above a value.
    Comparator {
        /// Sensors of the plant.
        signals: Vec<String>,
        /// Greatest magnitude for 0.
        above: f64,
    },
}

impl PinCourse {
    /// Driver at a time in s, and the time of the next step.
    pub fn at(&self, time: f64) -> (PinDriver, Option<f64>) {
        let PinCourse::Steps(steps) = self else { return (PinDriver::Sensor, None) };
        let index = steps.partition_point(|(begin, _)| *begin <= time);
        let driver = index.checked_sub(1).map_or(PinDriver::Sensor, |last| steps[last].1);
        (driver, steps.get(index).map(|(begin, _)| *begin))
    }
}

/// An entry of a table, with the places of its name and its value.
#[derive(Clone, Debug)]
pub(super) struct Entry<T> {
    pub(super) name: String,
    pub(super) place: Span,
    pub(super) value: T,
}

/// Entry of a signal: its own, or, of a copy's signal, the one for all copies.
pub(super) fn entry_of<'e, T>(list: &'e [Entry<T>], signal: &str) -> Option<&'e Entry<T>> {
    let named = |name: &str| list.iter().find(|entry| entry.name == name);
    named(signal).or_else(|| named(indexed_parts(signal)?.0))
}

/// The plant that a file names.
#[derive(Clone, Debug)]
pub enum Kind {
    /// A small plant.
    Model {
        /// Its row.
        model: &'static Model,
        /// Parameters in the order of the model.
        parameters: Vec<f64>,
        /// State at the beginning, in the order of the model.
        initial: Vec<f64>,
    },
    /// An FMU.
    Fmu {
        /// Path as the file states it, relative to the file's folder.
        path: String,
        /// Parameters and other variables to be set before the initialisation, by name, with their places.
        start: Vec<(String, f64, Span)>,
        /// Seconds that a step may take.
        limit: f64,
    },
}

/// A number of a plant's file that a user may set.
#[derive(Clone, PartialEq, Debug)]
pub struct Setting {
    /// Name, as in the file.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// SI unit; empty for a pure number.
    pub unit: &'static str,
    /// Meaning in words.
    pub text: String,
    /// Least value that makes sense, or the least positive number; `None` for any.
    pub least: Option<f64>,
}

/// A plant's file.
#[derive(Clone, Debug)]
pub struct PlantFile {
    pub(super) sources: Arc<Sources>,
    /// The plant.
    pub kind: Kind,
    /// Steps of the plant in a period, at least.
    pub steps: u32,
    /// Copies of a small plant, each with signals of its own, `w[1]` and so on; 1: one plant, whose signals have no index.
    pub copies: u32,
    pub(super) ports: Vec<Entry<PortOf>>,
    pub(super) disturbances: Vec<Entry<Course>>,
    pub(super) inputs: Vec<Entry<Course>>,
    pins: Vec<Entry<PinCourse>>,
}

impl PlantFile {
    /// Reads the text of a file.
    ///
    /// # Errors
    /// All mistakes in it.
    pub fn read(name: &str, text: &str) -> Result<PlantFile, Diagnostics> {
        let mut sources = Sources::default();
        sources.add(name, text.to_owned());
        let mut reader = Reader { sources: Arc::new(sources), mistakes: Vec::new() };
        let file = match text.len() {
            length if length > TEXT_BYTES => {
                reader.mistakes.push(Diagnostic::placeless(
                    CODE,
                    format!("{name} is longer than {} MiB", TEXT_BYTES >> 20),
                ));
                None
            }
            _ => match DeTable::parse(text) {
                Ok(table) => reader.file(table.get_ref()),
                Err(error) => {
                    reader.mistakes.push(toml_mistake(&error, text));
                    None
                }
            },
        };
        let Reader { sources, mistakes } = reader;
        file.filter(|_| mistakes.is_empty()).ok_or_else(|| diagnostics(sources, mistakes))
    }

    /// An FMU by itself, whose signals have the names of the ports.
    pub fn of_fmu(path: &str) -> PlantFile {
        PlantFile {
            sources: Arc::default(),
            kind: Kind::Fmu { path: path.to_owned(), start: Vec::new(), limit: STEP_LIMIT },
            steps: 1,
            copies: 1,
            ports: Vec::new(),
            disturbances: Vec::new(),
            inputs: Vec::new(),
            pins: Vec::new(),
        }
    }

    /// Input pins of a board that the file drives, with their places.
    pub fn pins(&self) -> impl Iterator<Item = (&str, Span, &PinCourse)> {
        self.pins.iter().map(|Entry { name, place, value }| (name.as_str(), *place, value))
    }

    /// Path of the plant's FMU, if it is one. `file` is the path of this file, beside which FMUs lie, or of the FMU by itself.
    pub fn fmu(&self, file: &Path) -> Option<PathBuf> {
        let Kind::Fmu { path, .. } = &self.kind else { return None };
        Some(if is_fmu(file) { file.to_owned() } else { file.parent().unwrap_or(Path::new("")).join(path) })
    }

    /// A mistake about a signal, at its entry under `[ports]` if it has one.
    pub fn mistake_of(&self, signal: &str, message: String) -> Diagnostics {
        let entry = entry_of(&self.ports, signal);
        let mistake = match entry {
            Some(entry) => Diagnostic::error(CODE, entry.place, message),
            None => Diagnostic::placeless(CODE, message),
        };
        diagnostics(Arc::clone(&self.sources), vec![mistake])
    }

    /// A mistake at a place of this file.
    pub fn mistake(&self, place: Span, message: String) -> Diagnostics {
        diagnostics(Arc::clone(&self.sources), vec![Diagnostic::error(CODE, place, message)])
    }

    /// Numbers of a small plant's file that a user may set: parameters, and value and time of the last step of each disturbance that does not
    /// return to 0, called `load` and `load.at`.
    pub fn settings(&self) -> Vec<Setting> {
        let Kind::Model { model, parameters, .. } = &self.kind else { return Vec::new() };
        let own = model.parameters.iter().zip(parameters).map(|(parameter, value)| Setting {
            name: parameter.name.to_owned(),
            value: *value,
            unit: parameter.unit,
            text: parameter.text.to_owned(),
            least: Some(parameter.least),
        });
        let disturbances = model.inputs.iter().filter(|input| input.is_disturbance).flat_map(|input| {
            let Quantity { name, unit, text } = input.quantity;
            let course = self.disturbances.iter().find(|entry| entry.name == name);
            let (time, value) = course
                .and_then(|entry| entry.value.steps.get(entry.value.acting).copied())
                .unwrap_or_default();
            let at = Setting {
                name: format!("{name}.at"),
                value: time,
                unit: "s",
                text: format!("time from which {name} acts"),
                least: Some(0.0),
            };
            [Setting { name: name.to_owned(), value, unit, text: text.to_owned(), least: None }, at]
        });
        own.chain(disturbances).collect()
    }

    /// Replaces a number of [`PlantFile::settings`].
    ///
    /// # Errors
    /// If there is no such number, or if the value makes no sense.
    pub fn set(&mut self, name: &str, value: f64) -> Result<(), String> {
        let unknown = || Err(format!("the plant has no parameter `{name}`"));
        let Kind::Model { model, parameters, .. } = &mut self.kind else { return unknown() };
        if let Some(at) = model.parameters.iter().position(|parameter| parameter.name == name) {
            let check = model.parameters[at].check(value);
            check.map_err(|expected| {
                format!("the parameter `{name}` of `{}` is {value}; {expected}", model.name)
            })?;
            parameters[at] = value;
            return Ok(());
        }
        let (signal, is_time) = name.strip_suffix(".at").map_or((name, false), |signal| (signal, true));
        let known = model.inputs.iter().any(|input| input.is_disturbance && input.quantity.name == signal);
        if !known {
            return unknown();
        }
        let at = self.disturbances.iter().position(|entry| entry.name == signal).unwrap_or_else(|| {
            let value = Course::new(vec![(0.0, 0.0)]);
            self.disturbances.push(Entry { name: signal.to_owned(), place: Span::default(), value });
            self.disturbances.len() - 1
        });
        let Course { steps, acting } = &mut self.disturbances[at].value;
        let before = acting.checked_sub(1).map_or(0.0, |index| steps[index].0);
        if !value.is_finite() || is_time && value < before {
            let expected = if is_time { format!("a time from {before} s on") } else { "a number".to_owned() };
            return Err(format!("`{name}` is {value}; expected {expected}"));
        }
        let Some((time, level)) = steps.get_mut(*acting) else { return Ok(()) };
        if is_time {
            let moved = value - *time;
            steps[*acting..].iter_mut().for_each(|(time, _)| *time += moved);
        } else {
            *level = value;
        }
        Ok(())
    }

    /// The small plant; `None` for an FMU.
    pub fn model(&self) -> Option<&'static Model> {
        match self.kind {
            Kind::Model { model, .. } => Some(model),
            Kind::Fmu { .. } => None,
        }
    }

    fn interface_of(&self, model: &Model) -> Interface {
        let interface = model.interface();
        if self.copies > 1 { interface.of_copies(self.copies) } else { interface }
    }

    /// Signals of the small plant; `None` for an FMU.
    pub fn interface(&self) -> Option<Interface> {
        self.model().map(|model| self.interface_of(model))
    }

    /// The input of this index is the duty of a half bridge whose switches the model has.
    pub fn is_leg(&self, input: usize) -> bool {
        self.model().is_some_and(|model| input % model.inputs.len().max(1) < model.legs())
    }

    /// The small plant in motion, with its signals. `period` is in seconds.
    ///
    /// # Errors
    /// If the plant is an FMU, or too fast for the period.
    pub fn simulation(&self, period: f64) -> Result<(Copies, Interface), SimulationError> {
        let Kind::Model { model, parameters, initial } = &self.kind else {
            return Err(SimulationError::Fmu);
        };
        let simulation = Simulation::new(model, parameters.clone(), initial, period, self.steps)?;
        Ok((Copies(vec![simulation; self.copies as usize]), self.interface_of(model)))
    }
}

/// The path names an FMU, by its extension.
pub fn is_fmu(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("fmu"))
}

/// Mistakes in the order of their places.
pub(super) fn diagnostics(sources: Arc<Sources>, mut list: Vec<Diagnostic>) -> Diagnostics {
    list.sort_by_key(|one| one.labels.first().map(|label| label.span));
    Diagnostics { sources, list, ..Diagnostics::default() }
}

/// Names in quotes, as a list for a message; the first ones if there are many.
pub(super) fn listed<'n>(names: impl IntoIterator<Item = &'n str>) -> String {
    const MOST: usize = 12;
    let names: Vec<&str> = names.into_iter().collect();
    let mut text = names.iter().take(MOST).map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    match names.len() {
        0 => text.push_str("none"),
        count if count > MOST => text.push_str(&format!(" and {} more", count - MOST)),
        _ => {}
    }
    text
}

fn span(range: Range<usize>) -> Span {
    Span::new(range.start as u32, range.end as u32)
}

/// Powers of ten of SI prefixes.
const PREFIXES: [(&str, i32); 9] =
    [("p", -12), ("n", -9), ("u", -6), ("µ", -6), ("m", -3), ("c", -2), ("k", 3), ("M", 6), ("G", 9)];

/// Number in the SI unit `unit` from a text such as `0.9 mH`.
fn quantity(text: &str, unit: &str) -> Option<f64> {
    let text = text.trim();
    let is_digit = |c: char| c.is_ascii_digit() || ".eE+-".contains(c);
    let most = text.find(|c| !is_digit(c)).unwrap_or(text.len());
    let end = (1..=most).rev().find(|&end| text[..end].parse::<f64>().is_ok())?;
    let written = text[end..].trim();
    let written = written.replace('*', "·").replace("^2", "²").replace("^3", "³").replace("ohm", "Ω");
    // A prefix belongs to the first symbol, and to its power: that is written out.
    let first = unit.split(['·', '/']).next().unwrap_or_default();
    let takes_prefix = !first.is_empty() && !first.starts_with("kg") && !first.ends_with(['²', '³']);
    let prefixed = |(prefix, power): &(&str, i32)| (written.strip_prefix(prefix)? == unit).then_some(*power);
    let power = match written == unit {
        true => 0,
        false if takes_prefix => PREFIXES.iter().find_map(prefixed)?,
        false => return None,
    };
    // Read as one decimal, so that 0.9 mH has the bits of 0.9e-3.
    let (mantissa, exponent) = text[..end].split_once(['e', 'E']).unwrap_or((&text[..end], "0"));
    let exponent = exponent.parse::<i32>().ok()?.checked_add(power)?;
    format!("{mantissa}e{exponent}").parse().ok()
}

struct Reader {
    sources: Arc<Sources>,
    mistakes: Vec<Diagnostic>,
}

/// Entries of a table in the order of the file.
fn entries<'t, 'i>(table: &'t DeTable<'i>) -> Vec<(&'t str, Span, &'t Spanned<DeValue<'i>>)> {
    let mut entries: Vec<_> =
        table.iter().map(|(name, value)| (name.get_ref().as_ref(), span(name.span()), value)).collect();
    entries.sort_by_key(|(_, place, _)| *place);
    entries
}

impl Reader {
    fn mistake(&mut self, place: Span, message: impl Into<String>) -> &mut Diagnostic {
        self.mistakes.push(Diagnostic::error(CODE, place, message));
        let last = self.mistakes.len() - 1;
        &mut self.mistakes[last]
    }

    /// Reports an unknown name among known ones.
    fn unknown<'n>(&mut self, what: &str, name: &str, place: Span, known: impl IntoIterator<Item = &'n str>) {
        let known: Vec<&str> = known.into_iter().collect();
        let near = nearest(name, known.iter().copied());
        let help = format!("known: {}", listed(known));
        let mistake = self.mistake(place, format!("{what} `{name}`"));
        *mistake = mistake.clone().help(help).did_you_mean(near);
    }

    fn file(&mut self, table: &DeTable<'_>) -> Option<PlantFile> {
        const KEYS: [&str; 11] = [
            "model",
            "fmu",
            "copies",
            "steps",
            "limit",
            "parameters",
            "initial",
            "ports",
            "disturbance",
            "inputs",
            "pins",
        ];
        for (name, place, _) in entries(table) {
            if !KEYS.contains(&name) {
                self.unknown("a plant's file has no key", name, place, KEYS);
            }
        }
        let get = |key: &str| table.get(key);
        let steps = get("steps").map_or(Some(1), |value| self.whole("steps", value, 1, MOST_STEPS));
        let copies = get("copies").map_or(Some(1), |value| self.whole("copies", value, 1, MOST_COPIES));
        let kind = self.kind(table);
        let ports = self.table(get("ports"), "ports", |reader, _, value| reader.port(value));
        let inputs = self.table(get("inputs"), "inputs", |reader, _, value| reader.course(value, None));
        let pins = self.table(get("pins"), "pins", |reader, _, value| reader.pin(value));
        let model = match &kind {
            Some(Kind::Model { model, .. }) => Some(*model),
            _ => None,
        };
        let disturbances = self.table(get("disturbance"), "disturbance", |reader, (name, _), value| {
            let unit = model.and_then(|model| {
                let name = indexed_parts(name).map_or(name, |(name, _)| name);
                let known = model.inputs.iter().find(|one| one.quantity.name == name);
                known.map(|one| one.quantity.unit)
            });
            reader.course(value, unit)
        });
        let sources = Arc::clone(&self.sources);
        let (steps, copies) = (steps?, copies?);
        Some(PlantFile { sources, kind: kind?, steps, copies, ports, disturbances, inputs, pins })
    }

    fn kind(&mut self, table: &DeTable<'_>) -> Option<Kind> {
        let get = |key: &str| table.get(key);
        match (get("model"), get("fmu")) {
            (Some(name), None) => {
                let (name, place) = (self.text("model", name)?, span(name.span()));
                let Some(model) = Model::named(name) else {
                    self.unknown("there is no model", name, place, MODELS.map(|model| model.name));
                    return None;
                };
                if let Some(limit) = get("limit") {
                    let _ = self.mistake(
                        span(limit.span()),
                        "`limit` is the time of an FMU's step; a model has none",
                    );
                }
                let mut parameters: Vec<f64> = model.parameters.iter().map(|one| one.value).collect();
                self.table(get("parameters"), "parameters", |reader, name, value| {
                    let Some(at) = model.parameters.iter().position(|one| one.name == name.0) else {
                        let known = model.parameters.iter().map(|one| one.name);
                        reader.unknown(&format!("`{}` has no parameter", model.name), name.0, name.1, known);
                        return None;
                    };
                    let parameter = &model.parameters[at];
                    parameters[at] = reader.number(value, Some(parameter.unit))?;
                    if let Err(expected) = parameter.check(parameters[at]) {
                        let text = format!("`{}` is {}: {expected}", name.0, parameters[at]);
                        let _ = reader.mistake(span(value.span()), text);
                    }
                    Some(())
                });
                let mut initial = vec![0.0; model.states.len()];
                self.table(get("initial"), "initial", |reader, name, value| {
                    let Some(at) = model.states.iter().position(|one| one.name == name.0) else {
                        let known = model.states.iter().map(|one| one.name);
                        reader.unknown(&format!("`{}` has no state", model.name), name.0, name.1, known);
                        return None;
                    };
                    initial[at] = reader.number(value, Some(model.states[at].unit))?;
                    Some(())
                });
                Some(Kind::Model { model, parameters, initial })
            }
            (None, Some(path)) => {
                let path = self.text("fmu", path)?.to_owned();
                if let Some(copies) = get("copies") {
                    let text = "`copies` is for a model; an FMU is one plant";
                    let _ = self.mistake(span(copies.span()), text);
                }
                if let Some(initial) = get("initial") {
                    let text = "`initial` is for the states of a model; variables of an FMU start as [parameters] says";
                    let _ = self.mistake(span(initial.span()), text);
                }
                let start = self
                    .table(get("parameters"), "parameters", |reader, _, value| reader.number(value, None));
                let start =
                    start.into_iter().map(|Entry { name, place, value }| (name, value, place)).collect();
                let limit = match get("limit") {
                    None => STEP_LIMIT,
                    Some(value) => {
                        let limit = self.number(value, Some("s"))?;
                        if !(limit > 0.0 && limit <= 86_400.0) {
                            let _ =
                                self.mistake(span(value.span()), "`limit` must be a time up to a day, in s");
                        }
                        limit
                    }
                };
                Some(Kind::Fmu { path, start, limit })
            }
            (Some(model), Some(fmu)) => {
                let later = span(model.span()).max(span(fmu.span()));
                let _ = self.mistake(later, "a plant is a `model` or an `fmu`, not both");
                None
            }
            (None, None) => {
                let known = format!("models: {}", listed(MODELS.map(|model| model.name)));
                let text = "expected `model = \"…\"` or `fmu = \"….fmu\"`: the plant of this file";
                self.mistakes.push(Diagnostic::error(CODE, Span::new(0, 0), text).help(known));
                None
            }
        }
    }

    /// Reads the entries of a table; `read` gets name and place of the name, and the value.
    fn table<'i, T>(
        &mut self,
        table: Option<&Spanned<DeValue<'i>>>,
        name: &str,
        mut read: impl FnMut(&mut Reader, (&str, Span), &Spanned<DeValue<'i>>) -> Option<T>,
    ) -> Vec<Entry<T>> {
        let Some(table) = table else { return Vec::new() };
        let Some(entries_of) = table.get_ref().as_table() else {
            let text = format!("`{name}` must be a table, as in `[{name}]` in a line of its own");
            let _ = self.mistake(span(table.span()), text);
            return Vec::new();
        };
        let read = |(name, place, value): (&str, Span, &Spanned<DeValue<'i>>)| {
            let value = read(self, (name, place), value)?;
            Some(Entry { name: name.to_owned(), place, value })
        };
        entries(entries_of).into_iter().filter_map(read).collect()
    }

    fn text<'t>(&mut self, key: &str, value: &'t Spanned<DeValue<'_>>) -> Option<&'t str> {
        let text = value.get_ref().as_str();
        if text.is_none() {
            let found = value.get_ref().type_str();
            let _ =
                self.mistake(span(value.span()), format!("`{key}` must be a text in quotes, found {found}"));
        }
        text
    }

    fn whole(&mut self, key: &str, value: &Spanned<DeValue<'_>>, least: u32, most: u32) -> Option<u32> {
        let number = value.get_ref().as_integer();
        let number = number.and_then(|number| i64::from_str_radix(number.as_str(), number.radix()).ok());
        let number = number.and_then(|number| u32::try_from(number).ok());
        let number = number.filter(|number| (least..=most).contains(number));
        if number.is_none() {
            let text = format!("`{key}` must be a whole number from {least} to {most}");
            let _ = self.mistake(span(value.span()), text);
        }
        number
    }

    /// A finite number in the unit, or a text with the unit or one with a prefix; `None` for numbers without a known unit.
    fn number(&mut self, value: &Spanned<DeValue<'_>>, unit: Option<&str>) -> Option<f64> {
        let number = match (value.get_ref(), unit) {
            (DeValue::Integer(number), _) => {
                i64::from_str_radix(number.as_str(), number.radix()).ok().map(|number| number as f64)
            }
            (DeValue::Float(number), _) => number.as_str().parse().ok(),
            (DeValue::String(text), Some(unit)) => quantity(text, unit),
            _ => None,
        };
        let number = number.filter(|number| number.is_finite());
        if number.is_none() {
            let expected = match unit {
                None => "expected a number".to_owned(),
                Some("") => "expected a number without a unit".to_owned(),
                Some(unit) => {
                    format!("expected a number in {unit}, or a text with the unit, as in \"1 {unit}\"")
                }
            };
            let found = match value.get_ref() {
                DeValue::String(text) => format!("\"{text}\""),
                DeValue::Float(number) => number.as_str().to_owned(),
                DeValue::Integer(number) => number.as_str().to_owned(),
                other => other.type_str().to_owned(),
            };
            let _ = self.mistake(span(value.span()), format!("{expected}; found {found}"));
        }
        number
    }

    fn course(&mut self, value: &Spanned<DeValue<'_>>, unit: Option<&str>) -> Option<Course> {
        let Some(list) = value.get_ref().as_array() else {
            let value = self.number(value, unit)?;
            return Some(Course::new(vec![(0.0, value)]));
        };
        let mut steps: Vec<(f64, f64)> = Vec::new();
        for step in list.iter() {
            let pair = step.get_ref().as_array().filter(|pair| pair.len() == 2);
            let Some((Some(time), Some(value))) = pair.map(|pair| (pair.first(), pair.get(1))) else {
                let text = "expected a list of [time in s, value], as in [[0, 1], [0.1, 2]]";
                let _ = self.mistake(span(step.span()), text);
                return None;
            };
            let at = self.time(time, steps.last().map(|(last, _)| *last))?;
            steps.push((at, self.number(value, unit)?));
        }
        if steps.is_empty() {
            let _ =
                self.mistake(span(value.span()), "expected a list of [time in s, value]; found an empty one");
            return None;
        }
        Some(Course::new(steps))
    }

    /// Time of a step, in s, which comes after the last one's.
    fn time(&mut self, value: &Spanned<DeValue<'_>>, last: Option<f64>) -> Option<f64> {
        let at = self.number(value, Some("s"))?;
        if at < 0.0 || last.is_some_and(|last| at <= last) {
            let text = format!("the times must begin with 0 or more and increase; {at} s does not");
            let _ = self.mistake(span(value.span()), text);
            return None;
        }
        Some(at)
    }

    fn port(&mut self, value: &Spanned<DeValue<'_>>) -> Option<PortOf> {
        if let Some(port) = value.get_ref().as_str() {
            return Some(PortOf::named(port));
        }
        let expected = "expected a port's name in quotes, or { port = \"…\", scale = 1.0, offset = 0.0 }";
        let Some(table) = value.get_ref().as_table() else {
            let _ = self.mistake(span(value.span()), expected);
            return None;
        };
        const KEYS: [&str; 4] = ["port", "scale", "offset", "limits"];
        for (name, place, _) in entries(table) {
            if !KEYS.contains(&name) {
                self.unknown("a port of a plant has no key", name, place, KEYS);
            }
        }
        let Some(port) = table.get("port") else {
            let _ = self.mistake(span(value.span()), expected);
            return None;
        };
        let port = self.text("port", port)?.to_owned();
        let scale = table.get("scale").map_or(Some(1.0), |value| self.number(value, None))?;
        let offset = table.get("offset").map_or(Some(0.0), |value| self.number(value, None))?;
        let limits = table.get("limits").map_or(Some(UNLIMITED), |value| {
            let pair = value.get_ref().as_array().filter(|pair| pair.len() == 2);
            let pair = pair.and_then(|pair| Some((pair.first()?, pair.get(1)?)));
            let found =
                pair.and_then(|(low, high)| Some((self.number(low, None)?, self.number(high, None)?)));
            let found = found.filter(|(low, high)| low <= high);
            if found.is_none() {
                let text =
                    "expected the least and the greatest value of the port, as in `limits = [0, 4095]`";
                let _ = self.mistake(span(value.span()), text);
            }
            found
        })?;
        Some(PortOf { port, scale, offset, limits })
    }

    fn pin(&mut self, value: &Spanned<DeValue<'_>>) -> Option<PinCourse> {
        if let Some(table) = value.get_ref().as_table() {
            return self.comparator(table, span(value.span()));
        }
        let Some(list) = value.get_ref().as_array() else {
            return Some(PinCourse::Steps(vec![(0.0, self.pin_driver(value)?)]));
        };
        let mut steps: Vec<(f64, PinDriver)> = Vec::new();
        for step in list.iter() {
            let pair = step.get_ref().as_array().filter(|pair| pair.len() == 2);
            let Some((Some(time), Some(driver))) = pair.map(|pair| (pair.first(), pair.get(1))) else {
                let text = "expected a list of [time in s, level], as in [[0.1, 0], [0.2, \"sensor\"]]";
                let _ = self.mistake(span(step.span()), text);
                return None;
            };
            let at = self.time(time, steps.last().map(|(last, _)| *last))?;
            steps.push((at, self.pin_driver(driver)?));
        }
        Some(PinCourse::Steps(steps))
    }

    fn pin_driver(&mut self, value: &Spanned<DeValue<'_>>) -> Option<PinDriver> {
        let driver = match value.get_ref() {
            DeValue::Integer(number) if number.as_str() == "0" => Some(PinDriver::Level(false)),
            DeValue::Integer(number) if number.as_str() == "1" => Some(PinDriver::Level(true)),
            DeValue::String(text) if text == "sensor" => Some(PinDriver::Sensor),
            DeValue::String(text) if text == "noise" => Some(PinDriver::Noise),
            _ => None,
        };
        if driver.is_none() {
            let text = "expected the level of a pin, 0 or 1, or \"sensor\", or \"noise\"";
            let _ = self.mistake(span(value.span()), text);
        }
        driver
    }

    fn comparator(&mut self, table: &DeTable<'_>, place: Span) -> Option<PinCourse> {
        const KEYS: [&str; 2] = ["signals", "above"];
        for (name, place, _) in entries(table) {
            if !KEYS.contains(&name) {
                self.unknown("a comparator has no key", name, place, KEYS);
            }
        }
        let signals = table.get("signals").and_then(|value| value.get_ref().as_array());
        let signals: Option<Vec<String>> = signals
            .and_then(|list| list.iter().map(|signal| Some(signal.get_ref().as_str()?.to_owned())).collect());
        let (Some(signals), Some(above)) = (signals, table.get("above")) else {
            let text = "expected the sensors that a comparator watches, as in { signals = [\"ia\", \"ib\"], above = 15 }";
            let _ = self.mistake(place, text);
            return None;
        };
        Some(PinCourse::Comparator { signals, above: self.number(above, None)? })
    }
}
