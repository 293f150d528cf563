// SPDX-License-Identifier: MIT OR Apache-2.0
//! A HyperQueue server and workers on this computer, each a process of its own.

use crate::{WorkError, at};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// The Python package with server, workers and client. A server that somebody else has started must be of the same version.
pub const HYPERQUEUE: &str = "hyperqueue==0.27.0";

/// The script that does what the package is needed for.
pub(crate) const fn script() -> &'static str {
    include_str!("takt_hq.py")
}

/// A server and its workers, which end when this is dropped.
pub struct Cluster {
    process: Child,
    server: PathBuf,
    processes: Processes,
}

/// The processes of a cluster, by their numbers.
#[derive(Clone, Debug, Default, serde::Deserialize)]
pub struct Processes {
    /// The server.
    pub server: u32,
    /// The workers.
    pub workers: Vec<u32>,
}

impl Cluster {
    /// Starts a server in a folder, and workers of one core each. If one of these processes ends, it is started again.
    ///
    /// # Errors
    /// If the server does not start.
    pub fn start(python: &Path, server: &Path, workers: usize) -> Result<Cluster, WorkError> {
        std::fs::create_dir_all(server).map_err(at(server))?;
        let server = std::path::absolute(server).map_err(at(server))?;
        let mut command = Command::new(python);
        command.args(["-c", script(), "cluster"]).arg(&server).arg(workers.max(1).to_string());
        let log = server.join("cluster.log");
        let messages = std::fs::File::create(&log).map_err(at(&log))?;
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(messages);
        let process = command.spawn().map_err(at(python))?;
        let mut cluster = Cluster { process, server, processes: Processes::default() };
        let mut line = String::new();
        let output = cluster.process.stdout.take();
        let read = output.map(|output| BufReader::new(output).read_line(&mut line));
        if !matches!(read, Some(Ok(1..))) {
            let errors = std::fs::read_to_string(&log).unwrap_or_default();
            return Err(WorkError::Queue(format!(
                "no server in {}: {}",
                cluster.server.display(),
                errors.trim()
            )));
        }
        cluster.processes =
            serde_json::from_str(&line).map_err(|error| WorkError::Queue(error.to_string()))?;
        Ok(cluster)
    }

    /// The processes with which it began.
    pub fn processes(&self) -> &Processes {
        &self.processes
    }

    /// The server's folder.
    pub fn server(&self) -> &Path {
        &self.server
    }

    /// Waits until it ends, which it does if it is interrupted.
    ///
    /// # Errors
    /// If the process is lost.
    pub fn wait(&mut self) -> Result<(), WorkError> {
        self.process.wait().map(drop).map_err(at(&self.server))
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        // Server and workers see that their parent is gone, and end.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
