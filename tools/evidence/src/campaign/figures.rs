// SPDX-License-Identifier: MIT OR Apache-2.0
//! Figures of units, and their merger, which depends only on the results and not on their order.

use crate::campaign::plan::Plan;
use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::ops::Range;

/// Prefix of output lines with figures: `figures: programs=500 mhz@3=131.4 faults=a,b`.
const LINE: &str = "figures: ";
/// Reported quantiles, in percent.
const QUANTILES: [f64; 6] = [5.0, 25.0, 50.0, 75.0, 95.0, 99.0];
/// Number of extreme values listed at each end of a distribution.
const LISTED: usize = 5;

/// A figure of a unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
enum Figure {
    /// A count; a merger adds counts.
    Count(u64),
    /// Values, each with its seed.
    Values(Vec<(u64, f64)>),
    /// Set of names that occurred; a merger forms the union.
    Names(BTreeSet<String>),
}

/// Figures of a unit, by name.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Figures(BTreeMap<String, Figure>);

impl Figures {
    /// Figures that consist of one count.
    pub(super) fn count(name: &str, count: u64) -> Figures {
        let mut figures = Figures::default();
        figures.add(name, Figure::Count(count));
        figures
    }

    pub(super) fn and_count(mut self, name: &str, count: u64) -> Figures {
        self.add(name, Figure::Count(count));
        self
    }

    pub(super) fn and_values(mut self, name: &str, values: Vec<(u64, f64)>) -> Figures {
        self.add(name, Figure::Values(values));
        self
    }

    fn add(&mut self, name: &str, figure: Figure) {
        match (self.0.get_mut(name), figure) {
            (Some(Figure::Count(sum)), Figure::Count(count)) => *sum += count,
            (Some(Figure::Values(all)), Figure::Values(values)) => all.extend(values),
            (Some(Figure::Names(all)), Figure::Names(names)) => all.extend(names),
            (_, figure) => {
                self.0.insert(name.to_owned(), figure);
            }
        }
    }
}

/// Contents of a unit's result file.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Outcome {
    pub(super) figures: Figures,
    /// CPU time in seconds, and host: for the track record, not for the report.
    pub(super) seconds: Option<f64>,
    pub(super) host: String,
}

/// Parses the figures in a program's output; `None` without a line of figures.
pub(super) fn of_output(output: &str) -> Option<Figures> {
    let mut figures = None;
    // libtest prints a test's name and its first output on the same line.
    for (_, line) in output.lines().filter_map(|line| line.split_once(LINE)) {
        let figures = figures.get_or_insert_with(Figures::default);
        for (name, value) in line.split_whitespace().filter_map(|word| word.split_once('=')) {
            match (name.split_once('@'), value.parse::<u64>()) {
                (Some((name, seed)), _) => {
                    let pair = seed.parse().ok().zip(value.parse().ok());
                    figures.add(name, Figure::Values(pair.into_iter().collect()));
                }
                (None, Ok(count)) => figures.add(name, Figure::Count(count)),
                (None, Err(_)) => {
                    let names = value.split(',').filter(|name| !name.is_empty()).map(str::to_owned);
                    figures.add(name, Figure::Names(names.collect()));
                }
            }
        }
    }
    figures
}

/// Merged results of all finished units.
#[derive(Debug, Default)]
pub(super) struct MergedResults {
    /// Number of finished units.
    pub(super) units: u64,
    /// CPU time in seconds, with the number of units that report it, and the hosts.
    pub(super) seconds: f64,
    pub(super) timed: u64,
    pub(super) hosts: BTreeSet<String>,
    figures: Figures,
}

impl MergedResults {
    /// Merges the results that exist so far.
    pub(super) fn of(plan: &Plan, units: Range<u64>) -> Result<MergedResults> {
        let mut merged = MergedResults::default();
        for unit in units {
            let path = plan.result(unit);
            if !path.is_file() {
                continue;
            }
            let text = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
            let Ok(Outcome { figures, seconds, host }) = serde_json::from_slice(&text) else {
                bail!("{} is not the result of a unit; delete it, and the unit is run again", path.display());
            };
            merged.add(figures);
            merged.seconds += seconds.unwrap_or(0.0);
            merged.timed += u64::from(seconds.is_some());
            merged.hosts.insert(host);
        }
        Ok(merged)
    }

    fn add(&mut self, Figures(figures): Figures) {
        self.units += 1;
        figures.into_iter().for_each(|(name, figure)| self.figures.add(&name, figure));
    }

    /// Figures in words, one line each.
    pub(super) fn text(&self) -> String {
        let mut text = String::new();
        for (name, figure) in &self.figures.0 {
            let name = name.replace('_', " ");
            let _ = match figure {
                Figure::Count(count) => writeln!(text, "  {name}: {}", grouped(*count)),
                Figure::Names(names) => {
                    let all = names.iter().map(String::as_str).collect::<Vec<_>>().join(" ");
                    writeln!(text, "  {name}: {} ({all})", names.len())
                }
                Figure::Values(values) => {
                    text += &distribution(&name, values);
                    Ok(())
                }
            };
        }
        text
    }

    /// Counts of parts, whose names have two points or more: for a record of their own.
    pub(super) fn parts(&self) -> BTreeMap<&str, u64> {
        let counts = self.figures.0.iter().filter_map(|(name, figure)| match figure {
            Figure::Count(count) if is_of_a_part(name) => Some((name.as_str(), *count)),
            _ => None,
        });
        counts.collect()
    }

    /// Counts and extremes on one line, for the track record.
    pub(super) fn summary(&self) -> String {
        let figure = |(name, figure): (&String, &Figure)| {
            if is_of_a_part(name) {
                return None;
            }
            let name = name.replace('_', " ");
            match figure {
                Figure::Count(count) => Some(format!("{name} {}", grouped(*count))),
                Figure::Names(_) => None,
                Figure::Values(values) => {
                    let sorted = sorted(values);
                    let at = |percent| quantile(&sorted, percent).map_or(0.0, |(_, value)| value);
                    Some(format!("{name} {:.2} to {:.2}, median {:.2}", at(0.0), at(100.0), at(50.0)))
                }
            }
        };
        self.figures.0.iter().filter_map(figure).collect::<Vec<_>>().join("; ")
    }
}

/// A figure belongs to a part of what a campaign examines: `tracking.first.units.flips`.
fn is_of_a_part(name: &str) -> bool {
    name.matches('.').count() > 1
}

fn sorted(values: &[(u64, f64)]) -> Vec<(u64, f64)> {
    let mut sorted = values.to_vec();
    sorted.sort_by(|one, other| one.1.total_cmp(&other.1).then(one.0.cmp(&other.0)));
    sorted
}

/// Nearest-rank quantile of ascending values.
fn quantile(sorted: &[(u64, f64)], percent: f64) -> Option<(u64, f64)> {
    let rank = (percent / 100.0 * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied()
}

/// Quantiles of values, and the extremes with their seeds.
fn distribution(name: &str, values: &[(u64, f64)]) -> String {
    let sorted = sorted(values);
    let mut text = format!("  {name}: {} values\n", sorted.len());
    for percent in QUANTILES {
        if let Some((_, value)) = quantile(&sorted, percent) {
            let _ = writeln!(text, "    {percent:>3} % are at most {value:.2}");
        }
    }
    let list = |values: &mut dyn Iterator<Item = &(u64, f64)>| {
        let listed = values.take(LISTED).map(|(seed, value)| format!("{value:.2} (seed {seed})"));
        listed.collect::<Vec<_>>().join(", ")
    };
    let _ = writeln!(text, "    least: {}", list(&mut sorted.iter()));
    let _ = writeln!(text, "    greatest: {}", list(&mut sorted.iter().rev()));
    text
}

/// Decimal number with commas between thousands.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_read_from_a_programs_output() {
        let output = "running 1 test\ntest a::b ... figures: t1.programs=500 faults=data-address,halt mhz@3=131.25\n\
                      figures: t1.programs=20 faults=halt\nprograms=9\n";
        let figures = of_output(output).expect("there are some");
        let names = ["data-address", "halt"].map(str::to_owned).into();
        let expected = [
            ("t1.programs", Figure::Count(520)),
            ("faults", Figure::Names(names)),
            ("mhz", Figure::Values(vec![(3, 131.25)])),
        ];
        assert_eq!(figures.0, expected.map(|(name, figure)| (name.to_owned(), figure)).into());
        assert_eq!(of_output("test result: ok\n"), None);
    }

    /// The order in which units end does not affect the report.
    #[test]
    fn the_order_of_results_does_not_show() {
        let units: Vec<Figures> = (0..40)
            .map(|unit: u64| {
                let value = (unit * 7 % 13) as f64;
                Figures::count("programs", 100 + unit)
                    .and_values("error", vec![(unit, value), (unit + 100, value)])
            })
            .collect();
        let text = |order: &mut dyn Iterator<Item = &Figures>| {
            let mut merged = MergedResults::default();
            order.for_each(|figures| merged.add(figures.clone()));
            (merged.text(), merged.summary())
        };
        let forward = text(&mut units.iter());
        assert_eq!(forward, text(&mut units.iter().rev()));
        assert_eq!(forward, text(&mut units.iter().skip(17).chain(units.iter().take(17))));
        assert!(
            forward.0.contains("programs: 4,780\n") && forward.0.contains("error: 80 values\n"),
            "{}",
            forward.0
        );
        assert!(forward.0.contains("least: 0.00 (seed 0), 0.00 (seed 13), 0.00 (seed 26)"), "{}", forward.0);
        assert_eq!(forward.1, "error 0.00 to 12.00, median 6.00; programs 4,780");
    }

    #[test]
    fn results_are_read_as_they_were_written() {
        let figures =
            Figures::count("programs", 3).and_values("error", vec![(1, 0.25)]).and_values("none", Vec::new());
        let text = serde_json::to_string(&figures).expect("it is JSON");
        assert_eq!(serde_json::from_str::<Figures>(&text).expect("it is a result"), figures);
    }
}
