// SPDX-License-Identifier: MIT OR Apache-2.0
//! Three-processor controller: the three programs run as a system, with packets from a host and a plant behind encoders and drives, and
//! each module is compared with its binary64 model (docs/controller.md). The largest differences are printed (`--nocapture`).
#![allow(clippy::print_stdout)]

mod bench;
mod errors;
mod jog;
mod motion;
mod packets;
mod queue;
mod servo;
mod signals;
mod world;

/// Images: each program is equal after a round trip through its image, debug information included.
#[test]
fn images_are_read_back() {
    use takt_asm::{MemoryLoader, Options, Search, assemble, image};
    for (name, machine) in
        [("dynamic.s", &takt_isa::T1), ("kinematic.s", &takt_isa::T3), ("communication.s", &takt_isa::T1)]
    {
        let loader = Search::new(MemoryLoader::new(takt_programs::THREE)).library(takt_programs::LIBRARY);
        let options = Options { machine, ..Options::default() };
        let assembled =
            assemble(name, &loader, &options).unwrap_or_else(|mistakes| panic!("{}", mistakes.render(false)));
        let debug = assembled.debug_info();
        let bytes = image::write_with(&assembled.program, Some(&debug)).expect("an image holds it");
        let (program, read) = image::read_with(&bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(program, assembled.program, "{name}");
        assert_eq!(read, Some(debug), "{name}");
    }
}
