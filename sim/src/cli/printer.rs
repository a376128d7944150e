//! Standard output that may be closed by its reader.

use std::io::{ErrorKind, Write};

use crate::SimError;

/// Prints until the reader closes the pipe.
#[derive(Debug, Default)]
pub struct Printer {
    closed: bool,
}

impl Printer {
    /// Prints and flushes; a closed pipe is no error (`yawara scenes | head -1`).
    pub fn print(&mut self, text: &str) -> Result<(), SimError> {
        if self.closed {
            return Ok(());
        }
        let mut out = std::io::stdout().lock();
        match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => {
                self.closed = true;
                Ok(())
            }
            other => other.map_err(|source| SimError::Io("<stdout>".into(), source)),
        }
    }
}
