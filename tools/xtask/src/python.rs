// SPDX-License-Identifier: MIT OR Apache-2.0
//! Python package: builds the wheel, and runs the package's tests on the installed wheel.

use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::process::Command;
use takt_automation::command::{Report, output};
use takt_automation::command::{root, run};
use takt_automation::venv::{MODELS, Venv};

/// Wheel builder, pinned. (`pip install .` would fetch another version.)
pub(crate) const MATURIN: &str = "maturin==1.16.0";
/// Packages of the Python tests, in addition to [`MODELS`].
const TESTS: [&str; 7] = [
    "numpy==2.4.6",
    "pytest==9.2.0",
    "mypy==2.4.1",
    // Used by the examples for plots.
    "matplotlib==3.11.2",
    // Provides motor, bridge and carrier for the closed loop of `programs/servo`.
    "motulator==0.5.0",
    // A master for FMUs, and a maker of others.
    "fmpy==0.3.32",
    "pythonfmu==0.7.0",
];

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The folder of the wheel.
    #[arg(long, default_value = "target/wheels")]
    out: PathBuf,
}

/// Builds the wheel in the cargo profile of takt and the tests, so that shared crates are compiled once.
pub(crate) fn wheel(arguments: &Arguments) -> Result<()> {
    let wheel = build(&Venv::with(&[MATURIN])?, &root().join(&arguments.out), &[])?;
    println!("{}", wheel.display());
    Ok(())
}

/// Builds the wheel with additional maturin arguments.
pub(crate) fn build(venv: &Venv, out: &Path, arguments: &[&str]) -> Result<PathBuf> {
    std::fs::create_dir_all(out).with_context(|| format!("cannot make the folder {}", out.display()))?;
    // A new folder, so that it contains exactly one wheel.
    let fresh = out.join(format!(".{}", std::process::id()));
    let mut command = venv.command("maturin")?;
    command.args(["build", "--release", "--interpreter"]).arg(venv.tool("python3")).args(arguments);
    let built = run(command.arg("--out").arg(&fresh).current_dir(root())).and_then(|()| {
        let found = std::fs::read_dir(&fresh)?.collect::<Result<Vec<_>, _>>()?;
        let [wheel] = &found[..] else { bail!("maturin built {} wheels", found.len()) };
        let place = out.join(wheel.file_name());
        std::fs::rename(wheel.path(), &place)?;
        Ok(place)
    });
    // A leftover folder is harmless.
    let _ = std::fs::remove_dir_all(&fresh);
    built
}

/// Builds the package, installs it in the environment, and tests it there.
pub(crate) fn test() -> Result<Report> {
    let packages: Vec<&str> = [MATURIN].into_iter().chain(TESTS).chain(MODELS).collect();
    let venv = Venv::with(&packages)?;
    let wheel = build(&venv, &root().join("target/wheels"), &[])?;
    let python = || {
        let mut command = Command::new(venv.tool("python3"));
        command.current_dir(root()).args(["-I", "-m"]);
        command
    };
    let install =
        ["pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps", "--force-reinstall"];
    run(python().args(install).arg(&wheel))?;
    let checked = ["tools/python/takt", "tools/python/examples"];
    run(python().args(["mypy", "--strict", "--cache-dir", "target/mypy"]).args(checked))?;
    output(python().args(["pytest", "-q", "-p", "no:cacheprovider", "tools/python/tests"]))
}
