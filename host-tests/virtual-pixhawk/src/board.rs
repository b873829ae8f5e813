//! What is soldered on a Pixhawk 1, and this firmware depends on.
//!
//! *Purpose.* The STM32F427 with its crystal and its supply, as `rigless` wants a
//! board described.
//!
//! *Design.* The crystal's error is one number: it moves HSE, so every peripheral,
//! and the core clock, so SysTick and the DWT counter. The core retires an
//! instruction in the cycles that its setting says, one without a setting:
//! [`CyclesPerInstruction`].
//!
//! *Limits.* The error is rounded to whole Hz of HSE (41.7 ppb) and stays as it is
//! for the whole run. No FRAM, no sensors: a firmware that talks to one
//! of them finds nothing there. The core counts at 168 MHz from its first
//! instruction, also before the firmware has started the PLL.

use std::num::{NonZeroU32, NonZeroU64};
use std::str::FromStr;

use rigless::cpu;
use rigless::machine::{Board, Target, armv7m};
use rigless::mcu::{Mcu, Operate as _};
use rigless::snapshot::Store;
use rigless::soc::stm32f427::Stm32f427;

use crate::card::{Card, Slot};
use crate::crystal::CrystalStart;
use crate::meter::Meter;
use crate::probe::Probe;
use crate::pulse_wire::PulseWire;
use crate::usb::{Host, Part};
use crate::wire::Wire;

/// The crystal of the Pixhawk 1 (PX4 `boards/px4/fmu-v2`, `board.h`), in Hz.
const HSE_HZ: u64 = 24_000_000;
/// Core cycles a period of the crystal: PLL M = 24, N = 336, P = 2 (there, too).
const CORE_PER_HSE: u64 = 7;
/// The regulated supply, in mV.
const SUPPLY_MV: u32 = 3_300;
/// Where UART4 (GPS), USART2 (TELEM1) and USART3 (TELEM2) stand among the part's serial ports.
pub(crate) const GPS: usize = 6;
pub(crate) const TELEM1: usize = 1;
pub(crate) const TELEM2: usize = 2;
/// All of them.
pub(crate) const PORTS: [usize; 3] = [GPS, TELEM1, TELEM2];

/// How many cycles the core takes for an instruction, the same for each.
///
/// The emulator's 1 is the least of all cores. The status line's frame is 1.55 by the timings of the
/// Cortex-M4 TRM without one wait state, and 1.64 with the flash's five, its cache and its
/// prefetch, a computed figure: so 1.6 stands for a Pixhawk of metal, and 2 for one that has bad luck.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CyclesPerInstruction(f64);

impl CyclesPerInstruction {
    /// One, as everywhere where nothing else is said.
    pub const ONE: Self = Self(1.0);
    /// Least and most that are allowed.
    const RANGE: std::ops::RangeInclusive<f64> = 1.0..=4.0;

    /// Instructions that a core of `core_hz` retires in a second.
    fn instructions_per_second(self, core_hz: NonZeroU64) -> NonZeroU64 {
        let rate = (core_hz.get() as f64 / self.0).round() as u64;
        NonZeroU64::new(rate).unwrap_or(NonZeroU64::MIN)
    }
}

impl FromStr for CyclesPerInstruction {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            Ok(cycles) if Self::RANGE.contains(&cycles) => Ok(Self(cycles)),
            _ => Err(format!("`{text}` is no number from 1 to 4")),
        }
    }
}

/// The board that the emulator runs.
#[derive(Debug)]
pub(crate) struct Pixhawk1 {
    pub(crate) mcu: Part,
    pub(crate) pulse: PulseWire,
    hse_hz: u64,
    pace: CyclesPerInstruction,
    meter: Meter,
    probe: Probe,
    programs_flash: bool,
    crystal: CrystalStart,
}

/// What is plugged into a board.
pub(crate) struct Plugged {
    pub(crate) gps: Wire,
    pub(crate) telem1: Wire,
    pub(crate) telem2: Wire,
    /// On AUX5.
    pub(crate) pulse: PulseWire,
    pub(crate) card: Option<Card>,
    /// Where the USB connector leads.
    pub(crate) usb: Host,
}

impl Store for Pixhawk1 {}

impl Pixhawk1 {
    /// A board whose crystal is `crystal_ppb` off.
    pub(crate) fn new(
        crystal_ppb: i32,
        pace: CyclesPerInstruction,
        plugged: Plugged,
        meter: Meter,
        probe: Probe,
    ) -> anyhow::Result<Self> {
        let hse_hz = hse_hz(crystal_ppb);
        let mut mcu = Stm32f427::new()?;
        mcu.rcc.attach_crystals(hse_hz, 0);
        mcu.set_supply(SUPPLY_MV);
        mcu.usart[GPS].attach(plugged.gps);
        mcu.usart[TELEM1].attach(plugged.telem1);
        mcu.usart[TELEM2].attach(plugged.telem2);
        mcu.sdio.attach(Slot(plugged.card));
        let mcu = Part::new(mcu, plugged.usb)?;
        Ok(Self {
            mcu,
            pulse: plugged.pulse,
            hse_hz,
            pace,
            meter,
            probe,
            programs_flash: false,
            crystal: CrystalStart::AtOnce,
        })
    }

    /// Gives it a crystal that starts so. Where it never does, the core keeps its rate all the same: an
    /// emulated core's is fixed.
    pub(crate) fn with_crystal_start(mut self, start: CrystalStart) -> Self {
        if start == CrystalStart::Never {
            self.mcu.rcc.attach_crystals(0, 0);
        }
        self.crystal = start;
        self
    }

    /// Makes the flash one that the core can erase and program.
    pub(crate) fn with_programmable_flash(self) -> Self {
        Self {
            programs_flash: true,
            ..self
        }
    }

    /// The card's slot.
    pub(crate) fn slot(&mut self) -> Option<&mut Option<Card>> {
        self.mcu.sdio.card_mut::<Slot>().map(|slot| &mut slot.0)
    }

    /// What hangs on serial port `nth`, and whether the board listens there, at
    /// which speed.
    pub(crate) fn wire(&mut self, nth: usize) -> Option<&mut Wire> {
        self.mcu.usart[nth].chip_mut::<Wire>()
    }
}

/// The crystal's frequency with its error, to the nearest Hz.
fn hse_hz(crystal_ppb: i32) -> u64 {
    let error_hz = (f64::from(crystal_ppb) * HSE_HZ as f64 / 1e9).round() as i64;
    HSE_HZ.saturating_add_signed(error_hz)
}

impl Board for Pixhawk1 {
    fn name(&self) -> &'static str {
        "pixhawk1"
    }

    fn target_names(&self) -> Vec<&'static str> {
        vec!["stm32f427"]
    }

    fn mcu(&mut self, target: usize) -> Option<&mut dyn Mcu> {
        (target == 0).then_some(&mut self.mcu)
    }

    fn targets(&mut self) -> Vec<Target<'_>> {
        let core_hz = NonZeroU64::new(self.hse_hz * CORE_PER_HSE).unwrap_or(NonZeroU64::MIN);
        let lines = u32::from(self.mcu.cpu().interrupt_lines);
        let core = armv7m::Core {
            variant: armv7m::Variant::M4,
            clock_hz: core_hz,
            interrupt_lines: NonZeroU32::new(lines).unwrap_or(NonZeroU32::MIN),
            // PM0214 4.3: sixteen levels.
            priority_bits: 4,
            // PM0214 4.5: SysTick's other clock is HCLK / 8.
            refclk_divider: const { NonZeroU32::new(8).expect("8 is not 0") },
            instructions_per_second: self.pace.instructions_per_second(core_hz),
            boot: "flash",
        };
        let mut spec = core.spec_with_parts(
            &cpu::armv7m::windows(self.mcu.bus()),
            armv7m::Fpu::FpV4Sp,
            armv7m::MpuRegions::Eight,
        );
        spec.processor = self.meter.around(
            spec.processor,
            self.probe.clone(),
            self.programs_flash,
            self.crystal,
        );
        vec![Target::new("stm32f427", &mut self.mcu, spec)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_core_retires_less_in_a_second() {
        let core_hz = NonZeroU64::new(168_000_000).unwrap();
        let pace = |text: &str| text.parse::<CyclesPerInstruction>();
        let rate = |text| pace(text).unwrap().instructions_per_second(core_hz).get();
        assert_eq!(rate("1"), 168_000_000);
        assert_eq!(rate("1.6"), 105_000_000);
        assert_eq!(rate("2.0"), 84_000_000);
        assert!(pace("0.9").is_err() && pace("NaN").is_err() && pace("").is_err());
    }

    #[test]
    fn the_crystals_error_is_rounded_to_a_hertz() {
        assert_eq!(hse_hz(0), 24_000_000);
        assert_eq!(hse_hz(40_000), 24_000_960);
        assert_eq!(hse_hz(-500_000), 23_988_000);
        assert_eq!(hse_hz(20), 24_000_000);
        assert_eq!(hse_hz(21), 24_000_001);
    }
}
