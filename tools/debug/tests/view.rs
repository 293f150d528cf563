// SPDX-License-Identifier: MIT OR Apache-2.0
//! Full-screen view as cells: layout at all sizes, and the picture in the documents.

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;
use ratatui::style::{Color, Modifier};
use std::fmt::Write as _;
use std::sync::Arc;
use takt_asm::{MemoryLoader, Options as AsmOptions, assemble};
use takt_debug::console::{Console, KEYS, Target, first_mistake};
use takt_debug::session::{Options, Session};
use takt_debug::system::{SystemOptions, SystemSession};
use takt_debug::view::{self, Pane, Screen};
use takt_emu::Rows;
use takt_isa::{F3, MACHINES, Program};
use takt_programs::hybrid::Controller;
use takt_programs::hybrid::closed_loop::ClosedLoop;
use takt_programs::trajectory::Trajectory;
use takt_programs::{AGH, SOURCES, gcode};

const SOURCE: &str = "\
.output sum, count:int
.reg    i:int n:int x q
; sum of a table\tand its count
        li      n, 3
        mov     i, zero
        fadd    sum, zero, zero
next:   call    add
        iadd    i, i, 1
        ilt     x, i, n
        bnz     x, next
        mov     count, i
        halt
add:    ld      x, table[i]
        fadd    sum, sum, x
        fdiv    q, x, sum
        ret
.data
table:  .float  0.5, 0.25, -1.75
";

fn console(source: &str) -> Console {
    let files = [("a.s", source)];
    let options = AsmOptions { machine: &F3, ..AsmOptions::default() };
    let assembled = assemble("a.s", &MemoryLoader::new(&files), &options).unwrap();
    let sources = vec![("a.s".to_owned(), source.to_owned())];
    let options = Options { sources, constants: assembled.constants, ..Options::default() };
    Console::new(Session::new(&assembled.program, options).unwrap())
}

/// Screen after these commands.
fn screen(console: &mut Console, commands: &[&str]) -> Screen {
    let mut screen = Screen::new(console.panes());
    for command in commands {
        let answer = console.execute(command);
        screen.log_command(command, &answer, console.panes());
    }
    screen
}

fn drawn(screen: &mut Screen, width: u16, height: u16) -> TestBackend {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| view::draw(frame, screen)).unwrap();
    terminal.backend().clone()
}

#[test]
fn unwritten_values_show_their_whole_note() {
    let mut console = console(&SOURCE.replace("count", "number_of_entries"));
    let mut screen = screen(&mut console, &[]);
    for width in 90..=160 {
        let drawn = drawn(&mut screen, width, 40).to_string();
        assert!(drawn.contains("never written"), "{width}: {drawn}");
        let opens = drawn.matches("(never written").count();
        assert_eq!(opens, drawn.matches("(never written)").count(), "{width}: {drawn}");
    }
}

#[test]
fn layout_of_the_panes() {
    let mut console = console(SOURCE);
    let commands = ["break add if i == 1", "display sum", "continue", "step 4", "print smu"];
    let mut screen = screen(&mut console, &commands);
    for (name, width, height) in [("80x24", 80, 24), ("120x40", 120, 40), ("20x5", 20, 5)] {
        insta::assert_snapshot!(name, drawn(&mut screen, width, height));
    }
    screen.typed = Some(("print sum + 1".to_owned(), 9));
    insta::assert_snapshot!("typed", drawn(&mut screen, 40, 8));
    screen.running = Some("in cycle 12,345; Ctrl-C stops".to_owned());
    insta::assert_snapshot!("running", drawn(&mut screen, 40, 8));
    screen.help = Some(0);
    insta::assert_snapshot!("help", drawn(&mut screen, 100, 40));
}

/// Rows of the screen as strings.
fn rows(backend: &TestBackend) -> Vec<String> {
    let buffer = backend.buffer();
    let width = usize::from(buffer.area.width);
    let row = |cells: &[ratatui::buffer::Cell]| cells.iter().map(|cell| cell.symbol()).collect::<String>();
    buffer.content.chunks(width).map(row).collect()
}

/// In the last line, the keys for quitting and stepping back come first, and no hint is truncated.
#[test]
fn the_last_line_has_whole_words() {
    let mut console = console(SOURCE);
    let mut screen = screen(&mut console, &[]);
    let mut last = |width| rows(&drawn(&mut screen, width, 24)).pop().unwrap().trim_end().to_owned();
    let all = last(300);
    let whole: Vec<&str> = all.split("  ").collect();
    for width in [20, 40, 80, 120, 200] {
        let line = last(width);
        assert!(line.split("  ").all(|hint| whole.contains(&hint)), "{width}: {line}");
        assert!(width < 40 || line.contains("q quit"), "{width}: {line}");
        assert!(
            width < 80 || line.contains("s/S step/back") && line.contains("c/C continue/reverse"),
            "{line}"
        );
    }
}

/// All lines of a bundle are marked: in the source where they fit, otherwise by number in the source's title, and beside the operations.
#[test]
fn every_line_of_a_bundle_is_shown() {
    let source = |between: usize| {
        let comments = "; nothing\n".repeat(between);
        format!(
            ".input a, b\n.output y, z\n.schedule on\n.period\np: fadd y, a, b\n{comments} fmul z, a, b\n wait p\n"
        )
    };
    for (between, mark) in [(7, "+   5 p:"), (60, " also 5 ")] {
        let mut console = console(&source(between));
        let mut screen = screen(&mut console, &["break p", "continue"]);
        let rows = rows(&drawn(&mut screen, 80, 24));
        assert!(rows.iter().any(|row| row.contains(mark)), "{between}:\n{}", rows.join("\n"));
        let line = (between + 6).to_string();
        let bundle = rows.iter().find(|row| row.starts_with("mul ")).expect("a slot of the bundle");
        assert!(bundle[..40].trim_end().ends_with(&line), "{bundle}");
    }
}

/// The panes show the selected core of a system; one line shows all cores.
#[test]
fn the_cores_of_a_system() {
    let machine = MACHINES.iter().find(|machine| machine.name == "t1").expect("there is one");
    let options = AsmOptions { machine, ..AsmOptions::default() };
    let assembled = assemble("a.s", &MemoryLoader::new(&[("a.s", SOURCE)]), &options).unwrap();
    let core = |name: &str| format!("[[core]]\nname = \"{name}\"\nprogram = \"a.s\"\nmachine = \"t1\"\n");
    let text = format!("tick = 1000\n{}{}", core("first"), core("second"));
    let program = |_: &takt_system::Request<'_>| -> Result<_, takt_system::ProgramError<()>> {
        Ok(assembled.program.clone())
    };
    let Ok(description) = takt_system::read("system.toml", &text, program) else { panic!("it is one") };
    let session = SystemSession::new(&description, SystemOptions::default()).unwrap();
    let view = || {
        let sources = vec![("a.s".to_owned(), SOURCE.to_owned())];
        Session::new(&assembled.program, Options { sources, ..Options::default() }).unwrap()
    };
    let mut console = Console::of_system(session, vec![view(), view()]);
    let commands = ["break second.add", "continue", "display sum", "core", "core", "step 2"];
    insta::assert_snapshot!("system", drawn(&mut screen(&mut console, &commands), 100, 30));
}

#[test]
fn scrolling_stays_within() {
    let mut console = console(SOURCE);
    let mut screen = screen(&mut console, &["continue"]);
    let natural = drawn(&mut screen, 80, 24).buffer().clone();
    for pane in Pane::ALL {
        assert_eq!(screen.focus, pane);
        // After any scroll beyond the end, scrolling back by one line has a visible effect at once.
        screen.scroll(1_000_000);
        let end = drawn(&mut screen, 80, 24).buffer().clone();
        screen.scroll(1_000_000);
        assert!(drawn(&mut screen, 80, 24).buffer() == &end, "{pane:?}");
        screen.scroll(-3_000_000);
        drawn(&mut screen, 80, 24);
        screen.turn(1);
    }
    // A command resets the scroll positions.
    screen.log_command("", &Ok(String::new()), console.panes());
    screen.log_command("continue", &console.execute("continue"), console.panes());
    assert_eq!(drawn(&mut screen, 80, 24).buffer().area, natural.area);
    screen.help = Some(usize::MAX);
    drawn(&mut screen, 80, 24);
    screen.scroll(-1);
    drawn(&mut screen, 80, 24);
}

#[test]
fn any_size_and_any_text() {
    // Names of maximum length, a source with terminal escape sequences, and illegal program words.
    let long = "n".repeat(200);
    let source = format!(
        ".output {long}\n.reg a{long}\n; \x1b[2J\u{7}\t世界 {long}\n{long}x: mov {long}, zero\nfadd a{long}, zero, zero\nhalt\n"
    );
    let mut wild = console(&source);
    let mut illegal = console(SOURCE).session().program().clone();
    illegal.code.iter_mut().for_each(|word| *word = !0);
    let mut illegal = Console::new(Session::new(&illegal, Options::default()).unwrap());
    let mut empty = {
        let program =
            Program { code: Vec::new(), lines: Vec::new(), ..console("halt").session().program().clone() };
        Console::new(Session::new(&program, Options::default()).unwrap())
    };
    for console in [&mut wild, &mut illegal, &mut empty] {
        let commands = ["display cycle", "print nothing", "step", "continue", "registers", "help"];
        let mut screen = screen(console, &commands);
        for (typed, help) in [(None, None), (Some(("x".repeat(300), 300)), None), (None, Some(7))] {
            (screen.typed, screen.help) = (typed, help);
            let sizes = (1..40).flat_map(|width| (1..16).map(move |height| (width, height)));
            for (width, height) in sizes.chain([(300, 1), (1, 300), (500, 200)]) {
                let backend = drawn(&mut screen, width, height);
                let controls = |symbol: &str| symbol.chars().any(char::is_control);
                assert!(!backend.buffer().content.iter().any(|cell| controls(cell.symbol())));
                screen.scroll(1);
                screen.turn(1);
            }
        }
    }
}

#[test]
fn keys_stand_for_commands() {
    let script: String = KEYS.iter().map(|(_, line)| format!("{line}\n")).collect();
    assert_eq!(first_mistake(&script, Target::System), None);
    let mut keys: Vec<char> = KEYS.iter().map(|(key, _)| *key).collect();
    keys.sort_unstable();
    keys.dedup();
    assert_eq!(keys.len(), KEYS.len());
}

/// The tracking program in its closed loop, as in `takt debug --track --tui`.
fn tracking(periods: usize) -> Console {
    let mut loader = MemoryLoader::default();
    for (path, text) in SOURCES {
        loader.add(*path, *text);
    }
    let assembled = assemble("hybrid/tracking.s", &loader, &AsmOptions::default()).unwrap();
    let program = assembled.program;
    let trajectory = Trajectory::plan(&gcode::read(AGH).unwrap()).unwrap();
    let controller = ClosedLoop::new(&trajectory, Controller::<f64>::new());
    let rows: Rows = controller
        .take(periods)
        .map(|record| {
            let registers = program.inputs.iter().map(|port| port.register);
            registers.zip(record.unwrap().inputs.to_words()).collect()
        })
        .collect();
    let options = Options {
        inputs: Some(Arc::new(rows)),
        tick: std::num::NonZeroU64::new(12_500),
        constants: assembled.constants,
        sources: SOURCES.iter().map(|(path, text)| ((*path).to_owned(), (*text).to_owned())).collect(),
        ..Options::default()
    };
    Console::new(Session::new(&program, options).unwrap())
}

/// This test writes docs/pictures/debug.svg if TAKT_PICTURES=1, and compares it otherwise.
#[test]
fn the_picture_of_the_documents() {
    let mut console = tracking(700);
    let commands = [
        "goto period 620",
        "display F1 - 80",
        "break :63",
        "watch l1d > 0.9",
        "continue",
        "step 6",
        "ulp l1d, sqrt(ll1)",
    ];
    let mut screen = screen(&mut console, &commands);
    // The width is legible on a telephone.
    let picture = svg(drawn(&mut screen, 72, 44).buffer());
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/pictures/debug.svg");
    if std::env::var_os("TAKT_PICTURES").is_some() {
        std::fs::write(path, &picture).unwrap();
    }
    let is_fresh = std::fs::read_to_string(path).is_ok_and(|old| old == picture);
    assert!(
        is_fresh,
        "stale: TAKT_PICTURES=1 cargo test --release -p takt-debug --test suite view:: rewrites it"
    );
}

/// Converts cells to an SVG picture, in runs of equal style.
fn svg(buffer: &Buffer) -> String {
    const WIDTH: f32 = 8.4;
    const HEIGHT: u16 = 18;
    let color = |color, other| match color {
        Color::Black => "#1c1c1c",
        Color::Red => "#e06c75",
        Color::Green => "#98c379",
        Color::Yellow => "#e5c07b",
        Color::Cyan => "#56b6c2",
        Color::DarkGray => "#7f848e",
        _ => other,
    };
    let area = buffer.area;
    let (width, height) = (f32::from(area.width) * WIDTH, area.height * HEIGHT);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.1} {height}\" width=\"{width:.1}\" height=\"{height}\" font-family=\"monospace\" font-size=\"14\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#1c1c1c\"/>\n",
    );
    for y in 0..area.height {
        let cell = |x: u16| &buffer[(x, y)];
        let mut x = 0;
        while x < area.width {
            let (start, style) = (x, cell(x).style());
            let mut run = String::new();
            while x < area.width && cell(x).style() == style {
                run.push_str(cell(x).symbol());
                x += 1;
            }
            let (mut ink, mut paper) = (color(cell(start).fg, "#d7dae0"), color(cell(start).bg, "#1c1c1c"));
            if cell(start).modifier.contains(Modifier::REVERSED) {
                std::mem::swap(&mut ink, &mut paper);
            }
            let (left, width) = (f32::from(start) * WIDTH, f32::from(x - start) * WIDTH);
            if paper != "#1c1c1c" {
                let top = y * HEIGHT;
                let _ = writeln!(
                    text,
                    "<rect x=\"{left:.1}\" y=\"{top}\" width=\"{width:.1}\" height=\"{HEIGHT}\" fill=\"{paper}\"/>"
                );
            }
            if !run.trim().is_empty() {
                let bold =
                    if cell(start).modifier.contains(Modifier::BOLD) { " font-weight=\"bold\"" } else { "" };
                let run = run.replace('&', "&amp;").replace('<', "&lt;");
                let base = y * HEIGHT + 13;
                let _ = writeln!(
                    text,
                    "<text x=\"{left:.1}\" y=\"{base}\" textLength=\"{width:.1}\" fill=\"{ink}\" xml:space=\"preserve\"{bold}>{run}</text>"
                );
            }
        }
    }
    text + "</svg>\n"
}
