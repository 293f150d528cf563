// SPDX-License-Identifier: MIT OR Apache-2.0
//! Table of peripherals: pins, registers and parameters of each. The generator, the models' tests, the reader of wiring files and `takt
//! board` take names and limits from here.

/// Direction of a signal, seen from the peripheral.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Into the peripheral, from outside.
    Input,
    /// Out of the peripheral.
    Output,
}

/// Pin of a peripheral: port `pin_<name>` of its module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pin {
    /// Name in wiring files.
    pub name: &'static str,
    /// Direction, seen from the peripheral.
    pub direction: Direction,
    /// The pin may stay unconnected; an input is then 0.
    pub optional: bool,
    /// Output of a register that the module does not read: the register may lie at the device's pin.
    pub is_register: bool,
    /// Parameter whose value is the level that switches off what is at the pin; 0 is that level without a parameter.
    pub off: Option<&'static str>,
}

/// Register of 32 bits: port `r_<name>` of the module if the program reads it, `w_<name>` if the program writes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    /// Name in wiring files.
    pub name: &'static str,
    /// A float may be scaled into the register, which the program writes.
    pub scaled: bool,
    /// Optional pin that the register needs.
    pub pin: Option<&'static str>,
    /// Contents of the register, for documentation.
    pub text: &'static str,
}

/// Parameter of a peripheral's module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// Name in wiring files; in capitals, the parameter of the module.
    pub name: &'static str,
    /// Least value; below 0 for a register's two's complement.
    pub least: i64,
    /// Greatest value that the module supports.
    pub most: i64,
    /// Value of a parameter that a wiring leaves out.
    pub default: u32,
    /// Meaning and unit, for documentation.
    pub text: &'static str,
    /// Names of the values from `least` on, with which a wiring states the parameter; empty if the parameter is a number.
    pub names: &'static [&'static str],
    /// Half a bit in cycles, which a wiring may also state by [`RATE`], in MHz.
    pub is_half_bit: bool,
}

/// Parameter of a trip that takes effect without a clock.
pub const DIRECT: &str = "direct";

/// Key of a wiring for the highest rate of bits, in MHz, in place of half a bit in cycles.
pub const RATE: &str = "rate";

/// Signals that a module takes besides clock, reset, pins and registers, or gives to other peripherals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Strobes {
    /// Input `enable`: the outputs may drive.
    pub enable: bool,
    /// Inputs `trip` and `off`: the outputs are at their tripped level. Other kinds with `enable` are disabled by a trip.
    pub trip: bool,
    /// Input `start`: a conversion begins.
    pub start: bool,
    /// A window begins at `start`; a wiring states the place of a carrier at its centre.
    pub window: bool,
    /// Inputs `place` and `back`: the carrier, whose half period in cycles is the module's parameter `HALF`.
    pub carrier: bool,
    /// Input `clear` and output `trip`: the module trips other peripherals, until it is cleared.
    pub trips: bool,
    /// Output `off`: with the parameter [`DIRECT`] a trip takes effect without a clock.
    pub direct: bool,
}

/// Port of a module: name and width.
pub type Port = (String, u32);

/// Kind of a peripheral.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kind {
    /// Name in wiring files.
    pub name: &'static str,
    /// Name of the Verilog module.
    pub module: &'static str,
    /// Short description, for documentation.
    pub text: &'static str,
    /// Pins, in the order of the module's ports.
    pub pins: &'static [Pin],
    /// Registers that the program reads: captured together at the tick.
    pub reads: &'static [Register],
    /// Registers that the program writes: published together at its `wait`.
    pub writes: &'static [Register],
    /// Parameters of the module.
    pub parameters: &'static [Parameter],
    /// Strobes of the module.
    pub strobes: Strobes,
}

const fn input(name: &'static str) -> Pin {
    Pin { name, direction: Direction::Input, optional: false, is_register: false, off: None }
}

const fn output(name: &'static str) -> Pin {
    Pin { name, direction: Direction::Output, optional: false, is_register: false, off: None }
}

const fn register_output(name: &'static str) -> Pin {
    Pin { is_register: true, ..output(name) }
}

const fn off(parameter: &'static str, pin: Pin) -> Pin {
    Pin { off: Some(parameter), ..pin }
}

const fn optional(pin: Pin) -> Pin {
    Pin { optional: true, ..pin }
}

const fn register(name: &'static str, text: &'static str) -> Register {
    Register { name, scaled: false, pin: None, text }
}

const fn scaled(name: &'static str, text: &'static str) -> Register {
    Register { name, scaled: true, pin: None, text }
}

const fn at(pin: &'static str, register: Register) -> Register {
    Register { pin: Some(pin), ..register }
}

const fn parameter(name: &'static str, least: i64, most: i64, default: u32, text: &'static str) -> Parameter {
    Parameter { name, least, most, default, text, names: &[], is_half_bit: false }
}

const fn choice(
    name: &'static str,
    names: &'static [&'static str],
    default: u32,
    text: &'static str,
) -> Parameter {
    Parameter { names, ..parameter(name, 0, names.len() as i64 - 1, default, text) }
}

const fn half_bit(least: i64, most: i64, default: u32) -> Parameter {
    let text = "half a bit in cycles; or `rate`: MHz, of which the highest is taken that the clock makes";
    Parameter { is_half_bit: true, ..parameter("half", least, most, default, text) }
}

const FILTER: Parameter =
    parameter("filter", 1, 256, 3, "cycles for which a level must stand before it counts");
const SIGNED: Parameter = parameter("signed", 0, 1, 1, "1: the value is signed, and 0 is 50 % duty");

/// Bits of a position within a turn, of an absolute encoder. The bits above are a positive integer in any case.
const TURN: Parameter = parameter(
    "turn",
    5,
    32,
    24,
    "bits of `position`; a float holds 24 bits exactly, and the bits above are `turns`",
);
const POSITION: Register = register("position", "the lowest `turn` bits of the position");
const TURNS: Register = register("turns", "the bits above them, 0 without any");
const LOST: Register =
    register("lost", "starts that came during a frame or the rest after it and were dropped");

const PLAIN: Strobes = Strobes {
    enable: false,
    trip: false,
    start: false,
    window: false,
    carrier: false,
    trips: false,
    direct: false,
};
const ENABLED: Strobes = Strobes { enable: true, ..PLAIN };
const STARTED: Strobes = Strobes { start: true, ..PLAIN };
const MODULATED: Strobes = Strobes { trip: true, carrier: true, ..ENABLED };
const TRIPPING: Strobes = Strobes { trips: true, ..PLAIN };
const WINDOWED: Strobes = Strobes { start: true, window: true, ..TRIPPING };

/// Names of the levels of a half bridge at rest.
const RESTS: &[&str] = &["off", "low", "high"];
/// Times from which a `pwm3` acts on new duties: the names of the parameter `update`.
pub const UPDATES: &[&str] = &["now", "valley", "peak", "either"];

/// Table of all kinds of peripherals.
pub const KINDS: &[Kind] = &[
    Kind {
        name: "quadrature",
        module: "takt_quadrature",
        text: "incremental encoder, four counts to a line, with index",
        pins: &[input("a"), input("b"), optional(input("index"))],
        reads: &[
            register("count", "the position in counts; wraps at 32 bits"),
            at("index", register("at_index", "the count at the last pulse of the index")),
            at("index", register("indices", "pulses of the index so far")),
            register("errors", "times that both pins changed at once"),
            register("since", "cycles since the last edge of a or b, at most 2^31 - 1"),
        ],
        writes: &[],
        parameters: &[
            FILTER,
            parameter(
                "start",
                i32::MIN as i64,
                i32::MAX as i64,
                0,
                "the count at power-up and reset, where the axis is parked",
            ),
        ],
        strobes: PLAIN,
    },
    Kind {
        name: "step",
        module: "takt_step",
        text: "step and direction, counted",
        pins: &[input("step"), input("direction")],
        reads: &[register("count", "the position in steps; wraps at 32 bits")],
        writes: &[],
        parameters: &[FILTER],
        strobes: PLAIN,
    },
    Kind {
        name: "pwm",
        module: "takt_pwm",
        text: "half bridge: centred pulses, complementary pin, dead time",
        pins: &[register_output("high"), optional(register_output("low"))],
        reads: &[],
        writes: &[scaled("duty", "cycles of the pulse, 0 to 2·half; signed: -half to half, 0 is 50 % duty")],
        parameters: &[
            parameter("half", 1, 65535, 1250, "half a period in cycles"),
            parameter("dead", 0, 255, 0, "dead time in cycles"),
            SIGNED,
        ],
        strobes: ENABLED,
    },
    Kind {
        name: "pwm3",
        module: "takt_pwm3",
        text: "three half bridges on a carrier, with dead time",
        pins: &[
            off("invert_high", output("high_a")),
            optional(off("invert_low", output("low_a"))),
            off("invert_high", output("high_b")),
            optional(off("invert_low", output("low_b"))),
            off("invert_high", output("high_c")),
            optional(off("invert_low", output("low_c"))),
        ],
        reads: &[],
        writes: &[
            scaled(
                "a",
                "cycles of phase a's pulse, 0 to 2·half of the carrier; signed: -half to half, 0 is 50 % duty",
            ),
            scaled("b", "the same of phase b"),
            scaled("c", "the same of phase c"),
            register("stop", "not 0: the switches are at rest, as without drive"),
        ],
        parameters: &[
            parameter("dead", 0, 1023, 0, "dead time in cycles"),
            parameter(
                "minimum",
                0,
                1023,
                0,
                "least cycles for which a switch is on; a shorter pulse is left out",
            ),
            choice(
                "update",
                UPDATES,
                0,
                "when duties act: `\"now\"`, from the next `\"valley\"` or `\"peak\"` on, or from `\"either\"`",
            ),
            Parameter { default: 0, ..SIGNED },
            parameter("invert_high", 0, 1, 0, "1: the pins of high switches are active low"),
            parameter("invert_low", 0, 1, 0, "1: the pins of low switches are active low"),
            choice(
                "safe",
                RESTS,
                0,
                "switches while the drive is not enabled: `\"off\"`, or those of the `\"low\"` or `\"high\"` side on",
            ),
            choice(
                "tripped",
                RESTS,
                0,
                "the same while a trip is held; `\"low\"` brakes a motor by its windings",
            ),
        ],
        strobes: MODULATED,
    },
    Kind {
        name: "trip",
        module: "takt_trip",
        text: "fault of a driver, or a comparator, which makes peripherals safe without the core",
        pins: &[input("in")],
        reads: &[
            register("state", "bit 0: the trip is held, bit 1: the pin asks for it"),
            register("trips", "trips so far; wraps at 32 bits"),
        ],
        writes: &[register("clear", "not 0: clears the trip if the pin no longer asks")],
        parameters: &[
            parameter("filter", 0, 255, 3, "cycles for which a level must stand before it counts; 0: none"),
            parameter("invert", 0, 1, 0, "1: the pin is active low"),
            parameter(
                DIRECT,
                0,
                1,
                0,
                "1: half bridges of a `pwm3` go off without a clock, and without a filter",
            ),
        ],
        strobes: Strobes { direct: true, ..TRIPPING },
    },
    Kind {
        name: "sigma-delta",
        module: "takt_sigma_delta",
        text: "analogue output: a stream of pulses on one pin",
        pins: &[register_output("out")],
        reads: &[],
        writes: &[scaled("value", "ones in 65536 cycles; signed: -32768 to 32768")],
        parameters: &[SIGNED],
        strobes: ENABLED,
    },
    Kind {
        name: "spi",
        module: "takt_spi",
        text: "SPI master for a converter: one frame each period, of one line or up to eight",
        pins: &[
            register_output("clock"),
            output("select"),
            optional(output("out")),
            optional(input("in")),
            optional(input("in2")),
            optional(input("in3")),
            optional(input("in4")),
            optional(input("in5")),
            optional(input("in6")),
            optional(input("in7")),
            optional(input("in8")),
        ],
        reads: &[
            at("in", register("received", "value received in the last frame")),
            register("frames", "frames so far"),
            register("lost", "starts that came during a frame and were dropped"),
            at(
                "in2",
                register(
                    "received2",
                    "value received at `in2` in the same frame; likewise up to `received8`",
                ),
            ),
            at("in3", register("received3", "the same of `in3`")),
            at("in4", register("received4", "the same of `in4`")),
            at("in5", register("received5", "the same of `in5`")),
            at("in6", register("received6", "the same of `in6`")),
            at("in7", register("received7", "the same of `in7`")),
            at("in8", register("received8", "the same of `in8`")),
        ],
        writes: &[at("out", scaled("send", "value to send in the next frames"))],
        parameters: &[
            half_bit(3, 65535, 4),
            parameter("bits", 1, 32, 16, "bits of a frame"),
            parameter("polarity", 0, 1, 0, "level of the clock at rest"),
            parameter("phase", 0, 1, 0, "0: data is sampled at the clock's first edge, 1: at its second"),
            parameter("signed", 0, 1, 0, "1: the highest bit received is a sign"),
            parameter("send", 0, u32::MAX as i64, 0, "value to send until the program has written `send`"),
        ],
        strobes: STARTED,
    },
    Kind {
        name: "ssi",
        module: "takt_ssi",
        text: "absolute encoder with a synchronous serial interface",
        pins: &[output("clock"), input("data")],
        reads: &[
            POSITION,
            TURNS,
            register("frames", "valid frames so far"),
            LOST,
            register("errors", "frames that were not valid: data was 0 before, or the two parts differ"),
        ],
        writes: &[],
        parameters: &[
            half_bit(3, 65535, 30),
            parameter("bits", 8, 36, 13, "bits of the encoder"),
            TURN,
            parameter("gray", 0, 1, 0, "1: the bits are Gray code"),
            parameter("double", 0, 1, 0, "1: the encoder sends the bits twice, with a 0 between"),
            parameter("pause", 1, 1 << 20, 1500, "cycles of rest after a frame, for the encoder's monoflop"),
        ],
        strobes: STARTED,
    },
    Kind {
        name: "biss-c",
        module: "takt_biss_c",
        text: "absolute encoder with BiSS C, unidirectional",
        pins: &[output("ma"), input("slo")],
        reads: &[
            POSITION,
            TURNS,
            register("error", "1: the encoder reports an error"),
            register("warning", "1: the encoder reports a warning"),
            register("frames", "frames with a right CRC so far"),
            LOST,
            register("errors", "frames with a wrong CRC"),
            register("silent", "frames without acknowledge, or without a start bit in time"),
            register("delay", "cycles from the clock's second rise to the acknowledge: the line"),
        ],
        writes: &[],
        parameters: &[
            half_bit(2, 65535, 4),
            parameter("bits", 12, 36, 18, "bits of the position, turns among them"),
            TURN,
            parameter("wait", 2, 255, 32, "bits from the clock's second rise to the start bit, at most"),
            parameter("timeout", 1, 1 << 20, 1500, "cycles of rest after a frame, for the encoder's timeout"),
        ],
        strobes: STARTED,
    },
    Kind {
        name: "sinc3",
        module: "takt_sinc3",
        text: "bits of a delta-sigma modulator: a sinc3 filter, and a faster one whose overcurrent is a trip",
        pins: &[input("data"), optional(register_output("clock")), optional(input("clock_in"))],
        reads: &[
            register("value", "the filtered value, -osr³ to osr³"),
            register("values", "values so far; wraps at 32 bits"),
            register("state", "bit 0: the trip is held, bit 1: there is overcurrent"),
            register("trips", "trips so far; wraps at 32 bits"),
        ],
        writes: &[register("clear", "not 0: clears the trip if there is no overcurrent")],
        parameters: &[
            half_bit(2, 255, 3),
            choice(
                "clock",
                &["out", "in"],
                0,
                "`\"out\"`: the modulator takes its clock; `\"in\"`: it has its own",
            ),
            parameter("osr", 8, 256, 64, "bits from value to value, and a third of the bits in one"),
            parameter("fast", 8, 32, 16, "the same of the sums for overcurrent"),
            parameter(
                "limit",
                0,
                32768,
                0,
                "least magnitude of such a sum that trips, at most fast³; 0: none does",
            ),
        ],
        strobes: WINDOWED,
    },
    Kind {
        name: "hall",
        module: "takt_hall",
        text: "three Hall sensors of a motor: sector, count, time from sector to sector",
        pins: &[input("a"), input("b"), input("c")],
        reads: &[
            register("sector", "0 to 5: 100, 110, 010, 011, 001, 101 of a, b, c; stays in a forbidden state"),
            register("fault", "1: the pins are in a forbidden state, 000 or 111"),
            register("count", "sectors passed, up or down; wraps at 32 bits"),
            register(
                "time",
                "cycles between the last two changes of the sector, or since the last one if they are more, at most 2^31 - 1",
            ),
            register("errors", "forbidden states, and changes by more than a sector, so far"),
        ],
        writes: &[],
        parameters: &[FILTER],
        strobes: PLAIN,
    },
    Kind {
        name: "digital-in",
        module: "takt_digital_in",
        text: "switch, debounced",
        pins: &[input("in")],
        reads: &[register("level", "0 or 1"), register("rises", "rising edges so far")],
        writes: &[],
        parameters: &[
            parameter("hold", 1, 1 << 24, 3, "cycles for which a level must stand before it counts"),
            parameter("invert", 0, 1, 0, "1: the pin is active low"),
        ],
        strobes: PLAIN,
    },
    Kind {
        name: "digital-out",
        module: "takt_digital_out",
        text: "one pin, on or off",
        pins: &[off("safe", register_output("out"))],
        reads: &[],
        writes: &[register("level", "0: off, else on")],
        parameters: &[parameter("safe", 0, 1, 0, "the pin while the drive is not enabled")],
        strobes: ENABLED,
    },
];

impl Kind {
    /// Finds a kind by name.
    pub fn from_name(name: &str) -> Option<&'static Kind> {
        KINDS.iter().find(|kind| kind.name == name)
    }

    /// Ports of the module in the order in which tests and generator connect them, with widths: first the inputs, without the clock, then
    /// the outputs.
    pub fn ports(&self) -> (Vec<Port>, Vec<Port>) {
        let mut takes = vec![("rst".to_owned(), 1)];
        let strobe = |name: &str, there: bool| there.then(|| (name.to_owned(), 1));
        takes.extend(strobe("enable", self.strobes.enable));
        takes.extend(strobe("trip", self.strobes.trip));
        takes.extend(strobe("off", self.strobes.trip));
        takes.extend(strobe("clear", self.strobes.trips));
        takes.extend(strobe("start", self.strobes.start));
        if self.strobes.carrier {
            takes.extend([("place".to_owned(), 16), ("back".to_owned(), 1)]);
        }
        takes.extend(strobe("take", !self.reads.is_empty()));
        takes.extend(strobe("put", !self.writes.is_empty()));
        let pins = |direction| {
            let pins = self.pins.iter().filter(move |pin| pin.direction == direction);
            pins.map(|pin| (format!("pin_{}", pin.name), 1))
        };
        takes.extend(pins(Direction::Input));
        takes.extend(self.writes.iter().map(|register| (format!("w_{}", register.name), 32)));
        let reads = self.reads.iter().map(|register| (format!("r_{}", register.name), 32));
        let trip = strobe("trip", self.strobes.trips).into_iter().chain(strobe("off", self.strobes.direct));
        (takes, pins(Direction::Output).chain(trip).chain(reads).collect())
    }
}

/// Rows of the table in docs/board.md, one per kind.
pub fn markdown() -> String {
    let registers = |registers: &[Register]| {
        let texts = registers.iter().map(|register| format!("`{}`: {}", register.name, register.text));
        texts.collect::<Vec<_>>().join("; ")
    };
    let row = |kind: &Kind| {
        let pins = kind.pins.iter().map(|pin| match pin.optional {
            true => format!("{} (optional)", pin.name),
            false => pin.name.to_owned(),
        });
        let value = |p: &Parameter| match p.names.get(p.default as usize) {
            Some(name) => format!("\"{name}\""),
            None => p.default.to_string(),
        };
        let parameters = kind.parameters.iter().map(|p| format!("`{}` ({}): {}", p.name, value(p), p.text));
        format!(
            "| `{}`: {} | {} | {} | {} | {} |\n",
            kind.name,
            kind.text,
            pins.collect::<Vec<_>>().join(", "),
            registers(kind.reads),
            registers(kind.writes),
            parameters.collect::<Vec<_>>().join("; ")
        )
    };
    KINDS.iter().map(row).collect()
}
