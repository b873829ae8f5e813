//! The firmware's log: defmt frames in, lines of text out.
//!
//! *Purpose.* [`LogDecoder`] reads what a board wrote to RTT or to semihosting
//! with the format strings of the very image that runs.
//!
//! *Design.* defmt ends each frame with a zero byte, so the bytes after the last
//! zero are kept until the rest has come.
//!
//! *Limits.* Only defmt's default encoding (rzcobs) can be cut at zeros; an image
//! with another one is refused. What was lost on the way is counted as
//! damaged frames; where it was lost is not known.

use anyhow::{Context as _, ensure};
use defmt_decoder::{DecodeError, Encoding, Table};

/// How much a log line matters; ordered from least to most.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Level {
    /// Every detail.
    Trace,
    /// For finding faults.
    Debug,
    /// What happens when all is well.
    Info,
    /// Something that ought not to be.
    Warn,
    /// Something that stopped working.
    Error,
}

impl Level {
    /// Its name, in lower case.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Trace => "trace",
            Self::Debug => "debug",
            Self::Info => "info",
            Self::Warn => "warn",
            Self::Error => "error",
        }
    }

    fn from_name(name: &str) -> Option<Self> {
        [
            Self::Trace,
            Self::Debug,
            Self::Info,
            Self::Warn,
            Self::Error,
        ]
        .into_iter()
        .find(|level| level.as_str() == name)
    }
}

/// One line of the firmware's log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogLine {
    /// How much it matters; `None` for a line printed without a level.
    pub level: Option<Level>,
    /// The firmware's own timestamp, as it formats it.
    pub timestamp: Option<String>,
    /// The message.
    pub text: String,
}

impl std::fmt::Display for LogLine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(timestamp) = &self.timestamp {
            write!(f, "{timestamp} ")?;
        }
        let level = self.level.map_or("print", Level::as_str);
        write!(f, "{level:5} {}", self.text)
    }
}

/// Decodes one board's log.
pub struct LogDecoder {
    table: Table,
    /// The beginning of a frame whose end has not come.
    unfinished: Vec<u8>,
    damaged: u64,
}

impl std::fmt::Debug for LogDecoder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LogDecoder")
            .field("unfinished", &self.unfinished.len())
            .field("damaged", &self.damaged)
            .finish_non_exhaustive()
    }
}

impl LogDecoder {
    /// A decoder with the format strings of the image `elf`.
    ///
    /// # Errors
    ///
    /// `elf` is no ELF file, has no defmt format strings, or logs in an encoding
    /// other than rzcobs.
    pub fn new(elf: &[u8]) -> anyhow::Result<Self> {
        let table = Table::parse(elf)?.context("the image has no defmt format strings")?;
        ensure!(
            table.encoding() == Encoding::Rzcobs,
            "the image logs in another encoding than rzcobs"
        );
        Ok(Self {
            table,
            unfinished: Vec::new(),
            damaged: 0,
        })
    }

    /// The lines that `bytes`, the next of the stream, complete.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<LogLine> {
        self.unfinished.extend_from_slice(bytes);
        let Some(last_zero) = self.unfinished.iter().rposition(|&byte| byte == 0) else {
            return Vec::new();
        };
        let frames: Vec<u8> = self.unfinished.drain(..=last_zero).collect();
        let mut decoder = self.table.new_stream_decoder();
        decoder.received(&frames);
        let mut lines = Vec::new();
        loop {
            match decoder.decode() {
                Ok(frame) => lines.push(LogLine {
                    level: frame
                        .level()
                        .and_then(|level| Level::from_name(level.as_str())),
                    timestamp: frame.display_timestamp().map(|at| at.to_string()),
                    text: frame.display_message().to_string(),
                }),
                Err(DecodeError::Malformed) => self.damaged += 1,
                Err(DecodeError::UnexpectedEof) => return lines,
            }
        }
    }

    /// Frames that could not be decoded: bytes of the stream were lost.
    #[must_use]
    pub const fn damaged(&self) -> u64 {
        self.damaged
    }
}
