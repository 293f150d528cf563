// SPDX-License-Identifier: MIT OR Apache-2.0
//! Plots of a session: joint angles, velocities and tracking errors over time, and two views of the tool path.

use crate::terminal::plot::{Area, JOINT_COLORS, Outcome, POINTS, WIDTH, chart, headed, in_pixels, mesh, px};
use anyhow::{Result, anyhow};
use plotters::prelude::*;
use takt_robot::controller::{RECORD_TICKS, Record};
use takt_robot::geometry::pose_of;
use takt_robot::host::{TICK, degrees};

const NAMES: [&str; 6] = ["q1", "q2", "q3", "q4", "q5", "q6"];
/// Height of the panels, in pixels.
const PANEL: u32 = 300;
const PATHS: u32 = 420;
const HEIGHT: u32 = 3 * PANEL + PATHS;

/// Plots all records, as SVG.
pub(super) fn draw(title: &str, records: &[Record]) -> Result<String> {
    let mut svg = String::new();
    draw_into(title, records, &mut svg).map_err(|error| anyhow!("cannot draw: {error}"))?;
    Ok(in_pixels(&svg, WIDTH, HEIGHT))
}

fn draw_into(title: &str, records: &[Record], svg: &mut String) -> Outcome<()> {
    let root = SVGBackend::with_string(svg, (px(WIDTH), px(HEIGHT))).into_drawing_area();
    root.fill(&WHITE)?;
    let (angles, rest) = root.split_vertically(px(PANEL));
    let (velocities, rest) = rest.split_vertically(px(PANEL));
    let (errors, paths) = rest.split_vertically(px(PANEL));
    let curves = |value: &dyn Fn(usize, usize) -> f64| -> [Vec<(f64, f64)>; 6] {
        std::array::from_fn(|joint| (0..records.len()).map(|i| (records[i].time, value(i, joint))).collect())
    };
    let reference = curves(&|i, joint| records[i].reference[joint].to_degrees());
    panel(&angles, &format!("{title}: joint angles"), "angle, degrees", &thin(&reference))?;
    // Differences between records; since the reference is a binary32, they are coarse at this step.
    let step = TICK * RECORD_TICKS as f64;
    let velocity = curves(&|i, joint| {
        let (a, b) = (i.saturating_sub(2), (i + 2).min(records.len() - 1));
        let time = ((b - a) as f64 * step).max(step);
        (records[b].reference[joint] - records[a].reference[joint]).to_degrees() / time
    });
    panel(&velocities, "Velocities of the reference", "deg/s", &thin(&velocity))?;
    let error =
        curves(&|i, joint| (records[i].reference[joint] - records[i].joints[joint]).to_degrees() * 1e3);
    panel(&errors, "Tracking errors: reference less plant", "millidegrees", &extremes(&error))?;
    let tool: Vec<[f64; 3]> = records
        .iter()
        .step_by(records.len().div_ceil(4 * POINTS as usize).max(1))
        .map(|record| {
            let ([x, y, z, ..], _) = pose_of(&degrees(&record.joints), [0.0; 3]);
            [x, y, z]
        })
        .collect();
    let (left, right) = paths.split_horizontally(px(WIDTH / 2));
    path(
        &left,
        "The flange along z",
        ("x, mm", "y, mm"),
        &tool.iter().map(|p| (p[0], p[1])).collect::<Vec<_>>(),
    )?;
    path(
        &right,
        "The flange along y",
        ("x, mm", "z, mm"),
        &tool.iter().map(|p| (p[0], p[2])).collect::<Vec<_>>(),
    )?;
    root.present()?;
    Ok(())
}

/// Thins smooth curves to fewer points.
fn thin(curves: &[Vec<(f64, f64)>; 6]) -> [Vec<(f64, f64)>; 6] {
    let every = curves[0].len().div_ceil(2 * POINTS as usize).max(1);
    std::array::from_fn(|joint| curves[joint].iter().step_by(every).copied().collect())
}

/// Value of largest magnitude in each stretch of time, so that no peak is lost.
fn extremes(curves: &[Vec<(f64, f64)>; 6]) -> [Vec<(f64, f64)>; 6] {
    let every = curves[0].len().div_ceil(POINTS as usize).max(1);
    std::array::from_fn(|joint| {
        let stretches = curves[joint].chunks(every);
        stretches
            .filter_map(|stretch| stretch.iter().copied().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())))
            .collect()
    })
}

fn panel(area: &Area<'_>, title: &str, unit: &str, curves: &[Vec<(f64, f64)>; 6]) -> Outcome<()> {
    let styles = JOINT_COLORS.map(|color| color.stroke_width(px(1)));
    let lines: Vec<(&str, ShapeStyle)> = NAMES.into_iter().zip(styles).collect();
    let area = headed(area, title, &lines)?;
    let values = || curves.iter().flatten().map(|(_, value)| *value);
    let (low, high) = (values().fold(0.0, f64::min), values().fold(0.0, f64::max));
    let margin = 0.05 * (high - low).max(1e-3);
    let end = curves[0].last().map_or(0.0, |(time, _)| *time).max(1e-3);
    let mut chart = chart(&area).build_cartesian_2d(0.0..end, low - margin..high + margin)?;
    mesh(&mut chart, "time, s", unit)?;
    for (curve, style) in curves.iter().zip(styles) {
        chart.draw_series(LineSeries::new(curve.iter().copied(), style))?;
    }
    Ok(())
}

/// Plot of a path with equal scales on both axes.
fn path(area: &Area<'_>, title: &str, (x, y): (&str, &str), points: &[(f64, f64)]) -> Outcome<()> {
    let area = headed(area, title, &[])?;
    let range = |pick: fn(&(f64, f64)) -> f64| {
        let ends = points.iter().map(pick).fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
        if ends.0 > ends.1 { (0.0, 1.0) } else { ends }
    };
    let (across, along) = (range(|p| p.0), range(|p| p.1));
    let (width, height) = chart(&area).build_cartesian_2d(0.0..1.0, 0.0..1.0)?.plotting_area().dim_in_pixel();
    let scale = ((across.1 - across.0) / f64::from(width)).max((along.1 - along.0) / f64::from(height));
    let widen = |(low, high): (f64, f64), pixels: u32| {
        let (centre, half) = ((low + high) / 2.0, (0.54 * scale * f64::from(pixels)).max(1.0));
        centre - half..centre + half
    };
    let mut chart = chart(&area).build_cartesian_2d(widen(across, width), widen(along, height))?;
    mesh(&mut chart, x, y)?;
    let style = JOINT_COLORS[0].stroke_width(px(1));
    chart.draw_series(LineSeries::new(points.iter().copied(), style))?;
    Ok(())
}
