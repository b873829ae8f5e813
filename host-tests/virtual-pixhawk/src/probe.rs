//! What a debug probe can do to a board: read and write registers, the core's and the part's, and the code.
//!
//! *Purpose.* Faults are provoked from outside, so that the image that is tested is the one that is
//! flashed.
//!
//! *Design.* What concerns the core waits in a list until the core runs next, because only the
//! emulator's own thread reaches it there.

use std::sync::{Arc, Mutex, PoisonError};

use anyhow::ensure;
use rigless::emulator::{CoreBus, Processor, Queued};
use rigless::mcu::Operate as _;
use rigless::soc::Width;
use world::WorldNanos;

use crate::run::Pixhawk;

/// A register of the core, by the number under which GDB has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CoreRegister {
    /// The stack pointer.
    Sp = 13,
    /// The program counter.
    Pc = 15,
}

/// ICSR, and its bit that makes NMI pending.
const ICSR: u32 = 0xE000_ED04;
const NMIPENDSET: u32 = 1 << 31;

/// What waits to be done to the core.
#[derive(Clone, Debug)]
enum Poke {
    Register(CoreRegister, u32),
    Word(u32, u32),
    Code(u32, Vec<u8>),
}

/// A stretch of memory as the processor knows it: its address, its length, and where the host has it.
#[derive(Clone, Copy, Debug)]
struct Mapped {
    start: u64,
    length: u64,
    host: usize,
}

/// The list, and the memory that the processor was given.
#[derive(Clone, Debug, Default)]
pub(crate) struct Probe(Arc<Mutex<(Vec<Poke>, Vec<Mapped>)>>);

impl Probe {
    fn with<R>(&self, act: impl FnOnce(&mut (Vec<Poke>, Vec<Mapped>)) -> R) -> R {
        act(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// The processor was given this memory.
    pub(crate) fn handle_map(&self, start: u64, length: u64, host: *mut u8) {
        let host = host.expose_provenance();
        self.with(|(_, mapped)| {
            mapped.push(Mapped {
                start,
                length,
                host,
            });
        });
    }

    /// Does what waits, before the core goes on.
    pub(crate) fn apply(&self, processor: &mut dyn Processor, bus: &dyn CoreBus) {
        let (pokes, mapped) = self.with(|(pokes, mapped)| (std::mem::take(pokes), mapped.clone()));
        for poke in pokes {
            match poke {
                Poke::Register(register, value) => {
                    processor.set_gdb_register(register as usize, &value.to_le_bytes());
                }
                Poke::Word(address, value) => {
                    let now = bus.time(processor.retired());
                    let value = Some(value.into());
                    processor.debugger_access(value, address.into(), Width::W32, now);
                }
                Poke::Code(address, bytes) => {
                    let start = u64::from(address);
                    let end = start + bytes.len() as u64;
                    let Some(region) = mapped.iter().find(|region| {
                        region.start <= start && end <= region.start + region.length
                    }) else {
                        continue;
                    };
                    let offset = (start - region.start) as usize;
                    let place = std::ptr::with_exposed_provenance_mut::<u8>(region.host + offset);
                    // SAFETY: these bytes lie within the memory that the emulator gave its processor
                    // for as long as that lives, and the processor, whose thread this is, stands.
                    unsafe { place.copy_from_nonoverlapping(bytes.as_ptr(), bytes.len()) };
                    processor.ask(Queued::Invalidate(start, end));
                }
            }
        }
    }

    fn push(&self, poke: Poke) {
        self.with(|(pokes, _)| pokes.push(poke));
    }
}

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
