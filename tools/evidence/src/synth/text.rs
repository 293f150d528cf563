// SPDX-License-Identifier: MIT OR Apache-2.0
//! Text of measurements, for the terminal and `docs/synthesis.md`.

use super::TARGET_MHZ;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use takt_board::place::NETLIST;
use takt_family::{FAMILIES, Family, MEASURED, Mapping, REFERENCE, Resources, lacks};
use takt_isa::UNITS;
use takt_isa::spec::machines::MACHINES;
use takt_rtl::synthesis::{PartResources, Synthesis};

/// Formats a measurement for the terminal.
pub(super) fn in_words(row: &Synthesis, seeds: &[u32]) -> String {
    let Resources { luts, carries, flip_flops, multipliers, block_rams } = row.resources;
    let mut text = format!("{} on {}", row.design, row.device);
    if let (Some(grade), Some(least), Some(median), Some(greatest)) =
        (row.grade, row.least(), row.median(), row.greatest())
    {
        let _ = write!(text, ", speed grade {grade}\n  clock after place and route, by seed:");
        for (seed, mhz) in seeds.iter().zip(&row.mhz) {
            let _ = write!(text, " {seed}: {mhz:.1}");
        }
        let _ = write!(
            text,
            " MHz\n  least {least:.1}, median {median:.1}, greatest {greatest:.1} MHz\n  longest path: {}",
            row.critical_path
        );
    }
    let _ = write!(
        text,
        "\n  {luts} LUTs{}, {flip_flops} flip-flops, {multipliers} multipliers, {block_rams} block RAMs",
        carries.map_or_else(String::new, |carries| format!(
            " ({} LUT4, {carries} in carry chains)",
            luts - carries
        ))
    );
    if MACHINES.iter().any(|machine| machine.name == row.design) {
        let (clock, [luts, flip_flops, memory, multipliers]) = PAPER;
        let _ = write!(
            text,
            "\n  the paper's processor (Stratix III EP3SL150, tables 2 and 4): {clock} MHz, {luts} LUTs, {flip_flops} flip-flops, {multipliers} multipliers, {memory} kB"
        );
    }
    if !row.parts.is_empty() {
        text += "\n";
        text += &parts_in_words(&row.parts);
    }
    text
}

/// Formats the resources of each part of a system, one line each.
pub(super) fn parts_in_words(parts: &[PartResources]) -> String {
    let line = |part: &PartResources| {
        let Resources { luts, flip_flops, multipliers, block_rams, .. } = part.resources;
        let name = &part.name;
        format!(
            "  {name}: {luts} LUT4, {flip_flops} flip-flops, {multipliers} multipliers, {block_rams} block RAMs"
        )
    };
    parts.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// Processor of the founding paper, FPGA3 on a Stratix III EP3SL150: MHz (table 2); LUTs, registers, kB of memory, 18-bit multipliers
/// (table 4).
const PAPER: (u32, [&str; 4]) = (125, ["12,010", "7,489", "120", "8"]);

/// Text of `docs/synthesis.md`, from the record.
pub(crate) fn markdown(rows: &[Synthesis]) -> String {
    let total = REFERENCE.place.as_ref().and_then(|place| place.used).map_or("total", |[luts, ..]| luts);
    let [a, b] = REFERENCE.multiplier;
    let mut text = format!(
        "# Synthesis\n
<!-- Written by `cargo evidence synth` and `cargo xtask docs` from rtl/synthesis.json. -->\n
How fast the circuit is and how much of a device it takes, after place and route with open tools. `cargo evidence synth`
measures it; the first run installs the tools (400 MB) in `.venv`, or in the folder that `TAKT_VENV` names.\n
Clocks are nextpnr's, for the slowest conditions of the speed grade, with the seeds 1, 2, … up to the stated
number. The median (of an even number, the lower of the two in the middle) is the clock that the README and `takt track`
use. The total is nextpnr's {total}: {lut}, those of memories in logic included, and the halves of carry chains' cells,
which take a LUT4's place each (older rows have the total only). Multipliers have {a} x {b} bits, block RAMs {kbit} kbit.
`--seed N` measures one seed, `--freq F` with another target than 200 MHz; neither is recorded.\n",
        lut = REFERENCE.lut,
        kbit = REFERENCE.block_ram().bits() / 1024,
    );
    let is_machine = |row: &&Synthesis| !is_unit(&row.design) && row.parts.is_empty();
    let (reference, others): (Vec<_>, Vec<_>) = rows.iter().partition(|row| is_of(row, REFERENCE));
    let (machines, rest): (Vec<_>, Vec<_>) = reference.into_iter().partition(is_machine);
    let (systems, units): (Vec<_>, Vec<_>) = rest.into_iter().partition(|row| !row.parts.is_empty());
    let placed = |rows: &[&Synthesis]| rows.iter().any(|row| row.grade.is_some());
    if placed(&machines) {
        let (part, grade) = (MEASURED.part, MEASURED.grade);
        let _ = write!(
            text,
            "\n## Machines\n\nWith their memories, as a Wishbone slave between registers that are not counted (in rows before 2026-11-22: the core on a shift register).\n`cargo evidence synth --machine t3 --device {part} --grade {grade}`, and so on.\n"
        );
        text += &table(&machines);
        let (clock, [luts, flip_flops, memory, multipliers]) = PAPER;
        let _ = writeln!(
            text,
            "| the paper's FPGA3 | Stratix III EP3SL150 | | | {clock} | | | | {luts} ALUTs | {flip_flops} | {multipliers} | {memory} kB | |"
        );
        text += "\nThe last line is the processor of the founding paper (its tables 2 and 4). Longest paths, of the median seed:\n\n";
        for row in machines.iter().filter(|row| row.grade.is_some()) {
            let _ = writeln!(
                text,
                "- {}, {}-{}: {}.",
                row.design,
                row.device,
                row.grade.unwrap_or(0),
                row.critical_path
            );
        }
    }
    if placed(&units) {
        text += "\n## Units\n\nEach unit alone, between registers that are not counted. `cargo evidence synth --unit all`.\n";
        text += &table(&units);
    }
    if placed(&systems) {
        text += "\n## Systems\n\nSeveral cores in one clock ([system.md](system.md)) with their programs and links, the host's pins behind a shift\nregister that is not counted. `cargo evidence synth --system programs/three/controller.toml --seeds 1`, and so on.\n";
        text += &table(&systems);
        text += "\nLongest paths, of the median seed:\n\n";
        for row in systems.iter().filter(|row| row.grade.is_some()) {
            let _ = writeln!(text, "- {}: {}.", row.design, row.critical_path);
        }
        for row in systems {
            let _ = writeln!(
                text,
                "\nParts of {}, each core with its gate, as yosys leaves them: what placing adds is in the total only.\n\n\
                 | part | LUT4, carry halves included | flip-flops | multipliers | block RAMs |\n|---|---|---|---|---|",
                row.design
            );
            for PartResources { name, resources } in &row.parts {
                let Resources { luts, flip_flops, multipliers, block_rams, .. } = resources;
                let _ = writeln!(text, "| {name} | {luts} | {flip_flops} | {multipliers} | {block_rams} |");
            }
        }
    }
    if !others.is_empty() {
        text += &other_families(&others);
    }
    let tools: BTreeSet<&str> = rows.iter().flat_map(|row| row.tools.split(", ")).collect();
    if !tools.is_empty() {
        let tools: Vec<&str> = tools.into_iter().rev().collect();
        let _ = writeln!(
            text,
            "\nTools: {}.{} Place and route aims at {TARGET_MHZ} MHz.",
            tools.join(", "),
            commands(REFERENCE)
        );
    }
    text
}

/// Synthesis commands of a family, as a sentence.
fn commands(family: &Family) -> String {
    let Some(synthesis) = &family.synthesis else { return String::new() };
    let [fast, small] =
        [Mapping::Fast, Mapping::Small].map(|mapping| (synthesis.commands)("TOP", NETLIST, mapping));
    let files: Vec<&str> = synthesis.files.iter().map(|(name, _)| *name).collect();
    let mut text = format!(" Synthesis of a module `TOP`: `{fast}`");
    if !files.is_empty() {
        let _ = write!(text, ", with {} of rtl/family", files.join(", "));
    }
    // If possible, show the small mapping as the fast one with additional options.
    let same = fast.bytes().zip(small.bytes()).take_while(|(a, b)| a == b).count();
    if let Some(more) =
        small.get(same..(same + small.len()).saturating_sub(fast.len())).filter(|more| !more.is_empty())
    {
        let _ = write!(text, "; for units and machines of one slot with `{}`, which is smaller", more.trim());
    }
    text + "."
}

/// The design is a unit alone; machines are rows of the table or files of this repository.
fn is_unit(design: &str) -> bool {
    UNITS.iter().any(|unit| unit.name == design)
}

fn is_of(row: &Synthesis, family: &Family) -> bool {
    family.part(&row.device).is_some()
}

/// Table row of a family: cells, memories, oscillator, and capacities of its devices.
fn family_row(family: &Family) -> String {
    let [a, b] = family.multiplier;
    let carry = family.carry.map_or("", |_| ", carry cells included");
    let logic = match family.memories.logic {
        Some(shape) => format!("{} x {} bits", shape.words, shape.bits),
        None => "none: flip-flops".to_owned(),
    };
    let oscillator = family.oscillator.map_or_else(String::new, |oscillator| {
        let (lowest, highest) = oscillator.mhz;
        let range = if lowest < highest { format!("{lowest} to {highest}") } else { highest.to_string() };
        format!("{}, {range} MHz", oscillator.cell)
    });
    let has = family.parts.iter().filter_map(|part| Some((part.name, part.room?)));
    let has = has.map(|(name, room)| {
        let Resources { luts, flip_flops, multipliers, block_rams, .. } = room;
        format!(
            "{name}: {luts} LUTs, {flip_flops} flip-flops, {multipliers} multipliers, {block_rams} block RAMs"
        )
    });
    format!(
        "| {} | {}{carry} | of {a} x {b} bits | of {} kbit | {logic} | {oscillator} | {} |\n",
        family.text,
        family.lut,
        family.block_ram().bits() / 1024,
        has.collect::<Vec<_>>().join("<br>")
    )
}

/// Names of the resources that a device lacks.
pub(super) fn lacking(lacks: &[(&str, u64, u64)]) -> String {
    lacks.iter().map(|(name, ..)| *name).collect::<Vec<_>>().join(", ")
}

/// Table of devices of other families.
fn other_families(rows: &[&Synthesis]) -> String {
    let names = FAMILIES.iter().filter(|family| **family != REFERENCE).map(|family| family.name);
    let mut text = format!(
        "\n## Other families\n
Resources after synthesis with yosys, of the same designs; clocks where a design was placed and routed. Intel's Cyclone V is the
nearest open relative of the paper's Stratix III. `cargo evidence synth --family {}`, with `--machine t1` or
`--unit all`. A design that does not fit the device shows how far it is from it.\n
| family | LUTs | multipliers | block RAMs | memory in LUTs | oscillator | devices have |\n|---|---|---|---|---|---|---|\n",
        names.collect::<Vec<_>>().join("|")
    );
    text.extend(FAMILIES.iter().map(|family| family_row(family)));
    text += "\n| design | device and grade | LUTs | flip-flops | multipliers | block RAMs | MHz median | too few | date |\n|---|---|---|---|---|---|---|---|---|\n";
    for part in FAMILIES.iter().flat_map(|family| family.parts) {
        for row in rows.iter().filter(|row| row.device == part.name) {
            let Resources { luts, flip_flops, multipliers, block_rams, .. } = row.resources;
            let grade = row.grade.map_or_else(String::new, |grade| format!("-{grade}"));
            let median = row.median().map_or_else(String::new, |mhz| {
                let seeds = row.mhz.len();
                format!("{mhz:.1} ({seeds} seed{})", if seeds == 1 { "" } else { "s" })
            });
            let lacks = lacking(&lacks(part, &row.resources));
            let _ = writeln!(
                text,
                "| {} | {}{grade} | {luts} | {flip_flops} | {multipliers} | {block_rams} | {median} | {lacks} | {} |",
                row.design, row.device, row.date
            );
        }
    }
    for row in rows.iter().filter(|row| row.grade.is_some()) {
        let _ = writeln!(text, "\nLongest path of {} on {}: {}.", row.design, row.device, row.critical_path);
    }
    text
}

fn table(rows: &[&Synthesis]) -> String {
    let mut text = String::from(
        "\n| design | device and grade | seeds | MHz least | median | greatest | LUT4 | carry halves | total | flip-flops | multipliers | block RAMs | date |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for row in rows {
        let (Some(grade), Some(least), Some(median), Some(greatest)) =
            (row.grade, row.least(), row.median(), row.greatest())
        else {
            continue;
        };
        let Resources { luts, carries, flip_flops, multipliers, block_rams } = row.resources;
        let apart =
            carries.map_or_else(|| " | ".to_owned(), |carries| format!("{} | {carries}", luts - carries));
        let _ = writeln!(
            text,
            "| {} | {}-{grade} | {} | {least:.1} | {median:.1} | {greatest:.1} | {apart} | {luts} | {flip_flops} | {multipliers} | {block_rams} | {} |",
            row.design,
            row.device,
            row.mhz.len(),
            row.date
        );
    }
    text
}
