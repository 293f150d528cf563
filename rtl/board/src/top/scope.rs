// SPDX-License-Identifier: MIT OR Apache-2.0
//! The scope: its size, and its instance beside the core that it records.

use super::error::TopError;
use super::shadow_memory::COPIED;
use super::template::Values;
use crate::application::Application;
use crate::boards::Board;
use crate::protocol::{SCOPE, address, channel};
use crate::scope::{LEAST_DEPTH, MOST_WORDS};
use crate::wiring::Wiring;
use takt_isa::memory::{BlockRam, Shape};

/// Block RAMs left from which on a scope has 8 channels unless the wiring says how many; below, it has 4.
const ROOMY: u64 = 64;
/// Most samples of a scope whose depth the wiring leaves out.
const USUAL_DEPTH: u32 = 2048;
/// Samples of such a scope on a device whose block RAMs are not known.
const UNKNOWN_DEPTH: u32 = 256;
/// Registers that a core's writes pass in the scope.
const PASSED: u32 = 2;

/// The size of a scope.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScopeSize {
    /// Channels: 1, 2, 4 or 8.
    pub channels: u32,
    /// Samples, a power of two.
    pub depth: u32,
    /// Block RAMs of the ring.
    pub block_rams: u64,
    /// The core that is recorded.
    pub core: usize,
}

/// The core that the scope of a wiring records; `None` without a scope.
pub(crate) fn recorded(wiring: &Wiring, application: &Application<'_>) -> Option<usize> {
    let request = wiring.scope.as_ref()?;
    let named = request.core.as_deref().and_then(|name| application.description().core_named(name));
    Some(named.unwrap_or(0))
}

fn blocks(channels: u32, depth: u32, block: &BlockRam) -> u64 {
    block.blocks(Shape { words: u64::from(channels) * u64::from(depth), bits: 32 })
}

impl ScopeSize {
    /// The scope of a wiring, in the block RAMs that are left: half of them at most if the wiring does not say how deep it is.
    pub(super) fn of(
        board: &Board,
        wiring: &Wiring,
        application: &Application<'_>,
        left: Option<u64>,
    ) -> Result<Option<ScopeSize>, TopError> {
        let (Some(request), Some(core)) = (&wiring.scope, recorded(wiring, application)) else {
            return Ok(None);
        };
        let block = board.family.block_ram();
        let channels = request.channels.unwrap_or(if left.unwrap_or(0) >= ROOMY { 8 } else { 4 });
        let fits = |depth: &u32| match left {
            Some(left) => blocks(channels, *depth, block) <= left / 2,
            None => *depth <= UNKNOWN_DEPTH,
        };
        let depths = std::iter::successors(Some(USUAL_DEPTH), |depth| Some(depth / 2));
        let usual = || depths.take_while(|depth| *depth > LEAST_DEPTH).find(fits).unwrap_or(LEAST_DEPTH);
        let depth = request.depth.unwrap_or_else(usual).min(MOST_WORDS / channels);
        let block_rams = blocks(channels, depth, block);
        match left {
            Some(left) if block_rams > left => {
                let device = board.device.name;
                Err(TopError::Scope { channels, depth, needed: block_rams, left, device })
            }
            _ => Ok(Some(ScopeSize { channels, depth, block_rams, core })),
        }
    }
}

/// The values of the template for the scope.
pub(super) fn section(scope: Option<ScopeSize>, wiring: &Wiring, application: &Application<'_>) -> Values {
    let nothing = |name| (name, String::new());
    let Some(ScopeSize { channels, depth, core: k, .. }) = scope else {
        return vec![
            nothing("SCOPE"),
            nothing("SCOPE_WRITABLE"),
            ("SCOPE_READ", "32'd0".to_owned()),
            nothing("SCOPE_SAMPLE"),
            nothing("ENDED"),
            nothing("RETIRE_ADDRESS"),
            nothing("SCOPE_NETS"),
        ];
    };
    let machine = application.description().cores[k].program.machine;
    let slots = machine.slots.len();
    let latency = machine.slots.iter().flat_map(|slot| slot.units).map(|unit| unit.latency).max();
    let settle = latency.unwrap_or(0) + COPIED + PASSED;
    let is_program = application.is_program();
    let (tick, ended, bundles) = match is_program {
        true => ("core_tick".to_owned(), "scope_ended".to_owned(), "scope_bundles".to_owned()),
        false => (format!("core_ticks[{k}]"), format!("ended[{k}]"), format!("{}'d0", 16 * slots)),
    };
    let tripped =
        super::wrapper::trips(wiring).map_or_else(|| "1'b0".to_owned(), |trips| format!("|{trips}"));
    let [first, last] = [SCOPE, SCOPE + 0x3f].map(|at| format!("16'd{at}"));
    let text = format!(
        "    // ---- the scope

    wire [31:0] scope_read, scope_sample;
    takt_scope #(
        .SLOTS({slots}), .CHANNELS({channels}), .DEPTH({}), .INPUTS(10'd{}), .PORTS({}), .CORE({k}), .BUNDLES({}), .SETTLE({settle})
    ) scope (
        .clk(clk), .rst(rst), .core_rst(core_rst), .restart(restart),
        .load(loads[{k}]), .load_space(load_space), .load_address(load_address[9:0]), .load_value(load_value[31:0]),
        .core_tick({tick}), .ended({ended}), .waiting(waiting[{k}]), .stopped(halted[{k}] | fault[{k}]),
        .missed(late[{k}]), .tripped({tripped}), .drive(drive),
        .retire(retire{k}), .retire_register(retire_register{k}), .retire_address({bundles}), .retire_value(retire_value{k}),
        .in_write(in_write{k}), .in_index(in_index{k}), .in_value(in_value{k}),
        .bus_write(bus_write & address >= {first} & address <= {last}), .address(address[5:0]), .bus_value(bus_value),
        .at({{page[2:0], address[13:0]}}), .read(scope_read), .sample(scope_sample)
    );
",
        depth.trailing_zeros(),
        machine.inputs.base,
        machine.inputs.depth.trailing_zeros(),
        u8::from(is_program),
    );
    vec![
        ("SCOPE", text),
        ("SCOPE_WRITABLE", writable(channels)),
        ("SCOPE_READ", format!("address[15:6] == 10'd{} ? scope_read : 32'd0", SCOPE >> 6)),
        ("SCOPE_SAMPLE", "page[3] ? scope_sample : ".to_owned()),
        ("ENDED", "scope_ended".to_owned()),
        ("RETIRE_ADDRESS", "scope_bundles".to_owned()),
        (
            "SCOPE_NETS",
            match is_program {
                true => {
                    format!("    wire        scope_ended;\n    wire [{}:0] scope_bundles;\n", 16 * slots - 1)
                }
                false => String::new(),
            },
        ),
    ]
}

/// The addresses that the host writes, with a line for them.
fn writable(channels: u32) -> String {
    let names = ["scope_state", "scope_every", "scope_length", "scope_trigger", "scope_level"];
    let channels = (0..channels as usize).map(channel).flat_map(|at| [at, at + 1]);
    let each = names.into_iter().map(address).chain(channels);
    let each: Vec<String> = each.map(|at| format!("16'd{at}")).collect();
    format!("            {}: writable <= 1'b1;\n", each.join(", "))
}
