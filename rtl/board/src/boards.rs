// SPDX-License-Identifier: MIT OR Apache-2.0
//! Boards as data: the files `rtl/board/boards/*.toml`, which name their sources, and files of the same form that a user writes.

use crate::document::{Document, Located, Mistake, Table};
use std::collections::BTreeMap;
use takt_family::{FAMILIES, Family, Part, Pinout, Pull, Sites};

/// Files that come with this crate, by the name of the board.
const FILES: &[(&str, &str)] = &[
    ("ulx3s-85f", include_str!("../boards/ulx3s-85f.toml")),
    ("ulx3s-45f", include_str!("../boards/ulx3s-45f.toml")),
    ("colorlight-i5", include_str!("../boards/colorlight-i5.toml")),
    ("colorlight-i9", include_str!("../boards/colorlight-i9.toml")),
    ("icepi-zero", include_str!("../boards/icepi-zero.toml")),
    ("orangecrab", include_str!("../boards/orangecrab.toml")),
    ("ecpix5-45f", include_str!("../boards/ecpix5-45f.toml")),
    ("ecpix5-85f", include_str!("../boards/ecpix5-85f.toml")),
    ("tang-nano-9k", include_str!("../boards/tang-nano-9k.toml")),
    ("tang-nano-20k", include_str!("../boards/tang-nano-20k.toml")),
    ("tang-primer-20k", include_str!("../boards/tang-primer-20k.toml")),
    ("tang-primer-25k", include_str!("../boards/tang-primer-25k.toml")),
    ("icebreaker", include_str!("../boards/icebreaker.toml")),
    ("icesugar", include_str!("../boards/icesugar.toml")),
    ("gatemate-evb", include_str!("../boards/gatemate-evb.toml")),
    ("olimex-gatemate", include_str!("../boards/olimex-gatemate.toml")),
    ("crosslink-nx-evn", include_str!("../boards/crosslink-nx-evn.toml")),
    ("arty-a7-35", include_str!("../boards/arty-a7-35.toml")),
    ("arty-a7-100", include_str!("../boards/arty-a7-100.toml")),
    ("zybo-z7-10", include_str!("../boards/zybo-z7-10.toml")),
    ("zybo-z7-20", include_str!("../boards/zybo-z7-20.toml")),
    ("pynq-z1", include_str!("../boards/pynq-z1.toml")),
    ("de10-nano", include_str!("../boards/de10-nano.toml")),
];

/// FPGA board, as described by its file.
#[derive(Clone, Debug)]
pub struct Board {
    /// Name on the command line.
    pub name: String,
    /// Description in a sentence.
    pub text: String,
    /// Source of the facts in the board's file.
    pub source: String,
    /// The device's family.
    pub family: &'static Family,
    /// FPGA on the board.
    pub device: &'static Part,
    /// The family's packages and pins.
    pub pinout: &'static Pinout,
    /// The device's package.
    pub package: String,
    /// The device's speed grade.
    pub grade: u8,
    /// I/O standard of all pins.
    pub standard: String,
    /// Sites that are always driven high.
    pub high: Vec<String>,
    /// The site of the clock, and its frequency in MHz.
    pub clock: (String, f64),
    /// The site on which the FPGA sends to the host.
    pub send: String,
    /// The site on which the FPGA receives from the host.
    pub receive: String,
    /// Reset button; `None` if the board has none.
    pub reset: Option<Reset>,
    /// Sites of the user LEDs, in the board's order.
    pub leds: Vec<String>,
    /// A 1 lights an LED; otherwise a 0 does.
    pub leds_high: bool,
    /// The pins that wirings may use: sites by the pins' names, in the order of the file.
    pub pins: Vec<(String, String)>,
}

/// A reset button: where it is connected, and its polarity.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reset {
    /// Site of the device that the button is connected to.
    pub site: String,
    /// Level while the button is pressed.
    pub level: bool,
    /// The resistor that the FPGA adds.
    pub pull: Pull,
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

    /// Finds a board that comes with this crate; `None` for an unknown name.
    ///
    /// # Errors
    /// Mistakes in the board's file.
    pub fn from_name(name: &str) -> Option<Result<Board, Vec<Mistake>>> {
        let (_, text) = FILES.iter().find(|(board, _)| *board == name)?;
        Some(Board::read(&format!("{name}.toml"), text))
    }

    /// Reads a board from the text of a file.
    ///
    /// # Errors
    /// All mistakes in the file, in its order.
    pub fn read(file: &str, text: &str) -> Result<Board, Vec<Mistake>> {
        Board::read_among(file, text, FAMILIES)
    }

    /// Reads a board like [`Board::read`]; its device must be of one of these families.
    ///
    /// # Errors
    /// All mistakes in the file, in its order.
    pub fn read_among(
        file: &str,
        text: &str,
        families: &'static [&'static Family],
    ) -> Result<Board, Vec<Mistake>> {
        let document = Document::new(file, text);
        let board = document.top().and_then(|top| board(&document, &top, families));
        document.finish(board)
    }

    /// The site of a pin.
    pub fn site(&self, pin: &str) -> Option<&str> {
        self.pins.iter().find(|(name, _)| name == pin).map(|(_, site)| site.as_str())
    }
}

/// Looks up a value in a list; a mistake names the valid values.
fn one_of<'a>(
    document: &Document<'_>,
    what: &str,
    given: &Located<String>,
    all: &[&'a str],
) -> Option<&'a str> {
    let found = all.iter().find(|name| **name == given.value).copied();
    if found.is_none() {
        document.mistake(
            &given.place,
            format!("there is no {what} `{}`; there are {}", given.value, all.join(", ")),
        );
    }
    found
}

/// A device that a board may have, its family, and the family's pins.
type Device = (&'static Part, &'static Family, &'static Pinout);

/// The devices of the families that a board may have; a name that stands for a family is none.
fn devices(families: &'static [&'static Family]) -> Vec<Device> {
    let pinouts = families.iter().filter_map(|family| Some((*family, family.board.as_ref()?)));
    pinouts
        .flat_map(|(family, pinout)| {
            family.parts.iter().filter(|part| part.room.is_some()).map(move |part| (part, family, pinout))
        })
        .collect()
}

fn board(document: &Document<'_>, top: &Table<'_>, families: &'static [&'static Family]) -> Option<Board> {
    let text = |table: &Table<'_>, key| table.need(key, table.string(key));
    let name = text(top, "name");
    let what = text(top, "text");
    let source = text(top, "source");
    let devices = devices(families);
    let parts: Vec<&str> = devices.iter().map(|(part, ..)| part.name).collect();
    let part = text(top, "part").and_then(|part| one_of(document, "device", &part, &parts));
    let device = devices.into_iter().find(|(device, ..)| Some(device.name) == part);
    // With an unknown device, names of package and pins are not checked, so that the file's other mistakes are still found.
    let pinout = device.map(|(_, _, pinout)| pinout);
    let known = |what, given: &Located<String>, all: fn(&Pinout) -> &'static [&'static str]| {
        pinout.and_then(|pinout| one_of(document, what, given, all(pinout)))
    };
    let package = text(top, "package").and_then(|given| known("package", &given, |pinout| pinout.packages));
    let (lowest, highest) = device.map_or((0, u8::MAX), |(_, family, _)| family.grades);
    let grade = top.need("grade", top.integer("grade", lowest.into(), highest.into()));
    let standard =
        text(top, "standard").and_then(|given| known("standard", &given, |pinout| pinout.standards));
    let sites =
        SiteAllocation { document, sites: pinout.map(|pinout| pinout.sites), taken: BTreeMap::new().into() };
    let high = top.strings("high").unwrap_or_default();
    let high: Vec<String> = high.into_iter().filter_map(|site| sites.take(site, "high")).collect();
    let clock = top.need("clock", top.table("clock")).and_then(|table| {
        let site = text(&table, "site").and_then(|site| sites.take(site, "the clock"));
        let mhz = table.need("mhz", table.number("mhz", 8.0, 400.0));
        table.reject_unknown_keys(&[]);
        Some((site?, mhz?.value))
    });
    let uart = top.need("uart", top.table("uart")).and_then(|table| {
        let send = text(&table, "send").and_then(|site| sites.take(site, "the UART"));
        let receive = text(&table, "receive").and_then(|site| sites.take(site, "the UART"));
        table.reject_unknown_keys(&[]);
        Some((send?, receive?))
    });
    let reset = top.table("reset").map(|table| {
        let site = text(&table, "site").and_then(|site| sites.take(site, "the reset"));
        let level = table.need("level", table.integer("level", 0, 1));
        let pull = match table.string("pull") {
            Some(pull) => one_of(document, "pull", &pull, &["up", "down", "none"]),
            None => Some("none"),
        };
        table.reject_unknown_keys(&[]);
        let pull = match pull? {
            "up" => Pull::Up,
            "down" => Pull::Down,
            _ => Pull::None,
        };
        Some(Reset { site: site?, level: level?.value == 1, pull })
    });
    let leds = top.table("leds").map(|table| {
        let list = table.need("sites", table.strings("sites"))?;
        let level = table.need("level", table.integer("level", 0, 1));
        table.reject_unknown_keys(&[]);
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
    top.reject_unknown_keys(&[]);
    let (device, family, pinout) = device?;
    let (send, receive) = uart?;
    let (leds, leds_high) = leds.unwrap_or(Some((Vec::new(), true)))?;
    Some(Board {
        name: name?.value,
        text: what?.value,
        source: source?.value,
        family,
        device,
        pinout,
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

/// Sites in use, each with its user and line.
struct SiteAllocation<'a> {
    document: &'a Document<'a>,
    /// Form of the names of the device's pins; `None` for an unknown device.
    sites: Option<Sites>,
    taken: std::cell::RefCell<BTreeMap<String, (String, usize)>>,
}

impl SiteAllocation<'_> {
    /// Takes a site, if its name is valid and it is free.
    fn take(&self, site: Located<String>, by: &str) -> Option<String> {
        if let Some(sites) = self.sites.filter(|sites| !(sites.is_site)(&site.value)) {
            let text = format!("`{}` is not a site; a site is {}", site.value, sites.form);
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
