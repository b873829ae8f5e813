//! What waits to be done to the core from outside, as a debug probe does it.
//!
//! *Design.* It waits in a list until the core runs next, because only the emulator's own thread
//! reaches the core there.

use std::sync::{Arc, Mutex, PoisonError};

use rigless::emulator::{CoreBus, Processor, Queued};
use rigless::soc::Width;

/// A register of the core, by the number under which GDB has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CoreRegister {
    /// The stack pointer.
    Sp = 13,
    /// The program counter.
    Pc = 15,
}

/// What waits to be done to the core.
#[derive(Clone, Debug)]
pub(crate) enum Poke {
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

    /// Adds to the list.
    pub(crate) fn push(&self, poke: Poke) {
        self.with(|(pokes, _)| pokes.push(poke));
    }
}
