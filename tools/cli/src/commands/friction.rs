// SPDX-License-Identifier: MIT OR Apache-2.0
//! The option `takt track --fit-friction`: friction identified from a run, as a table and as source lines.

use anyhow::{Result, bail};
use serde_json::{Value, json};
use std::fmt::Write as _;
use takt_programs::hybrid::identify::{FEWEST, Fit, RANGE, SETTLE, WINDOW};
use takt_programs::hybrid::params::SAMPLE_TIME;

/// For each axis: name, units, and the registers of friction and velocity in tracking_friction.s.
const AXES: [(&str, &str, &str, &str); 5] = [
    ("arm 1", "N, m/s", "f1", "v1d"),
    ("arm 2", "N, m/s", "f2", "v2d"),
    ("arm 3", "N, m/s", "f3", "v3d"),
    ("tilt", "N*m, rad/s", "ff4", "omega_alpha"),
    ("rotation", "N*m, rad/s", "ff5", "omega_gamma"),
];

/// Identified friction of all axes.
pub(crate) struct Friction {
    windows: usize,
    fits: [Fit; 5],
}

impl Friction {
    /// Collects the fits; fails if an axis moved too little along the path to be fitted.
    pub(crate) fn new(windows: usize, fits: [Option<Fit>; 5], path: &str) -> Result<Friction> {
        let ms = |periods: u32| f64::from(periods) * SAMPLE_TIME * 1e3;
        let mut all = Vec::new();
        for (fit, (name, ..)) in fits.into_iter().zip(AXES) {
            let Some(fit) = fit else {
                bail!(
                    "{path}: no friction of {name} in this run, which has {windows} windows: a fit needs {FEWEST} windows of {:.0} ms at \
                     constant speed, {:.0} ms after it is reached, in both directions, the fastest {RANGE} times the slowest",
                    ms(WINDOW),
                    ms(SETTLE)
                );
            };
            all.push(fit);
        }
        match all.try_into() {
            Ok(fits) => Ok(Friction { windows, fits }),
            Err(_) => bail!("{path}: an axis is missing"),
        }
    }

    /// Writes a table of the parameters, and the source lines.
    pub(crate) fn text(&self, of: &str, out: &mut String) {
        let _ = writeln!(
            out,
            "\nFriction as {of} meets it, from {} windows of {:.0} ms at constant speed\n  {:<12}{:<12}{:>10}{:>10}{:>10}{:>11}{:>10}{:>10}{:>10}",
            self.windows,
            f64::from(WINDOW) * SAMPLE_TIME * 1e3,
            "",
            "",
            "Fc",
            "Fs",
            "vs",
            "v0",
            "Fv",
            "offset",
            "rms left"
        );
        for ((name, units, ..), fit) in AXES.iter().zip(&self.fits) {
            let [fc, fs, vs, v0, fv] = parameters(fit);
            let [offset, rms] = [fit.offset, fit.rms].map(short);
            let _ = writeln!(
                out,
                "  {name:<12}{units:<12}{fc:>10}{fs:>10}{vs:>10}{v0:>11}{fv:>10}{offset:>10}{rms:>10}"
            );
        }
        out.push_str("\nFor tracking_friction.s:\n");
        for ((_, _, register, velocity), fit) in AXES.iter().zip(&self.fits) {
            let _ = writeln!(out, "        friction {register}, {velocity}, {}", parameters(fit).join(", "));
        }
    }

    pub(crate) fn json(&self) -> Value {
        let axes = AXES.iter().zip(&self.fits).map(|((name, ..), fit)| (*name, fit));
        json!({"windows": self.windows, "axes": axes.collect::<std::collections::BTreeMap<_, _>>()})
    }
}

/// Values of the parameters Fc, Fs, vs, v0, Fv.
fn parameters(fit: &Fit) -> [String; 5] {
    let friction = fit.friction;
    let vs = if friction.stribeck == 0.0 { 1.0 } else { friction.stribeck_speed };
    [friction.coulomb, friction.stribeck, vs, friction.sign_speed, friction.viscous].map(short)
}

/// Formats a number with four significant digits.
fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    if (1e-2..1e4).contains(&rounded.abs()) { format!("{rounded}") } else { format!("{rounded:e}") }
}
