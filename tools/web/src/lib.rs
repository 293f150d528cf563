// SPDX-License-Identifier: MIT OR Apache-2.0
//! The playground: what a page in a browser asks of Takt.
//!
//! [`Playground::call`] takes a method and its parameters as JSON and answers in JSON, so that everything here is tested
//! without a browser. In one, `exports` hands the texts across. The page itself is in `page/`; nothing of the language is in it:
//! colours, diagnostics and completion come from [`takt_editor::lsp`], the pipeline's picture from [`takt_analysis::picture`].
//!
//! | method | what it does |
//! |---|---|
//! | `about` | machines, examples, limits |
//! | `lsp`, `lsp.check`, `lsp.schedule` | messages to and from the language server |
//! | `assemble` | assembles, bounds the cycles, opens a debug session |
//! | `execute` | a command of the debugger's console |
//! | `run` | periods on the emulator, so many at a call |
//! | `track` | periods of the closed loop along the AGH path |
//! | `source` | the text of a file that a program includes |
//! | `picture` | the pipeline's picture as data |
//! | `listing`, `header`, `verilog`, `image` | what can be taken away |
//!
//! Nothing here knows the time or waits: whoever calls divides what is long.

mod examples;
mod export;
#[cfg(target_arch = "wasm32")]
mod exports;
mod language;
mod ports;
mod program;
mod run;
mod track;
mod view;

use program::Loaded;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use takt_debug::console::Console;
use takt_editor::lsp::Inline;
use takt_isa::Machine;
use takt_isa::timing::Cycle;

/// Cycles that a period, or a command of the debugger, may take: about a second in a browser.
pub const CYCLES: Cycle = 20_000_000;
/// Rows of recorded inputs, and periods of a run.
pub const PERIODS: usize = 100_000;
/// Bytes of a source.
pub const SOURCE_BYTES: usize = 4 << 20;

/// The results for the page's program so far.
pub struct Playground {
    language: Inline,
    loaded: Option<Loaded>,
    console: Option<Console>,
    run: Option<run::Run>,
    track: Option<track::Track>,
}

impl Default for Playground {
    fn default() -> Playground {
        Playground::new(takt_isa::MACHINES[0])
    }
}

/// Parameters of a method.
fn parameters<P: DeserializeOwned>(method: &str, params: Value) -> Result<P, String> {
    serde_json::from_value(params).map_err(|error| format!("the parameters of `{method}`: {error}"))
}

impl Playground {
    /// A playground whose language server assembles for a machine.
    pub fn new(machine: &'static Machine) -> Playground {
        let language = language::server(machine);
        Playground { language, loaded: None, console: None, run: None, track: None }
    }

    /// Answers a request of the page.
    ///
    /// # Errors
    /// Its mistakes, for the user to read.
    pub fn call(&mut self, method: &str, params: Value) -> Result<Value, String> {
        #[derive(Deserialize)]
        struct OfMachine {
            machine: String,
        }
        match method {
            "about" => Ok(examples::about()),
            "lsp.start" => {
                let OfMachine { machine: name } = parameters(method, params)?;
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
            "picture" => self.picture(parameters(method, params)?),
            "listing" => Ok(Value::from(takt_asm::listing::listing(&self.loaded()?.assembled))),
            "header" => export::header(self.loaded()?, params),
            "verilog" => export::verilog(self.loaded()?),
            _ => Err(format!("the playground has no `{method}`")),
        }
    }

    /// The image of the program, with what a debugger needs.
    ///
    /// # Errors
    /// If there is no program, or it does not fit an image.
    pub fn image(&self) -> Result<Vec<u8>, String> {
        export::image(self.loaded()?)
    }

    fn loaded(&self) -> Result<&Loaded, String> {
        self.loaded.as_ref().ok_or_else(|| "no program is assembled yet".to_owned())
    }
}
