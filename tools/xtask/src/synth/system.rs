// SPDX-License-Identifier: MIT OR Apache-2.0
//! A system of several cores, as it is synthesised, and what each of its parts takes.

use super::Design;
use crate::root;
use anyhow::{Context, Result, anyhow};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use takt_asm::{FileLoader, Search};
use takt_board::place::PINS;
use takt_board::tools::Mapping;
use takt_isa::spec::machines::MACHINES;
use takt_rtl::synthesis::{PartResources, Resources};
use takt_rtl::system::SystemPlan;
use takt_rtl::verilog::{Direction, Net};
use takt_rtl::{Library, export_system};
use takt_system::{LinkKind, ProgramError, ReadError};

/// The part of all that is neither a core nor a link.
const REST: &str = "loader and ticks";

/// A system as `takt rtl` writes it, its host's pins behind a shift register and a parity.
pub(super) fn system(file: &Path, library: &Library, ecp5: bool) -> Result<Design> {
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
    let base = |name: &str| name.rsplit('/').next().unwrap_or(name).to_owned();
    let mut files = BTreeMap::new();
    for file in design.files.iter().chain(design.ecp5.iter().filter(|_| ecp5)).chain([&design.image]) {
        files.insert(base(&file.name), file.text.clone());
    }
    // All inputs out of a shift register, all outputs into a register and a parity.
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
    // A shift register in, one out, and a multiplexer before each of its flip-flops.
    let wrapper = Resources {
        luts: u64::from(outputs) + 1,
        flip_flops: u64::from(2 * inputs + outputs) + 2,
        ..Resources::default()
    };
    let parts = parts(&design.plan);
    // One of the repository's goes by its path.
    let own = fs::canonicalize(file)?.strip_prefix(fs::canonicalize(root())?).map(Path::to_path_buf).ok();
    let (recorded, name) =
        own.map_or((false, name.into_owned()), |path| (true, path.to_string_lossy().replace('\\', "/")));
    Ok(Design {
        name,
        files,
        top: "wrapper".to_owned(),
        mapping: Mapping::Fast,
        pins: PINS,
        wrapper,
        parts,
        recorded,
    })
}

/// Instances in the top, and what they count as: each core with its gate, each snapshot and FIFO, all wires together.
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

/// Of yosys' netlist, what is counted here.
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

/// The resources of each part, from yosys' netlist: its cells have the names of the instances that they come from.
///
/// # Errors
/// If it is none.
pub(super) fn count(netlist: &str, top: &str, parts: &[(String, String)]) -> Result<Vec<PartResources>> {
    let netlist: Netlist = serde_json::from_str(netlist).context("cannot read yosys' netlist")?;
    let module = netlist.modules.get(top).with_context(|| format!("yosys' netlist has no {top}"))?;
    let mut counts: Vec<PartResources> = Vec::new();
    let names = parts.iter().map(|(_, name)| name.as_str()).chain([REST]);
    for name in names {
        if !counts.iter().any(|part| part.name == name) {
            counts.push(PartResources {
                name: name.to_owned(),
                resources: Resources { carries: Some(0), ..Resources::default() },
            });
        }
    }
    for (cell, Cell { kind }) in &module.cells {
        let mut path = cell.split('.');
        if path.next() != Some("system") {
            continue; // the wrapper's
        }
        let instance = path.next().unwrap_or("");
        let known = parts.iter().find(|(known, _)| known == instance);
        let name = known.map_or(REST, |(_, name)| name.as_str());
        let Some(part) = counts.iter_mut().find(|part| part.name == name) else { continue };
        let Resources { luts, carries, flip_flops, multipliers, block_rams } = &mut part.resources;
        match kind.as_str() {
            "LUT4" => *luts += 1,
            "CCU2C" => {
                *luts += 2;
                *carries = carries.map(|count| count + 2);
            }
            "TRELLIS_DPR16X4" => *luts += DISTRIBUTED_LUTS,
            "TRELLIS_FF" => *flip_flops += 1,
            "MULT18X18D" => *multipliers += 1,
            "DP16KD" => *block_rams += 1,
            _ => {}
        }
    }
    Ok(counts)
}

/// LUT4 that hold the 16 x 4 bits of a memory in logic.
const DISTRIBUTED_LUTS: u64 = 4;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_count_for_the_part_that_their_name_begins_with() {
        let parts = [("core_a", "core a"), ("wire0_x", "wires"), ("wire1_y", "wires")]
            .map(|(instance, name)| (instance.to_owned(), name.to_owned()));
        let netlist = r#"{"modules": {"wrapper": {"cells": {
            "system.core_a.core.x_LUT4_Z": {"type": "LUT4"},
            "system.core_a.core.sum_CCU2C_S0": {"type": "CCU2C"},
            "system.core_a.core.memory.0.0": {"type": "DP16KD"},
            "system.core_ab.x_LUT4_Z": {"type": "LUT4"},
            "system.wire0_x.v_TRELLIS_FF_Q": {"type": "TRELLIS_FF"},
            "system.wire1_y.v_TRELLIS_FF_Q": {"type": "TRELLIS_FF"},
            "system.loader.a_LUT4_Z": {"type": "LUT4"},
            "shift_TRELLIS_FF_Q": {"type": "TRELLIS_FF"}
        }}}}"#;
        let counts = count(netlist, "wrapper", &parts).expect("a netlist");
        let of = |name: &str| counts.iter().find(|part| part.name == name).expect("a part").resources;
        assert_eq!((of("core a").luts, of("core a").carries, of("core a").block_rams), (3, Some(2), 1));
        assert_eq!((of("wires").luts, of("wires").flip_flops), (0, 2));
        assert_eq!(of(REST).luts, 2);
        assert!(count(netlist, "another", &parts).is_err());
    }
}
