// SPDX-License-Identifier: MIT OR Apache-2.0
//! Binary under test, and temporary folders.

pub(crate) mod protocol;

use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};

/// Program that sums a table, with a call for each element.
pub(crate) const SUM: &str = "\
.output sum, count:int
.reg    i:int n:int x
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
        ret
.data
table:  .float  0.5, 0.25, -1.75
";

/// Path of a source in the repository.
pub(crate) fn source(name: &str) -> String {
    format!("{}/../../programs/hybrid/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// A test's temporary folder.
pub(crate) struct Folder(PathBuf);

impl Folder {
    pub(crate) fn new() -> Folder {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let name = format!("{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        std::fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    pub(crate) fn path(&self) -> &Path {
        &self.0
    }

    pub(crate) fn write(&self, name: impl AsRef<Path>, contents: impl AsRef<[u8]>) {
        std::fs::write(self.0.join(name), contents).unwrap();
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.0.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub(crate) fn read_text(&self, name: &str) -> String {
        String::from_utf8(self.read(name)).unwrap()
    }

    /// Names of the files in the folder, sorted.
    pub(crate) fn list(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.0).unwrap();
        let mut names: Vec<String> =
            entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    /// A `takt` command in this folder, limited to 1 GiB of address space and 60 s of CPU time: a runaway process is killed by a signal,
    /// and so has no exit status.
    pub(crate) fn command(&self, arguments: &[impl AsRef<OsStr>]) -> Command {
        let mut command = Command::new("/bin/sh");
        command
            .args(["-c", "ulimit -v 1048576; ulimit -t 60; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_takt")])
            .args(arguments)
            .current_dir(&self.0)
            .env_remove("NO_COLOR")
            .env_remove("COLUMNS")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    /// Runs `takt` without standard input.
    pub(crate) fn takt(&self, arguments: &[impl AsRef<OsStr>]) -> RunOutput {
        RunOutput::of(self.command(arguments))
    }

    /// Runs `takt` with the arguments in `line`, separated by blanks.
    pub(crate) fn line(&self, line: &str) -> RunOutput {
        self.takt(&line.split_whitespace().collect::<Vec<_>>())
    }

    /// Runs `takt` with these bytes on standard input.
    pub(crate) fn fed(&self, line: &str, input: &[u8]) -> RunOutput {
        self.fed_by(line, |stdin| {
            // The process may end before it has read all input.
            let _ = stdin.write_all(input);
        })
    }

    /// Runs `takt`; `feed` writes its standard input.
    pub(crate) fn fed_by(&self, line: &str, feed: impl FnOnce(&mut dyn Write) + Send) -> RunOutput {
        let mut command = self.command(&line.split_whitespace().collect::<Vec<_>>());
        let mut child = command.stdin(Stdio::piped()).spawn().unwrap();
        let mut stdin = child.stdin.take().unwrap();
        std::thread::scope(|scope| {
            scope.spawn(move || feed(&mut stdin));
            RunOutput::from(child.wait_with_output().unwrap())
        })
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Outcome of a run.
#[derive(Debug)]
pub(crate) struct RunOutput {
    /// Exit status; `None` after a signal.
    pub(crate) status: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl RunOutput {
    pub(crate) fn of(mut command: Command) -> RunOutput {
        RunOutput::from(command.output().unwrap())
    }

    /// Standard output of a run, which must succeed without messages.
    #[track_caller]
    pub(crate) fn ok(self) -> String {
        assert_eq!((self.status, self.stderr.as_str()), (Some(0), ""));
        self.stdout
    }
}

impl From<std::process::Output> for RunOutput {
    fn from(output: std::process::Output) -> RunOutput {
        RunOutput {
            status: output.status.code(),
            stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }
}

/// A `takt board sim` process, killed on drop.
#[cfg(unix)]
pub(crate) struct SimulatedBoard {
    process: std::process::Child,
    /// Path of the board's pseudo-terminal.
    pub(crate) port: String,
    pub(crate) baud: String,
}

#[cfg(unix)]
impl SimulatedBoard {
    /// Starts the simulation, and reads the path of its UART.
    pub(crate) fn start(line: &str, folder: &Path) -> SimulatedBoard {
        let mut command = Command::new(env!("CARGO_BIN_EXE_takt"));
        command.args(line.split_whitespace()).current_dir(folder);
        // Standard error of the simulation is kept in a file of the folder.
        let told = std::fs::File::create(folder.join("told.txt")).unwrap();
        let mut process = command.stdout(Stdio::piped()).stderr(told).spawn().unwrap();
        let mut said = String::new();
        let stdout = process.stdout.take().unwrap();
        std::io::BufRead::read_line(&mut std::io::BufReader::new(stdout), &mut said).unwrap();
        let (port, baud) = said.trim().split_once(' ').unwrap_or_else(|| panic!("`{said}`"));
        SimulatedBoard { process, port: port.to_owned(), baud: baud.to_owned() }
    }
}

#[cfg(unix)]
impl Drop for SimulatedBoard {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
