// SPDX-License-Identifier: MIT OR Apache-2.0
//! Embedded Verilog files of `rtl/`.

/// Name and text of a file.
pub(crate) type File = (&'static str, &'static str);

macro_rules! files {
    ($folder:literal: $($name:literal)*) => {
        &[$(($name, include_str!(concat!("../", $folder, "/", $name)))),*]
    };
}

/// Arithmetic units and their common modules, without the tables, which [`crate::tables`] computes.
#[rustfmt::skip]
pub(crate) const UNITS: &[File] = files!("units":
    "add.v"
    "addmul.v"
    "alu.v"
    "alu_late.v"
    "arccosine.v"
    "arctangent.v"
    "convert.v"
    "divroot.v"
    "fused.v"
    "multiply.v"
    "recurrence.v"
    "sine.v"
    "common/takt_leading_zeros.v"
    "common/takt_product.v"
    "common/takt_significand_product.v"
    "common/takt_unpack.v"
);

/// Fixed modules of a core, which the generated ones instantiate.
#[rustfmt::skip]
pub(crate) const CORE: &[File] = files!("core":
    "takt_bank.v"
    "takt_onehot_mux.v"
    "takt_hazard.v"
    "takt_issue.v"
    "takt_long_latency.v"
    "takt_loops.v"
    "takt_memory.v"
    "takt_outputs.v"
    "takt_double_buffer.v"
    "takt_program.v"
    "takt_sequencer.v"
    "takt_source.v"
    "takt_in_flight.v"
);

/// Modules between the cores of a system.
#[rustfmt::skip]
pub(crate) const SYSTEM: &[File] = files!("system":
    "takt_delay.v"
    "takt_fifo.v"
    "takt_gate.v"
    "takt_loader.v"
    "takt_pace.v"
    "takt_snapshot.v"
    "takt_start.v"
    "takt_wire.v"
);

/// Modules between the two cores of a pair.
#[rustfmt::skip]
pub(crate) const PAIR: &[File] = files!("pair":
    "takt_compare.v"
    "takt_known.v"
    "takt_later.v"
);

/// Modules of memories with error correction.
#[rustfmt::skip]
pub(crate) const ECC: &[File] = files!("ecc":
    "takt_ecc_code.v"
    "takt_ecc_program.v"
    "takt_ecc_report.v"
    "takt_ecc_scrub.v"
);

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::path::Path;

    #[test]
    fn every_file_is_listed() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let count = |folder: &str| {
            let entries = fs::read_dir(root.join(folder)).expect("the project's folder");
            entries
                .filter(|entry| entry.as_ref().is_ok_and(|e| e.path().extension().is_some_and(|x| x == "v")))
                .count()
        };
        assert_eq!(UNITS.len() + crate::tables::texts().len(), count("units") + count("units/common"));
        assert_eq!(CORE.len(), count("core"));
        assert_eq!(SYSTEM.len(), count("system"));
        assert_eq!(PAIR.len(), count("pair"));
        assert_eq!(ECC.len(), count("ecc"));
    }
}
