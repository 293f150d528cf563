// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cycles of the kernels of `programs/taclebench` on other processors: a simulated RISC-V core, and a performance model of the Cortex-M7.

use anyhow::{Context, Result, bail};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::ops::Range;
use std::process::Command;
use takt_automation::command::{apt_install, output_of, root, works};
use takt_automation::venv::Venv;

/// CV32E40P with the floating-point unit CVFPU, in SystemVerilog.
const CORE: &str = "pythondata-cpu-cv32e40p==1.0.1.post1909";

/// Required programs: name, an argument that tests it, Debian package.
const TOOLS: [(&str, &str, &str); 6] = [
    ("riscv64-unknown-elf-gcc", "--version", "gcc-riscv64-unknown-elf"),
    ("clang-16", "--version", "clang-16"),
    ("ld.lld-16", "--version", "lld-16"),
    ("llvm-mca-16", "--version", "llvm-16"),
    ("qemu-arm", "--version", "qemu-user"),
    ("verilator", "--version", "verilator"),
];

/// Document with the table, and the marker before it.
const DOCUMENT: &str = "docs/library.md";
const MARKER: &str = "<!-- table: others -->\n";
const HEAD: &str =
    "| program | t3 | t1 | t4 | CV32E40P with CVFPU | Cortex-M7, model |\n|---|---|---|---|---|---|\n";

/// Marker before the table of Takt's own cycles, which a test of `takt-programs` checks.
const OWN: &str = "<!-- table: taclebench -->\n";

/// Byte range of the table rows after a marker.
fn rows(text: &str, marker: &str) -> Result<Range<usize>> {
    let start = text.find(marker).with_context(|| format!("{DOCUMENT} has no {marker}"))? + marker.len();
    let rows = text[start..].split_inclusive('\n').take_while(|line| line.starts_with('|'));
    Ok(start..start + rows.map(str::len).sum::<usize>())
}

/// Installs the tools, counts the cycles, and writes the table to the document.
pub(crate) fn compare() -> Result<()> {
    let missing: Vec<&str> =
        TOOLS.iter().filter(|(tool, ask, _)| !works(tool, ask)).map(|(.., package)| *package).collect();
    if !missing.is_empty() {
        apt_install(&missing)?;
    }
    let venv = Venv::with(&[CORE])?;
    let find = "import pythondata_cpu_cv32e40p as core; print(core.data_location)";
    let core = output_of(Command::new(venv.tool("python3")).args(["-I", "-c", find]))?;
    let mut count = Command::new(venv.tool("python3"));
    count.arg(root().join("benches/others/run.py")).arg(core.trim()).arg(root().join("target/others"));
    let counted = output_of(&mut count)?;
    let counted: BTreeMap<String, BTreeMap<String, u64>> =
        serde_json::from_str(&counted).context("run.py's answer")?;

    let path = root().join(DOCUMENT);
    let text = fs::read_to_string(&path)?;
    let mut table = HEAD.to_owned();
    for row in text[rows(&text, OWN)?].lines().skip(2) {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let [_, name, _, t3, _, t1, _, t4, ..] = cells[..] else { bail!("{DOCUMENT}: {row}") };
        let kernel = name.trim_matches('`').trim_end_matches(".s");
        let other = |processor: &str| {
            let cycles = counted.get(kernel).and_then(|cycles| cycles.get(processor));
            cycles.with_context(|| format!("run.py has no {kernel} on {processor}"))
        };
        let (riscv, arm) = (other("riscv")?, other("arm")?);
        let _ = writeln!(table, "| {name} | {t3} | {t1} | {t4} | {riscv} | {arm} |");
    }
    print!("{table}");
    let mut new = text.clone();
    new.replace_range(rows(&text, MARKER)?, &table);
    fs::write(&path, new)?;
    Ok(())
}
