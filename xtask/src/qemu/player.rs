//! The receiver at the other end of a board's GPS line, in real time.
//!
//! *Purpose.* A simulated receiver, or a recording of one, on a socket that QEMU takes for a UART.
//!
//! *Limits.* No baud timing: a burst arrives as fast as the firmware reads it, at any rate that the
//! two ends may be set to.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use world::{Receiver, ReceiverSettings, Recording, Talker, WorldNanos};

/// How long to wait for bytes at most, before the time and Ctrl-C are looked at again.
const PATIENCE: Duration = Duration::from_millis(20);

/// Who talks on a board's GPS line.
pub enum Player {
    /// A simulated receiver.
    Receiver(Box<Receiver>),
    /// A recording.
    Recording(Recording),
}

impl Player {
    /// A receiver like `settings`.
    pub fn receiver(settings: ReceiverSettings) -> Self {
        Self::Receiver(Box::new(Receiver::new(settings)))
    }

    /// Plays on `line` until `is_over`, the world having begun at `started`.
    ///
    /// # Errors
    ///
    /// When QEMU has ended.
    pub fn play(
        &mut self,
        mut line: TcpStream,
        started: Instant,
        is_over: impl Fn() -> bool,
    ) -> Result<()> {
        let now = || WorldNanos(u64::try_from(started.elapsed().as_nanos()).unwrap_or(u64::MAX));
        let mut buffer = [0; 256];
        while !is_over() {
            while let Some(burst) = self.talker().poll(now()) {
                if line.write_all(&burst.bytes).is_err() {
                    bail!("QEMU ended by itself");
                }
            }
            let until_next = self.talker().next_event().map_or(PATIENCE, |next| {
                Duration::from_nanos(next.0.saturating_sub(now().0))
            });
            let patience = until_next.clamp(Duration::from_millis(1), PATIENCE);
            line.set_read_timeout(Some(patience))?;
            match line.read(&mut buffer) {
                Ok(0) => bail!("QEMU ended by itself"),
                Ok(count) => {
                    let baud = self.baud();
                    let bytes = buffer.get(..count).unwrap_or_default();
                    self.talker().handle_bytes(now(), baud, bytes);
                }
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(_) => bail!("QEMU ended by itself"),
            }
        }
        Ok(())
    }

    /// QEMU has no rates: whatever the board is set to is understood.
    fn baud(&self) -> u32 {
        match self {
            Self::Receiver(receiver) => receiver.port().baud,
            Self::Recording(_) => 115_200,
        }
    }

    fn talker(&mut self) -> &mut dyn Talker {
        match self {
            Self::Receiver(receiver) => &mut **receiver,
            Self::Recording(recording) => recording,
        }
    }
}
