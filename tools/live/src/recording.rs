// SPDX-License-Identifier: MIT OR Apache-2.0
//! A recording of the scope as text.

use std::fmt::Write as _;
use takt_board::scope::Recording;
use takt_debug::value;

/// The recording in a line.
pub fn summary(recording: &Recording) -> String {
    let [first, .., last] = recording.periods[..] else {
        return "1 sample".to_owned();
    };
    let mut text = format!(
        "{} samples of {} channels, period {first} to {last}",
        recording.periods.len(),
        recording.channels.len()
    );
    if let Some((_, period)) = recording.trigger {
        let _ = write!(text, "; triggered in period {period}: {}", recording.causes.join(" and "));
    }
    if recording.is_stopped {
        text.push_str("; the last sample is what the program left when it stopped");
    }
    text
}

/// The values of a sample as text; a channel without a value has none.
pub fn cells(recording: &Recording, row: usize) -> impl Iterator<Item = String> {
    let channels = recording.channels.iter().zip(&recording.values);
    channels.map(move |((_, ty), values)| values[row].map_or(String::new(), |bits| value::text(*ty, bits)))
}

/// A table in CSV with a row for each sample.
pub fn table(recording: &Recording) -> String {
    let mut text = "period".to_owned();
    for (name, _) in &recording.channels {
        let quote = if name.contains(',') { "\"" } else { "" };
        let _ = write!(text, ",{quote}{name}{quote}");
    }
    text.push('\n');
    for (row, period) in recording.periods.iter().enumerate() {
        let _ = write!(text, "{period}");
        for cell in cells(recording, row) {
            let _ = write!(text, ",{cell}");
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt_isa::Type;

    #[test]
    fn a_table_leaves_cells_without_values_empty() {
        let recording = Recording {
            channels: vec![("x".to_owned(), Type::F), ("P[1,2]".to_owned(), Type::I)],
            periods: vec![7, 9, 10],
            values: vec![
                vec![None, Some(1.5f32.to_bits()), Some(f32::NAN.to_bits())],
                vec![Some(3), Some(u32::MAX), Some(u32::MAX)],
            ],
            trigger: Some((1, 9)),
            causes: vec!["`x > 1`".to_owned()],
            is_stopped: true,
        };
        assert_eq!(table(&recording), "period,x,\"P[1,2]\"\n7,,3\n9,1.5,-1\n10,NaN,-1\n");
    }
}
