// SPDX-License-Identifier: MIT OR Apache-2.0
//! Columns of a table over time as SVG: those of one unit share charts, as on the page.

use super::{Area, Axes, CUT, Outcome, font, in_pixels, mesh, px};
use crate::terminal::number::rounded;
use anyhow::{Result, anyhow};
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Width in pixels: on a telephone's screen, the type can still be read.
const WIDTH: u32 = 480;
/// Stretches to which a run is thinned out, at least: somewhat more than there are pixels.
const POINTS: u64 = 500;
/// Height in pixels of a chart with its names, of the names, and of the title.
const HEIGHT: u32 = 150;
const NAMES: u32 = 18;
const TITLE: u32 = 36;
/// Place of a chart's names from the left, in pixels: above the axis.
const LEFT: u32 = 62;
/// Margin on the left, in pixels.
const MARGIN: u32 = 6;
/// Difference of two columns that are the same but for the rounding to binary32, relative to the largest value.
const SAME: f64 = 1e-6;
/// Most columns of a chart that have nothing in common but their unit, and the largest ratio of their ranges.
const SHARED: usize = 4;
const SCALE: f64 = 20.0;
/// Longest time, in s, whose axis counts milliseconds.
const BRIEF: f64 = 2.0;
/// A limit is drawn if a value reaches this fraction of it.
const NEAR: f64 = 0.4;
/// Dashes of references and limits, and the line before a name, in pixels.
const DASH: u32 = 4;
const GAP: u32 = 4;
const SAMPLE: u32 = 18;
/// Most charts; further columns are left out.
const CHARTS: usize = 40;
/// Width of a character in a chart's names, in pixels.
const LABEL: u32 = 8;
/// Characters of a line of constants, and its height in pixels.
const LINE: usize = 60;
const LINE_HEIGHT: u32 = 22;
/// Color of limits, and of the time in which a column is at its limit, as on the page.
const LIMIT: RGBColor = RGBColor(0xa3, 0x15, 0x6b);
const SATURATED: RGBColor = RGBColor(0xd9, 0x8a, 0x1f);
/// Colors of a chart's signals, or of an array's elements; told apart by the colour-blind, too (Okabe and Ito). A reference has the colour of
/// its signal, and is dashed.
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
    /// Symmetric limits of columns.
    limits: Vec<Option<f64>>,
    /// Length of a period in s; without it, the axis counts periods.
    period: Option<f64>,
    /// Periods of a stretch.
    every: u64,
    rows: u64,
    stretches: Vec<Stretch>,
    /// Periods of each column whose value is no finite number.
    lost: Vec<u64>,
}

/// A column in a chart.
struct Drawn {
    column: usize,
    color: RGBColor,
    /// The column is the reference of another one in the chart.
    is_reference: bool,
}

/// Name of the array of which a name such as `motor.ia[2]` is an element.
fn array(name: &str) -> Option<&str> {
    name.strip_suffix(']')?.rsplit_once('[').map(|(of, _)| of)
}

/// Two names are the same but for their last character.
fn differ_at_the_end(one: &str, other: &str) -> bool {
    let mut ends = [one.chars(), other.chars()];
    let last = ends.each_mut().map(|name| name.next_back());
    let [one, other] = ends.map(|rest| rest.as_str().to_owned());
    !one.is_empty() && one == other && last[0] != last[1]
}

impl Curves {
    pub(crate) fn new(titles: Vec<String>, period: Option<f64>) -> Curves {
        Curves {
            lost: vec![0; titles.len()],
            titles,
            units: Vec::new(),
            limits: Vec::new(),
            period,
            every: 1,
            rows: 0,
            stretches: Vec::new(),
        }
    }

    /// Gives the columns their units.
    pub(crate) fn with_units(self, units: Vec<Option<String>>) -> Curves {
        Curves { units, ..self }
    }

    /// Gives columns, by their names, the symmetric limits that saturate them.
    pub(crate) fn with_limits(self, limits: Vec<(String, f64)>) -> Curves {
        let limit = |title: &String| limits.iter().find(|(name, _)| name == title).map(|(_, limit)| *limit);
        Curves { limits: self.titles.iter().map(limit).collect(), ..self }
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
        for ((range, lost), text) in ranges.iter_mut().zip(&mut self.lost).zip(values) {
            match text.parse::<f64>() {
                Ok(value) if value.is_finite() => {
                    *range =
                        Some(range.map_or((value, value), |(low, high)| (low.min(value), high.max(value))));
                }
                Ok(_) => *lost += 1,
                Err(_) => {}
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

    /// The column that follows a reference: `id`, or a plant's `motor.id`, of `id_ref`.
    fn signal_of(&self, reference: usize) -> Option<usize> {
        let wanted = self.titles[reference].rsplit('.').next().and_then(|text| text.strip_suffix("_ref"))?;
        self.titles.iter().position(|name| name.rsplit('.').next() == Some(wanted))
    }

    /// Columns of each chart, before those of one unit are joined: one, an array's elements, or a signal with its reference.
    fn charts(&self) -> Vec<Vec<usize>> {
        let mut charts: Vec<Vec<usize>> = Vec::new();
        let arrays: Vec<Option<&str>> = self.titles.iter().map(|name| array(name)).collect();
        for column in 0..self.titles.len() {
            if self.signal_of(column).is_some() || self.repeats(column).is_some() {
                continue;
            }
            if let Some(of) = arrays[column] {
                let elements: Vec<usize> = (0..arrays.len()).filter(|at| arrays[*at] == Some(of)).collect();
                if elements[0] == column {
                    charts.extend(elements.chunks(COLORS.len()).map(<[usize]>::to_vec));
                }
                continue;
            }
            let reference = (0..arrays.len()).find(|other| self.signal_of(*other) == Some(column));
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
        let same = (0..self.titles.len()).filter_map(|column| {
            self.repeats(column).map(|shown| format!("{} = {}", self.titles[column], self.titles[shown]))
        });
        let words = words.chain(same).collect();
        let mut joined: Vec<Vec<usize>> = Vec::new();
        for columns in moving {
            match joined.iter_mut().find(|chart| self.may_join(chart, &columns)) {
                Some(chart) => chart.extend(columns),
                None => joined.push(columns),
            }
        }
        (joined, words)
    }

    /// Two charts can share an axis: they have the same unit, or none and names such as `da` and `db`, no array, and ranges of one order.
    fn may_join(&self, one: &[usize], other: &[usize]) -> bool {
        let span = |columns: &[usize]| self.ends(columns).map_or(0.0, |(low, high)| high - low);
        let (least, most) = (span(one).min(span(other)), span(one).max(span(other)));
        let name = |columns: &[usize]| columns.first().map_or("", |column| self.titles[*column].as_str());
        self.unit(one) == self.unit(other)
            && (!self.unit(one).is_empty() || differ_at_the_end(name(one), name(other)))
            && self.array(one).is_none()
            && self.array(other).is_none()
            && one.len() + other.len() <= SHARED
            && most <= SCALE * least
    }

    /// Least and largest value of a chart's columns.
    fn ends(&self, columns: &[usize]) -> Option<(f64, f64)> {
        let ranges = columns.iter().filter_map(|column| self.range(*column));
        ranges.reduce(|(low, high), (a, b)| (low.min(a), high.max(b)))
    }

    /// Limits of a chart's columns that their values approach, with a sign.
    fn limits(&self, columns: &[usize]) -> Vec<f64> {
        let mut found: Vec<f64> = Vec::new();
        for column in columns {
            let Some((limit, (low, high))) =
                self.limits.get(*column).copied().flatten().zip(self.range(*column))
            else {
                continue;
            };
            let reached = [(high, limit), (-low, -limit)];
            let near =
                reached.into_iter().filter(|(value, _)| *value >= NEAR * limit).map(|(_, limit)| limit);
            found.extend(near.filter(|limit| !found.contains(limit)).collect::<Vec<_>>());
        }
        found
    }

    /// Runs of stretches, from the first to behind the last, in which a column of a chart is at its limit.
    fn saturated(&self, columns: &[usize]) -> Vec<(usize, usize)> {
        let limits: Vec<(usize, f64)> =
            columns.iter().filter_map(|column| Some((*column, (*self.limits.get(*column)?)?))).collect();
        let mut runs: Vec<(usize, usize)> = Vec::new();
        for (index, stretch) in self.stretches.iter().enumerate() {
            let is_at = |(column, limit): &(usize, f64)| {
                stretch.ranges[*column].is_some_and(|(low, high)| high >= *limit || low <= -*limit)
            };
            match runs.last_mut() {
                _ if !limits.iter().any(is_at) => {}
                Some(last) if last.1 == index => last.1 += 1,
                _ => runs.push((index, index + 1)),
            }
        }
        runs
    }

    /// Columns of a chart with their colours.
    fn drawn(&self, columns: &[usize]) -> Vec<Drawn> {
        let signal = |column: usize| self.signal_of(column).filter(|signal| columns.contains(signal));
        let signals: Vec<usize> =
            columns.iter().copied().filter(|column| signal(*column).is_none()).collect();
        let color = |column: usize| {
            let of = signals.iter().position(|other| *other == signal(column).unwrap_or(column));
            COLORS[of.unwrap_or_default() % COLORS.len()]
        };
        let drawn =
            |&column: &usize| Drawn { column, color: color(column), is_reference: signal(column).is_some() };
        columns.iter().map(drawn).collect()
    }

    /// Name of a column above its chart: of an array's element, the index.
    fn name<'n>(&'n self, columns: &[usize], column: usize) -> &'n str {
        let whole = self.titles[column].as_str();
        let index = whole.rsplit('[').next().map(|index| index.trim_end_matches(']'));
        index.filter(|_| self.array(columns).is_some()).unwrap_or(whole)
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

    /// Column of the same name that shows what a plant's state is: a sensor without an error.
    fn repeats(&self, column: usize) -> Option<usize> {
        let (_, signal) = self.titles[column].split_once('.')?;
        let shown = self.titles.iter().position(|name| name == signal)?;
        let (low, high) = self.range(shown)?;
        let near = |a: f64, b: f64| (a - b).abs() <= SAME * low.abs().max(high.abs());
        let same = self.stretches.iter().all(|Stretch { ranges }| match (ranges[column], ranges[shown]) {
            (Some(a), Some(b)) => near(a.0, b.0) && near(a.1, b.1),
            (a, b) => a.is_none() && b.is_none(),
        });
        same.then_some(shown)
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
        Ok(in_pixels(&svg, WIDTH, height))
    }

    fn draw_into(
        &self,
        title: &str,
        charts: &[Vec<usize>],
        lines: &[String],
        height: u32,
        svg: &mut String,
    ) -> Outcome<()> {
        let root = SVGBackend::with_string(svg, (px(WIDTH), px(height))).into_drawing_area();
        root.fill(&WHITE)?;
        let (head, rest) = root.split_vertically(px(TITLE));
        head.margin(px(8), 0, 0, 0).titled(title, font(16))?;
        let (rest, foot) = rest.split_vertically(px(charts.len() as u32 * HEIGHT));
        // Without a length, a period's values stand around the period's number, from 1.
        let (length, begin, label) = match self.period {
            Some(period) if self.rows as f64 * period <= BRIEF => (period * 1e3, 0.0, "time, ms"),
            Some(period) => (period, 0.0, "time, s"),
            None => (1.0, 0.5, "period"),
        };
        let length = length * self.every as f64;
        let ends: Vec<f64> =
            (0..=self.stretches.len().max(1)).map(|end| begin + length * end as f64).collect();
        for (columns, area) in charts.iter().zip(rest.split_evenly((charts.len().max(1), 1))) {
            self.draw_chart(columns, &area, &ends)?;
        }
        let centred = font(13).into_text_style(&foot).pos(Pos::new(HPos::Center, VPos::Top));
        foot.draw_text(label, &centred, ((px(LEFT) + px(WIDTH)) as i32 / 2, 0))?;
        for (row, line) in lines.iter().enumerate() {
            let place = (px(LINE_HEIGHT) as i32, px((row as u32 + 1) * LINE_HEIGHT) as i32);
            foot.draw_text(line, &font(13).into_text_style(&foot), place)?;
        }
        root.present()?;
        Ok(())
    }

    /// Corners of the pieces of a column's curve: steps, as the values are held; a stretch of many periods has both of its ends. A stretch
    /// without a number ends a piece.
    fn pieces(&self, column: usize, ends: &[f64]) -> Vec<Vec<(f64, f64)>> {
        let mut pieces: Vec<Vec<(f64, f64)>> = vec![Vec::new()];
        for (stretch, ends) in self.stretches.iter().zip(ends.windows(2)) {
            let Some((low, high)) = stretch.ranges.get(column).copied().flatten() else {
                pieces.push(Vec::new());
                continue;
            };
            let Some(points) = pieces.last_mut() else { continue };
            match points.last_mut() {
                // The value is still held.
                Some(last) if low == high && last.1 == high && last.0 == ends[0] => last.0 = ends[1],
                _ if low == high => points.extend([(ends[0], low), (ends[1], high)]),
                _ => points.extend([(ends[0], low), (ends[0], high), (ends[1], high)]),
            }
        }
        pieces.retain(|points| !points.is_empty());
        pieces
    }

    /// Draws a chart; `ends` are the begin of the first stretch and the ends of all.
    fn draw_chart(&self, columns: &[usize], area: &Area<'_>, ends: &[f64]) -> Outcome<()> {
        let limits = self.limits(columns);
        let (low, high) = self.ends(columns).unwrap_or((0.0, 1.0));
        let (low, high) =
            limits.iter().fold((low, high), |(low, high), limit| (low.min(*limit), high.max(*limit)));
        let margin = if high > low { 0.06 * (high - low) } else { 1.0 };
        let (begin, end) = (ends[0], ends[ends.len() - 1]);
        let (names, area) = area.split_vertically(px(NAMES));
        let drawn = self.drawn(columns);
        let mut left = LEFT;
        if let Some(array) = self.array(columns) {
            names.draw_text(array, &font(14).into_text_style(&names), (px(left) as i32, px(2) as i32))?;
            left += LABEL * (array.chars().count() as u32 + 2);
        }
        for curve in &drawn {
            let (from, to, middle) = (px(left) as i32, px(left + SAMPLE) as i32, px(NAMES / 2) as i32);
            let line = vec![(from, middle), (to, middle)];
            let style = curve.color.stroke_width(px(2));
            if curve.is_reference {
                names.draw(&DashedPathElement::new(line, px(DASH), px(GAP), style))?;
            } else {
                names.draw(&PathElement::new(line, style))?;
            }
            let name = self.name(columns, curve.column);
            let style = font(14).with_color(curve.color).into_text_style(&names);
            names.draw_text(name, &style, (px(left + SAMPLE + GAP) as i32, px(2) as i32))?;
            left += SAMPLE + GAP + LABEL * (name.chars().count() as u32 + 2);
        }
        let (bottom, top) = (low - margin, high + margin);
        let mut chart = ChartBuilder::on(&area)
            .margin_left(px(MARGIN))
            .margin_right(px(18))
            .x_label_area_size(px(24))
            .y_label_area_size(px(LEFT - MARGIN))
            .build_cartesian_2d(begin..end, bottom..top)?;
        mesh(&mut chart, "", self.unit(columns))?;
        let saturated = self.saturated(columns);
        if !saturated.is_empty() {
            let style = font(13).with_color(SATURATED).into_text_style(&names);
            names.draw_text("shaded: at its limit", &style, (px(left) as i32, px(2) as i32))?;
            left += LABEL * 21;
        }
        if let Some(lost) =
            columns.iter().filter_map(|column| self.lost.get(*column)).max().filter(|lost| **lost > 0)
        {
            let periods = if *lost == 1 { "period" } else { "periods" };
            let style = font(13).with_color(LIMIT).into_text_style(&names);
            let text = format!("no finite number in {lost} {periods}");
            names.draw_text(&text, &style, (px(left) as i32, px(2) as i32))?;
        }
        for (from, to) in saturated {
            let corners = [(ends[from], bottom), (ends[to], top)];
            chart.draw_series([Rectangle::new(corners, SATURATED.mix(0.16).filled())])?;
        }
        for limit in limits {
            let line = [(begin, limit), (end, limit)];
            dashed(&mut chart, line.into_iter(), LIMIT)?;
            let text = format!("limit {} {}", rounded(limit, 6), self.unit(columns));
            let style = font(12).with_color(LIMIT).into_text_style(&area);
            let style = style.pos(Pos::new(HPos::Right, if limit > 0.0 { VPos::Top } else { VPos::Bottom }));
            // Beside the line, on the side of the values.
            let beside = limit - limit.signum() * margin / 2.0;
            chart.draw_series([Text::new(text.trim_end().to_owned(), (end, beside), style)])?;
        }
        // References lie below, then inputs, which come before outputs.
        let (references, signals): (Vec<&Drawn>, Vec<&Drawn>) =
            drawn.iter().partition(|curve| curve.is_reference);
        for curve in references.into_iter().chain(signals) {
            for points in self.pieces(curve.column, ends) {
                if curve.is_reference {
                    dashed(&mut chart, points.into_iter(), curve.color)?;
                } else {
                    chart.draw_series(LineSeries::new(points, curve.color.stroke_width(px(3) / 2)))?;
                }
            }
        }
        Ok(())
    }
}

/// Draws a dashed line.
fn dashed(
    chart: &mut ChartContext<'_, SVGBackend<'_>, Axes>,
    points: impl Iterator<Item = (f64, f64)> + Clone,
    color: RGBColor,
) -> Outcome<()> {
    let series = DashedLineSeries::new(points, px(DASH), px(GAP), color.stroke_width(px(1)));
    chart.draw_series(series)?;
    Ok(())
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

    /// Constant columns take a line of text, and a reference is drawn with its signal; both have units, and those of one unit share a chart.
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
        let texts = ["motor.id", "id_ref", "A", "w", "w_ref", "rad/s", "tripped = 1 V", "time, ms"];
        let missing: Vec<_> = texts.iter().filter(|text| !svg.contains(&format!("\n{text}\n"))).collect();
        assert!(missing.is_empty(), "{missing:?} in {svg}");
    }

    /// No line joins the values on both sides of a NaN, and the picture says how many there are.
    #[test]
    fn a_curve_has_gaps_where_there_is_no_number() {
        let mut curves = Curves::new(vec!["y".to_owned()], None);
        for value in ["1", "1", "NaN", "3", "inf", "", "5"] {
            curves.add(&[value.to_owned()]);
        }
        let ends = [0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5];
        let expected = [[(0.5, 1.0), (2.5, 1.0)], [(3.5, 3.0), (4.5, 3.0)], [(6.5, 5.0), (7.5, 5.0)]];
        assert_eq!(curves.pieces(0, &ends), expected.map(Vec::from));
        assert!(curves.draw("gaps").unwrap().contains("no finite number in 2 periods"));
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
