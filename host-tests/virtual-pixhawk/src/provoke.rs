//! What a debug probe can do to a board: read and write registers, the core's and the part's, and
//! the code.
//!
//! *Purpose.* Faults are provoked from outside, so that the image that is tested is the one that is
//! flashed.

use anyhow::ensure;
use rigless::mcu::Operate as _;
use rigless::soc::Width;
use world::WorldNanos;

use crate::probe::{CoreRegister, Poke};
use crate::run::Pixhawk;

/// ICSR, and its bit that makes NMI pending.
const ICSR: u32 = 0xE000_ED04;
const NMIPENDSET: u32 = 1 << 31;

impl Pixhawk {
    /// A register of the part, without the side effects of a read.
    ///
    /// # Errors
    ///
    /// There is none at that address, or the emulator gave up.
    pub fn peek(&mut self, address: u64) -> anyhow::Result<u32> {
        let value = self.order(move |stopped| {
            let part = &mut stopped.session.board_mut().mcu;
            part.peek(stopped.stop.at, address, Width::W32)
        })??;
        Ok(value as u32)
    }

    /// The halfword of code at `address`.
    ///
    /// # Errors
    ///
    /// There is no memory, or the emulator gave up.
    pub fn code_at(&mut self, address: u32) -> anyhow::Result<u16> {
        let halfword = self.order(move |stopped| stopped.host.read(address.into(), Width::W16))?;
        Ok(halfword? as u16)
    }

    /// Sets a register of the core; it has the value when the core runs next.
    pub fn set_core_register(&mut self, register: CoreRegister, value: u32) {
        self.probe().push(Poke::Register(register, value));
    }

    /// Writes a word of the core's own space, such as the interrupt controller's, as its code would.
    pub fn poke_core(&mut self, address: u32, value: u32) {
        self.probe().push(Poke::Word(address, value));
    }

    /// Writes a word of the static `name`, `offset` bytes behind its start, before the core goes on.
    ///
    /// # Errors
    ///
    /// The image has no such static, or it is shorter.
    pub fn set_word(&mut self, name: &str, offset: u32, value: u32) -> anyhow::Result<()> {
        let place = self.firmware().symbol(name)?;
        ensure!(
            u64::from(place.size) >= u64::from(offset) + 4,
            "{name} is shorter than that"
        );
        let bytes = value.to_le_bytes().to_vec();
        self.probe().push(Poke::Code(place.address + offset, bytes));
        Ok(())
    }

    /// Replaces the beginning of the function `name` by these instructions, in the board's flash; what was
    /// there.
    ///
    /// # Errors
    ///
    /// See [`Firmware::symbol`](crate::Firmware::symbol); or the function is shorter; or the emulator gave up.
    pub fn patch(&mut self, name: &str, instructions: &[u16]) -> anyhow::Result<Vec<u16>> {
        let place = self.firmware().symbol(name)?;
        ensure!(
            place.size as usize >= instructions.len() * 2,
            "{name} is shorter than that"
        );
        let addresses = (place.address..).step_by(2).take(instructions.len());
        let before = self.order(move |stopped| {
            addresses
                .map(|address| stopped.host.read(address.into(), Width::W16))
                .map(|halfword| halfword.map(|halfword| halfword as u16))
                .collect::<Result<Vec<_>, _>>()
        })??;
        let bytes = instructions.iter().copied().flat_map(u16::to_le_bytes);
        self.probe()
            .push(Poke::Code(place.address, bytes.collect()));
        Ok(before)
    }

    /// Makes the core's next access to the addresses from `from` up to `to` a bus error: where there is no
    /// memory, the emulator answers with 0 otherwise.
    ///
    /// # Errors
    ///
    /// The emulator gave up.
    pub fn fail_next_access(&mut self, from: u32, to: u32) -> anyhow::Result<()> {
        self.order(move |stopped| stopped.session.fail_next(from.into(), to.into()))
    }

    /// Stops the crystal. The part's clock security system acts, if it is on; its NMI is raised from
    /// here, because the emulator's model of it does not reach the core.
    ///
    /// # Errors
    ///
    /// The emulator gave up.
    pub fn fail_crystal(&mut self) -> anyhow::Result<()> {
        const CIR: u64 = 0x4002_3800 + 0x0C;
        const CSSF: u32 = 1 << 7;
        self.order(|stopped| {
            let part = &mut stopped.session.board_mut().mcu;
            part.drive_clocks(stopped.stop.at, |rcc, registers, context| {
                rcc.fail_hse(registers, context);
            });
        })?;
        if self.peek(CIR)? & CSSF != 0 {
            self.poke_core(ICSR, NMIPENDSET);
        }
        Ok(())
    }

    /// When the part was restarted, since it has power.
    ///
    /// # Errors
    ///
    /// The emulator gave up.
    pub fn restarts(&mut self) -> anyhow::Result<Vec<WorldNanos>> {
        self.order(|stopped| {
            let resets = stopped.session.resets().iter();
            resets.map(|reset| WorldNanos(reset.at.0)).collect()
        })
    }
}
