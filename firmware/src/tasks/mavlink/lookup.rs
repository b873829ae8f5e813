//! What the node looks up: parameters, and the file of the log.

use mavlink_node::{LogFile, Parameter, Parameters};
use sample_log::csv;

use super::broadcast;
use crate::reports::GNSS;
use crate::samples::SAMPLES;
use crate::settings::{GPS_BAUD, VARIANT};
use crate::story;
use crate::tasks::paper;

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
                broadcast::number(source.unwrap_or_default()).into()
            }
            Parameter::LogLen => SAMPLES.len(),
            Parameter::LogMissed => SAMPLES.with(|log| log.missed()),
            Parameter::Fault => story::before().map_or(0, |reason| reason.number().into()),
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
