// SPDX-License-Identifier: MIT OR Apache-2.0
//! Units for the tests: shell scripts in separate folders.

use std::path::PathBuf;
use std::time::Duration;
use takt_work::Unit;

/// Creates an empty folder.
pub(crate) fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("work").join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("the folder for tests can be written");
    folder
}

/// A unit that runs a shell script; `$R` is its result file.
pub(crate) fn unit(folder: &std::path::Path, name: &str, script: &str) -> Unit {
    let result = folder.join(name);
    let script = format!("R={}; {script}", result.display());
    let command = ["sh", "-c", &script].map(str::to_owned).to_vec();
    Unit {
        name: name.to_owned(),
        command,
        folder: folder.to_owned(),
        result,
        cpus: 1,
        time: Duration::from_secs(5),
    }
}
