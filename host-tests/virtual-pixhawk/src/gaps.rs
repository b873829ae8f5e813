//! Where the firmware went beyond what the emulator models.
//!
//! *Purpose.* A run is believed when nothing is listed here, or each entry is
//! explained.
//!
//! *Design.* `rigless` keeps these lists itself, one entry a register; they are put
//! into words once.
//!
//! *Limits.* A register that is modelled can still be modelled wrongly.

use std::collections::BTreeSet;

use rigless::machine::Board;
use rigless::session::Session;

/// What the firmware reached that has no model.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Gaps {
    /// Registers answered from the register file with no model behind them, as
    /// `INSTANCE.REGISTER`, and whether they were written.
    pub unmodelled: BTreeSet<(String, bool)>,
    /// Addresses that no register covers, or that are reached in a way that the part
    /// refuses, with the reason.
    pub refused: BTreeSet<String>,
    /// What a model reported against the way it was used.
    pub misuse: BTreeSet<String>,
    /// How often the part was restarted.
    pub resets: usize,
}

impl Gaps {
    pub(crate) fn of<D: Board + ?Sized>(session: &Session<D>) -> Self {
        let unmodelled = session.unimplemented().values();
        let unmapped = session.unmapped().into_iter().map(|gap| gap.to_string());
        let refused = session
            .refused()
            .iter()
            .map(|(address, fault)| format!("refused at={address:#010x}: {fault}"));
        let undefined = session
            .undefined()
            .iter()
            .map(|(address, seen)| format!("undefined {} at={address:#010x}", seen.instance));
        let unrouted = session
            .unrouted()
            .iter()
            .map(|(instance, number)| format!("no line for {instance} interrupt {number}"));
        let misuse = session
            .told()
            .map(|use_| format!("{}.{}: {}", use_.instance, use_.register, use_.reason));
        Self {
            unmodelled: unmodelled
                .map(|seen| {
                    let name = format!("{}.{}", seen.instance, seen.register);
                    (name, seen.writes > 0)
                })
                .collect(),
            refused: unmapped
                .chain(refused)
                .chain(undefined)
                .chain(unrouted)
                .collect(),
            misuse: misuse.collect(),
            resets: session.resets().len(),
        }
    }
}
