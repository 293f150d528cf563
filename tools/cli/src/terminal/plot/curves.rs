// SPDX-License-Identifier: MIT OR Apache-2.0
//! Columns of a table over time as SVG, a chart for each.

use super::{CUT, Outcome, POINTS, SIZE, chart, font, in_pixels, mesh, px};
use anyhow::{Result, anyhow};
use plotters::prelude::*;

/// Height of a chart in pixels, and of the title.
const HEIGHT: u32 = 150;
const TITLE: u32 = 40;
/// Most charts; further columns are left out.
const CHARTS: usize = 40;

/// Least and largest value of each column in a stretch of periods.
#[derive(Clone)]
struct Stretch {
    ranges: Vec<Option<(f64, f64)>>,
}

/// Columns of numbers, thinned out as they grow: each point is a stretch of periods with its least and its largest values.
pub(crate) struct Curves {
    titles: Vec<String>,
    /// Length of a period in s; without it, the axis counts periods.
    period: Option<f64>,
    /// Periods of a stretch.
    every: u64,
    rows: u64,
    stretches: Vec<Stretch>,
}

impl Curves {
    pub(crate) fn new(titles: Vec<String>, period: Option<f64>) -> Curves {
        Curves { titles, period, every: 1, rows: 0, stretches: Vec::new() }
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

    /// The picture.
    pub(crate) fn draw(&self, title: &str) -> Result<String> {
        let mut svg = String::new();
        let count = self.titles.len().clamp(1, CHARTS) as u32;
        let height = TITLE + count * HEIGHT;
        self.draw_into(title, (count, height), &mut svg).map_err(|error| anyhow!("cannot draw: {error}"))?;
        Ok(in_pixels(&svg, SIZE, height))
    }

    fn draw_into(&self, title: &str, (count, height): (u32, u32), svg: &mut String) -> Outcome<()> {
        let root = SVGBackend::with_string(svg, (px(SIZE), px(height))).into_drawing_area();
        root.fill(&WHITE)?;
        let (head, rest) = root.split_vertically(px(TITLE));
        head.titled(title, font(20))?;
        let time = |stretch: f64| stretch * self.every as f64 * self.period.unwrap_or(1.0);
        let end = time(self.stretches.len().max(1) as f64);
        let label = if self.period.is_some() { "time, s" } else { "period" };
        for (column, area) in rest.split_evenly((count as usize, 1)).iter().enumerate() {
            let of = |stretch: &Stretch| stretch.ranges.get(column).copied().flatten();
            let all = self.stretches.iter().filter_map(of);
            let (low, high) = all.fold((f64::MAX, f64::MIN), |(low, high), (a, b)| (low.min(a), high.max(b)));
            let (low, high) = if low > high { (0.0, 1.0) } else { (low, high) };
            // A constant has an axis, too.
            let margin = match () {
                () if high > low => 0.06 * (high - low),
                () if low == 0.0 => 1.0,
                () => 0.5 * low.abs(),
            };
            let mut chart = chart(area).build_cartesian_2d(0.0..end, low - margin..high + margin)?;
            let name = self.titles.get(column).map_or("", String::as_str);
            mesh(&mut chart, if column + 1 == count as usize { label } else { "" }, name)?;
            // Steps, as the values are held; a stretch of many periods has both of its ends.
            let points = self.stretches.iter().enumerate().filter_map(|(index, stretch)| {
                let (low, high) = of(stretch)?;
                let (from, to) = (time(index as f64), time(index as f64 + 1.0));
                Some([(from, low), (from, high), (to, high)])
            });
            chart.draw_series(LineSeries::new(points.flatten(), CUT.stroke_width(px(1))))?;
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

    #[test]
    fn an_empty_table_has_a_picture() {
        assert!(Curves::new(Vec::new(), None).draw("nothing").unwrap().contains("<svg"));
    }
}
