// SPDX-License-Identifier: MIT OR Apache-2.0
//! Boards, as data: `rtl/board/boards/*.toml`, of which each names its sources, and files of the same form that a user writes.

use crate::document::{At, Document, Mistake, Table};
use std::collections::BTreeMap;

/// The files that come with this crate, by the name of the board.
const FILES: &[(&str, &str)] = &[
    ("ulx3s-85f", include_str!("../boards/ulx3s-85f.toml")),
    ("ulx3s-45f", include_str!("../boards/ulx3s-45f.toml")),
    ("colorlight-i5", include_str!("../boards/colorlight-i5.toml")),
    ("colorlight-i9", include_str!("../boards/colorlight-i9.toml")),
    ("icepi-zero", include_str!("../boards/icepi-zero.toml")),
];

/// A device that the tools know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Device {
    /// Its maker's name for it.
    pub part: &'static str,
    /// nextpnr's option for it.
    pub option: &'static str,
    /// Its block RAMs, of 18 Kbit each.
    pub blocks: u64,
}

/// The devices: Lattice's ECP5 without transceivers.
pub const DEVICES: &[Device] = &[
    Device { part: "LFE5U-25F", option: "--25k", blocks: 56 },
    Device { part: "LFE5U-45F", option: "--45k", blocks: 108 },
    Device { part: "LFE5U-85F", option: "--85k", blocks: 208 },
];

const PACKAGES: [&str; 5] = ["CABGA256", "CSFBGA285", "CABGA381", "CABGA554", "CABGA756"];

const STANDARDS: [&str; 4] = ["LVCMOS33", "LVCMOS25", "LVCMOS18", "LVCMOS15"];

/// A board.
#[derive(Clone, Debug, PartialEq)]
pub struct Board {
    /// Its name on the command line.
    pub name: String,
    /// Its description in a sentence.
    pub text: String,
    /// The source of its facts.
    pub source: String,
    /// The device on it.
    pub device: Device,
    /// The device's package.
    pub package: String,
    /// The device's speed grade.
    pub grade: u8,
    /// The level of its pins.
    pub standard: String,
    /// Sites that are driven high, always.
    pub high: Vec<String>,
    /// The site of the clock, and its frequency in MHz.
    pub clock: (String, f64),
    /// The site on which the FPGA sends to the host.
    pub send: String,
    /// The site on which it receives.
    pub receive: String,
    /// The reset button; none if there is none.
    pub reset: Option<Reset>,
    /// Sites of lamps.
    pub leds: Vec<String>,
    /// True if a lamp is lit by a 1.
    pub leds_high: bool,
    /// The pins that wirings may use: sites by the pins' names, in the order of the file.
    pub pins: Vec<(String, String)>,
}

/// A reset button.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reset {
    /// Its site.
    pub site: String,
    /// Its level when pressed.
    pub level: bool,
    /// The pull that the FPGA adds: `UP`, `DOWN` or `NONE`.
    pub pull: &'static str,
}

impl Board {
    /// The boards that come with this crate.
    ///
    /// # Errors
    /// Mistakes in their files; the tests read them all.
    pub fn builtin() -> Result<Vec<Board>, Vec<Mistake>> {
        FILES.iter().map(|(name, text)| Board::read(&format!("{name}.toml"), text)).collect()
    }

    /// Names of the boards that come with this crate.
    pub fn names() -> impl Iterator<Item = &'static str> {
        FILES.iter().map(|(name, _)| *name)
    }

    /// The board of this name.
    ///
    /// # Errors
    /// Mistakes in its file.
    pub fn from_name(name: &str) -> Option<Result<Board, Vec<Mistake>>> {
        let (_, text) = FILES.iter().find(|(board, _)| *board == name)?;
        Some(Board::read(&format!("{name}.toml"), text))
    }

    /// Reads a board from the text of a file.
    ///
    /// # Errors
    /// Everything that is wrong with it, in the order of the file.
    pub fn read(file: &str, text: &str) -> Result<Board, Vec<Mistake>> {
        let document = Document::new(file, text);
        let board = document.top().and_then(|top| board(&document, &top));
        document.finish(board)
    }

    /// The site of a pin.
    pub fn site(&self, pin: &str) -> Option<&str> {
        self.pins.iter().find(|(name, _)| name == pin).map(|(_, site)| site.as_str())
    }
}

/// One of a list, or a mistake that names them.
fn one_of<'a>(document: &Document<'_>, what: &str, given: &At<String>, all: &[&'a str]) -> Option<&'a str> {
    let found = all.iter().find(|name| **name == given.value).copied();
    if found.is_none() {
        document
            .mistake(&given.place, format!("`{}` is no {what}; there are {}", given.value, all.join(", ")));
    }
    found
}

fn board(document: &Document<'_>, top: &Table<'_>) -> Option<Board> {
    let text = |table: &Table<'_>, key| table.need(key, table.string(key));
    let sites = Sites { document, taken: BTreeMap::new().into() };
    let name = text(top, "name");
    let what = text(top, "text");
    let source = text(top, "source");
    let parts: Vec<&str> = DEVICES.iter().map(|device| device.part).collect();
    let device = text(top, "part").and_then(|part| {
        let part = one_of(document, "device", &part, &parts)?;
        DEVICES.iter().find(|device| device.part == part).copied()
    });
    let package = text(top, "package").and_then(|given| one_of(document, "package", &given, &PACKAGES));
    let grade = top.need("grade", top.integer("grade", 6, 8));
    let standard = text(top, "standard").and_then(|given| one_of(document, "standard", &given, &STANDARDS));
    let high = top.strings("high").unwrap_or_default();
    let high: Vec<String> = high.into_iter().filter_map(|site| sites.take(site, "high")).collect();
    let clock = top.need("clock", top.table("clock")).and_then(|table| {
        let site = text(&table, "site").and_then(|site| sites.take(site, "the clock"));
        let mhz = table.need("mhz", table.number("mhz", 8.0, 400.0));
        table.no_others(&[]);
        Some((site?, mhz?.value))
    });
    let uart = top.need("uart", top.table("uart")).and_then(|table| {
        let send = text(&table, "send").and_then(|site| sites.take(site, "the UART"));
        let receive = text(&table, "receive").and_then(|site| sites.take(site, "the UART"));
        table.no_others(&[]);
        Some((send?, receive?))
    });
    let reset = top.table("reset").map(|table| {
        let site = text(&table, "site").and_then(|site| sites.take(site, "the reset"));
        let level = table.need("level", table.integer("level", 0, 1));
        let pull = match table.string("pull") {
            Some(pull) => one_of(document, "pull", &pull, &["up", "down", "none"]),
            None => Some("none"),
        };
        table.no_others(&[]);
        let pull = match pull? {
            "up" => "UP",
            "down" => "DOWN",
            _ => "NONE",
        };
        Some(Reset { site: site?, level: level?.value == 1, pull })
    });
    let leds = top.table("leds").map(|table| {
        let list = table.need("sites", table.strings("sites"))?;
        let level = table.need("level", table.integer("level", 0, 1));
        table.no_others(&[]);
        let list: Vec<String> = list.into_iter().filter_map(|site| sites.take(site, "a lamp")).collect();
        Some((list, level?.value == 1))
    });
    let pins = top.need("pins", top.table("pins"))?.texts();
    let pins: Vec<(String, String)> = pins
        .into_iter()
        .filter_map(|(name, site)| {
            let what = format!("pin `{}`", name.value);
            Some((name.value, sites.take(site, &what)?))
        })
        .collect();
    top.no_others(&[]);
    let (send, receive) = uart?;
    let (leds, leds_high) = leds.unwrap_or(Some((Vec::new(), true)))?;
    Some(Board {
        name: name?.value,
        text: what?.value,
        source: source?.value,
        device: device?,
        package: package?.to_owned(),
        grade: grade?.value as u8,
        standard: standard?.to_owned(),
        high,
        clock: clock?,
        send,
        receive,
        reset: match reset {
            None => None,
            Some(reset) => Some(reset?),
        },
        leds,
        leds_high,
        pins,
    })
}

/// Sites that are taken, and by what.
struct Sites<'a> {
    document: &'a Document<'a>,
    taken: std::cell::RefCell<BTreeMap<String, (String, usize)>>,
}

impl Sites<'_> {
    /// The site, if it looks like one and is not taken.
    fn take(&self, site: At<String>, by: &str) -> Option<String> {
        let letters = site.value.chars().take_while(char::is_ascii_uppercase).count();
        let digits = &site.value[letters..];
        let right = (1..=2).contains(&letters)
            && (1..=2).contains(&digits.len())
            && digits.chars().all(|c| c.is_ascii_digit());
        if !right {
            let text =
                format!("`{}` is no site; a site is a letter or two and a number, as in \"A10\"", site.value);
            self.document.mistake(&site.place, text);
            return None;
        }
        let line = self.document.line(&site.place);
        let mut taken = self.taken.borrow_mut();
        if let Some((other, at)) = taken.get(&site.value) {
            let text = format!("site {} is taken: line {at} has it for {other}", site.value);
            self.document.mistake(&site.place, text);
            return None;
        }
        taken.insert(site.value.clone(), (by.to_owned(), line));
        Some(site.value)
    }
}
