// SPDX-License-Identifier: MIT OR Apache-2.0
//! Images in a flash at the pins of a board in Verilator: which of them starts, the update by a host, and an update that power ends.

use std::convert::Infallible;
use std::fs;
use std::path::{Path, PathBuf};
use takt_asm::{MemoryLoader, Options, assemble};
use takt_board::flash::{self, Commands, FlashError, Place, Slot};
use takt_board::protocol::OUTPUTS;
use takt_board::simulation::Simulation;
use takt_board::{Board, Host, Wiring, top};
use takt_isa::{Program, T1};

const WIRING: &str = "clock = 50
period = 40
baud = 5_000_000
autostart = true

[flash]
pins = { select = \"gp0\", clock = \"gp1\", out = \"gp2\", in = \"gp3\" }
first = 0x100000
second = 0x110000
";
const SLOTS: [usize; 2] = [0x10_0000, 0x11_0000];

/// A program that says which it is.
fn program(mark: u32) -> Program {
    let text = format!(
        ".schedule on\n.output mark:int\n.once\n mark = {mark}\n wait period\n.period\nperiod: mark = {mark}\n wait period\n"
    );
    let loader = MemoryLoader::new(&[("p.s", text.as_str())]);
    let options = Options { machine: &T1, ..Options::default() };
    assemble("p.s", &loader, &options).unwrap_or_else(|e| panic!("{e:?}")).program
}

fn entries(mark: u32) -> Vec<(u16, u32)> {
    flash::entries(&top::image(&program(mark)).expect("it has an image").records)
}

fn circuit() -> u32 {
    top::circuit_number(&program(0)).expect("it has a circuit")
}

/// The board with the bitstream's program 1, and a flash with these bytes; `life`: bytes that change before the power goes.
fn power_up(folder: &Path, bytes: Option<&[u8]>, life: Option<u64>) -> Simulation {
    power_up_with(WIRING, folder, bytes, life)
}

fn power_up_with(wiring: &str, folder: &Path, bytes: Option<&[u8]>, life: Option<u64>) -> Simulation {
    let board = Board::from_name("ulx3s-85f").expect("a board").expect("a right one");
    let wiring = Wiring::read("w.toml", wiring, &board).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
    fs::create_dir_all(folder).expect("there is room");
    if let Some(bytes) = bytes {
        fs::write(folder.join("flash.bin"), bytes).expect("there is room");
    }
    let file = folder.join("flash.life");
    match life {
        Some(life) => fs::write(file, life.to_string()).expect("there is room"),
        None => drop(fs::remove_file(file)),
    }
    let mut sim =
        Simulation::new(&board, &wiring, &program(1), folder).unwrap_or_else(|error| panic!("{error}"));
    // Both images are read, one of them twice, and both boots write all memories.
    sim.run(400_000, &[]).expect("it runs");
    sim
}

fn connect(sim: Simulation) -> Host<Simulation> {
    Host::connect(sim, 7).unwrap_or_else(|error| panic!("{error}"))
}

/// The program that runs; `None` if none does.
fn runs(host: &mut Host<Simulation>) -> Option<u32> {
    let control = host.register("control").expect("it answers");
    (control & 1 == 1).then(|| host.read(OUTPUTS, 1).expect("it answers")[0])
}

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("flash").join(name)
}

/// The contents of a flash with images at the two places.
fn contents(images: [Option<&[u8]>; 2]) -> Vec<u8> {
    let mut bytes = vec![0xff; 0x12_0000];
    for (at, image) in SLOTS.into_iter().zip(images) {
        let image = image.unwrap_or_default();
        bytes[at..at + image.len()].copy_from_slice(image);
    }
    bytes
}

/// The program that an image is to start, by a statement of the form of its own.
fn mark_of(bytes: &[u8]) -> Option<(u32, u32)> {
    let word = |i: usize| u32::from_be_bytes(bytes[4 * i..4 * i + 4].try_into().expect("four bytes"));
    if &bytes[..4] != b"TKF1" || word(1) != circuit() || word(3) > 8192 {
        return None;
    }
    let count = word(3) as usize;
    let mut sum = u32::MAX;
    for byte in &bytes[..16 + 8 * count] {
        for bit in (0..8).rev() {
            let is_one = sum >> 31 != u32::from(byte >> bit & 1);
            sum = sum << 1 ^ if is_one { 0x04c1_1db7 } else { 0 };
        }
    }
    if sum != word(4 + 2 * count) {
        return None;
    }
    let found: Vec<(u16, u32)> = (0..count).map(|i| (word(4 + 2 * i) as u16, word(5 + 2 * i))).collect();
    let mark = (0..10).find(|mark| entries(*mark) == found).expect("it is one of the programs");
    Some((word(2), mark))
}

/// The program that starts with these contents; 1 is the bitstream's.
fn expected(bytes: &[u8]) -> u32 {
    match SLOTS.map(|at| mark_of(&bytes[at..])) {
        [None, None] => 1,
        [Some((_, mark)), None] | [None, Some((_, mark))] => mark,
        [Some((first, mark)), Some((second, other))] => {
            if (second.wrapping_sub(first) as i32) < 0 {
                mark
            } else {
                other
            }
        }
    }
}

/// Contents of a flash, by name: its two images, the program that starts, and the image with which.
type Case<'a> = (&'a str, [Option<&'a [u8]>; 2], u32, Option<Slot>);

#[test]
fn the_newest_valid_image_starts() {
    let image = |number, mark| flash::image(circuit(), number, &entries(mark));
    let (old, new) = (image(7, 2), image(8, 3));
    let turned = |at: usize| {
        let mut bytes = new.clone();
        bytes[at] ^= 0x10;
        bytes
    };
    let other = flash::image(circuit() ^ 1, 9, &entries(3));
    let long: Vec<u8> = [&new[..12], &[0, 1, 0, 0], &new[16..]].concat();
    let wrapped = [image(u32::MAX, 4), image(0, 5)];
    let cases: [Case<'_>; 11] = [
        ("empty", [None, None], 1, None),
        ("first", [Some(&old), None], 2, Some(Slot::First)),
        ("second", [None, Some(&old)], 2, Some(Slot::Second)),
        ("newer behind", [Some(&old), Some(&new)], 3, Some(Slot::Second)),
        ("newer in front", [Some(&new), Some(&old)], 3, Some(Slot::First)),
        ("numbers wrap", [Some(&wrapped[0]), Some(&wrapped[1])], 5, Some(Slot::Second)),
        ("an entry turned", [Some(&turned(40)), Some(&old)], 2, Some(Slot::Second)),
        ("the sum turned", [Some(&old), Some(&turned(new.len() - 1))], 2, Some(Slot::First)),
        ("another circuit", [Some(&other), Some(&old)], 2, Some(Slot::Second)),
        ("too long", [Some(&long), Some(&old)], 2, Some(Slot::Second)),
        ("no image", [Some(&turned(0)), Some(&turned(1))], 1, None),
    ];
    let folder = folder("newest");
    for (name, images, mark, slot) in cases {
        let bytes = contents(images);
        assert_eq!(expected(&bytes), mark, "{name}");
        let mut host = connect(power_up(&folder, Some(&bytes), None));
        let started = host.started().expect("it answers");
        assert_eq!((runs(&mut host), started.running()), (Some(mark), slot), "{name}");
        assert!(Slot::ALL.iter().all(|slot| !started.failed(*slot)), "{name}");
    }
}

/// A host stores images; each power-up begins with the last of them, until the host makes them forgotten.
#[test]
fn a_host_updates_the_image() {
    let folder = folder("update");
    let _ = fs::remove_file(folder.join("flash.bin"));
    for (mark, slot) in [(2, Slot::First), (3, Slot::Second), (4, Slot::First)] {
        let mut host = connect(power_up(&folder, None, None));
        let place = host.flash().expect("it answers").expect("it has a flash");
        assert_eq!((place.slots.map(|at| at as usize), place.circuit), (SLOTS, circuit()));
        let mut written = 0;
        let stored = flash::store(&mut host, &place, &entries(mark), |more| written += more);
        assert_eq!(stored.unwrap_or_else(|error| panic!("{error}")), (slot, mark - 1));
        assert_eq!(written, flash::image(0, 0, &entries(mark)).len());
        // The running program is not concerned.
        assert_eq!(runs(&mut host), Some(mark - 1));
        drop(host);
        assert_eq!(runs(&mut connect(power_up(&folder, None, None))), Some(mark));
    }
    let mut host = connect(power_up(&folder, None, None));
    let place = host.flash().expect("it answers").expect("it has a flash");
    flash::forget(&mut host, &place).unwrap_or_else(|error| panic!("{error}"));
    drop(host);
    assert_eq!(runs(&mut connect(power_up(&folder, None, None))), Some(1));
}

/// The flash that the device is configured from, whose clock is no ordinary pin.
#[test]
fn the_configuration_flash_serves_too() {
    let own = WIRING
        .replace("\"gp0\"", "\"flash_select\"")
        .replace("\"gp1\"", "\"mclk\"")
        .replace("\"gp2\"", "\"flash_out\"")
        .replace("\"gp3\"", "\"flash_in\"");
    let bytes = contents([None, Some(&flash::image(circuit(), 1, &entries(6)))]);
    let mut host = connect(power_up_with(&own, &folder("own"), Some(&bytes), None));
    assert_eq!(runs(&mut host), Some(6));
    let place = host.flash().expect("it answers").expect("it has a flash");
    assert_eq!(flash::numbers(&mut host, &place).unwrap_or_else(|error| panic!("{error}")), [None, Some(1)]);

    let board = Board::from_name("ulx3s-85f").expect("a board").expect("a right one");
    let wiring = Wiring::read("w.toml", &own, &board).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
    let circuit = top::circuit(&board, &wiring, &program(1)).unwrap_or_else(|error| panic!("{error}"));
    assert!(
        circuit.pins.1.contains("\"flash_select\" SITE \"R2\"") && !circuit.pins.1.contains("flash_clock"),
        "{}",
        circuit.pins.1
    );
    let top = circuit.files.iter().find(|file| file.name == "takt_board.v").expect("it is there");
    assert!(top.text.contains("USRMCLK flash_mclk (.USRMCLKI(flash_clock)"), "{}", top.text);
}

/// A flash by its data sheet, whose power goes after some changes of bytes.
struct Chip {
    bytes: Vec<u8>,
    life: u64,
    enabled: bool,
}

impl Chip {
    fn put(&mut self, at: usize, value: u8) {
        if self.life > 0 {
            self.life -= 1;
            self.bytes[at] = value;
        }
    }
}

impl Commands for Chip {
    type Error = Infallible;

    fn command(&mut self, send: &[u8], receive: usize) -> Result<Vec<u8>, Infallible> {
        assert!(!send.is_empty() && send.len() <= 64 && receive <= 64);
        let at = send.iter().skip(1).take(3).fold(0, |at, byte| at << 8 | usize::from(*byte));
        match send[0] {
            0x06 => self.enabled = true,
            0x9f => return Ok(vec![0xef, 0x40, 0x18]),
            0x05 => return Ok(vec![0; receive]),
            0x03 => return Ok(self.bytes[at..at + receive].to_vec()),
            0x20 => {
                assert!(std::mem::take(&mut self.enabled));
                (0..4096).for_each(|i| self.put(at / 4096 * 4096 + i, 0xff));
            }
            0x02 => {
                assert!(std::mem::take(&mut self.enabled));
                for (i, byte) in send[4..].iter().enumerate() {
                    // Within a page, addresses wrap, and bits can only be cleared.
                    let at = at / 256 * 256 + (at + i) % 256;
                    self.put(at, self.bytes[at] & byte);
                }
            }
            command => panic!("no command {command:02x}"),
        }
        Ok(Vec::new())
    }
}

fn place() -> Place {
    Place { slots: SLOTS.map(|at| at as u32), room: 8192, circuit: circuit() }
}

/// Power that goes at any byte of an update leaves the image before, or the new one; so says the form, for each byte, and the circuit, for
/// some of them.
#[test]
fn power_that_goes_during_an_update_leaves_a_valid_image() {
    let place = place();
    // The places hold the old image and an older one, which is overwritten.
    let images = [(1, 2), (2, 3)].map(|(number, mark)| flash::image(place.circuit, number, &entries(mark)));
    let before = contents([Some(&images[1]), Some(&images[0])]);
    let update = |life| {
        let mut chip = Chip { bytes: before.clone(), life, enabled: false };
        let done = flash::store(&mut chip, &place, &entries(4), |_| ()).is_ok();
        (chip.bytes, done)
    };
    let (whole, done) = update(u64::MAX);
    assert!(done && expected(&whole) == 4);
    let changes = 4096 + flash::image(0, 0, &entries(4)).len() as u64;
    let folder = folder("power");
    let (mut old, mut new) = (0, 0);
    for life in 0..=changes {
        let (bytes, done) = update(life);
        let mark = expected(&bytes);
        assert!(mark == 3 || (mark == 4 && life == changes), "after {life} bytes: {mark}");
        assert_eq!(done, life == changes, "after {life} bytes");
        (old, new) = (old + u32::from(mark == 3), new + u32::from(mark == 4));
        if life % 997 == 0 || life + 2 > changes {
            let mut host = connect(power_up(&folder, Some(&bytes), None));
            assert_eq!(runs(&mut host), Some(mark), "after {life} bytes");
        }
    }
    assert_eq!((u64::from(old), new), (changes, 1));
}

/// The same on the simulated board: the power of flash and board goes while the host writes.
#[test]
fn power_that_goes_on_the_board_leaves_a_valid_image() {
    let (folder, circuit) = (folder("board-power"), circuit());
    let image = flash::image(circuit, 5, &entries(2));
    for life in [0, 100, 4097, 4150] {
        let mut host = connect(power_up(&folder, Some(&contents([None, Some(&image)])), Some(life)));
        let place = host.flash().expect("it answers").expect("it has a flash");
        let stored = flash::store(&mut host, &place, &entries(3), |_| ());
        assert!(matches!(stored, Err(FlashError::Kept { .. })), "{stored:?}");
        drop(host);
        let bytes = fs::read(folder.join("flash.bin")).expect("it is there");
        assert_eq!(expected(&bytes), 2);
        assert_eq!(runs(&mut connect(power_up(&folder, None, None))), Some(2), "after {life} bytes");
    }
}

#[test]
fn a_flash_that_is_not_there_is_named() {
    struct Nothing(u8);
    impl Commands for Nothing {
        type Error = Infallible;
        fn command(&mut self, _: &[u8], receive: usize) -> Result<Vec<u8>, Infallible> {
            Ok(vec![self.0; receive])
        }
    }
    for level in [0, 0xff] {
        let error =
            flash::store(&mut Nothing(level), &place(), &entries(2), |_| ()).expect_err("there is none");
        assert!(error.to_string().starts_with("no flash answers at the pins"), "{error}");
    }
    let many = vec![(0, 0); 8193];
    let error = flash::store(&mut Nothing(0), &place(), &many, |_| ()).expect_err("it is too long");
    assert_eq!(error.to_string(), "the program's image has 8193 entries, and the board has room for 8192");
}

/// Mistakes in the table `[flash]` are told with their place.
#[test]
fn mistakes_in_the_wiring_are_named() {
    let board = Board::from_name("ulx3s-85f").expect("a board").expect("a right one");
    let said = |from: &str, to: &str| {
        let text = WIRING.replace(from, to);
        assert_ne!(text, WIRING);
        let read = Wiring::read("w.toml", &text, &board);
        let mistakes = match read {
            Err(mistakes) => mistakes,
            Ok(wiring) => wiring.check("w.toml", &text, &program(1)).expect_err("a mistake"),
        };
        mistakes.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };
    for (from, to, message) in [
        ("first = 0x100000", "first = 0x100800", "an image begins at a multiple of 4096 bytes (0x1000)"),
        ("first = 0x100000\n", "", "`first` is missing in [flash]"),
        ("second = 0x110000", "second = 0x108000", "the two images overlap: each takes"),
        ("second = 0x110000", "second = 0xfff000", "and ends beyond 16 MB"),
        (
            "second = 0x110000",
            "second = 0x1000000",
            "`second` must be a whole number from 0 to 16777215, not 0x1000000",
        ),
        ("clock = \"gp1\"", "clock = \"gp0\"", "pin `gp0` is used twice"),
        ("clock = \"gp1\"", "clock = \"mcl\"", "`mcl` is not a pin of ulx3s-85f"),
        ("in = \"gp3\"", "input = \"gp3\"", "`in` is missing"),
        ("baud = 5_000_000", "uart = false", "`flash` is for a host, which `uart = false` leaves out"),
    ] {
        let said = said(from, to);
        assert!(said.contains(message), "{said}");
    }
}
