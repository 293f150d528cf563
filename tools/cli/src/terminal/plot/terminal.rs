// SPDX-License-Identifier: MIT OR Apache-2.0
//! Plot of a drive on the terminal: panels, texts and colours of the SVG, with lines of Braille dots, two by four per character.

use super::{DEVIATES, Plot, REQUIRED, WRITES_NAN, error_title, path_title, required_text};
use crate::terminal::page::Page;
use std::fmt::Write as _;
use std::ops::Range;
use takt_isa::text::visible;

/// Width of a plot in columns, if the output is not a terminal.
const WIDTH: usize = 100;
/// Width of the value labels in columns, including the axis.
const LABELS: usize = 9;
/// Rows of the error panel, and maximum rows of the path panel.
const ERROR_ROWS: usize = 10;
const PATH_ROWS: usize = 30;
/// Minimum distance in columns between labels of the horizontal axis.
const TICK: usize = 14;

/// Colours of dots, as in the SVG. If several share a character, the later in this order wins: the path hides small deviations.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Ink {
    Rapid,
    Deviation,
    Cut,
    Limit,
}

impl Ink {
    /// Terminal sequence of the colour.
    fn code(self) -> &'static str {
        match self {
            Ink::Rapid => "\x1b[90m",
            Ink::Cut => "\x1b[34m",
            Ink::Deviation => "\x1b[33m",
            Ink::Limit => "\x1b[31m",
        }
    }
}

/// A panel of Braille dots.
struct Canvas {
    columns: usize,
    rows: usize,
    x: Range<f64>,
    y: Range<f64>,
    cells: Vec<(u8, Option<Ink>)>,
}

impl Canvas {
    fn new(columns: usize, rows: usize, x: Range<f64>, y: Range<f64>) -> Canvas {
        Canvas { columns, rows, x, y, cells: vec![(0, None); columns * rows] }
    }

    /// Coordinates of a point, in dots from the upper left corner.
    fn dots(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let across = (x - self.x.start) / (self.x.end - self.x.start) * (2 * self.columns - 1) as f64;
        let down = (self.y.end - y) / (self.y.end - self.y.start) * (4 * self.rows - 1) as f64;
        (across, down)
    }

    fn dot(&mut self, across: f64, down: f64, ink: Ink) {
        let (across, down) = (across.round(), down.round());
        // Also false for non-finite values.
        if !(across >= 0.0
            && down >= 0.0
            && across < (2 * self.columns) as f64
            && down < (4 * self.rows) as f64)
        {
            return;
        }
        let (across, down) = (across as usize, down as usize);
        let cell = &mut self.cells[down / 4 * self.columns + across / 2];
        // Bits of a Braille character: first three rows of two dots, then the fourth row.
        cell.0 |= match (across % 2, down % 4) {
            (0, 3) => 0x40,
            (_, 3) => 0x80,
            (column, row) => 1 << (3 * column + row),
        };
        cell.1 = cell.1.max(Some(ink));
    }

    fn line(&mut self, points: &[(f64, f64)], ink: Ink) {
        if let [only] = points {
            let (across, down) = self.dots(*only);
            self.dot(across, down, ink);
        }
        for pair in points.windows(2) {
            let (from, to) = (self.dots(pair[0]), self.dots(pair[1]));
            let steps = (to.0 - from.0).abs().max((to.1 - from.1).abs()).ceil();
            // A visible line is at most as long as both sides together.
            let steps = if steps.is_finite() {
                steps.min((4 * (self.columns + self.rows)) as f64).max(1.0)
            } else {
                0.0
            };
            for step in 0..=steps as usize {
                let part = step as f64 / steps.max(1.0);
                self.dot(from.0 + part * (to.0 - from.0), from.1 + part * (to.1 - from.1), ink);
            }
        }
    }

    /// Writes the rows, with labels on the left and at the bottom.
    fn write(&self, unit: (&str, &str), page: Page, out: &mut String) {
        let values = Values::of(&self.y, self.rows / 3);
        let height = (self.y.end - self.y.start) / self.rows as f64;
        for row in 0..self.rows {
            let top = self.y.end - row as f64 * height;
            let shown = values.within(top - height, top).map(|value| values.text(value));
            let mark = if shown.is_none() { '│' } else { '┤' };
            let _ = write!(out, "{:>width$} {mark}", shown.unwrap_or_default(), width = LABELS - 2);
            let cells = &self.cells[row * self.columns..(row + 1) * self.columns];
            for run in cells.chunk_by(|a, b| a.1 == b.1) {
                let dots = |cell: &(u8, _)| match cell.0 {
                    0 => ' ',
                    bits => char::from_u32(0x2800 + u32::from(bits)).unwrap_or(' '),
                };
                out.push_str(&inked(&run.iter().map(dots).collect::<String>(), run[0].1, page));
            }
            out.truncate(out.trim_end().len());
            out.push('\n');
        }
        let values = Values::of(&self.x, self.columns / TICK);
        let width = (self.x.end - self.x.start) / self.columns as f64;
        let (mut axis, mut below) = (String::new(), String::new());
        // The unit is at the right end, inside the panel.
        let end = self.columns.saturating_sub(unit.0.chars().count());
        for column in 0..self.columns {
            let left = self.x.start + column as f64 * width;
            // Omit a label that would overlap the unit.
            let value = values.within(left, left + width);
            let value = value.filter(|value| column + values.text(*value).chars().count() < end);
            axis.push(if value.is_some() { '┬' } else { '─' });
            if let Some(value) = value {
                let gap = column.saturating_sub(below.chars().count());
                let _ = write!(below, "{:gap$}{}", "", values.text(value));
            }
        }
        let _ = writeln!(out, "{:>width$} └{axis}", unit.1, width = LABELS - 2);
        let _ = writeln!(out, "{:LABELS$}{below:<end$}{}", "", unit.0);
    }
}

/// Labels of an axis: multiples of 1, 2 or 5 times a power of ten.
struct Values {
    step: f64,
    decimals: usize,
}

impl Values {
    /// At most `most` labels for a range.
    fn of(range: &Range<f64>, most: usize) -> Values {
        let least = ((range.end - range.start) / most.max(1) as f64).max(1e-9);
        let power = least.log10().floor();
        let steps = [1.0, 2.0, 5.0, 10.0].map(|times| times * 10f64.powf(power));
        let step = steps.into_iter().find(|step| *step >= least).unwrap_or(least);
        Values { step, decimals: (-step.log10().floor()).max(0.0) as usize }
    }

    /// Label within a half-open range that includes its lower end.
    fn within(&self, low: f64, high: f64) -> Option<f64> {
        let value = (low / self.step).ceil() * self.step;
        // Avoid a negative zero.
        (value < high).then_some(value + 0.0)
    }

    fn text(&self, value: f64) -> String {
        format!("{value:.*}", self.decimals)
    }
}

/// Colours a text, if the page has colours.
fn inked(text: &str, ink: Option<Ink>, page: Page) -> String {
    match ink.filter(|_| page.is_bold) {
        Some(ink) => format!("{}{text}\x1b[0m", ink.code()),
        None => text.to_owned(),
    }
}

/// Title of a panel, with a legend line.
fn head(title: &str, lines: &[(&str, Ink)], page: Page, out: &mut String) {
    let _ = writeln!(out, "{}", page.strong(&visible(title)));
    let lines: Vec<String> =
        lines.iter().map(|(text, ink)| format!("{} {text}", inked("──", Some(*ink), page))).collect();
    let _ = writeln!(out, "{:LABELS$}{}", "", lines.join("  "));
}

/// Rows of a trace's panel.
#[cfg(feature = "board")]
const TRACE_ROWS: usize = 6;

/// Curve of a panel of its own.
#[cfg(feature = "board")]
pub(crate) struct Trace {
    /// Title of the panel.
    pub(crate) name: String,
    /// Places and values, ascending; all finite.
    pub(crate) points: Vec<(f64, f64)>,
}

/// Traces as text, one below the other over the same axis, with a vertical line at `mark`. A trace without change is a line of words.
#[cfg(feature = "board")]
pub(crate) fn traces(all: &[Trace], unit: &str, mark: Option<f64>, page: Page) -> String {
    let columns = page.width.unwrap_or(WIDTH).clamp(LABELS + 2 * TICK, 2 * WIDTH) - LABELS - 1;
    let places = || all.iter().flat_map(|trace| &trace.points).map(|(x, _)| *x).chain(mark);
    let (first, last) = (places().fold(f64::INFINITY, f64::min), places().fold(f64::NEG_INFINITY, f64::max));
    let mut out = String::new();
    for Trace { name, points } in all {
        let values = || points.iter().map(|(_, value)| *value);
        let (low, high) =
            (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        if points.is_empty() || low == high || first >= last {
            let value = points.first().map_or_else(
                || "no value".to_owned(),
                |(_, value)| crate::terminal::number::rounded(*value, 7),
            );
            let _ = writeln!(out, "{} = {value}", page.strong(&visible(name)));
            continue;
        }
        let margin = 0.05 * (high - low);
        let mut canvas = Canvas::new(columns, TRACE_ROWS, first..last, low - margin..high + margin);
        for row in 0..mark.map_or(0, |_| 2 * TRACE_ROWS) {
            let (across, _) = canvas.dots((mark.unwrap_or(first), low));
            canvas.dot(across, 2.0 * row as f64, Ink::Rapid);
        }
        canvas.line(points, Ink::Cut);
        let _ = writeln!(out, "{}", page.strong(&visible(name)));
        canvas.write((unit, ""), page, &mut out);
    }
    out
}

impl Plot {
    /// Plot as text, for the width of a page.
    pub(crate) fn text(&self, title: &str, page: Page) -> String {
        let columns = page.width.unwrap_or(WIDTH).clamp(LABELS + 2 * TICK, 2 * WIDTH) - LABELS - 1;
        let mut out = String::new();
        self.path_text(title, columns, page, &mut out);
        out.push('\n');
        self.error_text(columns, page, &mut out);
        out.push('\n');
        out
    }

    fn path_text(&self, title: &str, columns: usize, page: Page, out: &mut String) {
        let lines = [("rapid moves", Ink::Rapid), ("cutting moves", Ink::Cut), (DEVIATES, Ink::Deviation)];
        head(&path_title(title), &lines, page, out);
        let (x, y) = self.ranges();
        // Equal scales on both axes: dots have the same spacing horizontally and vertically.
        let shape = (y.end - y.start) / (x.end - x.start);
        let rows = ((shape * (2 * columns) as f64 / 4.0).ceil() as usize).clamp(2, PATH_ROWS);
        let scale = ((x.end - x.start) / (2 * columns) as f64).max((y.end - y.start) / (4 * rows) as f64);
        let widen = |range: Range<f64>, dots: usize| {
            let (centre, half) = ((range.start + range.end) / 2.0, scale * dots as f64 / 2.0);
            centre - half..centre + half
        };
        let mut canvas = Canvas::new(columns, rows, widen(x, 2 * columns), widen(y, 4 * rows));
        let last = self.path.len().saturating_sub(1);
        for (index, run) in self.path.iter().enumerate() {
            let mut points = run.points.clone();
            points.extend(self.last.iter().map(|(_, end)| *end).filter(|_| index == last));
            canvas.line(&points, if run.cutting { Ink::Cut } else { Ink::Rapid });
            canvas.line(&run.deviating, Ink::Deviation);
        }
        canvas.write(("x, mm", "y, mm"), page, out);
    }

    fn error_text(&self, columns: usize, page: Page, out: &mut String) {
        let required = required_text();
        let mut lines =
            vec![("rapid moves", Ink::Rapid), ("cutting moves", Ink::Cut), (required.as_str(), Ink::Limit)];
        let nans = self.nans();
        if !nans.is_empty() {
            lines.push((WRITES_NAN, Ink::Deviation));
        }
        head(&error_title(self.stretch()), &lines, page, out);
        let (stretch, high) = (self.stretch(), self.worst() * 1.15);
        let end = self.errors.len() as f64 * stretch;
        let mut canvas = Canvas::new(columns, ERROR_ROWS, 0.0..end.max(stretch), 0.0..high);
        for (kind, ink) in [Ink::Rapid, Ink::Cut].into_iter().enumerate() {
            for (index, errors) in self.errors.iter().enumerate() {
                if let Some(error) = errors.errors[kind] {
                    let time = (index as f64 + 0.5) * stretch;
                    canvas.line(&[(time, 0.0), (time, error)], ink);
                }
            }
        }
        canvas.line(&[(0.0, REQUIRED), (end, REQUIRED)], Ink::Limit);
        for time in nans {
            canvas.line(&[(time, 0.9 * high), (time, high)], Ink::Deviation);
        }
        canvas.write(("time, s", "µm"), page, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of a canvas, without colours.
    fn rows(canvas: &Canvas) -> Vec<String> {
        let mut text = String::new();
        canvas.write(("x", "y"), Page::default(), &mut text);
        text.lines().map(str::to_owned).collect()
    }

    #[test]
    fn lines_are_drawn_in_dots() {
        let mut canvas = Canvas::new(4, 2, 0.0..7.0, 0.0..7.0);
        canvas.line(&[(0.0, 0.0), (7.0, 7.0)], Ink::Cut);
        let drawn = rows(&canvas);
        assert!(drawn[0].ends_with("  ⡠⠊") && drawn[1].ends_with("┤⡠⠊"), "{drawn:#?}");
        // Non-finite and distant points are skipped quickly.
        for wild in [f64::NAN, f64::INFINITY, -1e300] {
            canvas.line(&[(wild, 0.0), (0.0, wild), (wild, wild)], Ink::Limit);
        }
        assert!(rows(&canvas)[0].ends_with("⡠⠊"));
    }

    #[test]
    fn axes_have_round_values() {
        let all = |range: Range<f64>, most| {
            let values = Values::of(&range, most);
            let cells =
                (0..100).map(|cell| range.start + f64::from(cell) / 100.0 * (range.end - range.start));
            let found = cells.filter_map(|low| values.within(low, low + (range.end - range.start) / 100.0));
            found.map(|value| values.text(value)).collect::<Vec<_>>()
        };
        assert_eq!(all(0.0..11.5, 3), ["0", "5", "10"]);
        assert_eq!(all(-0.55..0.73, 4), ["-0.5", "0.0", "0.5"]);
        assert_eq!(all(-104.0..23.0, 5), ["-100", "-50", "0"]);
    }

    #[test]
    fn the_axis_ends_with_its_unit_at_every_width() {
        for columns in 20..120 {
            let canvas = Canvas::new(columns, 3, 0.0..34.7, 0.0..1.0);
            let mut text = String::new();
            canvas.write(("time, s", "y"), Page::default(), &mut text);
            let below = text.lines().last().unwrap();
            assert!(below.ends_with(" time, s") && below.chars().count() == LABELS + columns, "{text}");
        }
    }

    #[test]
    fn marks_have_colours_only_where_a_page_has() {
        let mut canvas = Canvas::new(30, 1, 0.0..1.0, 0.0..1.0);
        canvas.line(&[(0.0, 0.5)], Ink::Cut);
        canvas.line(&[(0.0, 0.4)], Ink::Limit);
        let mut text = String::new();
        canvas.write(("x", "y"), Page { width: Some(80), is_bold: true }, &mut text);
        assert!(text.contains("\x1b[31m") && !text.contains("\x1b[34m"), "{text}");
        assert!(!rows(&canvas).concat().contains('\x1b'));
    }
}
