// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tables of `takt track`: results compared with those of the founding paper.

use crate::commands::friction::Friction;
use crate::run::account::{Account, fused_operations, rounding};
use crate::run::controller::Latency;
use crate::run::deny::Denials;
use crate::terminal::files::Out;
use crate::terminal::options::PAPER_CLOCK;
use crate::terminal::page::{Columns, left, right};
use anyhow::Result;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::Write;
use takt_analysis::accuracy::{OutputPlace, enclose};
use takt_emu::PeriodReport;
use takt_isa::Program;
use takt_isa::program::Port;
use takt_programs::accuracy::{Accuracy, MaxError};
use takt_programs::hybrid::closed_loop::{Record, TrackingError};
use takt_programs::hybrid::kinematics;
use takt_programs::hybrid::ports::REFERENCE_LEN;

/// Results of a run along the path.
pub(crate) struct Tracking {
    /// Name of the program.
    pub(crate) name: String,
    pub(crate) program: Program,
    /// Name of the tool path.
    pub(crate) path: String,
    /// Clock in MHz, for conversion to time.
    pub(crate) clock: f64,
    pub(crate) totals: Totals,
    pub(crate) nan_writes: u64,
    /// Cycle account of the last period.
    pub(crate) account: Account,
    /// Encoder-to-force latency in the last period; `None` if the period read no encoder or wrote no force.
    pub(crate) latency: Option<Latency>,
    /// Identified friction, for --fit-friction.
    pub(crate) friction: Option<Friction>,
    pub(crate) denials: Denials,
}

/// Figures over all periods.
pub(crate) struct Totals {
    pub(crate) periods: u64,
    /// Cycles of the shortest and of the longest period.
    pub(crate) shortest: u64,
    pub(crate) longest: u64,
    /// Number of missed deadlines, including lost ticks.
    pub(crate) missed: u64,
    /// Errors of the joint reference: l, v, a of the arms; θ, ω, ε of the table.
    pub(crate) accuracy: Accuracy<REFERENCE_LEN>,
    pub(crate) error: TrackingError,
}

impl Totals {
    pub(crate) fn new() -> Totals {
        let (accuracy, error) = (Accuracy::default(), TrackingError::default());
        Totals { periods: 0, shortest: u64::MAX, longest: 0, missed: 0, accuracy, error }
    }

    pub(crate) fn add(&mut self, record: &Record, report: &PeriodReport) {
        self.periods += 1;
        self.shortest = self.shortest.min(report.cycles);
        self.longest = self.longest.max(report.cycles);
        self.missed += u64::from(report.missed) + report.lost;
        self.error.add(record);
        let measured = record.outputs.joint.to_array().map(|value| value as f32);
        self.accuracy.add(&measured, &kinematics::inverse(&record.sample.reference).to_array());
    }
}

/// Short name of a program for tables: the last part of its path, without the common extension.
pub(crate) fn variant(name: &str) -> &str {
    let file = name.rsplit(['/', '\\']).next().unwrap_or(name);
    match file.rsplit_once('.') {
        Some((stem, extension)) if takt_asm::EXTENSIONS.contains(&extension) => stem,
        _ => file,
    }
}

/// Table 2 of the paper: platform, clock in MHz, period in µs.
const PLATFORMS: [(&str, f64, f64); 4] = [
    ("FPGA1: Nios II, vendor's FPU", 100.0, 218.0),
    ("FPGA2: Nios II, custom FP instructions", 100.0, 82.0),
    ("DSP TMS320F28069", 80.0, 43.0),
    ("FPGA3: custom FP ASIP", 125.0, 21.0),
];

/// Table 1 of the paper: operation, count, corresponding mnemonics.
const OPERATIONS: [(&str, u64, &[&str]); 7] = [
    ("+ -", 186, &["fadd", "fsub"]),
    ("×", 216, &["fmul"]),
    ("/", 31, &["fdiv"]),
    ("√", 13, &["fsqrt"]),
    ("sin", 1, &["fsin"]),
    ("float(int)", 5, &["itof"]),
    ("saturation", 5, &["fsat"]),
];

/// Table 3 of the paper: output, unit, largest errors on PC, DSP and FPGA1,2,3. The paper gives a single figure for both axes of the
/// table.
const ERRORS: [(&str, &str, [f64; 3]); 15] = [
    ("l1", "m", [1.8651e-6, 1.8651e-6, 1.8651e-6]),
    ("l2", "m", [1.1658e-6, 2.2893e-8, 2.2165e-8]),
    ("l3", "m", [1.0510e-6, 1.0512e-7, 1.0510e-6]),
    ("v1", "m/s", [5.9368e-7, 5.9377e-7, 5.9368e-7]),
    ("v2", "m/s", [8.2634e-7, 8.2634e-7, 8.2634e-7]),
    ("v3", "m/s", [7.5938e-7, 7.6683e-7, 7.6003e-7]),
    ("a1", "m/s²", [1.8899e-6, 2.1942e-7, 2.2496e-7]),
    ("a2", "m/s²", [2.7877e-6, 6.0238e-7, 5.8701e-7]),
    ("a3", "m/s²", [2.6891e-6, 6.0238e-6, 2.9990e-6]),
    ("th4", "rad", [4.4702e-8; 3]),
    ("th5", "rad", [4.4702e-8; 3]),
    ("om4", "rad/s", [1.0000e-7; 3]),
    ("om5", "rad/s", [1.0000e-7; 3]),
    ("ep4", "rad/s²", [3.2011e-7; 3]),
    ("ep5", "rad/s²", [3.2011e-7; 3]),
];

/// The paper's requirement on the tool error, m.
const REQUIREMENT: f64 = 10e-6;

/// Ranges of outputs by kind. The paper's arm lengths are unknown, so maxima over the three arms are compared.
const KINDS: [(&str, std::ops::Range<usize>); 3] = [("l", 0..3), ("v", 3..6), ("a", 6..9)];

/// Largest error; a NaN counts as the largest.
fn largest(errors: impl Iterator<Item = f64>) -> f64 {
    errors.fold(0.0, |largest, error| if error > largest || error.is_nan() { error } else { largest })
}

/// Formats a number with thousands separators.
fn digits(value: u64) -> String {
    let digits = value.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// Prints the results as text.
pub(crate) fn text(tracking: &Tracking, out: &mut Out) -> Result<()> {
    let Tracking { name, path, totals, program, .. } = tracking;
    let periods = digits(totals.periods);
    let s = if totals.periods == 1 { "" } else { "s" };
    writeln!(
        out,
        "{name} on {}, closed loop along {path}: {periods} period{s} of 100 µs\n",
        program.machine.name
    )?;
    let of = format!("{} on {}", variant(name), program.machine.name);
    time_table(tracking, &of, out)?;
    operation_table(&tracking.account, &of, out)?;
    let fused = fused_operations(program);
    error_table(&totals.accuracy.errors, &bounds(program), fused, &of, out)?;

    writeln!(out, "\nLargest tracking error of the tool: {of}\n  {:<32}{:>11}", "", "µm")?;
    let columns = [left(34, 0), right(11, 0)];
    let columns = Columns::new(&columns, out.page());
    for (name, error, strong) in [
        ("  while cutting", totals.error.cutting, Some(1)),
        ("  over everything", totals.error.overall, None),
    ] {
        // Zero means that there was no period of that kind.
        let figure = if error > 0.0 { format!("{:.3}", error * 1e6) } else { "-".to_owned() };
        out.lines(&columns.row(&[name, &figure], strong.filter(|_| error > 0.0)))?;
    }
    writeln!(out, "  {:<32}{:>11.3}", "required while cutting", REQUIREMENT * 1e6)?;

    writeln!(out, "\nCycles of one period (the last), by cause: {of}")?;
    out.write_all(tracking.account.stall_table(&located(program, name), 5).as_bytes())?;
    if let Some(friction) = &tracking.friction {
        let mut text = String::new();
        friction.text(&of, &mut text);
        out.write_all(text.as_bytes())?;
    }
    Ok(())
}

/// Program with source paths relative to the user's folder: the folder of the given path, then the path within the project.
fn located(program: &Program, given: &str) -> Program {
    let mut program = program.clone();
    let folder = program.files.first().and_then(|first| given.strip_suffix(first.as_str()));
    let folder = folder.unwrap_or("").to_owned();
    // Library files have names such as `<math.s>`.
    for file in program.files.iter_mut().filter(|file| !file.starts_with('<')) {
        file.insert_str(0, &folder);
    }
    program
}

/// Prints table 2 of the paper with Takt's times.
fn time_table(tracking: &Tracking, of: &str, out: &mut Out) -> Result<()> {
    let (machine, clock, totals) = (tracking.program.machine.name, tracking.clock, &tracking.totals);
    let columns = [left(40, 0), right(9, 0), right(10, 0), right(12, 0)];
    let columns = Columns::new(&columns, out.page());
    writeln!(out, "Time of one period: {of}")?;
    out.lines(&columns.row(&["", "clock MHz", "cycles", "time µs"], None))?;
    let mut row = |name: &str, clock: &str, cycles: u64, time: &str, strong: bool| {
        let cells = [&format!("  {name}"), clock, &digits(cycles), time];
        out.lines(&columns.row(&cells, strong.then_some(3)))
    };
    for (platform, clock, time) in PLATFORMS {
        row(platform, &clock.to_string(), (clock * time) as u64, &time.to_string(), false)?;
    }
    for (which, cycles) in [("shortest", totals.shortest), ("longest", totals.longest)] {
        let (name, time) =
            (format!("Takt {machine}, {which} period"), format!("{:.3}", cycles as f64 / clock));
        row(&name, &clock.to_string(), cycles, &time, which == "longest")?;
    }
    let (_, fpga3_clock, fpga3_time) = PLATFORMS[3];
    if let Some(placed) = crate::run::synthesis::placed(machine) {
        let time = format!("{:.3}", totals.longest as f64 / placed.mhz);
        let name = format!("Takt {machine}, longest, as placed and routed");
        row(&name, &format!("{:.1}", placed.mhz), totals.longest, &time, false)?;
        writeln!(
            out,
            "  Placed and routed on {} on {} (median of {} seeds: docs/synthesis.md).",
            placed.device, placed.date, placed.seeds
        )?;
    } else {
        writeln!(out, "  Takt's own circuit of {machine} is not placed and routed yet.")?;
    }
    let whose = if clock == PAPER_CLOCK { "The clock is the paper's" } else { "The clock is --clock's" };
    writeln!(
        out,
        "  FPGA3 takes {:.1} times the cycles. {whose} where nothing else is said.",
        fpga3_clock * fpga3_time / totals.longest as f64
    )?;
    if let Some(latency) = tracking.latency {
        writeln!(
            out,
            "  encoder to force: {} cycles from the first read of the encoder read last, {} from the first of all",
            latency.from_last_encoder, latency.from_first_read
        )?;
    }
    writeln!(out, "  deadlines missed: {}", totals.missed)?;
    Ok(())
}

/// Prints table 1 of the paper with Takt's counts.
fn operation_table(account: &Account, of: &str, out: &mut Out) -> Result<()> {
    writeln!(out, "\nOperations of one period: {of}\n{:>34}{:>10}", "paper", "Takt")?;
    let operations = &account.operations;
    let mut listed = 0;
    for (name, paper, mnemonics) in OPERATIONS {
        let ours: u64 = mnemonics.iter().filter_map(|name| operations.get(name)).sum();
        listed += ours;
        writeln!(out, "  {name:<22}{paper:>10}{ours:>10}")?;
    }
    let is_other = |name: &str| OPERATIONS.iter().all(|(_, _, listed)| !listed.contains(&name));
    let others: Vec<String> = operations
        .iter()
        .filter(|(name, _)| is_other(name))
        .map(|(name, count)| format!("{name} {count}"))
        .collect();
    let all = account.total_operations();
    let others = if others.is_empty() { String::new() } else { format!("  ({})", others.join(", ")) };
    writeln!(out, "  {:<22}{:>10}{:>10}{others}", "others", "-", all - listed)?;
    let paper: u64 = OPERATIONS.iter().map(|(_, count, _)| count).sum();
    writeln!(out, "  {:<22}{paper:>10}{all:>10}", "all")?;
    Ok(())
}

/// Proved bounds of the outputs in [`ERRORS`], where the program's ranges yield one (as in `takt accuracy`): of the outputs after forces
/// and torques, in order.
fn bounds(program: &Program) -> Vec<Option<f64>> {
    let enclosure = enclose(program).ok();
    let bound = |output: &Port| {
        let mut bounds = enclosure.iter().flat_map(|enclosure| &enclosure.outputs);
        bounds.find(|bound| bound.place == OutputPlace::Port(output.register))?.error
    };
    let first = program.outputs.len().saturating_sub(ERRORS.len());
    program.outputs[first..].iter().map(bound).collect()
}

/// Prints table 3 of the paper with Takt's errors.
fn error_table(
    errors: &[MaxError],
    bounds: &[Option<f64>],
    fused: usize,
    of: &str,
    out: &mut Out,
) -> Result<()> {
    writeln!(out, "\nLargest |binary32 - binary64|: {of}")?;
    let columns =
        [left(29, 0), right(12, 0), right(8, 1), right(12, 0), right(12, 4), right(12, 3), right(12, 2)];
    let columns = Columns::new(&columns, out.page());
    out.lines(&columns.row(&["", "Takt", "ulp", "at most", "paper PC", "DSP", "FPGA"], None))?;
    let mut row = |name: &str, ours: f64, ulps: Option<f64>, most: Option<f64>, paper: [f64; 3]| {
        let most = most.map_or_else(|| "-".to_owned(), at_most);
        let ulps = ulps.map_or(String::new(), |ulps| format!("{ulps:.2}"));
        let [pc, dsp, fpga] = paper.map(|error| format!("{error:.4e}"));
        let cells = [format!("  {name}"), format!("{ours:.4e}"), ulps, most, pc, dsp, fpga];
        out.lines(&columns.row(&cells, None))
    };
    let bound = |row: usize| bounds.get(row).copied().flatten();
    for (i, ((name, unit, paper), error)) in ERRORS.iter().zip(errors).enumerate() {
        row(&format!("{name}, {unit}"), error.absolute, Some(error.ulps_of_largest()), bound(i), *paper)?;
    }
    for (kind, rows) in KINDS {
        let paper = [0, 1, 2].map(|column| largest(ERRORS[rows.clone()].iter().map(|row| row.2[column])));
        let most = rows.clone().map(bound).collect::<Option<Vec<f64>>>();
        let most = most.map(|bounds| largest(bounds.into_iter()));
        let ours = largest(errors[rows].iter().map(|error| error.absolute));
        row(&format!("largest {kind}"), ours, None, most, paper)?;
    }
    if columns.leave_out_some() {
        writeln!(out, "  A wider terminal has room for more columns.")?;
    }
    writeln!(out, "  Of the program, {}.", rounding(fused))?;
    for paragraph in [
        "  ulp: of the largest value that the output takes. At most: what rounding in one period can add up to, over all\n  \
         inputs within the program's .range (docs/accuracy.md); constants and inputs count as exact there. -: not bounded.\n",
        "  input's: the program passes a reference on as it comes in, and adds nothing to the error of rounding it to binary32.\n",
        "  The paper's arm lengths are unknown: compare the largest of a kind; so are its angles (ours reach π).\n",
    ] {
        out.paragraph(paragraph)?;
    }
    Ok(())
}

/// Formats a bound for its column. An output that copies an input has no rounding error; its measured error is that of the input.
fn at_most(bound: f64) -> String {
    if bound == 0.0 { "input's".to_owned() } else { format!("{bound:.4e}") }
}

/// Results of a drive as JSON.
pub(crate) fn json(tracking: &Tracking) -> Value {
    let by_name = |value: fn(&MaxError) -> f64| -> BTreeMap<&str, f64> {
        ERRORS
            .iter()
            .zip(&tracking.totals.accuracy.errors)
            .map(|((name, ..), error)| (*name, value(error)))
            .collect()
    };
    let totals = &tracking.totals;
    let time = |cycles: u64| cycles as f64 / tracking.clock;
    json!({
        "program": tracking.name,
        "machine": tracking.program.machine.name,
        "path": tracking.path,
        "periods": totals.periods,
        "cycles": {"min": totals.shortest, "max": totals.longest},
        "clock_mhz": tracking.clock,
        "time_us": {"min": time(totals.shortest), "max": time(totals.longest)},
        "placed": crate::run::synthesis::placed(tracking.program.machine.name),
        "encoder_to_force_cycles": tracking.latency,
        "deadlines_missed": totals.missed,
        "denied": tracking.denials.json,
        "operations": tracking.account.operations,
        "bundles": tracking.account.bundles,
        "fused_operations": fused_operations(&tracking.program),
        "max_error": by_name(|error| error.absolute),
        "max_error_bound": ERRORS.iter().map(|(name, ..)| *name).zip(bounds(&tracking.program)).collect::<BTreeMap<_, _>>(),
        "max_error_ulp": by_name(MaxError::ulps_of_largest),
        "tracking_error_m": {"cutting": totals.error.cutting, "overall": totals.error.overall},
        "stalls": tracking.account.stalls_json(),
        "nan_writes": tracking.nan_writes,
        "friction": tracking.friction.as_ref().map(Friction::json),
    })
}
