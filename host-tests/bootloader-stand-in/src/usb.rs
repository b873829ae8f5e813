//! The original's other port: a serial port on USB.
//!
//! *Purpose.* [`Usb`] receives and sends bytes, and says whether a cable is in.
//!
//! *Design.* Other people's stack, `usb-device` over `synopsys-usb-otg`, so that the board's model of OTG_FS serves two
//! drivers. It is polled: nothing is answered while the flash is erased, and the host is told to wait.
//!
//! *Limits.* The chip's 48 MHz are not set up, which the virtual board does not mind. The strings are the original's.

use cortex_m::singleton;
use stm32f4xx_hal::pac;
use synopsys_usb_otg::{UsbBus, UsbPeripheral};
use usb_device::bus::UsbBusAllocator;
use usb_device::device::{StringDescriptors, UsbDevice, UsbDeviceBuilder, UsbVidPid};
use usbd_serial::{SerialPort, USB_CLASS_CDC};

/// 3D Robotics, and the bootloader of a PX4 FMU.
const ORIGINAL: UsbVidPid = UsbVidPid(0x26AC, 0x0011);

/// OTG_FS.
struct Otg;

// SAFETY: it has no state.
unsafe impl Sync for Otg {}

// SAFETY: these are OTG_FS's registers, and nothing else in this program uses them while a bus is there.
unsafe impl UsbPeripheral for Otg {
    const REGISTERS: *const () = pac::OTG_FS_GLOBAL::PTR.cast();
    const HIGH_SPEED: bool = false;
    const FIFO_DEPTH_WORDS: usize = 320;
    const ENDPOINT_COUNT: usize = 4;

    fn enable() {}

    fn ahb_frequency_hz(&self) -> u32 {
        16_000_000
    }
}

/// The port.
pub struct Usb {
    device: UsbDevice<'static, UsbBus<Otg>>,
    port: SerialPort<'static, UsbBus<Otg>>,
}

impl Usb {
    /// Begins to answer a host; none the second time. OTG_FS has its clock.
    pub fn start() -> Option<Self> {
        let memory = singleton!(: [u32; 320] = [0; 320])?;
        let bus = UsbBus::new(Otg, memory);
        let bus: &'static UsbBusAllocator<_> = singleton!(: UsbBusAllocator<UsbBus<Otg>> = bus)?;
        let port = SerialPort::new(bus);
        let strings = StringDescriptors::default()
            .manufacturer("3D Robotics")
            .product("PX4 BL FMU v2.x")
            .serial_number("0");
        let device = UsbDeviceBuilder::new(bus, ORIGINAL)
            .strings(&[strings])
            .ok()?
            .device_class(USB_CLASS_CDC)
            .max_packet_size_0(64)
            .ok()?
            .self_powered(true)
            .build();
        Some(Self { device, port })
    }

    /// Answers the host.
    pub fn poll(&mut self) {
        self.device.poll(&mut [&mut self.port]);
    }

    /// A byte that the host has sent.
    pub fn receive(&mut self) -> Option<u8> {
        let mut byte = [0];
        let received = self.port.read(&mut byte);
        received.is_ok_and(|count| count == 1).then_some(byte[0])
    }

    /// Whether there was room for `byte`.
    pub fn send(&mut self, byte: u8) -> bool {
        self.port.write(&[byte]).is_ok()
    }
}
