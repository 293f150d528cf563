// SPDX-License-Identifier: MIT OR Apache-2.0
//! Plot of the front: time over LUT, with a circle for each machine, sized by its block RAM.

use super::front::Candidate;
use crate::terminal::plot::{Outcome, chart, font, headed, in_pixels, mesh, px};
use anyhow::{Result, anyhow};
use plotters::prelude::*;

const SIZE: (u32, u32) = (960, 620);
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
    let most = |of: fn(&Candidate) -> f64| all.iter().map(of).fold(1.0, f64::max) * 1.08;
    let right = most(|one| one.estimate.luts);
    let mut chart = chart(&area).build_cartesian_2d(0.0..right, 0.0..most(|one| one.time))?;
    mesh(&mut chart, "LUT4", "time of all programs, µs")?;
    let point = |one: &Candidate| (one.estimate.luts, one.time);
    let size = |one: &Candidate| px(3) + px(one.estimate.block_rams as u32) / 16;
    let circle =
        |one: &Candidate, color: RGBColor| Circle::new(point(one), size(one), color.mix(0.8).filled());
    chart.draw_series(all.iter().map(|one| circle(one, OTHER)))?;
    chart.draw_series(front.iter().map(|one| circle(one, FRONT)))?;
    let name = |one: &&Candidate| Text::new(format!("  {}", one.machine.name), point(one), font(12));
    chart.draw_series(front.iter().map(name))?;
    root.present()?;
    Ok(())
}
