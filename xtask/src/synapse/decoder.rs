//! Their decoder as a program beside this one.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use anyhow::{Context as _, Result, ensure};
use serde_json::Value;

use crate::image;

/// Their decoder, started once: Python takes its time for that.
pub struct Decoder {
    child: Child,
    datagrams: ChildStdin,
    verdicts: BufReader<ChildStdout>,
}

/// A frame as they read it.
#[derive(Debug)]
pub struct Theirs {
    pub message: u64,
    pub source: u64,
    pub destination: u64,
    pub idd: u64,
    pub acknowledge: bool,
    pub length: u64,
    pub sum_length: u64,
    /// What is wrong with it, by its name there.
    pub defects: Vec<String>,
    /// Its fields, if the message is one that they know.
    pub fields: Option<Value>,
}

/// Something that they always say of a frame with another one behind it, and that is no defect of it.
const NO_DEFECT: &str = "checksum_width_taken_from_the_properties_subfield";

fn script(python: &Path) -> Command {
    let mut command = Command::new(python);
    command.arg(image::root().join("host-tests/synapse/decode.py"));
    command
}

/// Where their fixtures are.
///
/// # Errors
///
/// When the script fails.
pub fn fixtures(python: &Path) -> Result<PathBuf> {
    let ended = script(python).arg("--fixtures").output()?;
    ensure!(ended.status.success(), "{ended:?}");
    Ok(String::from_utf8(ended.stdout)?.trim().into())
}

impl Decoder {
    /// Starts it.
    ///
    /// # Errors
    ///
    /// When it cannot be started.
    pub fn start(python: &Path) -> Result<Self> {
        let mut script = script(python);
        let mut child = script
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let datagrams = child.stdin.take().context("no standard input")?;
        let verdicts = child.stdout.take().context("no standard output")?;
        Ok(Self {
            child,
            datagrams,
            verdicts: BufReader::new(verdicts),
        })
    }

    /// The frames that they find in a datagram; `None` when they refuse it.
    ///
    /// # Errors
    ///
    /// When it has ended, or does not speak as its script does.
    pub fn decode(&mut self, datagram: &[u8]) -> Result<Option<Vec<Theirs>>> {
        let digits: String = datagram.iter().map(|byte| format!("{byte:02x}")).collect();
        writeln!(self.datagrams, "{digits}")?;
        let mut line = String::new();
        self.verdicts.read_line(&mut line)?;
        let verdict: Value = serde_json::from_str(&line).context("no verdict")?;
        if verdict["refused"].is_string() {
            return Ok(None);
        }
        let frames = verdict["frames"].as_array().context("no frames")?;
        frames.iter().map(read).collect::<Result<_>>().map(Some)
    }
}

impl Drop for Decoder {
    fn drop(&mut self) {
        // It has nothing to lose, and may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn read(frame: &Value) -> Result<Theirs> {
    let number = |name: &str| {
        let number = frame[name].as_u64();
        number.with_context(|| format!("{name} in {frame}"))
    };
    let defects = frame["defects"].as_array().context("no defects")?;
    let defects = defects.iter().filter_map(Value::as_str);
    Ok(Theirs {
        message: number("message")?,
        source: number("source")?,
        destination: number("destination")?,
        idd: number("idd")?,
        acknowledge: frame["acknowledge"].as_bool().unwrap_or_default(),
        length: number("length")?,
        sum_length: number("sum_length")?,
        defects: defects
            .filter(|&defect| defect != NO_DEFECT)
            .map(str::to_owned)
            .collect(),
        fields: (!frame["fields"].is_null()).then(|| frame["fields"].clone()),
    })
}
