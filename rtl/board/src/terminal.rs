// SPDX-License-Identifier: MIT OR Apache-2.0
//! Pseudo-terminal through which any host reaches the UART of a simulated board.

use rustix::fs::{OFlags, fcntl_setfl};
use rustix::io::{FdFlags, fcntl_setfd};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{self, OptionalActions};
use std::ffi::OsStr;
use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

/// The board's end of a pseudo-terminal.
#[derive(Debug)]
pub struct Terminal {
    own: File,
    /// The host's end, which is kept open: without a host, the line would otherwise be gone.
    _host: File,
    path: PathBuf,
}

impl Terminal {
    /// A new pseudo-terminal of the system.
    ///
    /// # Errors
    /// Fails if the system has no pseudo-terminal left.
    pub fn new() -> io::Result<Terminal> {
        let own = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
        // In a process that this one starts, it would keep the line alive.
        fcntl_setfd(&own, FdFlags::CLOEXEC)?;
        grantpt(&own)?;
        unlockpt(&own)?;
        let name = ptsname(&own, Vec::new())?;
        let path = PathBuf::from(OsStr::from_bytes(name.to_bytes()));
        let host = OpenOptions::new().read(true).write(true).open(&path)?;
        let mut settings = termios::tcgetattr(&host)?;
        settings.make_raw();
        termios::tcsetattr(&host, OptionalActions::Now, &settings)?;
        fcntl_setfl(&own, OFlags::RDWR | OFlags::NONBLOCK)?;
        Ok(Terminal { own: File::from(own), _host: host, path })
    }

    /// The path that the host opens.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Receives the bytes that the host has sent; receiving no byte is not an error.
    ///
    /// # Errors
    /// Fails if the line is gone.
    pub fn receive(&mut self) -> io::Result<Vec<u8>> {
        let mut bytes = vec![0; 4096];
        match self.own.read(&mut bytes) {
            Ok(count) => bytes.truncate(count),
            Err(error) if error.kind() == ErrorKind::WouldBlock => bytes.clear(),
            Err(error) => return Err(error),
        }
        Ok(bytes)
    }

    /// Sends bytes to the host. Bytes that nobody reads are lost, as on a wire.
    ///
    /// # Errors
    /// Fails if the line is gone.
    pub fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self.own.write(bytes) {
            Err(error) if error.kind() != ErrorKind::WouldBlock => Err(error),
            _ => Ok(()),
        }
    }
}
