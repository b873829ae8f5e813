//! A host on TELEM1 or USB that uploads, in the time of the virtual board.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use crate::common::BAUD;
use upload::{Device, Failure, Image, Uploader};
use world::{Sent, Talker, Transmission, WorldNanos};

/// What a station has done.
#[derive(Debug, Default)]
pub(super) struct Record {
    /// When each command begins and ends on the line.
    pub(super) commands: Vec<(WorldNanos, WorldNanos)>,
    pub(super) outcome: Option<Result<Device, Failure>>,
}

/// A host that uploads.
pub(super) struct Station {
    /// What it sends before: that the firmware is to restart.
    call: Option<Transmission>,
    uploader: Uploader,
    /// A command that waits for its moment, and since when.
    waiting: Option<(WorldNanos, Vec<u8>)>,
    free: WorldNanos,
    record: Arc<Mutex<Record>>,
}

fn since_start(at: WorldNanos) -> Duration {
    Duration::from_nanos(at.0)
}

impl Station {
    pub(super) fn new(image: Image, begins: WorldNanos, call: Option<Transmission>) -> Self {
        let begins = since_start(begins);
        Self {
            call,
            uploader: Uploader::new(image, begins, begins + Duration::from_secs(10)),
            waiting: None,
            free: WorldNanos(0),
            record: Arc::default(),
        }
    }

    pub(super) fn record(&self) -> Arc<Mutex<Record>> {
        Arc::clone(&self.record)
    }

    /// Takes what the uploader has to say.
    fn look(&mut self, now: WorldNanos) {
        let outcome = self.uploader.outcome();
        self.note(|record| record.outcome = outcome);
        if let Some(command) = self.uploader.poll_transmit() {
            self.waiting = Some((now, command));
        }
    }

    fn note(&self, change: impl FnOnce(&mut Record)) {
        change(&mut self.record.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

impl Talker for Station {
    fn next_event(&self) -> Option<WorldNanos> {
        if let Some((since, _)) = self.waiting {
            return Some(since);
        }
        let call = self.call.as_ref().map(|call| call.start);
        let due = self.uploader.poll_timeout()?;
        let due = WorldNanos(due.as_nanos() as u64);
        Some(call.unwrap_or(due).min(due))
    }

    fn poll(&mut self, now: WorldNanos) -> Option<Transmission> {
        if let Some(call) = self.call.take_if(|call| call.start <= now) {
            return Some(call);
        }
        if self.waiting.is_none() {
            self.uploader.handle_timeout(since_start(now));
            self.look(now);
        }
        let (_, bytes) = self.waiting.take()?;
        let transmission = Transmission {
            start: now.max(self.free),
            bytes,
            baud: BAUD,
        };
        self.free = transmission.end();
        let command = (transmission.start, transmission.end());
        self.note(|record| record.commands.push(command));
        Some(transmission)
    }

    fn handle_bytes(&mut self, at: WorldNanos, _: u32, bytes: &[u8]) {
        self.uploader.handle_bytes(bytes, since_start(at));
        self.look(at);
    }

    fn truth(&self) -> &[Sent] {
        &[]
    }
}
