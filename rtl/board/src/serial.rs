//! A serial port, or a pseudo-terminal in its place, as a line to a board.

use crate::protocol::Line;
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

/// An open serial port.
#[derive(Debug)]
pub struct Serial(File, Instant);

impl Serial {
    /// Opens a port with this baud rate, 8 data bits, no parity, one stop bit.
    ///
    /// # Errors
    /// If it cannot be opened or is no terminal.
    #[cfg(unix)]
    pub fn open(path: &Path, baud: u32) -> io::Result<Serial> {
        use rustix::termios::{self, OptionalActions, SpecialCodeIndex};
        let file = File::options().read(true).write(true).open(path)?;
        let mut settings = termios::tcgetattr(&file)?;
        settings.make_raw();
        settings.set_speed(baud)?;
        // A read waits for a tenth of a second at most.
        settings.special_codes[SpecialCodeIndex::VMIN] = 0;
        settings.special_codes[SpecialCodeIndex::VTIME] = 1;
        termios::tcsetattr(&file, OptionalActions::Flush, &settings)?;
        Ok(Serial(file, Instant::now()))
    }

    /// Not on this system: there is none whose settings are known how to make.
    ///
    /// # Errors
    /// Always.
    #[cfg(not(unix))]
    pub fn open(_: &Path, _: u32) -> io::Result<Serial> {
        Err(io::Error::new(io::ErrorKind::Unsupported, "serial ports are supported on Unix only"))
    }
}

impl Serial {
    /// Whether the port is still there. Of one that is not, reads bring nothing, as of a silent one.
    #[cfg(unix)]
    fn is_there(&self) -> bool {
        rustix::termios::tcgetattr(&self.0).is_ok()
    }

    #[cfg(not(unix))]
    fn is_there(&self) -> bool {
        true
    }

    /// An error of a port that is gone, in words. While a pseudo-terminal is being closed it can still be asked for, and fails.
    fn named(&self, error: io::Error) -> io::Error {
        if self.is_there() && !is_failure(&error) { error } else { gone() }
    }
}

/// True if the device failed, as it does when it is pulled out.
#[cfg(unix)]
fn is_failure(error: &io::Error) -> bool {
    error.raw_os_error() == Some(rustix::io::Errno::IO.raw_os_error())
}

#[cfg(not(unix))]
fn is_failure(_: &io::Error) -> bool {
    false
}

fn gone() -> io::Error {
    io::Error::new(io::ErrorKind::NotConnected, "the port was unplugged, or the simulated board has ended")
}

impl Line for Serial {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write_all(bytes).map_err(|error| self.named(error))
    }

    fn receive(&mut self) -> io::Result<Vec<u8>> {
        let mut bytes = vec![0; 4096];
        let count = self.0.read(&mut bytes).map_err(|error| self.named(error))?;
        if count == 0 && !self.is_there() {
            return Err(gone());
        }
        bytes.truncate(count);
        Ok(bytes)
    }

    fn patience(&self) -> u32 {
        5
    }

    fn time(&self) -> Duration {
        self.1.elapsed()
    }
}
