// SPDX-License-Identifier: MIT OR Apache-2.0
//! LinuxCNC, without screen and real-time kernel, as host of a simulated board with the hybrid robot; see tools/linuxcnc and
//! docs/linuxcnc.md.

use anyhow::{Context, Result, bail, ensure};
use serde_json::json;
use std::fs::{self, File};
use std::io::{BufRead, BufReader};
use std::os::unix::fs::chown;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use takt_automation::command::{EVERYTHING, apt_install, cargo, root, run, works};
use takt_automation::progress;
use takt_automation::venv::Venv;

#[derive(clap::Args, Default)]
pub(crate) struct Arguments {
    /// Write the tables of docs/linuxcnc.md and draw its picture.
    #[arg(long)]
    write: bool,
    /// Only this run.
    #[arg(long, value_name = "NAME", conflicts_with = "write")]
    only: Option<String>,
}

/// LinuxCNC and the compiler for its components: 2 GB with dependencies.
const PACKAGES: [&str; 2] = ["linuxcnc-uspace", "linuxcnc-uspace-dev"];
/// Python packages of report.py.
const REPORT: [&str; 2] = ["numpy==2.4.6", "matplotlib==3.11.2"];
/// User for LinuxCNC, which refuses to run as root.
const USER: &str = "nobody";
/// Lock file of a running LinuxCNC, which allows one instance per computer.
const LOCK: &str = "/tmp/linuxcnc.lock";
/// Files of tools/linuxcnc that a run needs.
const FILES: [&str; 4] = ["run.py", "takt.hal", "takt.ini", "record.hal"];
/// Time limit for the board's start, which includes Verilator's compilation.
const READY: Duration = Duration::from_secs(900);

/// A run of LinuxCNC with a board.
struct Run {
    name: &'static str,
    /// Title in the tables.
    title: &'static str,
    gcode: &'static str,
    /// The G-code program runs to its end.
    is_whole: bool,
    /// Additional arguments of `takt board sim`.
    board: &'static [&'static str],
    /// Additional arguments of run.py.
    display: &'static [&'static str],
    /// Number of periods with enabled drives before an event on the board.
    event: Option<u32>,
    /// Final message of LinuxCNC.
    says: &'static str,
    /// Response timeout in ms beyond which the host reports a fault; simulated boards are slow.
    timeout: u32,
    /// Time limit of the run.
    limit: Duration,
}

const AGH: &str = "programs/data/agh.ngc";
const SHORT: &str = "tools/linuxcnc/short.ngc";
const EMULATED: Duration = Duration::from_secs(240);

/// Default run: a whole program on an emulated board, without an event.
const PLAIN: Run = Run {
    name: "",
    title: "",
    gcode: AGH,
    is_whole: true,
    board: &["--emulated"],
    display: &[],
    event: None,
    says: "",
    timeout: 5000,
    limit: EMULATED,
};

const RUNS: [Run; 6] = [
    Run { name: "path", title: "agh.ngc, emulated board", ..PLAIN },
    Run { name: "short", title: "short.ngc, emulated board", gcode: SHORT, ..PLAIN },
    Run {
        name: "circuit",
        title: "short.ngc, the circuit in Verilator",
        gcode: SHORT,
        board: &[],
        display: &["--patience", "900"],
        timeout: 60_000,
        limit: Duration::from_secs(1800),
        ..PLAIN
    },
    Run {
        name: "unplugged",
        title: "the link is cut",
        is_whole: false,
        board: &["--emulated", "--unplug-at", "20000"],
        event: Some(20_000),
        says: "takt: the board does not answer: nothing for 2000 ms at /dev/pts/",
        timeout: 2000,
        ..PLAIN
    },
    Run {
        name: "stopped",
        title: "the button at `stop`",
        is_whole: false,
        board: &["--emulated", "--stop-at", "20000"],
        event: Some(20_000),
        says: "takt: the board has stopped its outputs: stop",
        ..PLAIN
    },
    Run {
        name: "emergency",
        title: "emergency stop in LinuxCNC",
        is_whole: false,
        display: &["--estop-at", "7"],
        ..PLAIN
    },
];

/// A child process that is killed on drop.
struct KilledOnDrop(Child);

impl Drop for KilledOnDrop {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The current user is root, under which LinuxCNC does not run.
fn is_root() -> Result<bool> {
    Ok(id("-u", None)? == 0)
}

fn id(what: &str, user: Option<&str>) -> Result<u32> {
    let output = Command::new("id").arg(what).args(user).output().context("cannot start id")?;
    let text = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    text.parse().with_context(|| format!("`id {what}` printed `{text}`, which is not a number"))
}

/// Compiles the component and installs it for LinuxCNC.
fn install() -> Result<()> {
    if !works("halcompile", "--help") || !Path::new("/usr/bin/linuxcnc").exists() {
        apt_install(&PACKAGES)?;
    }
    let folder = root().join("target/linuxcnc/component");
    fs::create_dir_all(&folder)?;
    for file in ["hal_takt.c", "takt_link.h"] {
        fs::copy(root().join("tools/linuxcnc").join(file), folder.join(file))?;
    }
    let install = run(Command::new("halcompile").args(["--install", "hal_takt.c"]).current_dir(&folder));
    install.context(
        "hal_takt was not installed; without root: `sudo halcompile --install tools/linuxcnc/hal_takt.c`",
    )
}

/// Runs LinuxCNC with each board, and writes the report.
pub(crate) fn linuxcnc(arguments: &Arguments) -> Result<()> {
    ensure!(
        !Path::new(LOCK).exists(),
        "LinuxCNC is running, and a machine can have one: end it, or, if it has died, remove {LOCK}"
    );
    install()?;
    run(cargo().args(["build", "--release", "--package", "takt", "--features", EVERYTHING]))?;
    let folder = root().join("target/linuxcnc");
    let runs = RUNS.iter().filter(|run| arguments.only.as_deref().is_none_or(|name| name == run.name));
    let runs: Vec<&Run> = runs.collect();
    if runs.is_empty() {
        let names: Vec<&str> = RUNS.iter().map(|run| run.name).collect();
        bail!("--only: there are {}", names.join(", "));
    }
    refuses_what_is_no_board()?;
    let mut names = Vec::new();
    for run in &runs {
        progress::step(&format!("LinuxCNC: {}", run.title), || run.run(&folder.join(run.name)))?;
        let kind = if run.is_whole { "cut" } else { "end" };
        names.push(json!({ "name": run.name, "title": run.title, "kind": kind, "event": run.event, "says": run.says }));
    }
    fs::write(folder.join("runs.json"), json!(names).to_string())?;
    let venv = Venv::with(&REPORT)?;
    let mut report = Command::new(venv.tool("python3"));
    report.arg(root().join("tools/linuxcnc/report.py")).arg(&folder);
    if arguments.write {
        report.arg("--document").arg(root().join("docs/linuxcnc.md"));
        report.arg("--picture").arg(root().join("docs/pictures/linuxcnc.svg"));
    }
    self::run(&mut report)
}

/// The component reports that a port has no board, and refuses to load.
fn refuses_what_is_no_board() -> Result<()> {
    for (port, baud, says) in [
        ("/dev/null", 3_000_000, "cannot open /dev/null at 3000000 baud: Inappropriate ioctl for device"),
        ("/dev/takt-is-not-here", 3_000_000, "No such file or directory"),
        ("/dev/null", 12_345, "no rate that is known (115200 to 4000000)"),
    ] {
        let folder = scratch("refused")?;
        fs::write(folder.join("refused.hal"), format!("loadrt hal_takt port={port} baud={baud}\n"))?;
        let output = as_user(&folder, "halrun -f refused.hal")?.output().context("cannot start halrun")?;
        let [said, more] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
        let said = format!("{said}{more}");
        ensure!(
            said.contains(says),
            "hal_takt at {port} with {baud} baud was expected to print `{says}`, but printed:\n{said}"
        );
        fs::remove_dir_all(&folder)?;
    }
    Ok(())
}

/// Folder that LinuxCNC's user can access, independent of the project's location.
fn scratch(name: &str) -> Result<PathBuf> {
    let folder = std::env::temp_dir().join(format!("takt-linuxcnc-{}-{name}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    Ok(folder)
}

/// Command that runs as LinuxCNC's user, in a folder owned by that user, with its own terminal and process group.
fn as_user(folder: &Path, command: &str) -> Result<Command> {
    let mut script = Command::new("script");
    let home = folder.display();
    let path = "PATH=/usr/local/bin:/usr/bin:/bin";
    let inner = format!("env -i HOME='{home}' {path} USER={USER} TERM=dumb {command}");
    let as_user = if is_root()? {
        let (user, group) = (id("-u", Some(USER))?, id("-g", Some(USER))?);
        chown(folder, Some(user), Some(group))?;
        for entry in fs::read_dir(folder)? {
            chown(entry?.path(), Some(user), Some(group))?;
        }
        format!("setpriv --reuid={user} --regid={group} --clear-groups {inner}")
    } else {
        inner
    };
    script.args(["-qec", &as_user, "/dev/null"]).current_dir(folder).stdin(Stdio::null()).process_group(0);
    Ok(script)
}

impl Run {
    /// Executes the run, and copies its output files to `target`.
    fn run(&self, target: &Path) -> Result<()> {
        let folder = scratch(self.name)?;
        let result = self.run_in(&folder);
        let _ = fs::remove_dir_all(target);
        fs::create_dir_all(target)?;
        for entry in fs::read_dir(&folder)? {
            let entry = entry?;
            // Skip the sockets that LinuxCNC leaves.
            if entry.file_type()?.is_file() {
                fs::copy(entry.path(), target.join(entry.file_name()))?;
            }
        }
        fs::remove_dir_all(&folder)?;
        result.with_context(|| format!("what it said is in {}", target.display()))
    }

    fn run_in(&self, folder: &Path) -> Result<()> {
        let tools = root().join("tools/linuxcnc");
        for file in FILES {
            fs::copy(tools.join(file), folder.join(file)).with_context(|| format!("cannot copy {file}"))?;
        }
        fs::copy(root().join(self.gcode), folder.join("program.ngc"))?;
        fs::write(folder.join("takt.tbl"), "")?;
        let (_board, port) = self.board(folder)?;
        let display = [self.display, &["program.ngc", "result.json"]].concat().join(" ");
        let ini = fs::read_to_string(folder.join("takt.ini"))?;
        let mut ini = ini.replace("PORT = /dev/ttyUSB0", &format!("PORT = {port}"));
        ini = ini.replace("TIMEOUT = 25", &format!("TIMEOUT = {}", self.timeout));
        ini = ini.replace("HALFILE = takt.hal", "HALFILE = takt.hal\nHALFILE = record.hal");
        ini = ini.replace("DISPLAY = ./run.py", &format!("DISPLAY = ./run.py {display}"));
        fs::write(folder.join("takt.ini"), ini)?;
        let mut linuxcnc = as_user(folder, "linuxcnc takt.ini")?;
        if is_root()? {
            chown(&port, Some(id("-u", Some(USER))?), None)?;
        }
        let log = File::create(folder.join("linuxcnc.txt"))?;
        linuxcnc.stdout(log.try_clone()?).stderr(log);
        let mut child = linuxcnc.spawn().context("cannot start LinuxCNC")?;
        let until = Instant::now() + self.limit;
        while child.try_wait()?.is_none() {
            if Instant::now() > until {
                // Kill the child's own process group.
                let _ = Command::new("kill").args(["--", &format!("-{}", child.id())]).status();
                let _ = child.wait();
                bail!("LinuxCNC did not end within {} s", self.limit.as_secs());
            }
            std::thread::sleep(Duration::from_millis(100));
        }
        ensure!(folder.join("result.json").is_file(), "LinuxCNC ended without a result");
        Ok(())
    }

    /// Starts the board; returns the process and its port.
    fn board(&self, folder: &Path) -> Result<(KilledOnDrop, String)> {
        let mut sim = Command::new(root().join("target/release/takt"));
        sim.args(["board", "sim", "--robot", "--serve", "--wiring"]);
        sim.arg(root().join("programs/hybrid/followed_board.toml"));
        sim.arg("--program").arg(root().join("programs/hybrid/followed.toml"));
        sim.args(self.board).arg("--record").arg(folder.join("sim.csv"));
        let log = File::create(folder.join("board.txt"))?;
        let mut board =
            KilledOnDrop(sim.stdout(Stdio::piped()).stderr(log).spawn().context("cannot start takt")?);
        let output = board.0.stdout.take().context("it has an output")?;
        let (send, receive) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            // Drain the remaining output, so that the board never blocks on a full pipe.
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                let _ = send.send(line);
            }
        });
        let line = receive.recv_timeout(READY).context("the board does not start: see board.txt")?;
        let port = line.split(' ').next().unwrap_or_default().to_owned();
        Ok((board, port))
    }
}
