//! The memory card's bus: commands and blocks over SDIO and DMA2.
//!
//! *Purpose.* What a card is told and what it gives, one command or one block of 512 bytes
//! at a time; [`card`](super::card) knows what to say.
//!
//! *Design.* No interrupt: whoever calls is at thread level, looks at the flags, and may be
//! interrupted at any time for as long as it takes, because DMA2 (stream 3, channel 4, RM0090
//! table 44) moves the words. Every wait has a limit. Blocks go through one buffer in RAM, which
//! the DMA can reach wherever the caller's memory is. Without hardware flow control (ES0206
//! 2.4.1); a FIFO that the DMA did not serve in time is an error like others.
//!
//! A failed transfer leaves words in the FIFO and both state machines somewhere. So there is one
//! way back, [`Sdio::start`]: the peripheral is reset, and the card begins again.
//!
//! *Limits.* 16 MHz and four lines, as PX4 has it on this board. The two writes that begin
//! a reception are made with interrupts masked, some cycles: the virtual board's interface gives
//! up a card that does not answer within a word.

use core::cell::UnsafeCell;

use stm32f4xx_hal::gpio::{Input, PC8, PC9, PC10, PC11, PC12, PD2, Pull, Speed};
use stm32f4xx_hal::pac::dma2::ST as Stream;
use stm32f4xx_hal::pac::{DMA2, SDIO};
use stm32f4xx_hal::rcc::{Enable as _, Rcc, Reset as _};
use timebase::CORE_HZ;

use super::time;

/// SDIO on its pins (DS9484, alternate functions).
const AF: u8 = 12;
/// Bytes of a block.
pub const BLOCK: usize = 512;

/// SDIO_CK is 48 MHz over this plus two (RM0090, 31.9.2): 400 kHz until the card has an
/// address, 16 MHz from then on.
const DIVIDER_SLOW: u8 = 118;
const DIVIDER_FAST: u8 = 1;
/// How long the card may take over a block in either direction, in periods of 16 MHz: 250 ms,
/// the limit of its specification (4.6.2).
const DATA_TIMER: u32 = 16_000_000 / 4;

/// Limits of waits, in µs. A response is there within 0.6 ms at 400 kHz, or the hardware says
/// that it is not; the data timer ends a block within 250 ms; the DMA has a few words left then.
const RESPONSE_US: u32 = 2_000;
const BLOCK_US: u32 = 300_000;
const DRAIN_US: u32 = 1_000;
/// The card's supply and 74 of its clocks, before the first command (6.4.1), in µs.
const POWER_UP_US: u32 = 2_000;

/// STA and ICR of RM0090, 31.9.11 and 31.9.12.
mod flags {
    pub(super) const CCRCFAIL: u32 = 1 << 0;
    pub(super) const DCRCFAIL: u32 = 1 << 1;
    pub(super) const CTIMEOUT: u32 = 1 << 2;
    pub(super) const DTIMEOUT: u32 = 1 << 3;
    pub(super) const TXUNDERR: u32 = 1 << 4;
    pub(super) const RXOVERR: u32 = 1 << 5;
    pub(super) const CMDREND: u32 = 1 << 6;
    pub(super) const CMDSENT: u32 = 1 << 7;
    pub(super) const DATAEND: u32 = 1 << 8;
    pub(super) const STBITERR: u32 = 1 << 9;
    /// Everything that is cleared by hand.
    pub(super) const CLEARED: u32 = 0x00C0_07FF;
    /// What ends a command, and what ends a block.
    pub(super) const COMMAND: u32 = CCRCFAIL | CTIMEOUT | CMDREND | CMDSENT;
    pub(super) const DATA: u32 = DCRCFAIL | DTIMEOUT | TXUNDERR | RXOVERR | DATAEND | STBITERR;
    /// LISR and LIFCR, stream 3: transfer error, and all five.
    pub(super) const DMA_TEIF: u32 = 1 << 25;
    pub(super) const DMA_ALL: u32 = 0x0F40_0000;
}

/// Why a command or a block did not come through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusError {
    /// Nobody answered the command.
    Silent,
    /// The answer to the command, or a block, was damaged.
    Crc,
    /// The block did not come, or was not taken, in time.
    DataTimeout,
    /// The FIFO ran over or dry, or the DMA failed: this side's fault.
    Fifo,
}

/// What a card answers a command with.
#[derive(Clone, Copy)]
enum Response {
    None = 0b00,
    Short = 0b01,
    Long = 0b11,
}

/// The pins of the card's slot.
pub struct Pins {
    /// D0 to D3.
    pub data: (PC8<Input>, PC9<Input>, PC10<Input>, PC11<Input>),
    /// CK.
    pub clock: PC12<Input>,
    /// CMD.
    pub command: PD2<Input>,
}

/// The buffer that the DMA reads and fills, aligned to its bursts of 16 bytes.
#[repr(align(16))]
struct Buffer(UnsafeCell<[u8; BLOCK]>);

// SAFETY: only the one `Sdio` touches it, and not while the DMA does.
unsafe impl Sync for Buffer {}

static BUFFER: Buffer = Buffer(UnsafeCell::new([0; BLOCK]));

/// The interface, of which there is one.
pub struct Sdio {
    sdio: SDIO,
    dma: DMA2,
}

/// Waits until `look` has something, for at most `limit_us`, 25 s.
pub fn within<T>(limit_us: u32, mut look: impl FnMut() -> Option<T>) -> Option<T> {
    let limit = limit_us * (CORE_HZ / 1_000_000);
    let start = stamp();
    loop {
        // Before the look: one that comes late because others ran is still a look.
        let is_last = stamp().wrapping_sub(start) > limit;
        let found = look();
        if found.is_some() || is_last {
            return found;
        }
    }
}

/// The low word of the time, outlined: waits are many and in no hurry.
#[inline(never)]
fn stamp() -> u32 {
    time::stamp().0
}

impl Sdio {
    /// The interface on its pins, off until [`Self::start`].
    pub fn new(sdio: SDIO, dma: DMA2, pins: Pins, rcc: &mut Rcc) -> Self {
        SDIO::enable(rcc);
        DMA2::enable(rcc);
        DMA2::reset(rcc);
        macro_rules! connect {
            ($($pin:expr, $pull:ident;)*) => {
                $($pin.into_alternate::<AF>().internal_resistor(Pull::$pull).set_speed(Speed::High);)*
            };
        }
        connect! {
            pins.data.0, Up;
            pins.data.1, Up;
            pins.data.2, Up;
            pins.data.3, Up;
            pins.command, Up;
            pins.clock, None;
        }
        Self { sdio, dma }
    }

    /// Begins anew: a fresh interface, 400 kHz on one line, a card that has had its time.
    #[inline(never)]
    pub fn start(&mut self) {
        self.stop_dma();
        // SAFETY: this one bit of RCC is changed at thread level only, and nobody changes another
        // one of that register after the board has been brought up.
        unsafe { SDIO::reset_unchecked() };
        self.sdio.power().write(|w| w.pwrctrl().power_on());
        self.sdio
            .clkcr()
            .write(|w| w.clkdiv().set(DIVIDER_SLOW).clken().enabled());
        within::<()>(POWER_UP_US, || None);
    }

    /// From now on 16 MHz on four lines, which the card has been told.
    pub fn speed_up(&mut self) {
        self.sdio.clkcr().write(|w| {
            w.clkdiv().set(DIVIDER_FAST);
            w.widbus().bus_width4();
            w.clken().enabled()
        });
    }

    /// Takes the clock from the card; [`Self::start`] gives it back.
    pub fn stop(&mut self) {
        self.stop_dma();
        // SAFETY: as in `start`.
        unsafe { SDIO::reset_unchecked() };
    }

    /// Sends a command that nobody answers.
    ///
    /// # Errors
    ///
    /// [`BusError::Silent`] when the interface did not send it.
    pub fn tell(&mut self, index: u8) -> Result<(), BusError> {
        self.clear_flags();
        self.send(index, 0, Response::None);
        self.ended().map(drop)
    }

    /// Sends a command; its short answer.
    ///
    /// # Errors
    ///
    /// [`BusError::Silent`] and [`BusError::Crc`].
    #[inline(never)]
    pub fn ask(&mut self, index: u8, argument: u32) -> Result<u32, BusError> {
        self.clear_flags();
        self.send(index, argument, Response::Short);
        self.answer()
    }

    /// As [`Self::ask`], where the answer has no checksum (ES0206, 2.4.2).
    ///
    /// # Errors
    ///
    /// [`BusError::Silent`].
    pub fn ask_unchecked(&mut self, index: u8, argument: u32) -> Result<u32, BusError> {
        match self.ask(index, argument) {
            Err(BusError::Crc) => Ok(self.sdio.resp1().read().bits()),
            other => other,
        }
    }

    /// Sends a command; its long answer, the first bits first.
    ///
    /// # Errors
    ///
    /// As [`Self::ask`].
    #[inline(never)]
    pub fn ask_long(&mut self, index: u8, argument: u32) -> Result<[u32; 4], BusError> {
        self.clear_flags();
        self.send(index, argument, Response::Long);
        self.answer()?;
        Ok([0, 1, 2, 3].map(|n| self.sdio.resp(n).read().bits()))
    }

    /// Has a command give a block; its answer, once `accepts` it, and the block.
    ///
    /// # Errors
    ///
    /// What `accepts` says, or a [`BusError`]. The interface has to be started again then.
    pub fn receive<E: From<BusError>>(
        &mut self,
        index: u8,
        argument: u32,
        accepts: impl FnOnce(u32) -> Result<(), E>,
        block: &mut [u8; BLOCK],
    ) -> Result<(), E> {
        self.prepare(false);
        // The data path listens before the card may speak.
        critical_section::with(|_| {
            self.begin(false);
            self.send(index, argument, Response::Short);
        });
        let result = self
            .answer()
            .map_err(E::from)
            .and_then(accepts)
            .and_then(|()| Ok(self.finish()?));
        self.stop_dma();
        if result.is_ok() {
            // SAFETY: the DMA has stopped, so that the buffer is ours.
            *block = unsafe { *BUFFER.0.get() };
        }
        result
    }

    /// Has a command take `block`, once `accepts` its answer.
    ///
    /// # Errors
    ///
    /// As [`Self::receive`].
    pub fn transmit<E: From<BusError>>(
        &mut self,
        index: u8,
        argument: u32,
        accepts: impl FnOnce(u32) -> Result<(), E>,
        block: &[u8; BLOCK],
    ) -> Result<(), E> {
        self.clear_flags();
        self.send(index, argument, Response::Short);
        accepts(self.answer()?)?;
        // SAFETY: the DMA stands still, so that the buffer is ours.
        unsafe { *BUFFER.0.get() = *block };
        self.prepare(true);
        self.begin(true);
        let result = self.finish();
        self.stop_dma();
        Ok(result?)
    }

    #[inline(never)]
    fn send(&mut self, index: u8, argument: u32, response: Response) {
        self.sdio.arg().write(|w| w.cmdarg().set(argument));
        self.sdio.cmd().write(|w| {
            w.cmdindex().set(index);
            // SAFETY: three of the four values, each of which has a meaning (31.9.4).
            unsafe { w.waitresp().bits(response as u8) };
            w.cpsmen().enabled()
        });
    }

    fn clear_flags(&mut self) {
        // SAFETY: flags that are cleared by writing 1.
        self.sdio.icr().write(|w| unsafe { w.bits(flags::CLEARED) });
    }

    /// The flags that ended the command.
    fn ended(&self) -> Result<u32, BusError> {
        within(RESPONSE_US, || {
            let found = self.sdio.sta().read().bits();
            (found & flags::COMMAND != 0).then_some(found)
        })
        .ok_or(BusError::Silent)
    }

    #[inline(never)]
    fn answer(&self) -> Result<u32, BusError> {
        let found = self.ended()?;
        if found & flags::CTIMEOUT != 0 {
            Err(BusError::Silent)
        } else if found & flags::CCRCFAIL != 0 {
            Err(BusError::Crc)
        } else {
            Ok(self.sdio.resp1().read().bits())
        }
    }

    /// Sets the DMA up for a block. The interface says when it ends (RM0090, 31.3.2).
    #[inline(never)]
    fn prepare(&mut self, to_card: bool) {
        self.stop_dma();
        let stream = self.stream();
        let fifo = self.sdio.fifo().as_ptr() as u32;
        // SAFETY: the addresses are those of the FIFO and of the buffer, which is as long as
        // what DLEN says and nobody else's while the stream runs.
        unsafe {
            stream.par().write(|w| w.bits(fifo));
            stream.m0ar().write(|w| w.bits(BUFFER.0.get() as u32));
        }
        stream.fcr().write(|w| w.dmdis().disabled().fth().full());
        stream.cr().write(|w| {
            // SAFETY: channel 4 of 8.
            unsafe { w.chsel().bits(4) };
            w.mburst().incr4().pburst().incr4();
            w.msize().bits32().psize().bits32();
            w.minc().incremented().pl().very_high();
            w.pfctrl().peripheral();
            if to_card {
                w.dir().memory_to_peripheral()
            } else {
                w.dir().peripheral_to_memory()
            }
        });
        // What was stored into the buffer is there before the DMA looks.
        cortex_m::asm::dmb();
        stream.cr().modify(|_, w| w.en().enabled());
        self.clear_flags();
        self.sdio.dtimer().write(|w| w.datatime().set(DATA_TIMER));
        self.sdio.dlen().write(|w| w.datalength().set(BLOCK as u32));
    }

    /// Lets the data path go.
    #[inline(never)]
    fn begin(&mut self, to_card: bool) {
        self.sdio.dctrl().write(|w| {
            // SAFETY: blocks of 2⁹ bytes.
            unsafe { w.dblocksize().bits(BLOCK.trailing_zeros() as u8) };
            w.dtdir().bit(!to_card);
            w.dmaen().enabled().dten().enabled()
        });
    }

    /// Waits until the block has crossed and the DMA is done with it.
    #[inline(never)]
    fn finish(&mut self) -> Result<(), BusError> {
        let found = within(BLOCK_US, || {
            let found = self.sdio.sta().read().bits();
            (found & flags::DATA != 0).then_some(found)
        })
        .ok_or(BusError::DataTimeout)?;
        for (flag, error) in [
            (flags::DCRCFAIL, BusError::Crc),
            (flags::DTIMEOUT | flags::STBITERR, BusError::DataTimeout),
            (flags::TXUNDERR | flags::RXOVERR, BusError::Fifo),
        ] {
            if found & flag != 0 {
                return Err(error);
            }
        }
        let drained = within(DRAIN_US, || {
            self.stream().cr().read().en().is_disabled().then_some(())
        });
        let failed = self.dma.lisr().read().bits() & flags::DMA_TEIF != 0;
        if failed || drained.is_none() {
            return Err(BusError::Fifo);
        }
        Ok(())
    }

    /// The stream stands still, and its flags are cleared; so the buffer is ours.
    #[inline(never)]
    fn stop_dma(&mut self) {
        self.stream().cr().modify(|_, w| w.en().disabled());
        // It ends its burst first (RM0090, 10.3.14).
        within(DRAIN_US, || {
            self.stream().cr().read().en().is_disabled().then_some(())
        });
        cortex_m::asm::dmb();
        // SAFETY: five of this stream's flags, cleared by writing 1.
        self.dma
            .lifcr()
            .write(|w| unsafe { w.bits(flags::DMA_ALL) });
    }

    fn stream(&self) -> &Stream {
        self.dma.st(3)
    }
}
