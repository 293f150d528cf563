// SPDX-License-Identifier: MIT OR Apache-2.0
//! HyperQueue server and workers on this computer, each in a separate process.

use crate::program::Server;
use crate::{Client, WorkError, at};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Python script that calls the package.
pub(crate) const fn script() -> &'static str {
    include_str!("takt_hq.py")
}

/// Shell script that keeps a program running: starts it, prints its process number, and restarts it when it ends. At the end of standard
/// input, which comes when the parent process is gone, the script ends the program and exits.
const KEEPER: &str = r#"
trap '' PIPE
(while :; do "$@" </dev/null >&2 & echo $!; wait $!; sleep 0.5; done) &
read -r _
trap '' TERM
kill 0
sleep 0.3
kill -9 0
"#;

/// A server with its workers; dropping it ends them.
pub struct Cluster {
    /// Python script, or the keepers of server and workers.
    keepers: Vec<Child>,
    server: PathBuf,
    processes: Processes,
}

/// Process numbers of a cluster.
#[derive(Clone, Debug, Default, serde::Deserialize)]
pub struct Processes {
    /// Process number of the server.
    pub server: u32,
    /// Process numbers of the workers.
    pub workers: Vec<u32>,
}

impl Cluster {
    /// Starts a server in a folder, and single-core workers. A process that ends is restarted.
    ///
    /// # Errors
    /// If the server does not start.
    pub fn start(client: &Client, server: &Path, workers: usize) -> Result<Cluster, WorkError> {
        std::fs::create_dir_all(server).map_err(at(server))?;
        let server = std::path::absolute(server).map_err(at(server))?;
        let log = server.join("cluster.log");
        let messages = File::create(&log).map_err(at(&log))?;
        let mut cluster = Cluster { keepers: Vec::new(), server, processes: Processes::default() };
        let started = match client {
            Client::Program(program) => cluster.keep(program, workers.max(1), &messages),
            Client::Python(python) => cluster.run_script(python, workers.max(1), &messages),
        };
        match started {
            Ok(()) => Ok(cluster),
            Err(WorkError::Queue(text)) if text.is_empty() => {
                let errors = std::fs::read_to_string(&log).unwrap_or_default();
                let server = cluster.server.display();
                Err(WorkError::Queue(format!("no server in {server}: {}", errors.trim())))
            }
            Err(error) => Err(error),
        }
    }

    fn run_script(&mut self, python: &Path, workers: usize, messages: &File) -> Result<(), WorkError> {
        let mut command = Command::new(python);
        command.args(["-c", script(), "cluster"]).arg(&self.server).arg(workers.to_string());
        command.stdin(Stdio::null());
        let line = self.spawn(command, messages)?;
        self.processes = serde_json::from_str(&line).map_err(|error| WorkError::Queue(error.to_string()))?;
        Ok(())
    }

    fn keep(&mut self, program: &Path, workers: usize, messages: &File) -> Result<(), WorkError> {
        self.processes.server = self.keeper(program, &["server", "start"], messages)?;
        Server { program, folder: &self.server }.connect(true)?;
        for _ in 0..workers {
            let worker = self.keeper(
                program,
                &["worker", "start", "--cpus", "1", "--on-server-lost", "stop"],
                messages,
            )?;
            self.processes.workers.push(worker);
        }
        Ok(())
    }

    /// Starts a keeper of `hq`; returns the process number of `hq`.
    fn keeper(&mut self, program: &Path, arguments: &[&str], messages: &File) -> Result<u32, WorkError> {
        let mut command = Command::new("sh");
        command
            .args(["-c", KEEPER, "takt"])
            .arg(program)
            .arg("--server-dir")
            .arg(&self.server)
            .args(arguments);
        // A separate process group: the keeper can end the whole group, and Ctrl-C reaches only this program.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        command.stdin(Stdio::piped());
        let line = self.spawn(command, messages)?;
        line.trim().parse().map_err(|_| WorkError::Queue(String::new()))
    }

    /// Starts a process; returns the first line that it prints.
    fn spawn(&mut self, mut command: Command, messages: &File) -> Result<String, WorkError> {
        let program = PathBuf::from(command.get_program());
        let messages = messages.try_clone().map_err(at(&self.server))?;
        let process = command.stdout(Stdio::piped()).stderr(messages).spawn().map_err(at(&program))?;
        self.keepers.push(process);
        let output = self.keepers.last_mut().and_then(|process| process.stdout.take());
        let mut line = String::new();
        let read = output.map(|output| BufReader::new(output).read_line(&mut line));
        if matches!(read, Some(Ok(1..))) { Ok(line) } else { Err(WorkError::Queue(String::new())) }
    }

    /// Process numbers from the start of the cluster; a restarted process has another.
    pub fn processes(&self) -> &Processes {
        &self.processes
    }

    /// Folder of the server.
    pub fn server(&self) -> &Path {
        &self.server
    }

    /// Waits until the cluster ends, for instance by an interrupt.
    ///
    /// # Errors
    /// If the process is lost.
    pub fn wait(&mut self) -> Result<(), WorkError> {
        for keeper in &mut self.keepers {
            // `wait` would close the child's standard input, which ends the cluster.
            let input = keeper.stdin.take();
            keeper.wait().map_err(at(&self.server))?;
            drop(input);
        }
        Ok(())
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        for keeper in &mut self.keepers {
            // Closing its input ends a keeper. Server and workers of the Python script notice that their parent is gone.
            if keeper.stdin.take().is_none() {
                let _ = keeper.kill();
            }
        }
        for keeper in &mut self.keepers {
            let _ = keeper.wait();
        }
    }
}
