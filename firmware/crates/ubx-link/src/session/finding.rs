//! What is known of the receiver, and what is new about that.

use crate::identity::{Generation, Identity, Unusable};

/// What is known of the receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finding {
    /// It is being looked for.
    Searching,
    /// It has not answered at any rate.
    Silent,
    /// It is there, and does not say what it is.
    Unnamed,
    /// It is there, and used.
    Used(Identity),
    /// It is there, and cannot be used.
    Unused(Identity, Unusable),
}

/// The present finding, and what the outside knows of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Findings {
    now: Finding,
    /// It has not been reported.
    is_new: bool,
    /// The last one that said what it is.
    last: Option<Identity>,
    /// One has acknowledged a CFG-VALSET.
    takes_keys: bool,
}

impl Findings {
    pub(super) const NONE: Self = Self {
        now: Finding::Searching,
        is_new: false,
        last: None,
        takes_keys: false,
    };

    /// It may be another one from now on.
    pub(super) const fn handle_lost(&mut self) {
        self.takes_keys = false;
    }

    /// A CFG-VALSET was acknowledged.
    pub(super) const fn handle_keys_taken(&mut self) {
        self.takes_keys = true;
    }

    /// It says what it is. Whether it is another one than before.
    #[inline(never)]
    pub(super) fn handle_version(&mut self, identity: &Identity) -> bool {
        let finding = match identity.generation() {
            Ok(_) => Finding::Used(*identity),
            Err(why) => Finding::Unused(*identity, why),
        };
        self.handle(finding);
        self.last.replace(*identity) != Some(*identity)
    }

    /// How it is configured; `None` if it is not used.
    #[inline(never)]
    pub(super) const fn generation(&self) -> Option<Generation> {
        match self.now {
            Finding::Used(ref identity) => match identity.generation() {
                Ok(generation) => Some(generation),
                Err(_) => None,
            },
            Finding::Unused(..) => None,
            _ if self.takes_keys => Some(Generation::Keys),
            _ => Some(Generation::Messages),
        }
    }

    /// The present one.
    pub(super) const fn now(&self) -> Finding {
        self.now
    }

    /// This is known now.
    #[inline(never)]
    pub(super) fn handle(&mut self, finding: Finding) {
        self.is_new |= self.now != finding;
        self.now = finding;
    }

    /// It is there, whatever it is.
    pub(super) fn handle_there(&mut self) {
        if matches!(self.now, Finding::Searching | Finding::Silent) {
            self.handle(Finding::Unnamed);
        }
    }

    /// What is new since the last call.
    #[inline]
    pub(super) fn poll(&mut self) -> Option<Finding> {
        core::mem::take(&mut self.is_new).then_some(self.now)
    }
}
