//! What is generated for a wiring: the module around core and peripherals, the board's top level, the image in block RAM, pins.

use crate::boards::Board;
use crate::kind::Direction;
use crate::protocol::{self, record_words};
use crate::wiring::{SIGNALS, Wiring};
use crate::{VERILOG, pll};
use std::fmt::Write as _;
use takt_isa::Program;
use takt_rtl::bench::{LoadRecord, load_records};
use takt_rtl::export::DesignFile;
use takt_rtl::{Library, export};
use thiserror::Error;

/// Bits of a record's number: the image in block RAM has twice as many records for each.
pub const IMAGE_BITS: u32 = 11;
/// Records that an image may have.
pub const RECORDS: usize = 1 << IMAGE_BITS;
/// Name of the board's top module.
pub const TOP: &str = "takt_board";
/// Name of the module around core and peripherals.
pub const AROUND: &str = "takt_peripherals";
/// Cycles that a reset of the board lasts, after which pins are valid.
const RESET_BITS: u32 = 8;

/// Why there is no circuit.
#[derive(Debug, Error)]
pub enum TopError {
    /// The program is too big for the image.
    #[error(
        "the program takes {0} records of block RAM; a board has {RECORDS}: each word, preset and data word that is not 0 takes one"
    )]
    TooBig(usize),
    /// The clock cannot be made.
    #[error(transparent)]
    Clock(#[from] pll::NoClock),
    /// The machine has no circuit.
    #[error(transparent)]
    Export(#[from] takt_rtl::ExportError),
}

/// A circuit for a board.
#[derive(Clone, Debug)]
pub struct Circuit {
    /// Verilog files and `image.hex`.
    pub files: Vec<DesignFile>,
    /// Modules that take the place of those of the same name on Lattice ECP5.
    pub ecp5: Vec<DesignFile>,
    /// Where the top's ports are, for nextpnr.
    pub pins: String,
    /// The core's clock in MHz.
    pub clock: f64,
    /// Records of the program.
    pub records: usize,
}

/// What is written at a start: records that change what zeros everywhere leave.
pub fn image(program: &Program) -> Result<Vec<LoadRecord>, TopError> {
    let records: Vec<_> = load_records(program)
        .into_iter()
        .filter(|record| {
            record.value != 0
                || !matches!(record.space, takt_rtl::bench::Space::Program | takt_rtl::bench::Space::Data)
        })
        .collect();
    if records.len() > RECORDS { Err(TopError::TooBig(records.len())) } else { Ok(records) }
}

/// The complete circuit of a program on a board.
///
/// # Errors
/// If the program is too big, the clock cannot be made, or the machine has no circuit.
pub fn circuit(board: &Board, wiring: &Wiring, program: &Program) -> Result<Circuit, TopError> {
    let records = image(program)?;
    let library = Library::builtin();
    let design = export(program.machine, &library)?.latching(program.latched_inputs())?;
    let mut files = design.files.clone();
    let mut put = |name: &str, text: String| {
        if !files.iter().any(|file| file.name.rsplit('/').next() == name.rsplit('/').next()) {
            files.push(DesignFile { name: name.to_owned(), text });
        }
    };
    for name in ["convert.v", "common/takt_leading_zeros.v"] {
        let own = name.rsplit('/').next().unwrap_or(name);
        let own = if own.starts_with("takt_") { own.to_owned() } else { format!("takt_{own}") };
        put(&format!("units/{own}"), library.text(name).unwrap_or_default().to_owned());
    }
    for (name, text) in VERILOG {
        put(&format!("board/{name}"), (*text).to_owned());
    }
    // The converter's code for a number with point to an integer, as its header has it.
    let convert = library.text("convert.v").unwrap_or_default();
    let to_integer = convert.lines().any(|line| line == "//@ op 1'b1 ftoi").into();
    put(&format!("{AROUND}.v"), around(wiring, program, &design.top, records.len(), to_integer));
    put(&format!("{TOP}.v"), top(board, wiring)?);
    let mut hex = String::from("// slot, space, address, value: what takt_boot writes at a start\n");
    for record in &records {
        let [low, high, place] = record_words(record);
        let _ = writeln!(hex, "{:018x}", u128::from(place) << 48 | u128::from(high) << 32 | u128::from(low));
    }
    put("image.hex", hex);
    Ok(Circuit {
        files,
        ecp5: design.ecp5,
        pins: pins(board, wiring),
        clock: wiring.clock,
        records: records.len(),
    })
}

/// Pins of that module that belong to peripherals and signals: name, direction, the board's pin.
pub(crate) fn own_pins(wiring: &Wiring) -> Vec<(String, Direction, String)> {
    let mut pins = Vec::new();
    for (signal, pin) in SIGNALS.iter().zip(&wiring.signals) {
        pins.extend(pin.clone().map(|pin| (format!("signal_{}", signal.name), signal.direction, pin)));
    }
    for peripheral in &wiring.peripherals {
        for (pin, at) in peripheral.kind.pins.iter().zip(&peripheral.pins) {
            let name = format!("{}_{}", peripheral.name, pin.name);
            pins.extend(at.clone().map(|at| (name, pin.direction, at)));
        }
    }
    pins
}

fn direction(direction: Direction) -> &'static str {
    match direction {
        Direction::Input => "input  wire",
        Direction::Output => "output wire",
    }
}

/// Core, peripherals and what is between them.
fn around(wiring: &Wiring, program: &Program, core: &str, records: usize, to_integer: u8) -> String {
    let machine = program.machine;
    let input_bits = machine.inputs.depth.trailing_zeros();
    let port_bits = machine.outputs_per_bank.trailing_zeros();
    let input = |name: &str| {
        let port = program.inputs.iter().find(|port| port.name == name)?;
        machine.inputs.index(port.register).map(|index| index.get())
    };
    let output = |name: &str| {
        let port = program.outputs.iter().find(|port| port.name == name)?;
        Some(u32::from(port.register.get()) % u32::from(machine.outputs_per_bank))
    };
    let (mut pins, mut nets, mut parts) = (String::new(), String::new(), String::new());
    let (mut inputs, mut outputs, mut taken, mut settings) =
        (String::new(), String::new(), String::new(), String::new());
    let (mut in_count, mut out_count) = (0, 0);
    for (name, way, _) in own_pins(wiring) {
        let _ = write!(pins, ",\n    {} {name}", direction(way));
    }
    for peripheral in &wiring.peripherals {
        let (name, kind) = (&peripheral.name, peripheral.kind);
        let parameters: Vec<String> = kind
            .parameters
            .iter()
            .zip(&peripheral.parameters)
            .map(|(parameter, value)| format!(".{}(32'd{value})", parameter.name.to_uppercase()))
            .collect();
        let list =
            if parameters.is_empty() { String::new() } else { format!("#({}) ", parameters.join(", ")) };
        let mut ports = vec![".clk(clk)".to_owned(), ".rst(rst)".to_owned()];
        if kind.strobes.enable {
            ports.push(".enable(drive)".to_owned());
        }
        if kind.strobes.start {
            ports.push(format!(".start({})", if peripheral.at_publish { "put" } else { "early | steps" }));
        }
        if !kind.reads.is_empty() {
            ports.push(".take(take)".to_owned());
        }
        if !kind.writes.is_empty() {
            ports.push(".put(put)".to_owned());
        }
        for (pin, at) in kind.pins.iter().zip(&peripheral.pins) {
            ports.push(match (at, pin.direction) {
                (Some(_), _) => format!(".pin_{}({name}_{})", pin.name, pin.name),
                (None, Direction::Input) => format!(".pin_{}(1'b0)", pin.name),
                (None, Direction::Output) => format!(".pin_{}()", pin.name),
            });
        }
        for (register, port) in kind.reads.iter().zip(&peripheral.reads) {
            let Some(index) = port.as_deref().and_then(input) else {
                ports.push(format!(".r_{}()", register.name));
                continue;
            };
            let net = format!("r_{name}_{}", register.name);
            let _ = writeln!(nets, "    wire [31:0] {net};");
            let _ = writeln!(
                inputs,
                "            8'd{in_count}: {{in_index, in_value}} <= {{{input_bits}'d{index}, {net}}};"
            );
            in_count += 1;
            ports.push(format!(".r_{}({net})", register.name));
        }
        for (i, (register, write)) in kind.writes.iter().zip(&peripheral.writes).enumerate() {
            let found = write.as_ref().and_then(|write| Some((output(&write.port)?, write.scale)));
            let Some((number, scale)) = found else {
                // Nobody writes it: an SPI sends its preset, others stay at rest.
                let preset = peripheral.parameter(register.name);
                ports.push(format!(".w_{}(32'd{preset})", register.name));
                continue;
            };
            let net = format!("w_{name}_{}", kind.writes[i].name);
            let _ = writeln!(nets, "    reg  [31:0] {net};");
            let _ = writeln!(outputs, "            8'd{out_count}: out_index <= {port_bits}'d{number};");
            let _ = writeln!(
                settings,
                "            8'd{out_count}: {{is_float, exponent}} = {{1'b{}, 10'd{}}};",
                u8::from(scale.is_some()),
                scale.unwrap_or(0).rem_euclid(1024)
            );
            let _ = writeln!(taken, "            8'd{out_count}: {net} <= float4 ? rounded : value4;");
            out_count += 1;
            ports.push(format!(".w_{}({net})", register.name));
        }
        let _ = writeln!(parts, "    {} {list}u_{name} ({});", kind.module, ports.join(", "));
    }
    let streams: String = machine
        .slots
        .iter()
        .map(|slot| {
            let b = slot.bank.name;
            format!(".output_{b}_write(), .output_{b}_index(), .output_{b}_value(), ")
        })
        .collect();
    let signal = |name: &str, value: &str| {
        let there = SIGNALS.iter().zip(&wiring.signals).any(|(s, pin)| s.name == name && pin.is_some());
        if there { format!("    assign signal_{name} = {value};\n") } else { String::new() }
    };
    let signals = signal("drive", "drive")
        + &signal("fault", "fault")
        + &signal("deadline", "|misses")
        + &signal("tick", "ticks");
    let stop = if wiring.signals[3].is_some() {
        "    takt_filter #(.HOLD(16), .BITS(8)) filter_stop (.clk(clk), .rst(rst), .pin(signal_stop), .level(stop));\n"
    } else {
        "    assign stop = 1'b0;\n"
    };
    let divide = (wiring.clock * 1e6 / f64::from(wiring.baud)).round();
    let mut values: Vec<(String, String)> = protocol::REGISTERS
        .iter()
        .map(|register| (format!("A_{}", register.name.to_uppercase()), register.address.to_string()))
        .collect();
    let more: [(&str, String); 38] = [
        ("NAME", AROUND.to_owned()),
        ("DIVIDE", divide.to_string()),
        ("PINS", pins),
        ("ID", format!("{:08x}", protocol::ID)),
        ("START", u8::from(wiring.autostart).to_string()),
        ("PERIOD", wiring.period.to_string()),
        ("LEAD", wiring.lead.to_string()),
        ("RECORDS", format!("{}'d{records}", IMAGE_BITS + 1)),
        ("RECORD_PAD", (31 - IMAGE_BITS).to_string()),
        ("IMAGE_BITS", IMAGE_BITS.to_string()),
        ("IMAGE_HIGH", (IMAGE_BITS + 1).to_string()),
        ("SLOTS", machine.slots.len().to_string()),
        ("CODE", machine.code_depth.trailing_zeros().to_string()),
        ("DATA", machine.data_depth.trailing_zeros().to_string()),
        ("IN_BITS", input_bits.to_string()),
        ("IN_HIGH", (input_bits - 1).to_string()),
        ("IN_LAST", ((1_u32 << input_bits) - 1).to_string()),
        ("PORT_BITS", port_bits.to_string()),
        ("PORT_HIGH", (port_bits - 1).to_string()),
        ("DEADLINES", wiring.deadlines.to_string()),
        ("HOST", wiring.host.to_string()),
        ("IN_COUNT", in_count.to_string()),
        ("OUT_COUNT", out_count.to_string()),
        ("INPUTS_AT", (protocol::INPUTS >> 12).to_string()),
        ("OUTPUTS_AT", (protocol::OUTPUTS >> 12).to_string()),
        ("IMAGE_AT", (protocol::IMAGE >> 14).to_string()),
        ("STOP", stop.trim_end().to_owned()),
        ("SIGNALS", signals),
        ("NETS", nets.trim_end().to_owned()),
        ("INPUTS", inputs),
        ("OUTPUTS", outputs),
        ("SETTINGS", settings),
        ("TAKEN", taken),
        ("PARTS", parts),
        ("CORE", core.to_owned()),
        ("STREAMS", streams.trim_end().to_owned()),
        ("FTOI", to_integer.to_string()),
        ("LATCHED", program.latched_inputs().to_string()),
    ];
    values.extend(more.map(|(name, value)| (name.to_owned(), value)));
    fill(include_str!("peripherals.v.in"), &values)
}

/// The text with every `@NAME@` replaced by its value.
fn fill(text: &str, values: &[(String, String)]) -> String {
    values.iter().fold(text.to_owned(), |text, (name, value)| text.replace(&format!("@{name}@"), value))
}

/// The board's top level: clock, reset, pins.
fn top(board: &Board, wiring: &Wiring) -> Result<String, TopError> {
    let (mut ports, mut connections, mut constants) = (String::new(), String::new(), String::new());
    for (name, way, _) in own_pins(wiring) {
        let _ = write!(ports, ",\n    {} {name}", direction(way));
        let _ = write!(connections, ", .{name}({name})");
    }
    for i in 0..board.high.len() {
        let _ = write!(ports, ",\n    output wire high{i}");
        let _ = writeln!(constants, "    assign high{i} = 1'b1;");
    }
    for i in 0..board.leds.len().min(LAMPS) {
        let _ = write!(ports, ",\n    output wire led{i}");
        let _ =
            writeln!(constants, "    assign led{i} = {}lamps[{i}];", if board.leds_high { "" } else { "~" });
    }
    let pressed = match &board.reset {
        None => "1'b0".to_owned(),
        Some(reset) => {
            ports.push_str(",\n    input  wire button");
            format!("{}button", if reset.level { "" } else { "~" })
        }
    };
    let pll = if (wiring.clock / board.clock.1 - 1.0).abs() < 1e-9 {
        "    assign clk    = clk_in;\n    assign locked = 1'b1;\n".to_owned()
    } else {
        let pll::Pll { reference, feedback, outputs } = pll::Pll::new(board.clock.1, wiring.clock)?;
        format!(
            "    EHXPLLL #(
        .PLLRST_ENA(\"DISABLED\"), .INTFB_WAKE(\"DISABLED\"), .STDBY_ENABLE(\"DISABLED\"), .DPHASE_SOURCE(\"DISABLED\"),
        .OUTDIVIDER_MUXA(\"DIVA\"), .OUTDIVIDER_MUXB(\"DIVB\"), .OUTDIVIDER_MUXC(\"DIVC\"), .OUTDIVIDER_MUXD(\"DIVD\"),
        .CLKI_DIV({reference}), .CLKOP_ENABLE(\"ENABLED\"), .CLKOP_DIV({outputs}), .CLKOP_CPHASE({}), .CLKOP_FPHASE(0),
        .FEEDBK_PATH(\"CLKOP\"), .CLKFB_DIV({feedback})
    ) pll (
        .RST(1'b0), .STDBY(1'b0), .CLKI(clk_in), .CLKOP(clk), .CLKFB(clk), .CLKINTFB(), .PHASESEL0(1'b0), .PHASESEL1(1'b0),
        .PHASEDIR(1'b1), .PHASESTEP(1'b1), .PHASELOADREG(1'b1), .PLLWAKESYNC(1'b0), .ENCLKOP(1'b0), .LOCK(locked)
    );
",
            outputs / 2
        )
    };
    Ok(format!(
        "// {TOP}: {}, its clock of {} MHz made {} MHz. Generated by `takt board build`.

module {TOP} (
    input  wire clk_in,
    input  wire uart_receive,
    output wire uart_send{ports}
);

    wire clk, locked;
{pll}
    // Reset lasts until the clock has been steady, and the button released, for {} cycles.
    reg  [{RESET_BITS}:0] steady;
    reg  [1:0] pressed, lock;
    initial {{steady, pressed, lock}} = {}'d0;
    wire rst = ~steady[{RESET_BITS}];
    always @(posedge clk) begin
        pressed <= {{pressed[0], {pressed}}};
        lock    <= {{lock[0], locked}};
        if (pressed[1] | ~lock[1]) steady <= {}'d0;
        else if (rst) steady <= steady + {}'d1;
    end

    wire [3:0] lamps;
{constants}
    {AROUND} around (
        .clk(clk), .rst(rst), .uart_receive(uart_receive), .uart_send(uart_send), .lamps(lamps){connections}
    );

endmodule
",
        board.text,
        board.clock.1,
        wiring.clock,
        1 << RESET_BITS,
        RESET_BITS + 5,
        RESET_BITS + 1,
        RESET_BITS + 1,
    ))
}

/// Lamps: alive, drive, fault, deadline.
const LAMPS: usize = 4;

/// Constraints for nextpnr.
fn pins(board: &Board, wiring: &Wiring) -> String {
    let mut text = String::new();
    let mut put = |name: &str, site: &str, pull: &str| {
        let _ = writeln!(text, "LOCATE COMP \"{name}\" SITE \"{site}\";");
        let _ = writeln!(text, "IOBUF PORT \"{name}\" IO_TYPE={} PULLMODE={pull};", board.standard);
    };
    put("clk_in", &board.clock.0, "NONE");
    put("uart_send", &board.send, "NONE");
    put("uart_receive", &board.receive, "UP");
    if let Some(reset) = &board.reset {
        put("button", &reset.site, reset.pull);
    }
    for (i, site) in board.high.iter().enumerate() {
        put(&format!("high{i}"), site, "NONE");
    }
    for (i, site) in board.leds.iter().take(LAMPS).enumerate() {
        put(&format!("led{i}"), site, "NONE");
    }
    for (name, way, pin) in own_pins(wiring) {
        // An open input is at rest: 1, which for `stop` means stop.
        let pull = if way == Direction::Input { "UP" } else { "NONE" };
        put(&name, board.site(&pin).unwrap_or_default(), pull);
    }
    let _ = writeln!(text, "FREQUENCY PORT \"clk_in\" {} MHZ;", board.clock.1);
    text
}
