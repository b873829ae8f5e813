//! A receiver that is replaced by another one.
//!
//! *Purpose.* What a board sees when a module fails in flight and its spare takes over.
//!
//! *Design.* A [`Talker`] of two: the first until it is unplugged, then nothing, then the second, whose
//! [`ReceiverSettings::power_on`](crate::ReceiverSettings::power_on) is the moment at which it has power.
//!
//! *Limits.* A burst that has begun to leave is sent whole.

use crate::pulse::Pulse;
use crate::receiver::Receiver;
use crate::talker::{Sent, Talker, Transmission, WorldNanos};

/// Two receivers, one after the other.
#[derive(Clone, Debug)]
pub struct Swap {
    first: Receiver,
    unplugged: WorldNanos,
    second: Receiver,
    is_first_gone: bool,
    truth: Vec<Sent>,
}

impl Swap {
    /// `first` until `unplugged`, and `second` from its power-on.
    #[must_use]
    pub const fn new(first: Receiver, unplugged: WorldNanos, second: Receiver) -> Self {
        Self {
            first,
            unplugged,
            second,
            is_first_gone: false,
            truth: Vec::new(),
        }
    }

    /// What both make on the pulse's wire.
    pub fn pulses(&self) -> impl Iterator<Item = Pulse> + Send + use<> {
        let unplugged = self.unplugged;
        let before = self.first.pulses();
        let before = before.take_while(move |pulse| pulse.edge < unplugged);
        before.chain(
            self.second
                .pulses()
                .skip_while(move |pulse| pulse.edge < unplugged),
        )
    }

    /// The one that is plugged in at `now`.
    fn present(&mut self, now: WorldNanos) -> &mut Receiver {
        self.is_first_gone |= now >= self.unplugged;
        if self.is_first_gone {
            &mut self.second
        } else {
            &mut self.first
        }
    }
}

impl Talker for Swap {
    fn next_event(&self) -> Option<WorldNanos> {
        if self.is_first_gone {
            return self.second.next_event();
        }
        let first = self.first.next_event();
        Some(first.map_or(self.unplugged, |at| at.min(self.unplugged)))
    }

    fn poll(&mut self, now: WorldNanos) -> Option<Transmission> {
        let receiver = self.present(now);
        let known = receiver.truth().len();
        let sent = receiver.poll(now);
        let new = receiver.truth().get(known..).unwrap_or_default().to_vec();
        self.truth.extend(new);
        sent
    }

    fn handle_bytes(&mut self, now: WorldNanos, baud: u32, bytes: &[u8]) {
        self.present(now).handle_bytes(now, baud, bytes);
    }

    fn truth(&self) -> &[Sent] {
        &self.truth
    }
}
