//! The playground: compiled for browsers, bundled, and tested in one.

use crate::reach::{Toolchain, WASM};
use crate::{apt_install, cargo, root, run, works};
use anyhow::{Context, Result};
use clap::Args;
use std::path::Path;
use std::process::Command;

/// What to do with it.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Open it in a headless browser and test it.
    #[arg(long)]
    test: bool,
    /// Measure the controller's speed in the browser (with --test).
    #[arg(long, requires = "test")]
    bench: bool,
    /// Keep pictures of the page in this folder (with --test).
    #[arg(long, value_name = "FOLDER", requires = "test")]
    screenshots: Option<std::path::PathBuf>,
}

/// Where the page is built; any file server can serve it.
pub(crate) const PAGE: &str = "target/playground";
/// What is compiled on the way.
const TARGET: &str = "target/web";
const BINDGEN: &str = "target/bindgen";

pub(crate) fn web(arguments: &Arguments) -> Result<()> {
    build()?;
    if arguments.test {
        test(arguments)?;
    }
    Ok(())
}

/// Builds the page.
pub(crate) fn build() -> Result<()> {
    let mut compile = Toolchain::find(&[WASM])?.cargo("build", WASM, TARGET);
    run(compile.args(["--release", "-p", "takt-web"]))?;
    let glue = format!("{TARGET}/glue");
    let mut bindgen = cargo();
    bindgen.args([
        "run",
        "--quiet",
        "--manifest-path",
        "web/bindgen/Cargo.toml",
        "--target-dir",
        BINDGEN,
        "--",
    ]);
    run(bindgen.arg(format!("{TARGET}/{WASM}/release/takt_web.wasm")).arg(&glue))?;
    let page = packages()?;
    let mut bundle = Command::new("node");
    run(bundle.arg("build.mjs").arg(root().join(glue)).arg(root().join(PAGE)).current_dir(page))?;
    eprintln!(
        "the playground is in {PAGE}: `python3 -m http.server -d {PAGE}` serves it on http://localhost:8000"
    );
    Ok(())
}

/// The page's folder, with what it needs from npm in the versions that are written down.
fn packages() -> Result<std::path::PathBuf> {
    if !works("node", "--version") || !works("npm", "--version") {
        apt_install(&["nodejs", "npm"])?;
    }
    let page = root().join("web/page");
    let lock = |path: &Path| std::fs::metadata(path).and_then(|about| about.modified()).ok();
    let installed = lock(&page.join("node_modules/.package-lock.json"));
    if installed.is_none() || installed < lock(&page.join("package-lock.json")) {
        run(Command::new("npm").args(["ci", "--no-audit", "--no-fund"]).current_dir(&page))?;
    }
    Ok(page)
}

fn test(arguments: &Arguments) -> Result<()> {
    if !works("chromium", "--version") {
        apt_install(&["chromium"])?;
    }
    let mut tests = Command::new("node");
    tests.args(["--test", "--test-reporter=spec", "test/"]).current_dir(root().join("web/page"));
    tests.env("TAKT_PAGE", root().join(PAGE));
    if arguments.bench {
        tests.env("TAKT_BENCH", "1");
    }
    if let Some(folder) = &arguments.screenshots {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        tests.env("TAKT_SCREENSHOTS", std::path::absolute(folder)?);
    }
    run(&mut tests)
}
