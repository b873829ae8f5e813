//! The memory card's bus: commands and blocks over SDIO and DMA2.
//!
//! *Purpose.* One command, or one block of 512 bytes, at a time; [`card`](super::card) knows which.
//!
//! *Design.* No interrupt: the caller is at thread level and polls the flags. It may be interrupted at
//! any time and for any time, because DMA2 (stream 3, channel 4, RM0090 table 44) moves the words.
//! Every wait has a limit. Blocks go through one buffer in RAM, which the DMA can reach wherever the
//! caller's memory is. Hardware flow control is off (ES0206 2.4.1); a FIFO that the DMA did not serve
//! in time is an error like others.
//!
//! A failed transfer leaves words in the FIFO, and the state machines of both sides are not known. So
//! there is one way back, [`Sdio::start`]: the peripheral is reset, and the card begins again.
//!
//! *Limits.* 16 MHz and four lines, as PX4 has it on this board. The two writes that begin a reception
//! are made with interrupts masked for some cycles, because the virtual board's interface gives up a
//! card that does not answer within a word.

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

/// CLKDIV until the card has an address: SDIO_CK is 48 MHz / (118 + 2) = 400 kHz (RM0090, 31.9.2).
const DIVIDER_SLOW: u8 = 118;

/// CLKDIV from then on: 48 MHz / (1 + 2) = 16 MHz.
const DIVIDER_FAST: u8 = 1;

/// The longest time for a block from the card, in periods of 16 MHz: 250 ms, more than the limit of its
/// specification (4.6.2.1).
const DATA_TIMER_RECEIVE: u32 = 16_000_000 / 4;

/// The longest time for a block to the card: 500 ms, for the time that the card is busy with it counts,
/// too (4.6.2.2; RM0090, 31.3.1).
const DATA_TIMER_TRANSMIT: u32 = 16_000_000 / 2;

/// The limit of the wait for a response, which is there within 0.6 ms at 400 kHz; or the hardware
/// reports that it is not. [µs]
const RESPONSE_US: u32 = 2_000;

/// The limit of the wait for a block, which the data timer ends within 500 ms. [µs]
const BLOCK_US: u32 = 600_000;

/// The limit of the wait for the DMA, which has a few words left after a block. [µs]
const DRAIN_US: u32 = 1_000;

/// For the card's supply, and 74 of its clocks before the first command (6.4.1). [µs]
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
    /// All flags that software has to clear.
    pub(super) const CLEARED: u32 = 0x00C0_07FF;
    /// What ends a command.
    pub(super) const COMMAND: u32 = CCRCFAIL | CTIMEOUT | CMDREND | CMDSENT;
    /// What ends a block.
    pub(super) const DATA: u32 = DCRCFAIL | DTIMEOUT | TXUNDERR | RXOVERR | DATAEND | STBITERR;
    /// LISR, stream 3: transfer error.
    pub(super) const DMA_TEIF: u32 = 1 << 25;
    /// LIFCR, stream 3: all five flags.
    pub(super) const DMA_ALL: u32 = 0x0F40_0000;
}

/// Why a command or a block did not come through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusError {
    /// The command was not answered.
    Silent,
    /// The answer to the command, or a block, was damaged.
    Crc,
    /// The block did not come, or the card did not take it, in time.
    DataTimeout,
    /// The FIFO overflowed or ran empty, or the DMA failed: this side's fault.
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

// SAFETY: only the one `Sdio` uses it, and not while the DMA does.
unsafe impl Sync for Buffer {}

static BUFFER: Buffer = Buffer(UnsafeCell::new([0; BLOCK]));

/// The interface, of which there is one.
pub struct Sdio {
    sdio: SDIO,
    dma: DMA2,
}

/// Waits until `look` returns something, for at most `limit_us`, which may be up to 25 s.
pub fn within<T>(limit_us: u32, mut look: impl FnMut() -> Option<T>) -> Option<T> {
    let limit = limit_us * (CORE_HZ / 1_000_000);
    let start = stamp();
    loop {
        // Read before the look: after a long interrupt there is still one look more.
        let is_last = stamp().wrapping_sub(start) > limit;
        let found = look();
        if found.is_some() || is_last {
            return found;
        }
    }
}

/// The low word of the time. Outlined, because many waits use it and none is in a hurry.
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

    /// Begins again: the interface is reset, at 400 kHz on one line, and the card has had the time
    /// that it needs after power-up.
    #[inline(never)]
    pub fn start(&mut self) {
        self.stop_dma();
        // SAFETY: this bit of RCC changes at thread level only, and no other bit of that register
        // changes after the board has been brought up.
        unsafe { SDIO::reset_unchecked() };
        self.sdio.power().write(|w| w.pwrctrl().power_on());
        self.sdio
            .clkcr()
            .write(|w| w.clkdiv().set(DIVIDER_SLOW).clken().enabled());
        within::<()>(POWER_UP_US, || None);
    }

    /// From now on 16 MHz on four lines, for which the card has been set.
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

    /// Sends a command that has no answer.
    ///
    /// # Errors
    ///
    /// [`BusError::Silent`] when the interface did not send it.
    pub fn command_only(&mut self, index: u8) -> Result<(), BusError> {
        self.clear_flags();
        self.send(index, 0, Response::None);
        self.ended().map(drop)
    }

    /// Sends a command, and returns its short answer.
    ///
    /// # Errors
    ///
    /// [`BusError::Silent`] and [`BusError::Crc`].
    #[inline(never)]
    pub fn command(&mut self, index: u8, argument: u32) -> Result<u32, BusError> {
        self.clear_flags();
        self.send(index, argument, Response::Short);
        self.answer()
    }

    /// As [`Self::command`], where the answer has no checksum (ES0206, 2.4.2).
    ///
    /// # Errors
    ///
    /// [`BusError::Silent`].
    pub fn command_unchecked(&mut self, index: u8, argument: u32) -> Result<u32, BusError> {
        match self.command(index, argument) {
            Err(BusError::Crc) => Ok(self.sdio.resp1().read().bits()),
            other => other,
        }
    }

    /// Sends a command, and returns its long answer, the first bits first.
    ///
    /// # Errors
    ///
    /// As [`Self::command`].
    #[inline(never)]
    pub fn command_long(&mut self, index: u8, argument: u32) -> Result<[u32; 4], BusError> {
        self.clear_flags();
        self.send(index, argument, Response::Long);
        self.answer()?;
        Ok([0, 1, 2, 3].map(|n| self.sdio.resp(n).read().bits()))
    }

    /// Sends a command for a block and receives it, if `accepts` takes the command's answer.
    ///
    /// # Errors
    ///
    /// What `accepts` returns, or a [`BusError`]. The interface has to be started again then.
    pub fn receive<E: From<BusError>>(
        &mut self,
        index: u8,
        argument: u32,
        accepts: impl FnOnce(u32) -> Result<(), E>,
        block: &mut [u8; BLOCK],
    ) -> Result<(), E> {
        self.prepare(false);
        // The data path is ready before the card may send.
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
            // SAFETY: the DMA has stopped, so that only this code uses the buffer.
            *block = unsafe { *BUFFER.0.get() };
        }
        result
    }

    /// Sends a command and `block` after it, if `accepts` takes the command's answer.
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
        // SAFETY: the DMA has stopped, so that only this code uses the buffer.
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
            // SAFETY: each of the values has a meaning (31.9.4).
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

    /// Sets the DMA up for a block. The interface controls when it ends (RM0090, 31.3.2).
    #[inline(never)]
    fn prepare(&mut self, to_card: bool) {
        self.stop_dma();
        let stream = self.stream();
        let fifo = self.sdio.fifo().as_ptr() as u32;
        // SAFETY: the addresses are those of the FIFO and of the buffer. The buffer is as long as
        // DLEN says, and no other code uses it while the stream runs.
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
        // What was stored into the buffer is there before the DMA reads it.
        cortex_m::asm::dmb();
        stream.cr().modify(|_, w| w.en().enabled());
        self.clear_flags();
        let longest = if to_card {
            DATA_TIMER_TRANSMIT
        } else {
            DATA_TIMER_RECEIVE
        };
        self.sdio.dtimer().write(|w| w.datatime().set(longest));
        self.sdio.dlen().write(|w| w.datalength().set(BLOCK as u32));
    }

    /// Starts the data path.
    #[inline(never)]
    fn begin(&mut self, to_card: bool) {
        self.sdio.dctrl().write(|w| {
            // SAFETY: blocks of 2⁹ bytes.
            unsafe { w.dblocksize().bits(BLOCK.trailing_zeros() as u8) };
            w.dtdir().bit(!to_card);
            w.dmaen().enabled().dten().enabled()
        });
    }

    /// Waits until the block is transferred and the DMA is done with it.
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

    /// Stops the stream and clears its flags; after that only this code uses the buffer.
    #[inline(never)]
    fn stop_dma(&mut self) {
        self.stream().cr().modify(|_, w| w.en().disabled());
        // The stream ends its burst first (RM0090, 10.3.14).
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
