// SPDX-License-Identifier: MIT OR Apache-2.0
//! Downloads: image, circuit, header.

use crate::program::LoadedProgram;
use serde::Deserialize;
use serde_json::{Value, json};
use takt_rtl::header::{Header, Language};
use takt_rtl::{Library, bench, export};

/// Maximum number of input rows in the test bench.
const BENCH_PERIODS: usize = 100;

pub(crate) fn image(loaded: &LoadedProgram) -> Result<Vec<u8>, String> {
    let assembled = &loaded.assembled;
    takt_asm::image::write_with(&assembled.program, Some(&assembled.debug_info()))
        .map_err(|error| error.to_string())
}

/// Verilog of the machine, with a test bench that runs the program: file names and texts.
pub(crate) fn verilog(loaded: &LoadedProgram) -> Result<Value, String> {
    let program = &loaded.assembled.program;
    let design = export(program.machine, &Library::builtin()).map_err(|error| error.to_string())?;
    let design = design.latching(program.latched_inputs()).map_err(|error| error.to_string())?;
    let rows = loaded.rows.as_ref().map_or(&[][..], |rows| rows.as_slice());
    let rows = &rows[..rows.len().min(BENCH_PERIODS)];
    let files = bench::folder(&design, Some(program), rows);
    let files = files.into_iter().map(|file| json!({ "name": file.name, "text": file.text }));
    Ok(json!({ "top": design.top, "files": files.collect::<Vec<_>>() }))
}

#[derive(Deserialize)]
struct ExportRequest {
    language: String,
}

/// Header for the host: ports and addresses of the program.
pub(crate) fn header(loaded: &LoadedProgram, params: Value) -> Result<Value, String> {
    let ExportRequest { language } = crate::parameters("header", params)?;
    let language = match language.as_str() {
        "c" => Language::C,
        "rust" => Language::Rust,
        "json" => Language::Json,
        "svd" => Language::Svd,
        other => return Err(format!("there is no header in `{other}` (languages: c, rust, json, svd)")),
    };
    let stem = loaded.name.strip_suffix(".s").unwrap_or(&loaded.name);
    let program = &loaded.assembled.program;
    Ok(Value::from(Header::new(program, stem, takt_analysis::section_cycles(program)).text(language)))
}
