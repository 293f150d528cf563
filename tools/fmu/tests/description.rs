// SPDX-License-Identifier: MIT OR Apache-2.0
//! The description of the variables, in both versions, and the file.

use crate::common::{model, system_model};
use takt_fmu::description::{Fmi, write};
use takt_fmu::{ArchiveError, Fmu, Library};

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
    let fixed = |text: &str| text.replace(&token, "{token}").replace(VERSION, "Takt {version}");
    insta::assert_snapshot!("fmi2", fixed(&two));
    insta::assert_snapshot!("fmi3", fixed(&three));
}

#[test]
fn systems() {
    let model = system_model();
    let two = write(&model, "system", "system", Fmi::Two);
    assert!(roxmltree::Document::parse(&two).is_ok());
    insta::assert_snapshot!(
        "system_fmi2",
        two.replace(&model.token(), "{token}").replace(VERSION, "Takt {version}")
    );
}

const VERSION: &str = concat!("Takt ", env!("CARGO_PKG_VERSION"));

/// Header of a library for Linux, and one for Windows, with the names that Takt's has.
fn libraries() -> [Vec<u8>; 2] {
    let mut elf = b"\x7fELF\x02\x01\x01\0\0\0\0\0\0\0\0\0\x03\0\x3e\0".to_vec();
    let mut dll = vec![0; 0x80];
    dll[..2].copy_from_slice(b"MZ");
    dll[0x3c] = 0x60;
    dll[0x60..0x66].copy_from_slice(b"PE\0\0\x64\x86");
    dll[0x60 + 23] = 0x20;
    [&mut elf, &mut dll].iter_mut().for_each(|library| library.extend(b"fmi2DoStep\0fmi3DoStep\0takt.json"));
    [elf, dll]
}

#[test]
fn only_the_library_goes_into_an_fmu() {
    let is_platform = |library: &[u8]| matches!(Library::new(library.to_vec()), Err(ArchiveError::Platform));
    let [elf, dll] = libraries();
    assert!(
        is_platform(b"") && is_platform(b"MZ\x90\0") && is_platform(&elf[..18]) && is_platform(&dll[..0x70])
    );
    assert!(matches!(Library::new(elf[..20].to_vec()), Err(ArchiveError::Foreign("fmi2DoStep"))));
    assert!(matches!(Library::new(dll[..0x80].to_vec()), Err(ArchiveError::Foreign("fmi2DoStep"))));
    for (library, place, value) in [
        (&elf, 18, 0xb7), // another processor
        (&elf, 16, 2),    // a program
        (&dll, 0x64, 0x4c),
        (&dll, 0x60 + 23, 0),
        (&dll, 0x3f, 0xff), // the header far behind the end
    ] {
        let mut other = library.clone();
        other[place] = value;
        assert!(is_platform(&other), "{place}");
    }
}

#[test]
fn each_platform_has_its_folder() {
    let model = model();
    let [linux, windows] = libraries().map(|bytes| Library::new(bytes).unwrap());
    let names = |fmi, libraries: &[Library]| -> Result<Vec<String>, ArchiveError> {
        let bytes = Fmu { model: &model, name: "law", fmi, libraries }.to_bytes()?;
        let archive = zip::ZipArchive::new(std::io::Cursor::new(bytes))?;
        let names = archive.file_names().map(|name| name.map(|name| name.into_owned()));
        let names = names.collect::<Result<Vec<String>, _>>()?;
        Ok(names.into_iter().filter(|name| name.starts_with("binaries")).collect())
    };
    let both = [windows.clone(), linux.clone()];
    assert_eq!(names(Fmi::Two, &both).unwrap(), ["binaries/linux64/law.so", "binaries/win64/law.dll"]);
    let three = ["binaries/x86_64-linux/law.so", "binaries/x86_64-windows/law.dll"];
    assert_eq!(names(Fmi::Three, &both).unwrap(), three);
    assert_eq!(names(Fmi::Two, std::slice::from_ref(&windows)).unwrap(), ["binaries/win64/law.dll"]);
    assert!(matches!(names(Fmi::Two, &[]), Err(ArchiveError::Missing)));
    let twice = names(Fmi::Two, &[linux.clone(), linux]).unwrap_err().to_string();
    assert_eq!(twice, "two libraries are for Linux, and an FMU holds one for each platform");
}
