//! `takt-bindgen IN.wasm FOLDER`: the JavaScript around the playground's WebAssembly, as `wasm-bindgen --target web` writes it.
//! That command brings 200 crates for what it does beyond; this is its library.

use anyhow::{Context, Result};
use std::env::args_os;
use wasm_bindgen_cli_support::Bindgen;

fn main() -> Result<()> {
    let mut arguments = args_os().skip(1);
    let input = arguments.next().context("usage: takt-bindgen IN.wasm FOLDER")?;
    let folder = arguments.next().context("usage: takt-bindgen IN.wasm FOLDER")?;
    Bindgen::new()
        .input_path(&input)
        .web(true)?
        .typescript(false)
        .remove_name_section(true)
        .remove_producers_section(true)
        .out_name("takt")
        .generate(&folder)
}
