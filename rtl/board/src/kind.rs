// SPDX-License-Identifier: MIT OR Apache-2.0
//! The table of peripherals: what each has of pins, registers and parameters. The generator, the models' tests, the reader of
//! wiring files and `takt board` take names and limits from here.

/// Which way a signal goes, seen from the peripheral.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Into it.
    Input,
    /// Out of it.
    Output,
}

/// A pin of a peripheral: port `pin_<name>` of its module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pin {
    /// Its name.
    pub name: &'static str,
    /// Its direction.
    pub direction: Direction,
    /// True if it may be left unconnected; an input is then 0.
    pub optional: bool,
}

/// A register of 32 bits: port `r_<name>` of its module if the program reads it, `w_<name>` if it writes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    /// Its name.
    pub name: &'static str,
    /// True if a float may be scaled into it, of one that is written.
    pub scaled: bool,
    /// Its contents.
    pub text: &'static str,
}

/// A parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// Its name in wiring files; in the module the same in capitals.
    pub name: &'static str,
    /// The least value; one below 0 is a register's two's complement.
    pub least: i64,
    /// The greatest.
    pub most: i64,
    /// Unless stated.
    pub default: u32,
    /// Its meaning, with its unit.
    pub text: &'static str,
}

/// The strobes that a module takes besides clock, reset, pins and registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Strobes {
    /// `enable`: the outputs may drive.
    pub enable: bool,
    /// `start`: a conversion begins.
    pub start: bool,
}

/// A port of a module: its name and its bits.
pub type Port = (String, u32);

/// A kind of peripheral.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kind {
    /// Its name in wiring files.
    pub name: &'static str,
    /// Its module.
    pub module: &'static str,
    /// Its description in a few words.
    pub text: &'static str,
    /// Its pins.
    pub pins: &'static [Pin],
    /// The registers that the program reads: captured together at the tick.
    pub reads: &'static [Register],
    /// The registers that the program writes: published together at its `wait`.
    pub writes: &'static [Register],
    /// Its parameters.
    pub parameters: &'static [Parameter],
    /// Its strobes.
    pub strobes: Strobes,
}

const fn input(name: &'static str) -> Pin {
    Pin { name, direction: Direction::Input, optional: false }
}

const fn output(name: &'static str) -> Pin {
    Pin { name, direction: Direction::Output, optional: false }
}

const fn optional(pin: Pin) -> Pin {
    Pin { optional: true, ..pin }
}

const fn register(name: &'static str, text: &'static str) -> Register {
    Register { name, scaled: false, text }
}

const fn scaled(name: &'static str, text: &'static str) -> Register {
    Register { name, scaled: true, text }
}

const fn parameter(name: &'static str, least: i64, most: i64, default: u32, text: &'static str) -> Parameter {
    Parameter { name, least, most, default, text }
}

const FILTER: Parameter =
    parameter("filter", 1, 256, 3, "cycles for which a level must stand before it counts");
const SIGNED: Parameter = parameter("signed", 0, 1, 1, "1: the value is signed, and 0 is 50 % duty");

const ENABLED: Strobes = Strobes { enable: true, start: false };
const PLAIN: Strobes = Strobes { enable: false, start: false };
const STARTED: Strobes = Strobes { enable: false, start: true };

/// Every kind of peripheral.
pub const KINDS: &[Kind] = &[
    Kind {
        name: "quadrature",
        module: "takt_quadrature",
        text: "incremental encoder, four counts to a line, with index",
        pins: &[input("a"), input("b"), optional(input("index"))],
        reads: &[
            register("count", "the position in counts; wraps at 32 bits"),
            register("at_index", "the count at the last pulse of the index"),
            register("indices", "pulses of the index so far"),
            register("errors", "times that both pins changed at once"),
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
        pins: &[output("high"), optional(output("low"))],
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
        name: "sigma-delta",
        module: "takt_sigma_delta",
        text: "analogue output: a stream of pulses on one pin",
        pins: &[output("out")],
        reads: &[],
        writes: &[scaled("value", "ones in 65536 cycles; signed: -32768 to 32768")],
        parameters: &[SIGNED],
        strobes: ENABLED,
    },
    Kind {
        name: "spi",
        module: "takt_spi",
        text: "SPI master for a converter: one frame each period",
        pins: &[output("clock"), output("select"), optional(output("out")), optional(input("in"))],
        reads: &[
            register("received", "what the last frame brought"),
            register("frames", "frames so far"),
            register("lost", "starts that came during a frame and were dropped"),
        ],
        writes: &[scaled("send", "what the next frames send")],
        parameters: &[
            parameter("half", 3, 65535, 4, "half a bit in cycles"),
            parameter("bits", 1, 32, 16, "bits of a frame"),
            parameter("polarity", 0, 1, 0, "level of the clock at rest"),
            parameter("phase", 0, 1, 0, "0: data is sampled at the clock's first edge, 1: at its second"),
            parameter("signed", 0, 1, 0, "1: the highest bit received is a sign"),
            parameter("send", 0, u32::MAX as i64, 0, "what is sent until the program has written `send`"),
        ],
        strobes: STARTED,
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
        pins: &[output("out")],
        reads: &[],
        writes: &[register("level", "0: off, else on")],
        parameters: &[parameter("safe", 0, 1, 0, "the pin while the drive is not enabled")],
        strobes: ENABLED,
    },
];

impl Kind {
    /// The kind of this name.
    pub fn from_name(name: &str) -> Option<&'static Kind> {
        KINDS.iter().find(|kind| kind.name == name)
    }

    /// The ports of its module in the order in which tests and generator connect them, with widths; first those that it takes, then
    /// those that it drives. The clock is not among them.
    pub fn ports(&self) -> (Vec<Port>, Vec<Port>) {
        let mut takes = vec![("rst".to_owned(), 1)];
        let strobe = |name: &str, there: bool| there.then(|| (name.to_owned(), 1));
        takes.extend(strobe("enable", self.strobes.enable));
        takes.extend(strobe("start", self.strobes.start));
        takes.extend(strobe("take", !self.reads.is_empty()));
        takes.extend(strobe("put", !self.writes.is_empty()));
        let pins = |direction| {
            let pins = self.pins.iter().filter(move |pin| pin.direction == direction);
            pins.map(|pin| (format!("pin_{}", pin.name), 1))
        };
        takes.extend(pins(Direction::Input));
        takes.extend(self.writes.iter().map(|register| (format!("w_{}", register.name), 32)));
        let reads = self.reads.iter().map(|register| (format!("r_{}", register.name), 32));
        (takes, pins(Direction::Output).chain(reads).collect())
    }
}

/// Every kind as a row of the table in docs/board.md.
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
        let parameters = kind.parameters.iter().map(|p| format!("`{}` ({}): {}", p.name, p.default, p.text));
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
