// SPDX-License-Identifier: MIT OR Apache-2.0
//! Projects for the tools of a device's maker: a board with its pins, or a core at the bus of the device's processors. Takt writes them and
//! does not run the tools.

use crate::application::Application;
use crate::boards::Board;
use crate::build::{self, BuildError, put};
use crate::top::{self, TOP};
use crate::wiring::Wiring;
use std::fmt::Write as _;
use std::path::Path;
use takt_family::{Attachment, Family, Flow, PinRole, Processor, Project};
use takt_isa::Program;
use takt_rtl::export::on_family;
use takt_rtl::header::{Header, Language};
use takt_rtl::template::fill;
use takt_rtl::{Library, axi, export, wishbone};
use thiserror::Error;

/// Reason why there is no project.
#[derive(Debug, Error)]
pub enum ProjectError {
    /// Circuit or files cannot be written.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// No flow of the family's maker is known.
    #[error("Takt writes no project for {0}: leave out `--flow`")]
    NoFlow(&'static str),
    /// The flow is that of another family.
    #[error("{family} has the flow `{known}` ({tools}), not `{flow}`")]
    OtherFlow {
        /// Text of the family.
        family: &'static str,
        /// Name of the family's flow.
        known: &'static str,
        /// Maker's tools of the family's flow.
        tools: &'static str,
        /// Flow that was asked for.
        flow: String,
    },
    /// The device has no processor.
    #[error("the {device} of {board} has no processor whose bus the core could be on: leave out `--axi`")]
    NoProcessor {
        /// Device.
        device: &'static str,
        /// Board.
        board: String,
    },
    /// A system has no slave of a bus.
    #[error("a system of several cores has no slave of a bus: `--axi` is for a single program")]
    System,
    /// The machine has no circuit.
    #[error(transparent)]
    Export(#[from] takt_rtl::ExportError),
}

/// A project in its folder.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// Files, by their names in the folder.
    pub files: Vec<String>,
    /// Maker and name of the tools.
    pub tools: &'static str,
    /// Commands that build the bitstream in the folder.
    pub commands: &'static [&'static str],
    /// Bitstream that they write.
    pub bitstream: &'static str,
}

/// Finds a flow by name, which must be that of a board's family.
///
/// # Errors
/// If the family has another flow, or none.
pub fn flow(board: &Board, name: &str) -> Result<&'static Flow, ProjectError> {
    let family: &'static Family = board.family;
    let flow = family.flow.as_ref().ok_or(ProjectError::NoFlow(family.text))?;
    if flow.name != name {
        return Err(ProjectError::OtherFlow {
            family: family.text,
            known: flow.name,
            tools: flow.tools,
            flow: name.to_owned(),
        });
    }
    Ok(flow)
}

/// Files of a folder as they are written.
struct Folder<'a> {
    folder: &'a Path,
    files: Vec<String>,
}

impl Folder<'_> {
    fn put(&mut self, name: &str, text: &str) -> Result<(), BuildError> {
        put(self.folder, name, text)?;
        self.files.push(name.to_owned());
        Ok(())
    }
}

/// Writes the project of a program, or a system, on a board into a folder.
///
/// # Errors
/// If there is no circuit, or a file cannot be written.
pub fn write<'a>(
    board: &Board,
    wiring: &Wiring,
    application: impl Into<Application<'a>>,
    flow: &Flow,
    folder: &Path,
) -> Result<Written, ProjectError> {
    let circuit = build::write(board, wiring, application, folder)?;
    let mut files: Vec<String> = circuit.files.iter().map(|file| file.name.clone()).collect();
    files.push(circuit.pins.0.to_owned());
    let mut to = Folder { folder, files };
    let device = (flow.device)(board.device, &board.package, board.grade);
    let constraints = top::constraints(board, wiring);
    let project = Project {
        top: TOP,
        device: &device,
        sources: verilog(circuit.files.iter().map(|file| file.name.as_str())),
        pins: circuit.pins.0,
        constraints: &constraints,
    };
    for (name, text) in (flow.files)(&project) {
        to.put(name, &text)?;
    }
    let inputs = constraints.pins.iter().filter(|pin| pin.role == PinRole::Input).count();
    let about = format!(
        "{}: `{TOP}`, at {} MHz from a clock of {} MHz, with {} pins, {inputs} of them asynchronous inputs.",
        board.text,
        wiring.clock,
        board.clock.1,
        constraints.pins.len()
    );
    to.put("README.md", &readme(flow, &device, &about, flow.bitstream, ""))?;
    Ok(Written { files: to.files, tools: flow.tools, commands: flow.commands, bitstream: flow.bitstream })
}

/// Clock of a core at a processor's bus, in MHz: lowest and highest.
pub const CLOCK: (f64, f64) = (10.0, 250.0);

/// Writes the project of a program's core at the bus of a board's processors, and programs in C and Python that drive it under Linux. The
/// clock is in MHz, of bus and core.
///
/// # Errors
/// If the device has no processor, the machine no circuit, or a file cannot be written.
pub fn write_attached(
    board: &Board,
    program: &Program,
    flow: &Flow,
    clock: f64,
    folder: &Path,
) -> Result<Written, ProjectError> {
    let processor = flow.processor.filter(|processor| (processor.is_on)(board.device));
    let processor = processor
        .ok_or_else(|| ProjectError::NoProcessor { device: board.device.name, board: board.name.clone() })?;
    let latched = program.latched_inputs();
    let design = export(program.machine, &Library::builtin())?.latching(latched)?;
    let mut to = Folder { folder, files: Vec::new() };
    let (slave, on_wishbone) = (axi::name(&design), wishbone::name(&design));
    let mut sources = on_family(&design.files, board.family);
    for (name, text) in
        [(&on_wishbone, wishbone::wrapper(&design, latched)), (&slave, axi::wrapper(&design, latched))]
    {
        sources.push(takt_rtl::export::DesignFile { name: format!("{name}.v"), text });
    }
    for file in &sources {
        to.put(&file.name, &file.text)?;
    }
    let device = (flow.device)(board.device, &board.package, board.grade);
    let attachment = Attachment {
        slave: &slave,
        device: &device,
        sources: verilog(sources.iter().map(|file| file.name.as_str())),
        clock,
        bytes: axi::BYTES,
    };
    for (name, text) in (processor.files)(&attachment) {
        to.put(name, &text)?;
    }
    for (name, text) in host(program) {
        to.put(name, &text)?;
    }
    let about = format!(
        "{}: the core {} at {clock} MHz behind AXI4-Lite, at the address {:#010x} of the processors ({}).",
        board.text, program.machine.name, processor.base, processor.text
    );
    to.put("README.md", &readme(flow, &device, &about, processor.bitstream, &on_linux(&processor)))?;
    Ok(Written {
        files: to.files,
        tools: flow.tools,
        commands: flow.commands,
        bitstream: processor.bitstream,
    })
}

fn verilog<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    names.filter(|name| name.ends_with(".v")).collect()
}

/// Programs of the host under Linux, with what they read: `takt_uio.c` with the header `program.h`, `takt_uio.py` with `program.json`.
pub fn host(program: &Program) -> [(&'static str, String); 4] {
    let header = Header::new(program, "program", takt_analysis::section_cycles(program));
    let row = |port: &takt_rtl::header::BusPort, is_input: bool| {
        let kind = match port.ty {
            "float" => "FLOAT",
            "int" => "INT",
            _ => "BITS",
        };
        format!("    {{ \"{}\", 0x{:04x}u, {kind}, {} }},\n", port.name, port.address, u8::from(is_input))
    };
    let inputs = header.inputs.iter().chain(&header.parameters).map(|port| row(port, true));
    let rows: String = inputs.chain(header.outputs.iter().map(|port| row(port, false))).collect();
    let c =
        fill(include_str!("project/takt_uio.c.in"), &[("PORTS", &rows.trim_end()), ("BYTES", &axi::BYTES)]);
    [
        ("program.h", header.text(Language::C)),
        ("program.json", header.text(Language::Json)),
        ("takt_uio.c", c),
        ("takt_uio.py", include_str!("project/takt_uio.py").to_owned()),
    ]
}

/// Text about a project: device, commands, checks.
fn readme(flow: &Flow, device: &str, about: &str, bitstream: &str, more: &str) -> String {
    let mut text = format!("# Project for {}\n\n{about} Device: {device}.\n\n```text\n", flow.tools);
    for command in flow.commands {
        let _ = writeln!(text, "{command}");
    }
    let _ = write!(
        text,
        "```\n\nThe bitstream is `{bitstream}`; a design that misses its clock ends in an error.

**Nobody has run this project.** Takt's developers have neither {} nor the board: projects like it ran with stand-ins for the
tool's commands, and their Verilog in a simulator, without clock generator and processors. Placement, timing, and everything electrical
are untested. Report what you find.
{more}",
        flow.tools
    );
    text
}

/// Text about the host's programs.
fn on_linux(processor: &Processor) -> String {
    format!(
        "
## From Linux

`takt_uio.c` (with `program.h`) and `takt_uio.py` (with `program.json`) load the program over the bus, start it, and run periods:

```text
cc -O2 -o takt_uio takt_uio.c
./takt_uio /dev/uio0 5 NAME=VALUE …           five periods with these inputs; a line of outputs for each
python3 takt_uio.py /dev/uio0 5 NAME=VALUE …  the same
```

The board's own image starts Linux. It loads the bitstream and then the overlay `takt.dtso`, which makes the core `/dev/uio0` and sets its
clock. An access before both waits for ever, and with it the processor. Linux' FPGA manager takes `{}`:

```text
{}
```
",
        processor.image,
        processor.commands.join("\n")
    )
}
