// SPDX-License-Identifier: MIT OR Apache-2.0
//! Values that a page shows: parameters, inputs and outputs, each with unit, range, and whether the host can set it.

use crate::session::Target;
use crate::value::{find, value_text};
use anyhow::Result;
use serde::Serialize;
use takt_asm::units::unit;
use takt_board::Host;
use takt_board::protocol::{Line, LinkError};
use takt_debug::value;
use takt_isa::program::Port;
use takt_isa::{Program, Type};
use takt_system::{Core, End, SystemPort};

/// A value, as the page describes it.
#[derive(Serialize)]
pub(crate) struct Shown {
    name: String,
    #[serde(rename = "type")]
    ty: &'static str,
    unit: Option<String>,
    /// Ends of the range that the source states.
    range: Option<[String; 2]>,
    /// Reason why the host cannot set it; `None` if it can.
    fixed: Option<String>,
}

/// All values, and their places on the board.
pub(crate) struct Values {
    pub(crate) parameters: Vec<Shown>,
    pub(crate) inputs: Vec<Shown>,
    pub(crate) outputs: Vec<Shown>,
    /// Names that may be channels of the scope.
    pub(crate) channels: Vec<String>,
    places: Vec<(u16, Type)>,
    /// The places in ascending order, which takes the fewest requests.
    order: Vec<usize>,
}

/// Port of a core, and the name by which the host knows its value.
struct Known<'p> {
    core: usize,
    directive: &'static str,
    port: &'p Port,
    name: String,
}

/// Ports of all cores by the name of the core's port.
fn ports<'p>(target: &'p Target, directive: &'static str, ports: fn(&Program) -> &[Port]) -> Vec<Known<'p>> {
    let cores = target.application.description().cores.iter().enumerate();
    let of = |(core, known): (usize, &'p Core)| {
        let name = move |port: &Port| target.application.name(core, &port.name);
        ports(&known.program)
            .iter()
            .map(|port| Known { core, directive, port, name: name(port) })
            .collect::<Vec<_>>()
    };
    cores.flat_map(of).collect()
}

/// Ports of cores at the other ends of a system's links from or to the host, by the name of the host's end.
fn ends(target: &Target, is_input: bool) -> Vec<Known<'_>> {
    let (description, ends) = (target.application.description(), target.application.endpoints());
    let ends = if is_input { &ends.inputs } else { &ends.outputs };
    let known = |end: &SystemPort| {
        let link = &description.links[end.link];
        let field = &link.fields[end.field];
        let (other, port) = if is_input { (link.to, &field.to) } else { (link.from, &field.from) };
        let End::Core(core) = other else { return None };
        let program = &description.cores[core].program;
        let (directive, all) =
            if is_input { (".input", &program.inputs) } else { (".output", &program.outputs) };
        let port = all.iter().find(|known| known.name == *port)?;
        Some(Known { core, directive, port, name: end.name.clone() })
    };
    ends.iter().filter_map(known).collect()
}

impl Values {
    pub(crate) fn of(target: &Target) -> Result<Values> {
        let Target { application, wiring, sources, .. } = target;
        let mut places = Vec::new();
        let mut all = |known: Vec<Known<'_>>| -> Result<Vec<Shown>> {
            let mut shown = Vec::new();
            for Known { core, directive, port, name } in known {
                places.push(find(application, &name)?);
                let fixed = match application.settable(&name) {
                    Err(text) => Some(text),
                    Ok((address, _)) => wiring
                        .as_ref()
                        .and_then(|wiring| wiring.driver(application, address))
                        .map(|driver| format!("the wiring connects `{name}` to {driver}, which drives it")),
                };
                let program = &application.description().cores[core].program;
                let range = program.range(port.register);
                let range =
                    range.map(|range| [range.low, range.high].map(|bits| value::text(range.ty, bits)));
                let unit = sources.get(core).and_then(|sources| unit(sources, directive, &port.name));
                shown.push(Shown { name, ty: port.ty.name(), unit, range, fixed });
            }
            Ok(shown)
        };
        let parameters = all(ports(target, ".param", |program| &program.parameters))?;
        let (inputs, outputs) = match application.is_program() {
            true => (
                ports(target, ".input", |program| &program.inputs),
                ports(target, ".output", |program| &program.outputs),
            ),
            false => {
                let cores = ports(target, ".output", |program| &program.outputs);
                (ends(target, true), ends(target, false).into_iter().chain(cores).collect())
            }
        };
        let (inputs, outputs) = (all(inputs)?, all(outputs)?);
        let mut channels = Vec::new();
        for (core, Core { program, .. }) in application.description().cores.iter().enumerate() {
            let all = program.host_registers().chain(&program.outputs).chain(&program.registers);
            channels.extend(all.map(|port| application.name(core, &port.name)));
        }
        let mut order: Vec<usize> = (0..places.len()).collect();
        order.sort_unstable_by_key(|at| places[*at].0);
        Ok(Values { parameters, inputs, outputs, channels, places, order })
    }

    /// Reads all values, as text: parameters, then inputs, then outputs.
    pub(crate) fn read<L: Line>(&self, host: &mut Host<L>) -> Result<Vec<String>, LinkError> {
        let addresses: Vec<u16> = self.order.iter().map(|at| self.places[*at].0).collect();
        let mut texts = vec![String::new(); self.places.len()];
        for (at, bits) in self.order.iter().zip(host.read_each(&addresses)?) {
            texts[*at] = value_text(bits, self.places[*at].1);
        }
        Ok(texts)
    }
}
