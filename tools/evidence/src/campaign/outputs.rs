// SPDX-License-Identifier: MIT OR Apache-2.0
//! Figures from outputs that are also meant for other readers: `takt track --monte-carlo --json`, libFuzzer.

use crate::campaign::figures::Figures;
use anyhow::{Context, Result};
use serde_json::Value;

/// Figures of a group of robots.
pub(super) fn robots(output: &str) -> Result<Figures> {
    let json: Value = serde_json::from_str(output).context("`takt track --json` printed no JSON")?;
    let count =
        |name: &str| json[name].as_u64().with_context(|| format!("`takt track --json` gave no `{name}`"));
    let drives = json["drives"].as_array().context("`takt track --json` gave no `drives`")?;
    let ended = drives.iter().filter(|drive| drive["failure"].is_null());
    let errors = |name: &'static str| {
        let error = move |drive: &Value| {
            Some((drive["seed"].as_u64()?, drive["tracking_error_m"][name].as_f64()? * 1e6))
        };
        ended.clone().filter_map(error).collect::<Vec<_>>()
    };
    let missed = drives.iter().filter_map(|drive| drive["deadlines_missed"].as_u64()).sum();
    Ok(Figures::count("robots", count("robots")?)
        .and_count("robots_within_the_requirement", count("kept")?)
        .and_count("robots_that_did_not_end", count("failed")?)
        .and_count("periods", count("robots")? * count("periods")?)
        .and_count("deadlines_missed", missed)
        .and_values("largest_error_while_cutting,_µm", errors("cutting"))
        .and_values("largest_error,_µm", errors("overall")))
}

/// Figures of a libFuzzer run, from its last line: `Done 50000 runs in 37 second(s)`.
pub(super) fn fuzzed(target: &str, output: &str) -> Result<Figures> {
    let words = output.lines().rev().find_map(|line| line.strip_prefix("Done "));
    let runs = words.and_then(|words| words.split(' ').next()?.parse().ok());
    Ok(Figures::count(&format!("inputs_of_{target}"), runs.context("libFuzzer did not say how much it ran")?))
}

/// Mutation score of a part, from its output: `… 95 of 100 mutants found, …`.
pub(super) fn mutants(part: &str, output: &str) -> Result<Figures> {
    let words: Vec<&str> = output.split_whitespace().collect();
    let mut score = words.windows(5).filter_map(|words| match words {
        [found, "of", all, "mutants", rest] if rest.starts_with("found") => {
            found.parse().ok().zip(all.parse().ok())
        }
        _ => None,
    });
    let (found, all) = score.next_back().context("`cargo evidence mutants` printed no score")?;
    Ok(Figures::count(&format!("{part}.mutants"), all).and_count(&format!("{part}.found"), found))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::figures::of_output;

    #[test]
    fn scores_are_read() {
        let expected = of_output("figures: core.mutants=44 core.found=43");
        assert_eq!(
            mutants("core", "core: 43 of 44 mutants found, 97.7 %; 2 more are no faults\n").ok(),
            expected
        );
        assert!(mutants("core", "").is_err());
    }

    #[test]
    fn libfuzzers_last_words_are_read() {
        let output = "#50000\tDONE   cov: 5713 ft: 22014\nDone 50000 runs in 37 second(s)\n";
        let expected = of_output("figures: inputs_of_image=50000");
        assert_eq!(fuzzed("image", output).ok(), expected);
        assert!(fuzzed("image", "==1== ERROR: libFuzzer: deadly signal\n").is_err());
    }
}
