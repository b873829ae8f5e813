//! A virtual Pixhawk under power.
//!
//! *Purpose.* [`Pixhawk`]: built, powered on, and brought from moment to moment.
//!
//! *Design.* The emulator runs a board from beginning to end in one call, so the
//! board has a thread of its own. At the moment it was asked to reach, it waits for
//! the next order. An order is a function that looks at the stopped board or names
//! the next moment; nothing happens between orders, so that a run depends on its
//! script alone. The thread's side of it is the [`operator`](crate::operator)'s.
//!
//! *Limits.* A run cannot be taken back. A reset of the part starts the application
//! through the stand-in for the bootloader again.

use std::path::Path;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;

use anyhow::{Context as _, anyhow};
use rigless::emulator::{self, Start};
use rigless::image::Image;
use rigless::session::Session;
use rigless::soc::Width;
use rigless::time::VirtualNanos;
use world::{Pulse, Receiver, Sent, Talker, WorldNanos};

use crate::board::{CyclesPerInstruction, GPS, Pixhawk1, Plugged, TELEM1, TELEM2};
use crate::bootloader::Bootloader;
use crate::card::Card;
use crate::crystal::CrystalStart;
use crate::flash::APPLICATION;
use crate::gaps::Gaps;
use crate::image::Firmware;
use crate::meter::{Meter, Profile};
use crate::operator::{Log, Logged, Next, Operator, Order, Stopped};
use crate::probe::Probe;
use crate::pulse_wire::{PulseWire, synchronised};
use crate::script::Script;
use crate::upload_bootloader::UploadBootloader;
use crate::usb::Host;
use crate::wire::{ReceivedByte, Wire};

/// The variable that says how many cycles an instruction takes on a board whose builder has no setting
/// else, 1 without it; `cargo xtask board-test` plays its tests by it.
pub const PACE_VARIABLE: &str = "PIXCLOCK_CYCLES_PER_INSTRUCTION";

/// Where the chip has its unique number (RM0090, 39.1).
const UNIQUE_ID: u64 = 0x1FFF_7A10;

/// One of the board's connectors with a serial line on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Connector {
    /// GPS: UART4.
    Gps,
    /// TELEM1: USART2, where MAVLink is spoken.
    Telem1,
    /// TELEM2: USART3, another link of MAVLink's.
    Telem2,
}

impl Connector {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Gps, Self::Telem1, Self::Telem2];

    const fn port(self) -> usize {
        match self {
            Self::Gps => GPS,
            Self::Telem1 => TELEM1,
            Self::Telem2 => TELEM2,
        }
    }
}

/// A Pixhawk before it has power.
pub struct Builder {
    firmware: Firmware,
    bootloader: Bootloader,
    unique_id: [u8; 12],
    upload: Option<(UploadBootloader, Vec<u8>)>,
    crystal_ppb: i32,
    crystal_start: CrystalStart,
    pace: CyclesPerInstruction,
    gps: Box<dyn Talker + Send>,
    telem1: Box<dyn Talker + Send>,
    telem2: Box<dyn Talker + Send>,
    pulse: PulseWire,
    card: Option<Card>,
    usb: Host,
}

/// A virtual Pixhawk 1 that runs an image.
#[derive(Debug)]
pub struct Pixhawk {
    firmware: Firmware,
    meter: Meter,
    probe: Probe,
    orders: Option<SyncSender<Order>>,
    thread: Option<JoinHandle<Result<(), emulator::Error>>>,
    now: WorldNanos,
}

impl Builder {
    /// A board with `firmware` in its flash, a perfect crystal, and nothing on its
    /// connectors. Its core is as fast as [`PACE_VARIABLE`] says.
    ///
    /// # Panics
    ///
    /// When that says something that is no pace.
    #[must_use]
    pub fn new(firmware: Firmware) -> Self {
        Self {
            firmware,
            bootloader: Bootloader::default(),
            unique_id: *b"virtual chip",
            upload: None,
            crystal_ppb: 0,
            crystal_start: CrystalStart::AtOnce,
            pace: std::env::var(PACE_VARIABLE).map_or(CyclesPerInstruction::ONE, |pace| {
                pace.parse().expect("the variable of the core's pace")
            }),
            gps: Box::new(Script::default()),
            telem1: Box::new(Script::default()),
            telem2: Box::new(Script::default()),
            pulse: PulseWire::new(std::iter::empty()),
            card: None,
            usb: Host::new(Script::default()).unplugged(),
        }
    }

    /// Gives it a crystal that starts so.
    #[must_use]
    pub const fn crystal_start(mut self, start: CrystalStart) -> Self {
        self.crystal_start = start;
        self
    }

    /// Puts a bootloader that takes uploads into the flash, and these bytes of an application behind it
    /// in place of the firmware's.
    #[must_use]
    pub fn upload_bootloader(mut self, bootloader: UploadBootloader, application: Vec<u8>) -> Self {
        self.upload = Some((bootloader, application));
        self
    }

    /// Puts another bootloader's stand-in before the image.
    #[must_use]
    pub const fn bootloader(mut self, bootloader: Bootloader) -> Self {
        self.bootloader = bootloader;
        self
    }

    /// Gives the chip another number than all others have.
    #[must_use]
    pub const fn unique_id(mut self, unique_id: [u8; 12]) -> Self {
        self.unique_id = unique_id;
        self
    }

    /// Makes the crystal run fast by `ppb` parts in 10⁹; slow, if it is negative. It
    /// is rounded to whole Hz of its 24 MHz.
    #[must_use]
    pub fn crystal_ppb(mut self, ppb: i32) -> Self {
        self.crystal_ppb = ppb;
        self
    }

    /// Makes the core slower.
    #[must_use]
    pub const fn pace(mut self, pace: CyclesPerInstruction) -> Self {
        self.pace = pace;
        self
    }

    /// Puts `receiver` on the GPS connector.
    #[must_use]
    pub fn gps(mut self, receiver: impl Talker + Send + 'static) -> Self {
        self.gps = Box::new(receiver);
        self
    }

    /// Puts `receiver` on the GPS connector, and its pulse on AUX5.
    #[must_use]
    pub fn gps_and_pulse(self, receiver: Receiver) -> Self {
        let pulses = receiver.pulses();
        self.gps(receiver).pulse(pulses)
    }

    /// Puts `station` on TELEM1.
    #[must_use]
    pub fn telem1(mut self, station: impl Talker + Send + 'static) -> Self {
        self.telem1 = Box::new(station);
        self
    }

    /// Puts `station` on TELEM2.
    #[must_use]
    pub fn telem2(mut self, station: impl Talker + Send + 'static) -> Self {
        self.telem2 = Box::new(station);
        self
    }

    /// Puts these pulses, in the order of their edges, on AUX5.
    #[must_use]
    pub fn pulse(mut self, pulses: impl Iterator<Item = Pulse> + Send + 'static) -> Self {
        self.pulse = PulseWire::new(synchronised(pulses));
        self
    }

    /// Puts `card` into the slot.
    #[must_use]
    pub fn card(mut self, card: Card) -> Self {
        self.card = Some(card);
        self
    }

    /// Connects the USB connector with `host`.
    #[must_use]
    pub fn usb(mut self, host: Host) -> Self {
        self.usb = host;
        self
    }

    /// Gives it power. It stands at the world's start, before its first instruction.
    ///
    /// # Errors
    ///
    /// The image has no log that can be read, or the emulator refuses it.
    pub fn power_on(self) -> anyhow::Result<Pixhawk> {
        let Self {
            firmware,
            bootloader,
            unique_id,
            upload,
            crystal_ppb,
            crystal_start,
            pace,
            gps,
            telem1,
            telem2,
            pulse,
            card,
            usb,
        } = self;
        let meter = Meter::default();
        let probe = Probe::default();
        let log = Log::new(&firmware)?;
        let mut board = Pixhawk1::new(
            crystal_ppb,
            pace,
            Plugged {
                gps: Wire::new(gps),
                telem1: Wire::new(telem1),
                telem2: Wire::new(telem2),
                pulse,
                card,
                usb,
            },
            meter.clone(),
            probe.clone(),
        )?;
        board = board.with_crystal_start(crystal_start);
        let mut images = match upload {
            Some((bootloader, application)) => {
                board = board.with_programmable_flash();
                bootloader.flash(application)?
            }
            None => firmware.flash(bootloader)?,
        };
        let number = Path::new("the chip's unique number");
        images.push(Image::new(number, unique_id.to_vec(), Some(UNIQUE_ID))?);
        let session = Session::new(Box::new(board), 0, VirtualNanos(0))?;
        let (orders, inbox) = sync_channel(0);
        let operator = Operator::new(inbox, log);
        let thread = std::thread::Builder::new()
            .name("pixhawk".to_owned())
            .spawn(move || {
                let finished = emulator::run(session, &Start::new(&images), operator)?;
                let mut session = finished.session;
                session.take_error().map_or(Ok(()), Err)
            })?;
        Ok(Pixhawk {
            firmware,
            meter,
            probe,
            orders: Some(orders),
            thread: Some(thread),
            now: WorldNanos(0),
        })
    }
}

impl Pixhawk {
    /// Runs to `at`; at once back if that has passed.
    ///
    /// # Errors
    ///
    /// The emulator gave up.
    pub fn run_to(&mut self, at: WorldNanos) -> anyhow::Result<()> {
        if at > self.now {
            self.order(move |stopped| stopped.next = Next::RunTo(at))?;
            // The next order is taken only when the board has come there.
            self.order(|_| ())?;
            self.now = at;
        }
        Ok(())
    }

    /// Runs for `ns` more.
    ///
    /// # Errors
    ///
    /// As for [`Pixhawk::run_to`].
    pub fn run_for(&mut self, ns: u64) -> anyhow::Result<()> {
        self.run_to(self.now.plus(ns))
    }

    /// The moment at which it stands.
    #[must_use]
    pub const fn now(&self) -> WorldNanos {
        self.now
    }

    /// The image that it runs.
    #[must_use]
    pub const fn firmware(&self) -> &Firmware {
        &self.firmware
    }

    pub(crate) const fn probe(&self) -> &Probe {
        &self.probe
    }

    /// Instructions executed since it has power: the cycles that it was not asleep.
    ///
    /// # Errors
    ///
    /// The emulator gave up.
    pub fn instructions(&mut self) -> anyhow::Result<u64> {
        self.order(|stopped| stopped.stop.instruction_count)
    }

    /// The lines of the log since the last call.
    ///
    /// # Errors
    ///
    /// The emulator gave up.
    pub fn take_log(&mut self) -> anyhow::Result<Vec<Logged>> {
        self.order(|stopped| std::mem::take(&mut stopped.log.lines))
    }

    /// Frames of the log that could not be decoded.
    ///
    /// # Errors
    ///
    /// The emulator gave up.
    pub fn damaged_log_frames(&mut self) -> anyhow::Result<u64> {
        self.order(|stopped| stopped.log.decoder.damaged())
    }

    /// The bytes of the static that the image calls `name`, as they are now.
    ///
    /// # Errors
    ///
    /// There is no such static, or the emulator gave up.
    pub fn read(&mut self, name: &str) -> anyhow::Result<Vec<u8>> {
        let place = self.firmware.symbol(name)?;
        let addresses = place.address..place.address + place.size;
        self.order(move |stopped| {
            addresses
                .map(|address| stopped.host.read(address.into(), Width::W8))
                .map(|byte| byte.map(|byte| byte as u8))
                .collect::<Result<Vec<_>, _>>()
        })?
        .with_context(|| format!("reading {name}"))
    }

    /// The first `length` bytes, a multiple of four, of the flash behind the bootloader.
    ///
    /// # Errors
    ///
    /// The emulator gave up.
    pub fn application(&mut self, length: u32) -> anyhow::Result<Vec<u8>> {
        let words = (APPLICATION..APPLICATION + length).step_by(4);
        let words = self.order(move |stopped| {
            words
                .map(|address| stopped.host.read(address.into(), Width::W32))
                .map(|word| word.map(|word| word as u32))
                .collect::<Result<Vec<_>, _>>()
        })?;
        let words = words.context("reading the flash")?;
        Ok(words.into_iter().flat_map(u32::to_le_bytes).collect())
    }

    /// What the board has sent on `connector` since the last call.
    ///
    /// # Errors
    ///
    /// The emulator gave up.
    pub fn take_received(&mut self, connector: Connector) -> anyhow::Result<Vec<ReceivedByte>> {
        self.wire(connector, Wire::take_received)
    }

    /// Every NAV-PVT that has left for the board, as its receiver knows it.
    ///
    /// # Errors
    ///
    /// The emulator gave up.
    pub fn truth(&mut self) -> anyhow::Result<Vec<Sent>> {
        self.wire(Connector::Gps, |wire| wire.truth())
    }

    /// Changes the card in the slot; the one that was there.
    ///
    /// # Errors
    ///
    /// The emulator gave up.
    pub fn swap_card(&mut self, card: Option<Card>) -> anyhow::Result<Option<Card>> {
        self.order(|stopped| {
            let slot = stopped.session.board_mut().slot();
            slot.map(|slot| std::mem::replace(slot, card))
        })?
        .context("the board has no slot")
    }

    /// Has `act` do something with the host at the USB connector.
    ///
    /// # Errors
    ///
    /// The emulator gave up.
    pub fn with_usb<T: Send + 'static>(
        &mut self,
        act: impl FnOnce(&mut Host) -> T + Send + 'static,
    ) -> anyhow::Result<T> {
        self.order(move |stopped| {
            let at = stopped.stop.at;
            stopped.session.board_mut().mcu.with_host(at, act)
        })
    }

    /// The USB's bus is suspended, or resumed.
    ///
    /// # Errors
    ///
    /// The emulator gave up.
    pub fn suspend_usb(&mut self, is_suspended: bool) -> anyhow::Result<()> {
        self.order(move |stopped| {
            let at = stopped.stop.at;
            stopped.session.board_mut().mcu.suspend(at, is_suspended);
        })
    }

    /// Where the firmware went beyond the emulator's models.
    ///
    /// # Errors
    ///
    /// The emulator gave up.
    pub fn gaps(&mut self) -> anyhow::Result<Gaps> {
        self.order(|stopped| Gaps::of(stopped.session))
    }

    /// From now on counts what is executed, with calls of `functions` watched; see
    /// [`Firmware::symbol`] for their names.
    ///
    /// # Errors
    ///
    /// A function has no symbol in the image.
    pub fn start_meter(&mut self, functions: &[&str]) -> anyhow::Result<()> {
        self.meter.start(&self.firmware, functions)
    }

    /// Ends counting.
    pub fn stop_meter(&mut self) -> Profile {
        self.meter.stop()
    }

    fn wire<T: Send + 'static>(
        &mut self,
        connector: Connector,
        ask: impl FnOnce(&mut Wire) -> T + Send + 'static,
    ) -> anyhow::Result<T> {
        self.order(move |stopped| stopped.session.board_mut().wire(connector.port()).map(ask))?
            .context("nothing hangs on that connector")
    }

    /// Has the stopped board do `ask`, and waits for its answer.
    pub(crate) fn order<T: Send + 'static>(
        &mut self,
        ask: impl FnOnce(&mut Stopped<'_>) -> T + Send + 'static,
    ) -> anyhow::Result<T> {
        let (answer, answered) = sync_channel(1);
        let order: Order = Box::new(move |stopped| {
            // The answer is not waited for if the board has ended.
            let _ = answer.send(ask(stopped));
        });
        let sent = self.orders.as_ref().map(|orders| orders.send(order));
        match (sent, answered.recv()) {
            (Some(Ok(())), Ok(answer)) => Ok(answer),
            _ => Err(self.why_it_ended()),
        }
    }

    fn why_it_ended(&mut self) -> anyhow::Error {
        self.orders = None;
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(Err(error))) => anyhow!(error).context("the emulator gave up"),
            Some(Err(_)) => anyhow!("the emulator panicked"),
            Some(Ok(Ok(()))) | None => anyhow!("the board has no power any more"),
        }
    }
}

impl Drop for Pixhawk {
    fn drop(&mut self) {
        let end: Order = Box::new(|stopped| stopped.next = Next::End);
        if let Some(orders) = self.orders.take() {
            // A board that has ended by itself takes no order and needs none.
            let _ = orders.send(end);
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
