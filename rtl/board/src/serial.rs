// SPDX-License-Identifier: MIT OR Apache-2.0
//! A serial port, or a pseudo-terminal in its place, as a line to a board.

use crate::protocol::Line;
use serial2::{CharSize, FlowControl, Parity, SerialPort, Settings, StopBits};
use std::io;
use std::path::Path;
use std::time::{Duration, Instant};

/// The time that a read waits for a byte.
const READ: Duration = Duration::from_millis(100);
/// Reads without a byte after which a request counts as lost: `SILENT` on a line that can lose bytes, `PATIENT` on a line that cannot.
const SILENT: u32 = 5;
const PATIENT: u32 = 100;
/// The time that a write may take.
const WRITE: Duration = Duration::from_secs(30);

/// An open serial port.
#[derive(Debug)]
pub struct Serial {
    port: SerialPort,
    opened: Instant,
    patience: u32,
}

impl Serial {
    /// Adapts the line to a simulated board, which loses no byte but is slow while the computer is busy: a repeated request would arrive
    /// twice.
    #[must_use]
    pub fn patient(self) -> Serial {
        Serial { patience: PATIENT, ..self }
    }

    /// Reserves the port, where the system has such locks: a second host would take answers of the first one.
    ///
    /// # Errors
    /// [`io::ErrorKind::ResourceBusy`] if another host has reserved it.
    pub fn reserved(self) -> io::Result<Serial> {
        #[cfg(unix)]
        {
            use rustix::fs::{FlockOperation, flock};
            // A port without locks is used without.
            if let Err(rustix::io::Errno::WOULDBLOCK) =
                flock(&self.port, FlockOperation::NonBlockingLockExclusive)
            {
                return Err(io::ErrorKind::ResourceBusy.into());
            }
        }
        Ok(self)
    }

    /// Opens a port with this baud rate, 8 data bits, no parity and 1 stop bit.
    ///
    /// # Errors
    /// Fails if the port cannot be opened, or is not a terminal.
    pub fn open(path: &Path, baud: u32) -> io::Result<Serial> {
        let mut port = SerialPort::open(path, |mut settings: Settings| {
            settings.set_raw();
            settings.set_baud_rate(baud)?;
            settings.set_char_size(CharSize::Bits8);
            settings.set_parity(Parity::None);
            settings.set_stop_bits(StopBits::One);
            settings.set_flow_control(FlowControl::None);
            Ok(settings)
        })?;
        port.set_read_timeout(READ)?;
        port.set_write_timeout(WRITE)?;
        port.discard_buffers()?;
        Ok(Serial { port, opened: Instant::now(), patience: SILENT })
    }
}

/// The error of an open port that is gone.
fn gone(error: &io::Error) -> io::Error {
    io::Error::new(
        io::ErrorKind::NotConnected,
        format!("the port was unplugged, or the simulated board has ended ({error})"),
    )
}

impl Line for Serial {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.port.write_all(bytes).map_err(|error| gone(&error))
    }

    fn receive(&mut self) -> io::Result<Vec<u8>> {
        let mut bytes = vec![0; 4096];
        match self.port.read(&mut bytes) {
            Ok(0) => return Err(gone(&io::ErrorKind::UnexpectedEof.into())),
            Ok(count) => bytes.truncate(count),
            Err(error) if error.kind() == io::ErrorKind::TimedOut => bytes.clear(),
            Err(error) => return Err(gone(&error)),
        }
        Ok(bytes)
    }

    fn patience(&self) -> u32 {
        self.patience
    }

    fn time(&self) -> Duration {
        self.opened.elapsed()
    }
}
