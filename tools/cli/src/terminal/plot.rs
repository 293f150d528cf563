// SPDX-License-Identifier: MIT OR Apache-2.0
//! SVG plots: tool path and tracking error over time; an arm's tool path in space, and joint angles over time.

pub(crate) mod curves;
pub(crate) mod terminal;

use anyhow::{Result, anyhow};
use plotters::coord::Shift;
use plotters::prelude::*;
use std::ops::Range;
use takt_programs::hybrid::closed_loop::Record;
use takt_programs::hybrid::params::SAMPLE_TIME;

/// Maximum number of points in a curve; one per period would give hundreds of thousands.
pub(crate) const POINTS: u64 = 1000;
/// Width of a plot in pixels, and heights of the path and of the errors below it.
pub(crate) const WIDTH: u32 = 720;
const PATH_HEIGHT: u32 = 430;
const ERRORS_HEIGHT: u32 = 270;
/// Drawing units per pixel. plotters uses integer coordinates, so slanted lines at pixel resolution would be jagged.
pub(crate) const FINE: u32 = 8;
const CUT: RGBColor = RGBColor(0x1f, 0x4e, 0x9c);
const RAPID: RGBColor = RGBColor(0xa8, 0xa8, 0xa8);
const LIMIT: RGBColor = RGBColor(0xc0, 0x30, 0x20);
const DEVIATION: RGBColor = RGBColor(0xd0, 0x88, 0x10);
/// Magnification of the deviations drawn beside the path.
const MAGNIFIED: f64 = 1000.0;
const DEVIATES: &str = "tool, deviation × 1,000";
/// Colours of θ1 to θ6.
pub(crate) const JOINT_COLORS: [RGBColor; 6] = [
    CUT,
    LIMIT,
    RGBColor(0x2a, 0x8a, 0x3c),
    RGBColor(0xd0, 0x88, 0x10),
    RGBColor(0x7a, 0x3c, 0xa0),
    RGBColor(0x40, 0x40, 0x40),
];
/// Heights of the arm's plots: tool path, and joint angles.
const SPACE_HEIGHT: u32 = 620;
const JOINTS_HEIGHT: u32 = 400;
/// Colour of the shadow of the tool path.
const SHADOW: RGBColor = RGBColor(0xe2, 0xe4, 0xe8);
/// The paper's requirement on the tool error, µm.
const REQUIRED: f64 = 10.0;

pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub(crate) type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Data of a plot, collected during the closed loop.
pub(crate) struct Plot {
    /// Number of periods per point of a curve.
    every: u64,
    path: Vec<Run>,
    /// Move and position of the tool in the last period.
    last: Option<(usize, (f64, f64))>,
    errors: Vec<StretchErrors>,
    /// Largest deviation in the current stretch, and its place in the plot; for cutting moves only.
    farthest: Option<(f64, (f64, f64))>,
}

/// Consecutive moves of one kind; points in mm.
struct Run {
    cutting: bool,
    points: Vec<(f64, f64)>,
    /// Largest deviation of the tool in each stretch of time, drawn beside the path with magnification.
    deviating: Vec<(f64, f64)>,
}

/// Largest errors in a stretch of time in µm, for rapid and for cutting moves.
#[derive(Clone, Copy, Default)]
struct StretchErrors {
    errors: [Option<f64>; 2],
    /// A NaN was written in a period of the stretch.
    has_nan: bool,
}

impl Plot {
    pub(crate) fn new(periods: u64) -> Plot {
        Plot {
            every: periods.div_ceil(POINTS).max(1),
            path: Vec::new(),
            last: None,
            errors: Vec::new(),
            farthest: None,
        }
    }

    /// Adds a period; `has_nan`: the period wrote a NaN.
    pub(crate) fn add(&mut self, record: &Record, has_nan: bool) {
        let cutting = record.sample.cutting;
        let point = (record.position[0] * 1e3, record.position[1] * 1e3);
        // Ends of moves are points of the path, so that corners stay sharp; a run starts where the previous one ended.
        let corner = self.last.filter(|(index, _)| *index != record.sample.move_index).map(|(_, end)| end);
        if let (Some(run), Some(corner)) = (self.path.last_mut(), corner) {
            run.points.push(corner);
        }
        let begins = record.period.is_multiple_of(self.every);
        let turns = self.path.last().is_none_or(|run| run.cutting != cutting);
        if (begins || turns)
            && let (Some((_, drawn)), Some(run)) = (self.farthest.take(), self.path.last_mut())
        {
            run.deviating.push(drawn);
        }
        if turns {
            self.path.push(Run { cutting, points: corner.into_iter().collect(), deviating: Vec::new() });
        }
        if cutting && self.farthest.is_none_or(|(error, _)| error < record.tool_error) {
            let [x, y, _] = record.sample.reference.position;
            let drawn = |reference: f64, tool: f64| (reference + MAGNIFIED * (tool - reference)) * 1e3;
            let drawn = (drawn(x, record.position[0]), drawn(y, record.position[1]));
            self.farthest = Some((record.tool_error, drawn));
        }
        if begins && let Some(run) = self.path.last_mut() {
            run.points.push(point);
        }
        self.last = Some((record.sample.move_index, point));

        if begins {
            self.errors.push(StretchErrors::default());
        }
        if let Some(stretch) = self.errors.last_mut() {
            let error = record.tool_error * 1e6;
            let largest = &mut stretch.errors[usize::from(cutting)];
            *largest = Some(largest.map_or(error, |largest| largest.max(error)));
            stretch.has_nan |= has_nan;
        }
    }

    /// Plot of path and errors as SVG.
    pub(crate) fn draw(&self, title: &str) -> Result<String> {
        let mut svg = String::new();
        self.draw_into(title, &mut svg).map_err(|error| anyhow!("cannot draw: {error}"))?;
        Ok(in_pixels(&svg, WIDTH, PATH_HEIGHT + ERRORS_HEIGHT))
    }

    fn draw_into(&self, title: &str, svg: &mut String) -> Outcome<()> {
        let root =
            SVGBackend::with_string(svg, (px(WIDTH), px(PATH_HEIGHT + ERRORS_HEIGHT))).into_drawing_area();
        root.fill(&WHITE)?;
        let (upper, lower) = root.split_vertically(px(PATH_HEIGHT));
        self.draw_path(title, &upper)?;
        self.draw_errors(&lower)?;
        root.present()?;
        Ok(())
    }

    fn draw_path(&self, title: &str, area: &Area<'_>) -> Outcome<()> {
        let (rapid, cut) = (RAPID.stroke_width(px(1)), CUT.stroke_width(px(2)));
        let deviation = DEVIATION.stroke_width(px(1));
        let lines = [("rapid moves", rapid), ("cutting moves", cut), (DEVIATES, deviation)];
        let area = headed(area, &path_title(title), &lines)?;
        let ends = self.last.iter().map(|(_, end)| end);
        let (x, y) = self.ranges();
        // Use equal scales on both axes, so that letters keep their shape. Only a chart knows the size that its axes leave.
        let (width, height) =
            chart(&area).build_cartesian_2d(0.0..1.0, 0.0..1.0)?.plotting_area().dim_in_pixel();
        let scale = ((x.end - x.start) / f64::from(width)).max((y.end - y.start) / f64::from(height));
        let widen = |range: Range<f64>, pixels: u32| {
            let (centre, half) = ((range.start + range.end) / 2.0, scale * f64::from(pixels) / 2.0);
            centre - half..centre + half
        };
        let mut chart = chart(&area).build_cartesian_2d(widen(x, width), widen(y, height))?;
        mesh(&mut chart, "x, mm", "y, mm")?;
        // Draw deviations below the path, which hides small ones.
        for run in &self.path {
            chart.draw_series(LineSeries::new(run.deviating.iter().copied(), deviation))?;
        }
        let last = self.path.len().saturating_sub(1);
        for (cutting, style) in [(false, rapid), (true, cut)] {
            for (i, run) in self.path.iter().enumerate().filter(|(_, run)| run.cutting == cutting) {
                let end = ends.clone().filter(|_| i == last);
                chart.draw_series(LineSeries::new(run.points.iter().chain(end).copied(), style))?;
            }
        }
        Ok(())
    }

    /// Ranges of x and y in mm, with a margin.
    fn ranges(&self) -> (Range<f64>, Range<f64>) {
        let drawn = self.path.iter().flat_map(|run| run.points.iter().chain(&run.deviating));
        let points: Vec<(f64, f64)> = drawn.chain(self.last.iter().map(|(_, end)| end)).copied().collect();
        let range = |pick: fn(&(f64, f64)) -> f64| {
            let ends = points.iter().map(pick).fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
            let margin = 0.05 * (ends.1 - ends.0) + 1.0;
            ends.0 - margin..ends.1 + margin
        };
        (range(|p| p.0), range(|p| p.1))
    }

    /// Duration of a stretch in seconds.
    fn stretch(&self) -> f64 {
        self.every as f64 * SAMPLE_TIME
    }

    /// Upper end of the error axis in µm: the larger of worst error and requirement.
    fn worst(&self) -> f64 {
        self.errors.iter().flat_map(|stretch| stretch.errors).flatten().fold(REQUIRED, f64::max)
    }

    /// Times in s of the stretches with NaNs.
    fn nans(&self) -> Vec<f64> {
        let stretches = self.errors.iter().enumerate().filter(|(_, stretch)| stretch.has_nan);
        stretches.map(|(index, _)| (index as f64 + 0.5) * self.stretch()).collect()
    }

    fn draw_errors(&self, area: &Area<'_>) -> Outcome<()> {
        let (rapid, cut, limit) = (RAPID.filled(), CUT.filled(), LIMIT.stroke_width(px(1)));
        let required = required_text();
        let mut lines = vec![("rapid moves", rapid), ("cutting moves", cut), (required.as_str(), limit)];
        let (stretch, nans) = (self.stretch(), self.nans());
        if !nans.is_empty() {
            lines.push((WRITES_NAN, DEVIATION.filled()));
        }
        let area = headed(area, &error_title(stretch), &lines)?;
        let end = self.errors.len() as f64 * stretch;
        let high = self.worst() * 1.15;
        let mut chart = chart(&area).build_cartesian_2d(0.0..end, 0.0..high)?;
        mesh(&mut chart, "time, s", "error, µm")?;
        for (kind, style) in [rapid, cut].into_iter().enumerate() {
            chart.draw_series(
                self.skylines(kind, stretch).into_iter().map(|points| Polygon::new(points, style)),
            )?;
        }
        chart.draw_series(LineSeries::new([(0.0, REQUIRED), (end, REQUIRED)], limit))?;
        let mark = |time: &f64| Cross::new((*time, 0.96 * high), px(4), DEVIATION.stroke_width(px(2)));
        chart.draw_series(nans.iter().map(mark))?;
        Ok(())
    }

    /// Outlines of the errors of one kind of move over adjacent stretches. (Separate bars would show seams.)
    fn skylines(&self, kind: usize, stretch: f64) -> Vec<Vec<(f64, f64)>> {
        let errors: Vec<Option<f64>> = self.errors.iter().map(|of| of.errors[kind]).collect();
        let mut outlines = Vec::new();
        let mut time = 0.0;
        for run in errors.chunk_by(|a, b| a.is_some() == b.is_some()) {
            let mut outline = vec![(time, 0.0)];
            for error in run {
                outline.extend(error.iter().flat_map(|&error| [(time, error), (time + stretch, error)]));
                time += stretch;
            }
            outline.push((time, 0.0));
            if run[0].is_some() {
                outlines.push(outline);
            }
        }
        outlines
    }
}

/// Texts shared by SVG and terminal plots.
const WRITES_NAN: &str = "the program wrote NaN";

fn path_title(title: &str) -> String {
    format!("Tool path of {title}, seen from above")
}

fn error_title(stretch: f64) -> String {
    format!("Tracking error of the tool, largest in each {:.1} ms", stretch * 1e3)
}

fn required_text() -> String {
    format!("required while cutting: {REQUIRED} µm")
}

/// Approximate number of bars in a histogram.
const BARS: f64 = 40.0;
const HISTOGRAM_HEIGHT: u32 = 480;

/// Histogram of ascending values in µm, with the requirement as a line.
pub(crate) fn histogram(title: &str, microns: &[f64]) -> Result<String> {
    let mut svg = String::new();
    histogram_into(title, microns, &mut svg).map_err(|error| anyhow!("cannot draw: {error}"))?;
    Ok(in_pixels(&svg, WIDTH, HISTOGRAM_HEIGHT))
}

/// Width of a bar: 1, 2 or 5 times a power of ten.
fn bar_width(span: f64) -> f64 {
    let least = (span / BARS).max(1e-3);
    let power = 10f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|step| step * power).find(|&width| width >= least).unwrap_or(power)
}

fn histogram_into(title: &str, microns: &[f64], svg: &mut String) -> Outcome<()> {
    let root = SVGBackend::with_string(svg, (px(WIDTH), px(HISTOGRAM_HEIGHT))).into_drawing_area();
    root.fill(&WHITE)?;
    let (kept, lost, limit) = (CUT.filled(), LIMIT.mix(0.6).filled(), LIMIT.stroke_width(px(2)));
    let required = format!("required: {REQUIRED} µm");
    let styles = [("robots that keep it", kept), ("that do not", lost), (required.as_str(), limit)];
    let area = headed(&root, title, &styles)?;
    let (least, most) = match microns {
        [first, .., last] => (first.min(REQUIRED), last.max(REQUIRED)),
        [only] => (only.min(REQUIRED), only.max(REQUIRED)),
        [] => (0.0, REQUIRED),
    };
    let width = bar_width(most - least);
    let first = (least / width).floor() - 1.0;
    let mut counts = vec![0_u64; ((most / width).floor() - first) as usize + 2];
    for value in microns {
        counts[((value / width).floor() - first) as usize] += 1;
    }
    let highest = counts.iter().copied().max().unwrap_or(0).max(1) as f64;
    let range = first * width..(first + counts.len() as f64) * width;
    let mut chart = chart(&area).build_cartesian_2d(range, 0.0..highest * 1.1)?;
    mesh(&mut chart, "largest tracking error while cutting, µm", "robots")?;
    for (index, &count) in counts.iter().enumerate().filter(|&(_, &count)| count > 0) {
        let from = (first + index as f64) * width;
        let style = if from >= REQUIRED { lost } else { kept };
        // Leave a gap between bars.
        let corners = [(from + 0.06 * width, 0.0), (from + 0.94 * width, count as f64)];
        chart.draw_series([Rectangle::new(corners, style)])?;
    }
    chart.draw_series(LineSeries::new([(REQUIRED, 0.0), (REQUIRED, highest * 1.1)], limit))?;
    root.present()?;
    Ok(())
}

/// Motion of an arm: tool positions in mm and joint angles in degrees for every period, and the period in seconds.
pub(crate) struct ArmPlot<'a> {
    pub(crate) tool: &'a [[f64; 3]],
    pub(crate) joints: &'a [[f32; 6]],
    pub(crate) period: f64,
}

impl ArmPlot<'_> {
    /// Plot of the tool path in space, with the joint angles over time below.
    pub(crate) fn draw(&self, title: &str) -> Result<String> {
        let mut svg = String::new();
        self.draw_into(title, &mut svg).map_err(|error| anyhow!("cannot draw: {error}"))?;
        Ok(in_pixels(&svg, WIDTH, SPACE_HEIGHT + JOINTS_HEIGHT))
    }

    fn draw_into(&self, title: &str, svg: &mut String) -> Outcome<()> {
        let size = (px(WIDTH), px(SPACE_HEIGHT + JOINTS_HEIGHT));
        let root = SVGBackend::with_string(svg, size).into_drawing_area();
        root.fill(&WHITE)?;
        let (upper, lower) = root.split_vertically(px(SPACE_HEIGHT));
        self.draw_space(title, &upper)?;
        self.draw_joints(&lower)?;
        root.present()?;
        Ok(())
    }

    fn draw_space(&self, title: &str, area: &Area<'_>) -> Outcome<()> {
        let (path, shadow) = (CUT.stroke_width(px(2)), SHADOW.filled());
        let area = headed(area, title, &[("tool", path), ("its shadow from above", shadow)])?;
        // Equal scales on all axes preserve the shape.
        let extent = |axis: usize| {
            let values = self.tool.iter().map(|position| position[axis]);
            values.fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(value), high.max(value)))
        };
        let extents = [0, 1, 2].map(extent);
        let half = extents.iter().map(|(low, high)| (high - low) / 2.0).fold(1.0, f64::max) * 1.15;
        let [x, y, z] = extents.map(|(low, high)| {
            let centre = (low + high) / 2.0;
            centre - half..centre + half
        });
        let floor = z.start;
        // The second axis of plotters points up.
        let at = |x: f64, y: f64, z: f64| (y, z, x);
        let mut chart = ChartBuilder::on(&area).margin(px(4)).margin_bottom(px(24)).build_cartesian_3d(
            y.start..y.end,
            z.start..z.end,
            x.start..x.end,
        )?;
        chart.with_projection(|mut projection| {
            // View from the side towards which the square leans.
            (projection.pitch, projection.yaw, projection.scale) = (0.5, -2.5, 0.86);
            projection.into_matrix()
        });
        let label = |value: &f64| format!("{value:.0}");
        chart
            .configure_axes()
            .light_grid_style(TRANSPARENT)
            .bold_grid_style(BLACK.mix(0.15).stroke_width(px(1)))
            .axis_panel_style(TRANSPARENT)
            .label_style(font(12))
            .tick_size(px(4))
            .x_formatter(&label)
            .y_formatter(&label)
            .z_formatter(&label)
            .draw()?;
        let names = [
            ("x, mm", at((x.start + x.end) / 2.0, y.start - 0.42 * half, floor)),
            ("y, mm", at(x.start - 0.42 * half, (y.start + y.end) / 2.0, floor)),
            ("z, mm", at(x.start, y.end + 0.5 * half, (z.start + z.end) / 2.0)),
        ];
        let names = names.map(|(name, point)| Text::new(name.to_owned(), point, font(14)));
        chart.draw_series(names)?;
        let every = self.tool.len().div_ceil(POINTS as usize).max(1);
        let points = || self.tool.iter().step_by(every);
        let below: Vec<_> = points().map(|&[x, y, _]| at(x, y, floor)).collect();
        chart.draw_series([Polygon::new(below, shadow)])?;
        chart.draw_series(LineSeries::new(points().map(|&[x, y, z]| at(x, y, z)), path))?;
        Ok(())
    }

    fn draw_joints(&self, area: &Area<'_>) -> Outcome<()> {
        let names = ["θ1", "θ2", "θ3", "θ4", "θ5", "θ6"];
        let styles = JOINT_COLORS.map(|color| color.stroke_width(px(2)));
        let lines: Vec<_> = names.into_iter().zip(styles).collect();
        let area = headed(area, "Joint angles on the way", &lines)?;
        let angles = || self.joints.iter().flatten().copied().map(f64::from);
        let (low, high) =
            (angles().fold(f64::MAX, f64::min) - 10.0, angles().fold(f64::MIN, f64::max) + 10.0);
        let end = self.joints.len().saturating_sub(1) as f64 * self.period;
        let mut chart = chart(&area).build_cartesian_2d(0.0..end, low..high)?;
        mesh(&mut chart, "time, s", "angle, degrees")?;
        let every = self.joints.len().div_ceil(POINTS as usize).max(1);
        for (joint, (_, style)) in lines.into_iter().enumerate() {
            let point =
                |(index, angles): (usize, &[f32; 6])| (index as f64 * self.period, f64::from(angles[joint]));
            // The corners, at quarters of the path, coincide with points of the curve.
            let points = self.joints.iter().enumerate().step_by(every).map(point);
            chart.draw_series(LineSeries::new(points, style))?;
        }
        Ok(())
    }
}

/// Sets the size in pixels of an SVG that was drawn in fine units.
pub(crate) fn in_pixels(svg: &str, width: u32, height: u32) -> String {
    let size = |unit: u32| format!("width=\"{}\" height=\"{}\"", width * unit, height * unit);
    let svg = svg.replacen(&size(FINE), &size(1), 1);
    svg.replacen(">\n", &format!(">\n{DARK}\n"), 1)
}

/// Colours on a dark page: the picture is negative, with its hues. Where a page holds the picture itself, the page's colours stay.
const DARK: &str =
    "<style>@media (prefers-color-scheme:dark){svg:root{filter:invert(.9) hue-rotate(180deg)}}</style>";

/// Converts pixels to drawing units.
pub(crate) fn px(pixels: u32) -> u32 {
    pixels * FINE
}

pub(crate) fn font(size: u32) -> (&'static str, u32) {
    ("sans-serif", px(size))
}

/// Draws a title and a legend line; returns the area below them.
pub(crate) fn headed<'a>(area: &Area<'a>, title: &str, styles: &[(&str, ShapeStyle)]) -> Outcome<Area<'a>> {
    let area = area.margin(px(10), 0, 0, 0).titled(title, font(20))?;
    let (head, rest) = area.split_vertically(px(24));
    let mut x = px(72) as i32;
    let (middle, swatch, gap) = (px(12) as i32, px(24) as i32, px(8) as i32);
    for &(text, style) in styles {
        let half = if style.filled { px(5) as i32 } else { 0 };
        if style.filled {
            head.draw(&Rectangle::new([(x, middle - half), (x + swatch, middle + half)], style))?;
        } else {
            head.draw(&PathElement::new([(x, middle), (x + swatch, middle)], style))?;
        }
        x += swatch + gap;
        head.draw(&Text::new(text.to_owned(), (x, middle - px(6) as i32), font(14)))?;
        x += (text.chars().count() as u32 * px(7)) as i32 + 3 * gap;
    }
    Ok(rest)
}

pub(crate) fn chart<'a, 'b>(area: &'a Area<'b>) -> ChartBuilder<'a, 'b, SVGBackend<'b>> {
    let mut chart = ChartBuilder::on(area);
    chart
        .margin(px(12))
        .margin_top(px(2))
        .margin_right(px(24))
        .x_label_area_size(px(44))
        .y_label_area_size(px(60));
    chart
}

pub(crate) type Axes =
    Cartesian2d<plotters::coord::types::RangedCoordf64, plotters::coord::types::RangedCoordf64>;

pub(crate) fn mesh(chart: &mut ChartContext<'_, SVGBackend<'_>, Axes>, x: &str, y: &str) -> Outcome<()> {
    // A sum with zero has no negative zero.
    let label = |value: &f64| format!("{}", (value * 1e6).round() / 1e6 + 0.0);
    // In a low or narrow chart, as many labels as do not touch.
    let (width, height) = chart.plotting_area().dim_in_pixel();
    chart
        .configure_mesh()
        .x_labels((width / px(64)).clamp(2, 11) as usize)
        .y_labels((height / px(22)).clamp(2, 11) as usize)
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.15).stroke_width(px(1)))
        .axis_style(BLACK.stroke_width(px(1)))
        .set_all_tick_mark_size(px(5))
        .label_style(font(12))
        .axis_desc_style(font(14))
        .x_label_formatter(&label)
        .y_label_formatter(&label)
        .x_desc(x)
        .y_desc(y)
        .draw()?;
    Ok(())
}
