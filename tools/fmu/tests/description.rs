// SPDX-License-Identifier: MIT OR Apache-2.0
//! The description of the variables, in both versions, and the file.

use crate::common::model;
use takt_fmu::description::{Fmi, write};
use takt_fmu::{ArchiveError, Fmu};

#[test]
fn descriptions() {
    let model = model();
    let two = write(&model, "a <law> & \"order\"\u{1}", "law", Fmi::Two);
    let three = write(&model, "law", "law", Fmi::Three);
    for text in [&two, &three] {
        let document = roxmltree::Document::parse(text).unwrap();
        assert_eq!(document.root_element().tag_name().name(), "fmiModelDescription");
    }
    let token = model.token();
    let version = concat!("Takt ", env!("CARGO_PKG_VERSION"));
    let fixed = |text: &str| text.replace(&token, "{token}").replace(version, "Takt {version}");
    insta::assert_snapshot!("fmi2", fixed(&two));
    insta::assert_snapshot!("fmi3", fixed(&three));
}

#[test]
fn only_the_library_goes_into_an_fmu() {
    let model = model();
    let with = |library: &[u8]| Fmu { model: &model, name: "law", fmi: Fmi::Two, library }.to_bytes();
    assert!(matches!(with(b""), Err(ArchiveError::Platform)));
    assert!(matches!(with(b"MZ\x90\0"), Err(ArchiveError::Platform)));
    let mut elf = b"\x7fELF\x02\x01\x01\0\0\0\0\0\0\0\0\0\x03\0\x3e\0".to_vec();
    assert!(matches!(with(&elf), Err(ArchiveError::Foreign("fmi2DoStep"))));
    elf.extend(b"fmi2DoStep\0fmi3DoStep\0takt.json");
    assert!(with(&elf).is_ok_and(|bytes| bytes.starts_with(b"PK")));
    elf[18] = 0xb7;
    assert!(matches!(with(&elf), Err(ArchiveError::Platform)), "another processor");
}
