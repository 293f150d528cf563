// SPDX-License-Identifier: MIT OR Apache-2.0
//! Playground: compilation to WebAssembly, bundling, and tests in a browser.

use crate::reach::{Toolchain, WASM};
use anyhow::{Context, Result};
use clap::Args;
use std::path::{Path, PathBuf};
use std::process::Command;
use takt_automation::command::{apt_install, cargo, root, run, works};
use takt_automation::progress;

/// The steps beyond building the page.
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
    screenshots: Option<PathBuf>,
    /// Write the documents' pictures of it: docs/pictures/loop.svg, which moves, and docs/pictures/playground.png.
    #[arg(long)]
    pictures: bool,
    /// Serve it on http://localhost:8000, until Ctrl-C.
    #[arg(long)]
    serve: bool,
}

/// Folder of the finished page; any file server can serve it.
pub(crate) const PAGE: &str = "target/playground";
/// Build folder of the page.
const TARGET: &str = "target/web";
/// The compiled module.
const COMPILED: &str = "target/web/wasm32-unknown-unknown/release/takt_web.wasm";
/// The compiled module of the page of a board.
const LIVE: &str = "target/web/wasm32-unknown-unknown/release/takt_live.wasm";

/// Cargo settings for a small download: optimisation for size, most of all of what runs rarely, and link-time optimisation.
const SMALL: [&str; 17] = [
    "profile.release.opt-level=\"s\"",
    "profile.release.lto=\"fat\"",
    "profile.release.codegen-units=1",
    "profile.release.package.takt-syntax.opt-level=\"s\"",
    "profile.release.package.takt-debug.opt-level=\"z\"",
    "profile.release.package.takt-diagnostics.opt-level=\"z\"",
    "profile.release.package.takt-editor.opt-level=\"z\"",
    "profile.release.package.takt-programs.opt-level=\"z\"",
    "profile.release.package.takt-system.opt-level=\"z\"",
    "profile.release.package.takt-robot.opt-level=\"z\"",
    "profile.release.package.takt-rtl.opt-level=\"z\"",
    "profile.release.package.takt-web.opt-level=\"z\"",
    "profile.release.package.takt-live.opt-level=\"z\"",
    "profile.release.package.takt-board.opt-level=\"z\"",
    "profile.release.package.toml.opt-level=\"z\"",
    "profile.release.package.serde_json.opt-level=\"z\"",
    "profile.release.package.lsp-types.opt-level=\"z\"",
];

pub(crate) fn web(arguments: &Arguments) -> Result<()> {
    build()?;
    if arguments.pictures {
        pictures()?;
    }
    if arguments.test {
        test(arguments)?;
    }
    match arguments.serve {
        true => serve(),
        false => {
            eprintln!(
                "the playground is in {PAGE}: `cargo xtask web --serve` serves it, as any file server does"
            );
            Ok(())
        }
    }
}

/// Builds the playground's page.
pub(crate) fn build() -> Result<()> {
    // One type of crate: cargo optimises no library at link time that is also compiled for other crates.
    let toolchain = Toolchain::find(&[WASM])?;
    for (package, what) in
        [("takt-web", "compiling the playground"), ("takt-live", "compiling the page of a board")]
    {
        let mut compile = toolchain.cargo("rustc", WASM, TARGET);
        compile.args(["--release", "-p", package, "--crate-type", "cdylib"]);
        // The project's profile favours compile time; the page favours size. Hot crates keep their optimisation level.
        for small in SMALL {
            compile.args(["--config", small]);
        }
        // Link-time optimisation is a minute or more without a line of cargo's.
        progress::step(what, || run(&mut compile))?;
    }
    let page = packages()?;
    let mut bundle = Command::new("node");
    bundle
        .arg("build.mjs")
        .arg(root().join(COMPILED))
        .arg(root().join(LIVE))
        .arg(root().join(PAGE))
        .current_dir(page);
    progress::step("bundling the playground", || run(&mut bundle))
}

/// Serves the page until somebody ends it.
fn serve() -> Result<()> {
    let mut server = Command::new("node");
    run(server.args(["serve.mjs", "8000"]).arg(root().join(PAGE)).current_dir(packages()?))
}

/// Draws the pictures of the documents.
fn pictures() -> Result<()> {
    chromium()?;
    for (script, from, to) in
        [("moving.mjs", COMPILED, "loop.svg"), ("photograph.mjs", PAGE, "playground.png")]
    {
        let mut draw = Command::new("node");
        draw.arg(script).arg(root().join(from)).arg(root().join("docs/pictures").join(to));
        run(draw.current_dir(packages()?))?;
    }
    Ok(())
}

/// Installs the browser, if it is missing.
fn chromium() -> Result<()> {
    if works("chromium", "--version") { Ok(()) } else { apt_install(&["chromium"]) }
}

/// Folder of the page, with npm packages in pinned versions.
fn packages() -> Result<PathBuf> {
    if !works("node", "--version") || !works("npm", "--version") {
        apt_install(&["nodejs", "npm"])?;
    }
    let page = root().join("tools/web/page");
    let lock = |path: &Path| std::fs::metadata(path).and_then(|about| about.modified()).ok();
    let installed = lock(&page.join("node_modules/.package-lock.json"));
    if installed.is_none() || installed < lock(&page.join("package-lock.json")) {
        let mut install = Command::new("npm");
        install.args(["ci", "--no-audit", "--no-fund"]).current_dir(&page);
        progress::step("npm's packages of the playground", || run(&mut install))?;
    }
    Ok(page)
}

fn test(arguments: &Arguments) -> Result<()> {
    let page = root().join(PAGE);
    let mut environment = vec![("TAKT_PAGE", page.as_path())];
    if arguments.bench {
        environment.push(("TAKT_BENCH", Path::new("1")));
    }
    let folder = arguments.screenshots.as_ref().map(std::path::absolute).transpose()?;
    if let Some(folder) = &folder {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        environment.push(("TAKT_SCREENSHOTS", folder));
    }
    in_browser("test/page.test.mjs", &environment)?;
    // The page of `takt live serve`, which shares its style and parts.
    run(cargo().args(["build", "--release", "-p", "takt", "--features", "full"]))?;
    let takt = root().join("target/release/takt");
    environment.push(("TAKT", &takt));
    in_browser("test/live.test.mjs", &environment)
}

/// Runs a test of the page's folder in a headless browser.
pub(crate) fn in_browser(test: &str, environment: &[(&str, &Path)]) -> Result<()> {
    chromium()?;
    let mut tests = Command::new("node");
    tests.args(["--test", "--test-reporter=spec", test]).current_dir(packages()?);
    run(tests.envs(environment.iter().copied()))
}
