//! What is generated for a wiring: the module around core and peripherals, the board's top level, the image in block RAM, pins.

mod memory;
mod observer;
mod parts;
mod program;
mod system;

use crate::application::Application;
use crate::boards::Board;
use crate::kind::Direction;
use crate::protocol::record_words;
use crate::wiring::{SIGNALS, Wiring};
use crate::{VERILOG, pll};
use parts::direction;
use std::fmt::Write as _;
use takt_isa::load::{LoadRecord, Space, load_records};
use takt_rtl::export::DesignFile;
use takt_rtl::{Driver, Library, SystemDesign, export, export_driven, system_records};
use takt_system::Description;
use thiserror::Error;

/// Bits of a record's number in a program's image.
const IMAGE_BITS: u32 = 11;
/// Records that a program's image may have, and those of a system for which there is room at least.
pub const RECORDS: usize = 1 << IMAGE_BITS;
/// Records that a system's image may have: the protocol has addresses for so many.
pub const SYSTEM_RECORDS: usize = crate::protocol::PAGES * crate::protocol::PAGE;
/// Name of the board's top module.
pub const TOP: &str = "takt_board";
/// Name of the module around core and peripherals.
pub const AROUND: &str = "takt_peripherals";
/// The number, as a power of two, of the cycles that a reset of the board lasts at least.
const RESET_BITS: u32 = 8;
/// Cycles from power-up until the board's reset is over. Before, a simulation's pins may be anything.
pub const RESET: u32 = 2 << RESET_BITS;

/// Why there is no circuit.
#[derive(Debug, Error)]
pub enum TopError {
    /// The program is too big for the image.
    #[error(
        "the program takes {0} records of block RAM; a board has {RECORDS}: each word, preset and data word that is not 0 takes one"
    )]
    TooBig(usize),
    /// The programs are too big for the image.
    #[error("the system's programs take {0} records; a board's image has {SYSTEM_RECORDS} at most")]
    SystemTooBig(usize),
    /// The device has too little block RAM.
    #[error(transparent)]
    Memory(#[from] memory::TooMuch),
    /// The clock cannot be made.
    #[error(transparent)]
    Clock(#[from] pll::NoClock),
    /// The machine has no circuit.
    #[error(transparent)]
    Export(#[from] takt_rtl::ExportError),
    /// The system has no circuit.
    #[error(transparent)]
    System(#[from] takt_rtl::SystemError),
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
    /// Records that the image has room for.
    pub room: usize,
}

/// What a program or a system needs at its start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Contents {
    /// Records, each as its three words in the image.
    pub records: Vec<[u32; 3]>,
    /// Records that there is room for.
    pub room: usize,
}

/// Bits of the number of one of so many records.
fn bits(records: usize) -> u32 {
    records.next_power_of_two().trailing_zeros().max(1)
}

/// What is written at a start: records that change what zeros everywhere leave.
///
/// # Errors
/// If there are too many.
pub fn image<'a>(application: impl Into<Application<'a>>) -> Result<Contents, TopError> {
    let is_zero =
        |record: &LoadRecord| record.value == 0 && matches!(record.space, Space::Program | Space::Data);
    match application.into() {
        Application::Program(program) => {
            let records = load_records(program).into_iter().filter(|record| !is_zero(record));
            let records: Vec<_> = records.map(|record| record_words(0, &record)).collect();
            match records.len() {
                most if most > RECORDS => Err(TopError::TooBig(most)),
                _ => Ok(Contents { records, room: RECORDS }),
            }
        }
        Application::System(description) => {
            let records = system_records(description).into_iter();
            let records: Vec<_> = records.map(|(core, record)| record_words(core, &record)).collect();
            let room = records.len().next_multiple_of(1024).max(RECORDS);
            match room > SYSTEM_RECORDS {
                true => Err(TopError::SystemTooBig(records.len())),
                false => Ok(Contents { records, room }),
            }
        }
    }
}

/// The complete circuit of a program, or a system, on a board.
///
/// # Errors
/// If the program is too big, the clock cannot be made, or the machine has no circuit.
pub fn circuit<'a>(
    board: &Board,
    wiring: &Wiring,
    application: impl Into<Application<'a>>,
) -> Result<Circuit, TopError> {
    let application = application.into();
    let contents = image(application)?;
    let library = Library::builtin();
    let (mut files, ecp5, around) = match application {
        Application::Program(program) => {
            let design = export(program.machine, &library)?.latching(program.latched_inputs())?;
            let around = program::around(wiring, program, &design.top, contents.records.len(), &library);
            (design.files, design.ecp5, around)
        }
        Application::System(description) => {
            memory::check(board, wiring, description, &contents)?;
            let design = system_design(description)?;
            let circuit = fingerprint(&design);
            let around = system::around(wiring, &design.plan, &contents, circuit, &library);
            (design.files, design.ecp5, around)
        }
    };
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
    // What goes between peripherals and cores is one thing for a program, and another for a system.
    let others: &[&str] = match application {
        Application::Program(_) => &["takt_follow.v", "takt_turn.v"],
        Application::System(_) => &["takt_exchange.v"],
    };
    for (name, text) in VERILOG.iter().filter(|(name, _)| !others.contains(name)) {
        put(&format!("board/{name}"), (*text).to_owned());
    }
    put(&format!("{AROUND}.v"), around);
    put(&format!("{TOP}.v"), top(board, wiring)?);
    let mut hex = String::from("// core, slot, space, address, value: what takt_boot writes at a start\n");
    let digits = if application.machines().len() > 1 { 19 } else { 18 };
    for [low, high, place] in &contents.records {
        let record = u128::from(*place) << 48 | u128::from(*high) << 32 | u128::from(*low);
        let _ = writeln!(hex, "{record:0digits$x}");
    }
    put("image.hex", hex);
    Ok(Circuit {
        files,
        ecp5,
        pins: pins(board, wiring),
        clock: wiring.clock,
        records: contents.records.len(),
        room: contents.room,
    })
}

fn system_design(description: &Description) -> Result<SystemDesign, TopError> {
    let mut design = export_driven(description, "board", &Library::builtin(), Driver::Board)?;
    // The board's own do this.
    let others = ["takt_loader.v", "takt_start.v", "takt_pace.v"];
    design.files.retain(|file| !others.iter().any(|name| file.name.ends_with(name)));
    Ok(design)
}

/// The number by which a host knows a system's circuit again: its modules, programs apart.
///
/// # Errors
/// As [`circuit`].
pub fn circuit_number(description: &Description) -> Result<u32, TopError> {
    Ok(fingerprint(&system_design(description)?))
}

/// FNV-1a of what was generated for the system, without comments, which name programs.
fn fingerprint(design: &SystemDesign) -> u32 {
    let own = design.files.iter().filter(|file| file.name.starts_with(&design.top));
    let lines =
        own.flat_map(|file| file.text.lines()).map(|line| line.split("//").next().unwrap_or(line).trim());
    lines
        .flat_map(str::bytes)
        .fold(0x811c_9dc5, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
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
        takt_isa::text::one_line(&board.text),
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
