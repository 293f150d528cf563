// SPDX-License-Identifier: MIT OR Apache-2.0
//! Playground: the services that Takt provides to a web page.
//!
//! [`Playground::call`] takes a method with JSON parameters and answers in JSON, so that everything can be tested without a browser. In a
//! browser, `exports` passes the texts. The page in `page/` contains no knowledge of the language: colours, diagnostics and completion
//! come from [`takt_editor::lsp`], the pipeline diagram from [`takt_analysis::picture`].
//!
//! | method | effect |
//! |---|---|
//! | `about` | machines, examples, limits |
//! | `lsp`, `lsp.check`, `lsp.schedule` | messages to and from the language server |
//! | `assemble` | assembles, bounds the cycles, opens a debug session |
//! | `execute` | executes a command of the debugger's console |
//! | `activity` | the machine, and what its slots, units and banks do at the debugger's position |
//! | `run` | runs periods on the emulator, a slice per call |
//! | `track` | runs periods of the closed loop along the AGH path |
//! | `source` | text of a file that a program includes |
//! | `picture` | pipeline diagram as data |
//! | `bundles` | the program's bundles, each operation with its source line |
//! | `listing`, `header`, `verilog`, `image` | downloads |
//!
//! The crate has no clock and never waits: the caller divides long work into calls.

mod activity;
mod constants;
mod examples;
mod export;
#[cfg(target_arch = "wasm32")]
mod exports;
mod language;
mod plant;
mod program;
mod run;
mod track;
mod view;

use program::LoadedProgram;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use takt_debug::console::Console;
use takt_editor::lsp::Inline;
use takt_isa::Machine;
use takt_isa::timing::Cycle;

/// Cycle limit of a period or of a debugger command: about a second in a browser.
pub const CYCLES: Cycle = 20_000_000;
/// Maximum number of input rows, and of periods in a run.
pub const PERIODS: usize = 100_000;
/// Maximum size of a source in bytes.
pub const SOURCE_BYTES: usize = 4 << 20;

/// State of the page: language server, loaded program, debug session, and runs.
pub struct Playground {
    language: Inline,
    loaded: Option<LoadedProgram>,
    console: Option<Console>,
    run: Option<run::Run>,
    track: Option<track::Track>,
}

impl Default for Playground {
    fn default() -> Playground {
        Playground::new(takt_isa::MACHINES[0])
    }
}

/// Deserialises the parameters of a method.
fn parameters<P: DeserializeOwned>(method: &str, params: Value) -> Result<P, String> {
    serde_json::from_value(params).map_err(|error| format!("the parameters of `{method}`: {error}"))
}

impl Playground {
    /// A playground whose language server assembles for a machine.
    pub fn new(machine: &'static Machine) -> Playground {
        let language = language::server(machine);
        Playground { language, loaded: None, console: None, run: None, track: None }
    }

    /// Answers a request from the page.
    ///
    /// # Errors
    /// If the request is invalid; the message is for the user.
    pub fn call(&mut self, method: &str, params: Value) -> Result<Value, String> {
        #[derive(Deserialize)]
        struct MachineParameters {
            machine: String,
        }
        match method {
            "about" => Ok(examples::about()),
            "lsp.start" => {
                let MachineParameters { machine: name } = parameters(method, params)?;
                self.language = language::server(program::machine(&name)?);
                Ok(Value::Null)
            }
            "lsp" => language::receive(&mut self.language, params),
            "lsp.check" => language::check(&mut self.language),
            "lsp.schedule" => language::schedule(&mut self.language),
            "assemble" => self.assemble(parameters(method, params)?),
            "execute" => self.execute(parameters(method, params)?),
            "run" => self.run(parameters(method, params)?),
            "track" => self.track(parameters(method, params)?),
            "source" => examples::source(parameters(method, params)?),
            "activity" => self.activity(),
            "bundles" => self.bundles(),
            "picture" => self.picture(parameters(method, params)?),
            "listing" => Ok(Value::from(takt_asm::listing::listing(&self.loaded()?.assembled))),
            "header" => export::header(self.loaded()?, params),
            "verilog" => export::verilog(self.loaded()?),
            _ => Err(format!("the playground has no `{method}`")),
        }
    }

    /// Image of the loaded program, with debug information.
    ///
    /// # Errors
    /// If no program is loaded, or if the image format cannot hold it.
    pub fn image(&self) -> Result<Vec<u8>, String> {
        export::image(self.loaded()?)
    }

    fn loaded(&self) -> Result<&LoadedProgram, String> {
        self.loaded.as_ref().ok_or_else(|| "no program is assembled yet".to_owned())
    }
}
