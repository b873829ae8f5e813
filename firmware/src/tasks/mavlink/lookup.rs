//! What the node looks up: parameters, the file of the log, and the status.

use device_id::DeviceId;
use mavlink_node::{LogFile, Parameter, Parameters, StatusLine, StatusWriter};
use sample_log::csv;

use super::source::number;
use super::words;
use crate::devices;
use crate::reports::GNSS;
use crate::samples::SAMPLES;
use crate::settings::{GPS_BAUD, VARIANT};
use crate::story;
use crate::tasks::{paper, status};

/// The board that this image runs on.
pub struct ThisBoard;

impl Parameters for ThisBoard {
    fn parameter(&self, parameter: Parameter) -> f32 {
        let value = match parameter {
            Parameter::Variant => VARIANT.number(),
            Parameter::TickUs => VARIANT.tick_us(),
            Parameter::GpsBaud if VARIANT.is_papers() => paper::baud(),
            Parameter::GpsBaud => GPS_BAUD,
            Parameter::Source => {
                let source = GNSS.get().map(|report| report.source);
                number(source.unwrap_or_default()).into()
            }
            Parameter::LogLen => SAMPLES.len(),
            Parameter::LogMissed => SAMPLES.with(|log| log.missed()),
            Parameter::GnssId => devices::receiver().0.number(),
            Parameter::GnssState => devices::receiver().1.number().into(),
            Parameter::CardId => DeviceId::CARD.number(),
            Parameter::CardState => devices::card().number().into(),
            Parameter::UsbId => DeviceId::USB.number(),
            Parameter::UsbState => devices::usb().number().into(),
            Parameter::ClockPrime => devices::prime(),
            Parameter::Fault => story::before().map_or(0, |(reason, _)| reason.number().into()),
        };
        // Exact below 2^24.
        value as f32
    }
}

impl LogFile for ThisBoard {
    fn log_len(&self) -> u32 {
        csv::file_len(SAMPLES.len())
    }

    fn log_began_ns(&self) -> Option<i64> {
        SAMPLES.with(|log| log.began_ns())
    }

    fn read_log(&self, offset: u32, out: &mut [u8]) -> usize {
        SAMPLES.read(offset, out)
    }
}

impl StatusLine for ThisBoard {
    fn write_status(&self, line: &mut StatusWriter<'_>) {
        status::write(line);
        let before = story::before();
        line.word("fault", before.map_or("", |(reason, _)| reason.as_str()));
        let place = before.map(|(_, place)| words::place_word(place));
        line.word("fault_at", place.as_deref().unwrap_or_default());
    }
}
