// SPDX-License-Identifier: MIT OR Apache-2.0
//! Plot of the front: time over LUT, with a circle for each machine, sized by its block RAM. It is as wide as a telephone's screen, so that
//! its type keeps its size there.

use super::front::Candidate;
use crate::terminal::plot::{Outcome, chart, font, headed, in_pixels, mesh, px};
use anyhow::{Result, anyhow};
use plotters::prelude::*;
use std::ops::Range;

const SIZE: (u32, u32) = (440, 420);
/// Size of the labels, and width of a character; pixels.
const LABEL: u32 = 11;
const CHARACTER: u32 = 6;
const FRONT: RGBColor = RGBColor(0x1f, 0x5f, 0xa8);
const OTHER: RGBColor = RGBColor(0xb8, 0xb8, 0xb8);

/// Plots all candidates; machines on the front are labelled.
pub(super) fn draw(all: &[Candidate], front: &[&Candidate]) -> Result<String> {
    let mut svg = String::new();
    draw_into(all, front, &mut svg).map_err(|error| anyhow!("cannot draw: {error}"))?;
    Ok(in_pixels(&svg, SIZE.0, SIZE.1))
}

fn draw_into(all: &[Candidate], front: &[&Candidate], svg: &mut String) -> Outcome<()> {
    let root = SVGBackend::with_string(svg, (px(SIZE.0), px(SIZE.1))).into_drawing_area();
    root.fill(&WHITE)?;
    let styles = [("front, the size is block RAM", FRONT.filled()), ("bettered", OTHER.filled())];
    let area = headed(&root, "Machines: time and area, estimated", &styles)?;
    let (across, up) = (axis(all, |one| one.estimate.luts), axis(all, |one| one.time));
    let mut chart = chart(&area).build_cartesian_2d(across, up)?;
    mesh(&mut chart, "LUT4", "time of all programs, µs")?;
    let point = |one: &Candidate| (one.estimate.luts, one.time);
    let size = |one: &Candidate| px(3) + px(one.estimate.block_rams as u32) / 16;
    let circle =
        |one: &Candidate, color: RGBColor| Circle::new(point(one), size(one), color.mix(0.8).filled());
    chart.draw_series(all.iter().map(|one| circle(one, OTHER)))?;
    chart.draw_series(front.iter().map(|one| circle(one, FRONT)))?;
    let plot = chart.plotting_area();
    let (wide, high) = plot.get_pixel_range();
    let names =
        front.iter().map(|one| (plot.map_coordinate(&point(one)), size(one) as i32, one.machine.name));
    let dots = all.iter().map(|one| {
        let ((x, y), radius) = (plot.map_coordinate(&point(one)), size(one) as i32);
        [x - radius..x + radius, y - radius..y + radius]
    });
    let labels = labels(names, &dots.collect::<Vec<_>>(), (wide.clone(), high.clone()));
    if labels.len() < front.len() {
        let text = format!("{} names are in the table only", front.len() - labels.len());
        root.draw(&Text::new(text, (wide.start + px(6) as i32, high.end - px(18) as i32), font(LABEL)))?;
    }
    for label in labels {
        let Label { name, at, from } = label;
        if let Some(from) = from {
            root.draw(&PathElement::new([from, (at.0, at.1 + px(LABEL) as i32 / 2)], BLACK.mix(0.4)))?;
        }
        root.draw(&Text::new(name.to_owned(), at, font(LABEL)))?;
    }
    root.present()?;
    Ok(())
}

/// Range of an axis that fits the data, with a margin for circles; from 0 where that costs less than a half of it.
fn axis(all: &[Candidate], of: fn(&Candidate) -> f64) -> Range<f64> {
    let (low, high) =
        all.iter().map(of).fold((f64::MAX, f64::MIN_POSITIVE), |(low, high), x| (low.min(x), high.max(x)));
    let gap = 0.08 * (high - low).max(0.01 * high);
    let begin = if low < high / 2.0 { 0.0 } else { low - gap };
    begin..high + gap
}

/// Name of a machine, with its place and, if it is away from its circle, the begin of a line from there.
struct Label<'n> {
    name: &'n str,
    at: (i32, i32),
    from: Option<(i32, i32)>,
}

/// Width and height of a part of the picture.
type Area = [Range<i32>; 2];

/// Labels that do not overlap, of all circles for whose names there is room: each at its circle's right or left, or as few lines above or
/// below as it takes, beside all `dots` if there is such a place. Circles are given by centre, radius and name.
fn labels<'n>(
    circles: impl Iterator<Item = ((i32, i32), i32, &'n str)>,
    dots: &[Area],
    (wide, high): (Range<i32>, Range<i32>),
) -> Vec<Label<'n>> {
    let (line, gap) = (px(LABEL + 3) as i32, px(4) as i32);
    let mut taken: Vec<Area> = Vec::new();
    let mut found = Vec::new();
    for ((x, y), radius, name) in circles {
        let width = (name.chars().count() as u32 * px(CHARACTER)) as i32;
        let sides = [x + radius + gap, x - radius - gap - width];
        let rows = (0..=high.len() as i32 / line).flat_map(|step| [step, -step]);
        let places = rows.flat_map(|row| sides.map(|left| (left, y - line / 2 + row * line)));
        let touches = |a: &Range<i32>, b: &Range<i32>| a.start < b.end && b.start < a.end;
        let beside = |areas: &[Area], (left, top): (i32, i32)| {
            let (across, down) = (left..left + width, top..top + line);
            !areas.iter().any(|[a, b]| touches(a, &across) && touches(b, &down))
        };
        let free = |&(left, top): &(i32, i32)| {
            let [across, down] = [left..left + width, top..top + line];
            let is_inside = across.start >= wide.start
                && across.end <= wide.end
                && top >= high.start
                && down.end <= high.end;
            is_inside && beside(&taken, (left, top))
        };
        let clear = |place: &(i32, i32)| free(place) && beside(dots, *place);
        let Some(at) = places.clone().find(clear).or_else(|| places.clone().find(free)) else { continue };
        let from = (at.1 != y - line / 2).then_some((x, y));
        taken.push([at.0..at.0 + width, at.1..at.1 + line]);
        found.push(Label { name, at, from });
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_do_not_overlap() {
        let close =
            (0..12).map(|i| ((px(200) as i32 + i, px(200) as i32 + i), px(6) as i32, "t3-a-long-name"));
        let field = (px(60) as i32..px(420) as i32, px(40) as i32..px(380) as i32);
        let labels = labels(close, &[], field);
        let width = (14 * px(CHARACTER)) as i32;
        for (i, one) in labels.iter().enumerate() {
            for other in &labels[..i] {
                let apart = (one.at.0 - other.at.0).abs() >= width
                    || (one.at.1 - other.at.1).abs() >= px(LABEL) as i32;
                assert!(apart, "{:?} and {:?}", one.at, other.at);
            }
        }
        assert!(labels[0].from.is_none() && labels[11].from.is_some());
    }

    #[test]
    fn labels_stand_beside_all_dots() {
        let (x, y, radius) = (px(200) as i32, px(200) as i32, px(6) as i32);
        let dot = |x: i32| [x - radius..x + radius, y - radius..y + radius];
        let field = (0..px(440) as i32, 0..px(420) as i32);
        let one = [((x, y), radius, "t3")];
        let alone = labels(one.into_iter(), &[dot(x)], field.clone());
        assert!(alone[0].at.0 > x && alone[0].from.is_none());
        let with = labels(one.into_iter(), &[dot(x), dot(x + 3 * radius)], field);
        assert!(with[0].at.0 < x && with[0].from.is_none(), "{:?}", with[0].at);
    }
}
