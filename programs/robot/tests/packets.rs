// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tables of the numbers on the link: Rust and assembly agree.

use takt_robot::packet::{
    Cause, FLAG_CHECK, FLAG_VIA, How, JogMode, Kind, MAGIC, PAYLOAD_WORDS, Profile, ReportKind,
};

/// Constants of packets.s, from lines `.const NAME = value`.
fn constants() -> Vec<(String, u32)> {
    let (_, text) = takt_programs::THREE.iter().find(|(name, _)| *name == "packets.s").expect("the file");
    let number = |text: &str| match text.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    };
    let constant = |line: &str| {
        let (name, value) = line.strip_prefix(".const")?.split_once('=')?;
        Some((name.trim().to_owned(), number(value.split(';').next()?.trim())?))
    };
    text.lines().filter_map(constant).collect()
}

#[test]
fn assembly_has_the_same_numbers() {
    macro_rules! rows {
        ($prefix:literal, $table:ty) => {
            <$table>::ALL
                .iter()
                .map(|row| (format!("{}_{}", $prefix, row.name().to_uppercase()), row.number()))
        };
    }
    let mut expected: Vec<(String, u32)> = vec![
        ("MAGIC".to_owned(), MAGIC),
        ("PAYLOAD_WORDS".to_owned(), PAYLOAD_WORDS as u32),
        ("FLAG_VIA".to_owned(), FLAG_VIA),
        ("FLAG_CHECK".to_owned(), FLAG_CHECK),
    ];
    expected.extend(rows!("KIND", Kind));
    expected.extend(rows!("PROFILE", Profile));
    expected.extend(rows!("HOW", How));
    expected.extend(rows!("JOG", JogMode));
    expected.extend(rows!("REPORT", ReportKind));
    expected.extend(rows!("CAUSE", Cause));
    let known = constants();
    for (name, number) in &expected {
        let found = known.iter().find(|(known, _)| known == name);
        assert_eq!(found.map(|(_, number)| number), Some(number), "{name}");
    }
    // Assembly has no constant that Rust lacks.
    let prefixes = ["KIND_", "PROFILE_", "HOW_", "JOG_", "REPORT_", "CAUSE_", "FLAG_"];
    for (name, _) in known.iter().filter(|(name, _)| prefixes.iter().any(|prefix| name.starts_with(prefix))) {
        // The second half of LIMITS exists only between the cores.
        let inner = name == "KIND_TORQUES";
        assert!(inner || expected.iter().any(|(known, _)| known == name), "{name}");
    }
}
