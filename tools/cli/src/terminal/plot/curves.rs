// SPDX-License-Identifier: MIT OR Apache-2.0
//! Columns of a table over time as SVG, a chart for each.

use super::{CUT, Outcome, POINTS, SIZE, chart, font, in_pixels, mesh, px};
use crate::terminal::number::rounded;
use anyhow::{Result, anyhow};
use plotters::prelude::*;

/// Height in pixels of a chart with its names, of the names, and of the title.
const HEIGHT: u32 = 160;
const NAMES: u32 = 18;
const TITLE: u32 = 40;
/// Place of a chart's names from the left, in pixels: above the axis.
const LEFT: u32 = 72;
/// Relative difference of two columns that are the same but for the rounding to binary32.
const SAME: f64 = 1e-6;
/// Most charts; further columns are left out.
const CHARTS: usize = 40;
/// Width of a character in a chart's names, in pixels.
const LABEL: u32 = 8;
/// Characters of a line of constants, and its height in pixels.
const LINE: usize = 110;
const LINE_HEIGHT: u32 = 22;
/// Colors of a chart's curves: a signal's, and the reference's below it, or an array's elements'; told apart by the colour-blind, too
/// (Okabe and Ito).
const COLORS: [RGBColor; 8] = [
    CUT,
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0x56, 0xb4, 0xe9),
    RGBColor(0x55, 0x55, 0x55),
    RGBColor(0xb5, 0xa8, 0x00),
];

/// Least and largest value of each column in a stretch of periods.
#[derive(Clone)]
struct Stretch {
    ranges: Vec<Option<(f64, f64)>>,
}

/// Columns of numbers, thinned out as they grow: each point is a stretch of periods with its least and its largest values.
pub(crate) struct Curves {
    titles: Vec<String>,
    /// Units of the columns, as far as they are known.
    units: Vec<Option<String>>,
    /// Length of a period in s; without it, the axis counts periods.
    period: Option<f64>,
    /// Periods of a stretch.
    every: u64,
    rows: u64,
    stretches: Vec<Stretch>,
}

/// Name of the array of which a name such as `motor.ia[2]` is an element.
fn array(name: &str) -> Option<&str> {
    name.strip_suffix(']')?.rsplit_once('[').map(|(of, _)| of)
}

impl Curves {
    pub(crate) fn new(titles: Vec<String>, period: Option<f64>) -> Curves {
        Curves { titles, units: Vec::new(), period, every: 1, rows: 0, stretches: Vec::new() }
    }

    /// Gives the columns their units.
    pub(crate) fn with_units(self, units: Vec<Option<String>>) -> Curves {
        Curves { units, ..self }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.rows == 0
    }

    /// Adds a row; a text that is no finite number leaves a gap.
    pub(crate) fn add(&mut self, values: &[String]) {
        if self.rows.is_multiple_of(self.every) {
            if self.stretches.len() as u64 >= 2 * POINTS {
                self.thin();
            }
            self.stretches.push(Stretch { ranges: vec![None; self.titles.len()] });
        }
        self.rows += 1;
        let Some(Stretch { ranges }) = self.stretches.last_mut() else { return };
        for (range, text) in ranges.iter_mut().zip(values) {
            if let Some(value) = text.parse::<f64>().ok().filter(|value| value.is_finite()) {
                *range = Some(range.map_or((value, value), |(low, high)| (low.min(value), high.max(value))));
            }
        }
    }

    /// Joins each two stretches.
    fn thin(&mut self) {
        let join = |a: Option<(f64, f64)>, b: Option<(f64, f64)>| match (a, b) {
            (Some((low, high)), Some((lower, higher))) => Some((low.min(lower), high.max(higher))),
            (one, other) => one.or(other),
        };
        let joined = self.stretches.chunks(2).map(|pair| match pair {
            [a, b] => Stretch { ranges: a.ranges.iter().zip(&b.ranges).map(|(a, b)| join(*a, *b)).collect() },
            rest => rest[0].clone(),
        });
        self.stretches = joined.collect();
        self.every *= 2;
    }

    /// Least and largest value of a column; `None` if it has no number.
    fn range(&self, column: usize) -> Option<(f64, f64)> {
        let all = self.stretches.iter().filter_map(|stretch| stretch.ranges.get(column).copied().flatten());
        all.reduce(|(low, high), (a, b)| (low.min(a), high.max(b)))
    }

    /// Columns of each chart: one, an array's elements, or a signal with the reference that it follows (`id`, or a plant's `motor.id`, and
    /// `id_ref`).
    fn charts(&self) -> Vec<Vec<usize>> {
        let mut charts: Vec<Vec<usize>> = Vec::new();
        let arrays: Vec<Option<&str>> = self.titles.iter().map(|name| array(name)).collect();
        let follows = |name: &str, reference: &str| {
            let signal = name.rsplit('.').next().unwrap_or(name);
            reference.rsplit('.').next().and_then(|text| text.strip_suffix("_ref")) == Some(signal)
        };
        let signal_of = |reference: &str| self.titles.iter().position(|name| follows(name, reference));
        for (column, name) in self.titles.iter().enumerate() {
            if signal_of(name).is_some() || self.is_repeated(column) {
                continue;
            }
            if let Some(of) = arrays[column] {
                let elements: Vec<usize> = (0..arrays.len()).filter(|at| arrays[*at] == Some(of)).collect();
                if elements[0] == column {
                    charts.extend(elements.chunks(COLORS.len()).map(<[usize]>::to_vec));
                }
                continue;
            }
            let reference = self.titles.iter().position(|other| signal_of(other) == Some(column));
            charts.push([Some(column), reference].into_iter().flatten().collect());
        }
        charts
    }

    /// Columns of the charts in which something changes, and the constant columns in words.
    fn parted(&self) -> (Vec<Vec<usize>>, Vec<String>) {
        let changes = |column: &usize| self.range(*column).is_some_and(|(low, high)| low < high);
        let (moving, still): (Vec<_>, Vec<_>) =
            self.charts().into_iter().partition(|columns| columns.iter().any(changes));
        let words = still.into_iter().flatten().map(|column| {
            let value = self.range(column).map_or_else(|| "no number".to_owned(), |(low, _)| rounded(low, 6));
            format!("{} = {value} {}", self.titles[column], self.unit(&[column])).trim_end().to_owned()
        });
        (moving, words.collect())
    }

    /// Names above a chart, each in the colour of its curve; of an array, its own name and the indices.
    fn names(&self, columns: &[usize]) -> Vec<(&str, RGBColor)> {
        let of = self.array(columns);
        let name = |column: usize| {
            let whole = self.titles[column].as_str();
            let index = whole.rsplit('[').next().map(|index| index.trim_end_matches(']'));
            index.filter(|_| of.is_some()).unwrap_or(whole)
        };
        let array = of.map(|name| (name, BLACK));
        array.into_iter().chain(columns.iter().map(|column| name(*column)).zip(COLORS)).collect()
    }

    /// Name of the array whose elements a chart has.
    fn array(&self, columns: &[usize]) -> Option<&str> {
        let of = array(&self.titles[*columns.first()?])?;
        columns.iter().all(|column| array(&self.titles[*column]) == Some(of)).then_some(of)
    }

    /// Unit of the columns of a chart, if it is one.
    fn unit(&self, columns: &[usize]) -> &str {
        let unit = |column: &usize| self.units.get(*column).and_then(Option::as_deref).unwrap_or_default();
        let first = columns.first().map_or("", unit);
        if columns.iter().all(|column| unit(column) == first) { first } else { "" }
    }

    /// A plant's state that the column of the same name shows, too: a sensor without an error.
    fn is_repeated(&self, column: usize) -> bool {
        let Some((_, signal)) = self.titles[column].split_once('.') else { return false };
        let Some(shown) = self.titles.iter().position(|name| name == signal) else { return false };
        let is_near = |(a, b): ((f64, f64), (f64, f64))| {
            let near = |a: f64, b: f64| (a - b).abs() <= SAME * a.abs().max(b.abs());
            near(a.0, b.0) && near(a.1, b.1)
        };
        self.stretches.iter().all(|Stretch { ranges }| match (ranges[column], ranges[shown]) {
            (Some(a), Some(b)) => is_near((a, b)),
            (a, b) => a.is_none() && b.is_none(),
        })
    }

    /// The picture.
    pub(crate) fn draw(&self, title: &str) -> Result<String> {
        let mut svg = String::new();
        let (mut charts, constants) = self.parted();
        charts.truncate(CHARTS);
        let mut lines: Vec<String> = Vec::new();
        for text in constants {
            match lines.last_mut() {
                Some(line) if line.len() + text.len() < LINE => *line += &format!(",   {text}"),
                _ => lines.push(text),
            }
        }
        let height = TITLE + charts.len() as u32 * HEIGHT + (lines.len() as u32 + 1) * LINE_HEIGHT;
        let drawn = self.draw_into(title, &charts, &lines, height, &mut svg);
        drawn.map_err(|error| anyhow!("cannot draw: {error}"))?;
        Ok(in_pixels(&svg, SIZE, height))
    }

    fn draw_into(
        &self,
        title: &str,
        charts: &[Vec<usize>],
        lines: &[String],
        height: u32,
        svg: &mut String,
    ) -> Outcome<()> {
        let root = SVGBackend::with_string(svg, (px(SIZE), px(height))).into_drawing_area();
        root.fill(&WHITE)?;
        let (head, rest) = root.split_vertically(px(TITLE));
        head.titled(title, font(20))?;
        let (rest, foot) = rest.split_vertically(px(charts.len() as u32 * HEIGHT));
        for (row, line) in lines.iter().enumerate() {
            let place = (px(LINE_HEIGHT) as i32, px(row as u32 * LINE_HEIGHT) as i32);
            foot.draw_text(line, &font(13).into_text_style(&foot), place)?;
        }
        let time = |stretch: f64| stretch * self.every as f64 * self.period.unwrap_or(1.0);
        let end = time(self.stretches.len().max(1) as f64);
        let label = if self.period.is_some() { "time, s" } else { "period" };
        for (number, (columns, area)) in
            charts.iter().zip(rest.split_evenly((charts.len().max(1), 1))).enumerate()
        {
            let ranges = columns.iter().filter_map(|column| self.range(*column));
            let (low, high) =
                ranges.reduce(|(low, high), (a, b)| (low.min(a), high.max(b))).unwrap_or((0.0, 1.0));
            let margin = if high > low { 0.06 * (high - low) } else { 1.0 };
            let (names, area) = area.split_vertically(px(NAMES));
            let mut left = LEFT;
            for (name, color) in self.names(columns) {
                let style = font(14).with_color(color).into_text_style(&names);
                names.draw_text(name, &style, (px(left) as i32, px(2) as i32))?;
                left += LABEL * (name.chars().count() as u32 + 2);
            }
            let mut chart = chart(&area).build_cartesian_2d(0.0..end, low - margin..high + margin)?;
            mesh(&mut chart, if number + 1 == charts.len() { label } else { "" }, self.unit(columns))?;
            // The reference lies below.
            for (column, color) in columns.iter().zip(COLORS).rev() {
                // Steps, as the values are held; a stretch of many periods has both of its ends.
                let points = self.stretches.iter().enumerate().filter_map(|(index, stretch)| {
                    let (low, high) = stretch.ranges.get(*column).copied().flatten()?;
                    let (from, to) = (time(index as f64), time(index as f64 + 1.0));
                    Some([(from, low), (from, high), (to, high)])
                });
                chart.draw_series(LineSeries::new(points.flatten(), color.stroke_width(px(1))))?;
            }
        }
        root.present()?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::Curves;

    #[test]
    fn thinning_keeps_extremes() {
        let mut curves = Curves::new(vec!["a".to_owned(), "b".to_owned()], Some(1e-3));
        for row in 0..100_000 {
            let peak = if row == 54_321 { 7 } else { row % 3 };
            curves.add(&[peak.to_string(), String::new()]);
        }
        assert!(curves.stretches.len() <= 2000 && curves.rows == 100_000);
        let high = curves
            .stretches
            .iter()
            .filter_map(|stretch| stretch.ranges[0])
            .map(|(_, high)| high)
            .fold(0.0, f64::max);
        assert_eq!(high, 7.0);
        assert!(curves.stretches.iter().all(|stretch| stretch.ranges[1].is_none()));
        let svg = curves.draw("a & b").unwrap();
        assert!(svg.contains("a &amp; b") && svg.contains("time, s"), "{}", &svg[..300]);
    }

    /// Constant columns take a line of text, and a reference lies below its signal; both have units.
    #[test]
    fn constants_are_words_and_references_share_a_chart() {
        let titles = ["id_ref", "motor.id", "tripped", "w_ref", "w"].map(str::to_owned);
        let mut curves = Curves::new(titles.to_vec(), Some(1e-3));
        for row in 0..10 {
            curves.add(&["0", &row.to_string(), "1", &row.to_string(), "2"].map(str::to_owned));
        }
        assert_eq!(curves.parted(), (vec![vec![1, 0], vec![4, 3]], vec!["tripped = 1".to_owned()]));
        let units = [Some("A"), Some("A"), Some("V"), Some("rad/s"), Some("rad/s")];
        let curves = curves.with_units(units.map(|unit| unit.map(str::to_owned)).to_vec());
        let svg = curves.draw("loop").unwrap();
        let texts = ["motor.id", "id_ref", "A", "w", "w_ref", "rad/s", "tripped = 1 V", "time, s"];
        let missing: Vec<_> = texts.iter().filter(|text| !svg.contains(&format!("\n{text}\n"))).collect();
        assert!(missing.is_empty(), "{missing:?} in {svg}");
    }

    /// A state that a port shows, too, is drawn once, unless the sensor has an error.
    #[test]
    fn a_state_is_no_second_curve_of_its_sensor() {
        let titles = ["w", "x", "motor.w", "motor.x"].map(str::to_owned);
        let mut curves = Curves::new(titles.to_vec(), Some(1e-3));
        for row in 0..10 {
            let (w, x) = (f64::from(row) / 3.0, f64::from(row));
            curves.add(&[(w as f32).to_string(), x.to_string(), w.to_string(), (x + 0.5).to_string()]);
        }
        assert_eq!(curves.parted().0, [[0], [1], [3]]);
    }

    /// Elements of an array share a chart, each in its colour, with its index.
    #[test]
    fn arrays_share_a_chart() {
        let titles = ["i[1]", "u", "i[2]", "m.w[1]", "m.w[2]"].map(str::to_owned);
        let mut curves = Curves::new(titles.to_vec(), Some(1e-3));
        for row in 0..10 {
            curves.add(&[&row.to_string(), "3", "4", "5", "5"].map(str::to_owned));
        }
        let still = ["u = 3", "m.w[1] = 5", "m.w[2] = 5"].map(str::to_owned).to_vec();
        assert_eq!(curves.parted(), (vec![vec![0, 2]], still));
        let svg = curves.draw("loop").unwrap();
        assert!(svg.contains("\ni\n") && svg.contains("\n1\n") && svg.contains("\n2\n"), "{svg}");
    }

    #[test]
    fn an_empty_table_has_a_picture() {
        assert!(Curves::new(Vec::new(), None).draw("nothing").unwrap().contains("<svg"));
    }
}
