// SPDX-License-Identifier: MIT OR Apache-2.0
//! Files that are no FMUs, or none that run here.

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use takt_fmu_plant::{Fmu, FmuError, FmuPlant};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

const DESCRIPTION: &str = "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"m\" guid=\"g\"><CoSimulation modelIdentifier=\"m\"/>\
     <ModelVariables><ScalarVariable name=\"u\" valueReference=\"0\" causality=\"input\"><Real start=\"0\"/></ScalarVariable>\
     <ScalarVariable name=\"w\" valueReference=\"1\" causality=\"output\"><Real/></ScalarVariable></ModelVariables></fmiModelDescription>";

/// Folder of this crate's test files.
fn folder() -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("archive");
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn archive(name: &str, files: &[(&str, &[u8])]) -> PathBuf {
    let path = folder().join(name);
    let mut zip = ZipWriter::new(File::create(&path).unwrap());
    for (name, bytes) in files {
        zip.start_file(*name, SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap();
    path
}

fn refused(path: &Path) -> String {
    Fmu::open(path).unwrap_err().to_string()
}

#[test]
fn files_that_cannot_run_are_refused_by_name() {
    let text = folder().join("text.fmu");
    std::fs::write(&text, "text").unwrap();
    assert!(refused(&folder().join("none.fmu")).contains("none.fmu: cannot be read"));
    assert!(refused(&text).contains("text.fmu: it is no FMU, which is a zip archive"));
    let described = ("modelDescription.xml", DESCRIPTION.as_bytes());
    for (name, files, expected) in [
        ("nothing.fmu", &[("a", &b""[..])][..], "has no modelDescription.xml"),
        ("bytes.fmu", &[("modelDescription.xml", &b"\xff"[..])], "modelDescription.xml cannot be read"),
        ("xml.fmu", &[("modelDescription.xml", &b"<a>"[..])], "is no XML"),
        ("empty.fmu", &[described], "no library at all"),
        ("win.fmu", &[described, ("binaries/win64/m.dll", &b"MZ"[..])], "libraries for win64"),
        (
            "outside.fmu",
            &[described, ("binaries/linux64/m.so", &b""[..]), ("../../x", &b""[..])],
            "outside of its folder: ../../x",
        ),
    ] {
        let error = refused(&archive(name, files));
        assert!(error.contains(expected) && error.contains(name), "{error}");
    }
}

#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn unpacked_folders_are_removed() {
    let files = [
        ("modelDescription.xml", DESCRIPTION.as_bytes()),
        ("binaries/linux64/m.so", b"no library"),
        ("sources/m.c", b""),
    ];
    let fmu = Fmu::open(&archive("m.fmu", &files)).unwrap();
    assert_eq!((fmu.description.name.as_str(), fmu.description.variables.len()), ("m", 2));
    // A process that ends at once, and variables that do not exist.
    let start = |values: &[(String, f64)]| {
        let fmu = Fmu::open(&folder().join("m.fmu")).unwrap();
        FmuPlant::new(fmu, Command::new("false"), values, 1e-3, 1, 1.0).unwrap_err()
    };
    assert!(matches!(
        start(&[("u".to_owned(), 1.0), ("x".to_owned(), 1.0)]),
        FmuError::Start { index: 1, .. }
    ));
    assert!(matches!(start(&[("w".to_owned(), 1.0)]), FmuError::Start { index: 0, .. }));
    let error = start(&[]).to_string();
    assert!(error.contains("its process broke down in its start: exit status: 1"), "{error}");
    let mine = format!("takt-fmu-{}-", std::process::id());
    let left = || {
        let entries = std::fs::read_dir(std::env::temp_dir()).unwrap().flatten();
        entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(&mine)).count()
    };
    assert!(left() >= 1);
    drop(fmu);
    assert_eq!(left(), 0);
}
