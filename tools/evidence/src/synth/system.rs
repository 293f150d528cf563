// SPDX-License-Identifier: MIT OR Apache-2.0
//! A system of several cores as a design for synthesis, with resources of each part.

use super::Design;
use anyhow::{Context, Result, anyhow};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use takt_asm::{FileLoader, Search};
use takt_automation::command::root;
use takt_family::{Cells, Family, Mapping, Resources};
use takt_isa::spec::machines::MACHINES;
use takt_rtl::export::on_family;
use takt_rtl::synthesis::PartResources;
use takt_rtl::system::SystemPlan;
use takt_rtl::verilog::{Direction, Net};
use takt_rtl::{Library, export_system};
use takt_system::{LinkKind, ProgramError, ReadError};

/// Name of the part that contains everything except cores and links.
const REST: &str = "loader and ticks";

/// A system as written by `takt rtl`, with the host's pins behind a shift register and a parity.
pub(super) fn system(file: &Path, library: &Library, family: &Family) -> Result<Design> {
    let text = fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
    let folder = file.parent().unwrap_or(Path::new(""));
    let name = file.file_stem().unwrap_or_default().to_string_lossy();
    let machines = |path: &str| takt_asm::machine::load(&folder.join(path));
    let description = takt_system::read_with(&file.display().to_string(), &text, machines, |request| {
        let path = folder.join(request.path);
        let machine = request.machine.unwrap_or(MACHINES[0]);
        let options = takt_asm::Options { machine, ..takt_asm::Options::default() };
        let source = fs::read(&path).map_err(|error| ProgramError::Missing {
            message: format!("{}: {error}", path.display()),
            help: None,
        })?;
        let beside = path.parent().unwrap_or(Path::new(""));
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let loader = Search::new(FileLoader::new(beside)).library(takt_programs::LIBRARY);
        match takt_asm::assemble_bytes(&name, source, &loader, &options) {
            Ok(assembled) => Ok(assembled.program),
            Err(mistakes) => Err(ProgramError::Invalid(anyhow!("{}", mistakes.render(false)))),
        }
    });
    let description = description.map_err(|error| match error {
        ReadError::Mistakes(mistakes) => anyhow!("{}", mistakes.render(false)),
        ReadError::Program(error) => error,
    })?;
    let design = export_system(&description, &name, library)?;
    let mut files = BTreeMap::new();
    for file in on_family(&design.files, family).iter().chain([&design.image]) {
        files.insert(file.base().to_owned(), file.text.clone());
    }
    // A shift register feeds all inputs; a register and a parity collect all outputs.
    let pins = design.plan.pins();
    let of = |direction| pins.iter().filter(move |pin| pin.direction == direction);
    let status = design.plan.status_pins();
    let width = |nets: &mut dyn Iterator<Item = u32>| nets.sum::<u32>();
    let inputs = width(&mut of(Direction::Input).map(|pin| pin.net.width())).max(2);
    let outputs =
        1 + width(&mut of(Direction::Output).map(|pin| pin.net.width()).chain(status.iter().map(Net::width)));
    let mut connections = String::new();
    let mut low = 0;
    for pin in of(Direction::Input) {
        write!(connections, ".{}(operands[{low} +: {}]), ", pin.net, pin.net.width())?;
        low += pin.net.width();
    }
    low = 1;
    for net in of(Direction::Output).map(|pin| &pin.net).chain(&status) {
        write!(connections, ".{net}(shown[{low} +: {}]), ", net.width())?;
        low += net.width();
    }
    let (top, last, seen) = (&design.top, inputs - 2, outputs - 1);
    files.insert(
        "wrapper.v".to_owned(),
        format!(
            "module wrapper (input wire clk, input wire rst, input wire serial_in, output reg serial_out);
    reg  [{inputs}-1:0] shift, operands;
    wire [{seen}:0] shown;
    reg  [{seen}:0] outputs;
    reg  load;
    {top} system (.clk(clk), .rst(rst), {connections}.running(shown[0]));
    always @(posedge clk) begin
        shift <= {{shift[{last}:0], serial_in}};
        load  <= shift[0] & shift[1];
        if (load) operands <= shift;
        outputs    <= load ? shown : {{outputs[0], outputs[{seen}:1]}};
        serial_out <= outputs[0];
    end
endmodule
"
        ),
    );
    // Size of the wrapper: an input shift register, and an output shift register with a multiplexer before each flip-flop.
    let wrapper = Resources {
        luts: u64::from(outputs) + 1,
        flip_flops: u64::from(2 * inputs + outputs) + 2,
        ..Resources::default()
    };
    let parts = parts(&design.plan);
    // Name a system of this repository by its path.
    let own = own_path(file)?;
    let (recorded, name) = (own.is_some(), own.unwrap_or_else(|| name.into_owned()));
    Ok(Design {
        name,
        files,
        top: "wrapper".to_owned(),
        mapping: Mapping::Fast,
        has_pins: true,
        wrapper,
        parts,
        recorded,
    })
}

/// Path in this repository of one of its files; `None` for other files.
pub(super) fn own_path(file: &Path) -> Result<Option<String>> {
    let (file, root) = (fs::canonicalize(file)?, fs::canonicalize(root())?);
    Ok(file.strip_prefix(root).ok().map(|path| path.to_string_lossy().replace('\\', "/")))
}

/// Instances in the top module with their parts: each core with its gate, each snapshot and FIFO, and all wires as one part.
fn parts(plan: &SystemPlan) -> Vec<(String, String)> {
    let cores = plan.description.cores.iter().enumerate().map(|(number, core)| {
        (plan.core_instance(number), format!("core {}, {}", core.name, core.program.machine.name))
    });
    let links = plan.description.links.iter().enumerate().map(|(number, link)| {
        let name = match link.kind {
            LinkKind::Wire => "wires".to_owned(),
            LinkKind::Snapshot { .. } => format!("snapshot {}", link.name),
            LinkKind::Fifo { depth, .. } => {
                format!("FIFO {}, {depth} entries of {}", link.name, link.fields.len())
            }
        };
        (plan.link_instance(number), name)
    });
    cores.chain(links).collect()
}

/// Counted items of yosys' netlist.
#[derive(Deserialize)]
struct Netlist {
    modules: BTreeMap<String, Module>,
}

#[derive(Deserialize)]
struct Module {
    #[serde(default)]
    cells: BTreeMap<String, Cell>,
}

#[derive(Deserialize)]
struct Cell {
    #[serde(rename = "type")]
    kind: String,
}

/// Resources of each part in yosys' netlist, where cell names begin with the original instance.
///
/// # Errors
/// If the text is not a netlist written by yosys.
pub(super) fn count(
    netlist: &str,
    top: &str,
    parts: &[(String, String)],
    cells: &Cells,
) -> Result<Vec<PartResources>> {
    let netlist: Netlist = serde_json::from_str(netlist).context("cannot read yosys' netlist")?;
    let module = netlist.modules.get(top).with_context(|| format!("yosys' netlist has no {top}"))?;
    let mut counts: Vec<PartResources> = Vec::new();
    let names = parts.iter().map(|(_, name)| name.as_str()).chain([REST]);
    for name in names {
        if !counts.iter().any(|part| part.name == name) {
            counts.push(PartResources { name: name.to_owned(), resources: cells.none() });
        }
    }
    for (cell, Cell { kind }) in &module.cells {
        let mut path = cell.split('.');
        if path.next() != Some("system") {
            continue; // belongs to the wrapper
        }
        let instance = path.next().unwrap_or("");
        let known = parts.iter().find(|(known, _)| known == instance);
        let name = known.map_or(REST, |(_, name)| name.as_str());
        let Some(part) = counts.iter_mut().find(|part| part.name == name) else { continue };
        cells.add(&mut part.resources, kind, 1);
    }
    Ok(counts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use takt_family::REFERENCE;

    #[test]
    fn cells_count_for_the_part_of_their_prefix() {
        let parts = [("core_a", "core a"), ("wire0_x", "wires"), ("wire1_y", "wires")]
            .map(|(instance, name)| (instance.to_owned(), name.to_owned()));
        let Cells { luts, carries, flip_flops, block_rams, .. } = REFERENCE.cells;
        let [lut, carry, flip_flop, block_ram] =
            [luts, carries, flip_flops, block_rams].map(|kinds| kinds[0].0);
        let netlist = json!({"modules": {"wrapper": {"cells": {
            "system.core_a.core.x_Z": {"type": lut},
            "system.core_a.core.sum_S0": {"type": carry},
            "system.core_a.core.memory.0.0": {"type": block_ram},
            "system.core_ab.x_Z": {"type": lut},
            "system.wire0_x.v_Q": {"type": flip_flop},
            "system.wire1_y.v_Q": {"type": flip_flop},
            "system.loader.a_Z": {"type": lut},
            "shift_Q": {"type": flip_flop},
        }}}});
        let counts = count(&netlist.to_string(), "wrapper", &parts, &REFERENCE.cells).expect("a netlist");
        let of = |name: &str| counts.iter().find(|part| part.name == name).expect("a part").resources;
        assert_eq!((of("core a").luts, of("core a").carries, of("core a").block_rams), (3, Some(2), 1));
        assert_eq!((of("wires").luts, of("wires").flip_flops), (0, 2));
        assert_eq!(of(REST).luts, 2);
        assert!(count(&netlist.to_string(), "another", &parts, &REFERENCE.cells).is_err());
    }
}
