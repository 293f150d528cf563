// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt debug` on a pseudo-terminal, with an emulated screen.

use crate::common;
use crate::common::{Folder, SUM, source};
use portable_pty::{Child, CommandBuilder, MasterPty, PtySize, native_pty_system};
use std::io::{Read, Write};
use std::num::NonZeroU16;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// A program that never ends.
const ENDLESS: &str = ".output n:int\n        mov n, zero\nloop:   iadd n, n, 1\n        jmp loop\n";

/// Time limit for any change on the screen.
const PATIENCE: Duration = Duration::from_secs(30);

/// A `takt` process on a pseudo-terminal.
struct Terminal {
    master: Box<dyn MasterPty + Send>,
    keys: Box<dyn Write + Send>,
    child: Box<dyn Child + Send + Sync>,
    output: Receiver<Vec<u8>>,
    parser: vt100::Parser,
}

impl Terminal {
    /// Runs a shell command line on a terminal of this size, in a folder that also serves as the state folder.
    fn new(folder: &Folder, line: &str, rows: u16, cols: u16) -> Terminal {
        let size = PtySize { rows, cols, ..PtySize::default() };
        let pair = native_pty_system().openpty(size).unwrap();
        let mut command = CommandBuilder::new("/bin/sh");
        command.args(["-c", &line.replace("takt ", concat!(env!("CARGO_BIN_EXE_takt"), " "))]);
        command.cwd(folder.path());
        command.env("TERM", "xterm-256color");
        command.env("XDG_STATE_HOME", folder.path().join("state"));
        command.env_remove("NO_COLOR");
        let child = pair.slave.spawn_command(command).unwrap();
        let mut reader = pair.master.try_clone_reader().unwrap();
        let (sender, output) = channel();
        std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(count @ 1..) = reader.read(&mut bytes) {
                if sender.send(bytes[..count].to_vec()).is_err() {
                    return;
                }
            }
        });
        let [height, width] = [rows, cols].map(|size| NonZeroU16::new(size).unwrap());
        let parser = vt100::Parser::new(height, width, 0);
        Terminal { keys: pair.master.take_writer().unwrap(), master: pair.master, child, output, parser }
    }

    fn text(&self) -> String {
        self.parser.screen().contents()
    }

    fn press(&mut self, keys: &str) {
        self.keys.write_all(keys.as_bytes()).unwrap();
        self.keys.flush().unwrap();
    }

    /// Waits until the screen satisfies a condition.
    #[track_caller]
    fn until(&mut self, what: &str, is: impl Fn(&vt100::Screen) -> bool) {
        let end = Instant::now() + PATIENCE;
        while !is(self.parser.screen()) {
            match self.output.recv_timeout(end.saturating_duration_since(Instant::now())) {
                Ok(bytes) => {
                    self.parser.process(&bytes);
                    // Answer the query for the cursor position, as terminals do.
                    if bytes.windows(4).any(|window| window == b"\x1b[6n") {
                        self.press("\x1b[1;1R");
                    }
                }
                Err(_) => panic!("no {what}:\n{}", self.text()),
            }
        }
    }

    /// Waits until a text is on the screen.
    #[track_caller]
    fn shows(&mut self, text: &str) {
        self.until(text, |screen| screen.contents().contains(text));
    }

    /// Waits for the prompt, then types a line.
    #[track_caller]
    fn line(&mut self, line: &str) {
        self.until("prompt", |screen| screen.contents().trim_end().ends_with("(takt)"));
        self.press(line);
    }

    /// Waits for a successful end.
    #[track_caller]
    fn ends(&mut self) {
        let end = Instant::now() + PATIENCE;
        loop {
            while let Ok(bytes) = self.output.recv_timeout(Duration::from_millis(10)) {
                self.parser.process(&bytes);
            }
            if let Some(status) = self.child.try_wait().unwrap() {
                // The last output may still be in transit; the end of file follows it.
                while let Ok(bytes) = self.output.recv_timeout(PATIENCE) {
                    self.parser.process(&bytes);
                }
                assert!(status.success(), "{status}:\n{}", self.text());
                return;
            }
            if Instant::now() > end {
                let _ = self.child.kill();
                panic!("it does not end:\n{}", self.text());
            }
        }
    }

    /// Waits for the end; returns the text left on the screen.
    #[track_caller]
    fn left(&mut self) -> String {
        self.ends();
        self.text()
    }

    /// Resizes the terminal, and waits for output.
    fn resize(&mut self, rows: u16, cols: u16) {
        self.master.resize(PtySize { rows, cols, ..PtySize::default() }).unwrap();
        let [height, width] = [rows, cols].map(|size| NonZeroU16::new(size).unwrap());
        self.parser.set_size(height, width);
        let bytes = self.output.recv_timeout(PATIENCE).unwrap();
        self.parser.process(&bytes);
    }
}

/// At any width takt breaks lines between words, so that the terminal breaks none; numbers stay below their titles, and one figure is
/// bold. In a pipe, lines are not folded.
#[test]
fn results_fit_the_terminal() {
    let folder = Folder::new();
    folder.write("sum.s", SUM);
    let commands = [
        "track -q --periods 200",
        "asm sum.s -O --check",
        "machines",
        "isa fdiv",
        "analyse sum.s",
        "track -q --plot --periods 200",
    ];
    for line in commands {
        let whole = folder.line(line).ok();
        assert!(!whole.contains('\x1b'));
        let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        let known = words(&whole);
        for cols in [80, 120, 200] {
            let mut terminal = Terminal::new(&folder, &format!("takt {line}; echo all printed"), 200, cols);
            terminal.shows("all printed");
            let text = terminal.text();
            if !line.contains("plot") {
                // If the terminal breaks a word, its fragments are not in the text.
                let broken = words(&text)
                    .into_iter()
                    .find(|word| !known.contains(word) && !ADDED.contains(&word.as_str()));
                assert_eq!(broken, None, "{line} in {cols} columns:\n{text}");
            }
            let screen = terminal.parser.screen();
            let wrapped = (0..200).find(|row| screen.row_wrapped(*row));
            assert_eq!(wrapped, None, "{line} in {cols} columns:\n{text}");
            let is_bold = |row| (0..cols).any(|col| screen.cell(row, col).is_some_and(vt100::Cell::bold));
            let wanted = line.starts_with("track") || line.starts_with("asm");
            assert_eq!((0..200).any(is_bold), wanted, "{line}");
        }
    }
    // Columns are dropped as a whole: at 80 columns the paper's PC and DSP are omitted, its FPGA stays.
    let mut terminal = Terminal::new(&folder, "takt track -q --periods 20; echo all printed", 200, 80);
    terminal.shows("all printed");
    let text = terminal.text();
    assert!(
        text.contains("FPGA\n") && !text.contains("paper PC") && text.contains("A wider terminal"),
        "{text}"
    );
}

/// Lists, tables, mistakes in the command line and the debugger's answers fit 80 columns, without a line that the terminal breaks.
#[test]
fn eighty_columns_are_enough() {
    let folder = Folder::new();
    folder.write("sum.s", SUM);
    let [foc, pi, csv] = ["foc.s", "pi.s", "pi.csv"].map(|name| source(&format!("../examples/{name}")));
    let track = source("tracking.s");
    let policy = concat!(env!("CARGO_MANIFEST_DIR"), "/../python/examples/pendulum.onnx");
    let lines = [
        "isa".to_owned(),
        "isa zzz".to_owned(),
        "asm sum.s -m t9".to_owned(),
        "bound sum.s --clock fast".to_owned(),
        format!("accuracy {foc}"),
        format!("accuracy {track}"),
        format!("accuracy {pi} --inputs {csv} --bound"),
        format!("model {policy} -o policy.s"),
        "debug sum.s --script commands.txt".to_owned(),
    ];
    folder.write("commands.txt", "step 3\nstep line\nhelp\nlist\n");
    for line in lines {
        let mut terminal = Terminal::new(&folder, &format!("takt {line}; echo all printed"), 200, 80);
        terminal.shows("all printed");
        let screen = terminal.parser.screen();
        let wrapped = (0..200).find(|row| screen.row_wrapped(*row));
        assert_eq!(wrapped, None, "{line}:\n{}", terminal.text());
        if line == "isa" {
            let text = terminal.text();
            assert!(text.contains("A wider terminal has room for the other machines"), "{text}");
            assert!(text.contains("fma      d, a, b, c   -         d = a · b + c\n"), "{text}");
        }
    }
}

/// Comments beside examples in the help continue under their own start.
#[test]
fn examples_of_the_help_fit_the_terminal() {
    let folder = Folder::new();
    for (cols, wanted) in [
        (80, format!("at a prompt; `help` lists\n{}the commands", " ".repeat(53))),
        (120, "at a prompt; `help` lists the commands".to_owned()),
    ] {
        let mut terminal = Terminal::new(&folder, "takt robot --help; echo all printed", 200, cols);
        terminal.shows("all printed");
        let text = terminal.text();
        assert!(text.contains(&wanted), "{text}");
    }
}

/// Words that appear only on narrow terminals.
const ADDED: [&str; 21] = [
    "all",
    "printed",
    "the",
    "A",
    "wider",
    "terminal",
    "has",
    "room",
    "for",
    "more",
    "columns.",
    "set",
    "by",
    "slot",
    "mul",
    "aux",
    "chain",
    "of",
    "dependent",
    "operations",
    "unit",
];

#[test]
fn full_screen() {
    let folder = Folder::new();
    folder.write("sum.s", SUM);
    let line = "takt debug sum.s -m f3 --tui; echo status $?; stty -a";
    let mut terminal = Terminal::new(&folder, line, 24, 80);
    terminal.until("the alternate screen", vt100::Screen::alternate_screen);
    terminal.shows("cycle 0, period 0");
    terminal.press("s");
    terminal.shows("(takt) step");
    // The command line has the history and completion of the prompt.
    terminal.press(":break ad\t if i == 1\r");
    terminal.shows("stop 1 at bundle");
    terminal.press("c");
    terminal.shows("stop 1: break add if i == 1");
    terminal.press(":display su\t\r");
    terminal.shows("sum = 0.5");
    terminal.press(":\x1b[A\x1b[A\r");
    terminal.shows("stop 2 at bundle");
    terminal.press(":prnt\r");
    terminal.shows("no command `prnt`");
    terminal.press("?");
    terminal.shows("Run on to a breakpoint");
    terminal.press("\x1b");
    terminal.until("the help gone", |screen| !screen.contents().contains("Run on to"));
    for (rows, cols) in [(1, 1), (5, 20), (40, 120), (2, 200), (24, 80)] {
        terminal.resize(rows, cols);
    }
    terminal.shows("in flight");
    terminal.shows("cycle 46, period 0");
    terminal.press("q");
    terminal.ends();
    // Screen, cursor and keyboard mode are restored.
    let screen = terminal.parser.screen();
    assert!(!screen.alternate_screen() && !screen.hide_cursor());
    let text = terminal.text();
    assert!(text.contains("status 0\n"), "{text}");
    assert!(text.contains("isig icanon iexten echo "), "{text}");
}

/// The panes show the core of a system that a key selects; one line shows all cores.
#[test]
fn full_screen_of_a_system() {
    let folder = Folder::new();
    folder.write("sum.s", SUM);
    folder.write("endless.s", ENDLESS);
    let core = |name: &str, program: &str| format!("[[core]]\nname = \"{name}\"\nprogram = \"{program}\"\n");
    folder.write("two.toml", format!("tick = 100\n{}{}", core("adds", "sum.s"), core("counts", "endless.s")));
    let mut terminal = Terminal::new(&folder, "takt debug two.toml --tui; echo status $?", 30, 120);
    terminal.shows("core adds: cycle 0, period 0");
    terminal.shows("counts ");
    terminal.shows("fadd    sum, sum, x");
    terminal.press(":break ad\t\r");
    terminal.shows("stop 1 at bundle");
    terminal.press("k");
    terminal.shows("core counts: cycle 0, period 0");
    terminal.shows("loop:   iadd n, n, 1");
    terminal.press("c");
    terminal.shows("stop 1: break add");
    terminal.until("the core that stopped", |screen| screen.contents().starts_with("core adds: cycle "));
    terminal.press(":core co\t\r");
    terminal.until("the other core", |screen| screen.contents().starts_with("core counts: cycle "));
    terminal.press("q");
    terminal.ends();
    assert!(terminal.text().contains("status 0"), "{}", terminal.text());
}

#[test]
fn a_long_run_is_interrupted_full_screen() {
    let folder = Folder::new();
    folder.write("endless.s", ENDLESS);
    let mut terminal = Terminal::new(&folder, "echo before; takt debug endless.s --tui; echo after", 24, 80);
    terminal.shows("cycle 0, period 0");
    terminal.press(":until n < 0\r");
    terminal.shows("Ctrl-C stops");
    terminal.press("\x03");
    terminal.shows("interrupted");
    terminal.press(":echo alive\r");
    terminal.shows("\nalive");
    terminal.press("\x04");
    terminal.ends();
    assert_eq!(terminal.text(), "before\nafter");
}

#[test]
fn full_screen_wants_a_terminal() {
    let folder = Folder::new();
    folder.write("sum.s", SUM);
    let done = folder.line("debug sum.s --tui");
    assert_eq!((done.status, done.stdout.as_str()), (Some(2), ""));
    assert!(done.stderr.contains("--tui needs a terminal"), "{}", done.stderr);
    let mut terminal = Terminal::new(&folder, "takt debug sum.s --tui | cat", 24, 80);
    terminal.shows("--tui needs a terminal");
    terminal.ends();
}

#[test]
fn the_prompt() {
    let folder = Folder::new();
    folder.write("sum.s", SUM);
    let mut terminal = Terminal::new(&folder, "takt debug sum.s", 40, 100);
    // Commands, labels and registers are completed.
    terminal.line("disp\t cou\t\r");
    terminal.shows("count = (never written)");
    terminal.line("break ad\t if i == 1\r");
    terminal.shows("stop 1 at bundle");
    terminal.line("continue\r");
    terminal.shows("stop 1: break add if i == 1");
    terminal.line("print sum +\r");
    terminal.shows("^");
    terminal.line("echo al");
    terminal.shows("(takt) echo al");
    terminal.press("\x03");
    terminal.until("another prompt", |screen| screen.contents().contains("(takt) echo al\n(takt)"));
    terminal.line("echo still here\r");
    terminal.shows("\nstill here");
    terminal.line("\x04");
    terminal.ends();

    // The history of the next session contains the commands of this one.
    let mut terminal = Terminal::new(&folder, "takt debug sum.s", 40, 100);
    terminal.line("\x1b[A\r");
    terminal.shows("\nstill here");
    terminal.line("\x1b[A\x1b[A\x1b[A\x1b[A\r");
    terminal.shows("stop 1 at bundle");
    terminal.line("quit\r");
    terminal.ends();
    let history = folder.read_text("state/takt/history");
    assert!(history.contains("echo still here\n") && history.ends_with("quit\n"), "{history}");
}

#[test]
fn a_long_run_is_interrupted() {
    let folder = Folder::new();
    folder.write("endless.s", ENDLESS);
    let mut terminal = Terminal::new(&folder, "exec takt debug endless.s", 24, 100);
    terminal.line("until n < 0\r");
    terminal.shows("Ctrl-C stops");
    terminal.press("\x03");
    terminal.shows("interrupted");
    terminal.line("echo alive\r");
    terminal.shows("\nalive");
    terminal.line("\x04");
    terminal.ends();
}

/// Ctrl-C holds a free-running board, and ends an endless search; the board returns to its original state.
#[cfg(unix)]
#[test]
fn a_board_at_the_prompt() {
    let folder = Folder::new();
    let example = |name: &str| format!("{}/../../programs/examples/board/{name}", env!("CARGO_MANIFEST_DIR"));
    let program = format!("{} --machine t1", example("position.s"));
    let wiring = example("position.toml");
    let board = format!("board sim --board ulx3s-85f --wiring {wiring} --program {program}");
    let board = common::SimulatedBoard::start(&board, folder.path());
    let line = format!("exec takt debug {program} --board {} --baud {}", board.port, board.baud);
    let mut terminal = Terminal::new(&folder, &line, 40, 100);
    terminal.shows("waits for the tick, since bundle");
    terminal.line("unt\t err\t == 1000\r");
    terminal.shows("until error == 1000");
    terminal.shows("in period ");
    terminal.press("\x03");
    terminal.shows("interrupted\nperiod ");
    terminal.line("cont\t\r");
    terminal.until("a long run", |screen| screen.contents().matches("Ctrl-C stops").count() == 1);
    terminal.press("\x03");
    terminal.until("another stop", |screen| screen.contents().matches("interrupted\nperiod ").count() == 2);
    terminal.line("print error == wanted - n\r");
    terminal.shows("\nerror == wanted - n = 1");
    terminal.line("\x04");
    terminal.ends();
    assert!(terminal.text().ends_with("the program runs; outputs drive"), "{}", terminal.text());
}

/// Long commands show the time so far and the remaining time, and slow assembly shows that it is running; none of this is written to a pipe.
#[test]
fn long_commands_show_progress() {
    const SLOW: &str = ".input x\n.output y\n.reg n:int\n.once\n wait p\n.period\np: li n, 100000\nturn: isub n, n, 1\n bnz n, turn\n mov y, x\n wait p\n";
    let folder = Folder::new();
    folder.write("slow.s", SLOW);
    let rows = 1_000_000;
    folder.write("in.csv", format!("run,x\n{}", "a,1\nb,2\n".repeat(rows / 2)));
    for (line, what) in [
        ("takt --no-jit run slow.s --batch in.csv", "1,000,000 periods,"),
        ("takt --no-jit run slow.s --inputs in.csv --outputs out.csv", "1,000,000 periods,"),
        ("takt --no-jit run slow.s --periods 1000000", "1,000,000 periods,"),
        ("takt track --periods 100000", "100,000 periods,"),
    ] {
        let mut terminal = Terminal::new(&folder, line, 24, 100);
        terminal.until(what, |screen| {
            let text = screen.contents();
            text.contains(what) && (text.contains(" to go") || text.contains(" s so far"))
        });
        terminal.press("\x03");
    }
    let done = folder.line("run slow.s --periods 30");
    assert_eq!((done.status, done.stderr.as_str()), (Some(0), ""));
}

/// Ctrl-C clears a progress bar, and the command ends by the signal.
#[test]
fn ctrl_c_leaves_no_bar_behind() {
    let folder = Folder::new();
    let line = "trap : INT; takt arm --poses 1000000000; echo ended $?";
    let mut terminal = Terminal::new(&folder, line, 10, 60);
    terminal.shows("poses,");
    terminal.press("\x03");
    assert_eq!(terminal.left().trim(), "ended 130");
}
