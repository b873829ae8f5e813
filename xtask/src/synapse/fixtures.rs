//! Their fixtures through both decoders.
//!
//! *Design.* What they refuse has to be cut off for ours; what they find a defect in has to be refused by
//! ours for that defect; all else has to be the same frames, #4000 with the same numbers in its fields.

use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use stanag_node::message::{INERTIAL_STATES, INERTIAL_STATES_LAYOUT};
use stanag_wire::{Frame, Refusal};

use super::decoder::{Decoder, Theirs};

/// How many there have to be: of one folder that was found empty nothing would be learnt.
const VALID: usize = 12;
const MALFORMED: usize = 2;

/// Compares all of them.
///
/// # Errors
///
/// Names the first on which both do not agree.
pub fn compare(decoder: &mut Decoder, folder: &Path) -> Result<()> {
    for (folder, wanted) in [(folder, VALID), (&folder.join("malformed"), MALFORMED)] {
        let mut count = 0;
        for entry in std::fs::read_dir(folder)? {
            let path = entry?.path();
            if path.extension().is_none_or(|it| it != "s4586") {
                continue;
            }
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            let datagram = std::fs::read(&path)?;
            let verdict = agree(decoder.decode(&datagram)?.as_deref(), &datagram);
            console::print_line!(
                "  {name}: {}",
                verdict.with_context(|| name.clone().into_owned())?
            );
            count += 1;
        }
        ensure!(
            count == wanted,
            "{count} fixtures in {}, not {wanted}",
            folder.display()
        );
    }
    Ok(())
}

/// Both verdicts as one.
fn agree(theirs: Option<&[Theirs]>, datagram: &[u8]) -> Result<String> {
    let ours = ours(datagram);
    let Some(theirs) = theirs else {
        let is_refused = matches!(ours, Err(Refusal::Short | Refusal::Length(_)));
        ensure!(is_refused, "they refuse it, ours has {ours:?}");
        return Ok("refused by both".into());
    };
    let defects: Vec<&str> = theirs
        .iter()
        .flat_map(|it| it.defects.iter().map(String::as_str))
        .collect();
    let frames = match (defects.as_slice(), ours) {
        ([], Ok(frames)) => frames,
        (["checksum_mismatch"], Err(Refusal::Sum)) => return Ok("a wrong sum for both".into()),
        (["idd_version_is_not_edition_3"], Err(Refusal::Idd(idd))) => {
            return Ok(format!("IDD {idd} for both"));
        }
        (defects, ours) => anyhow::bail!("they find {defects:?}, ours has {ours:?}"),
    };
    ensure!(
        frames.len() == theirs.len(),
        "{} frames, {}",
        frames.len(),
        theirs.len()
    );
    for (ours, theirs) in frames.iter().zip(theirs) {
        is_same(ours, theirs)?;
    }
    Ok(format!("the same for both, frames: {}", frames.len()))
}

fn ours(datagram: &[u8]) -> Result<Vec<Frame<'_>>, Refusal> {
    let (mut frames, mut rest) = (Vec::new(), datagram);
    while !rest.is_empty() {
        let (frame, behind) = Frame::read(rest)?;
        frames.push(frame);
        rest = behind;
    }
    Ok(frames)
}

fn is_same(ours: &Frame<'_>, theirs: &Theirs) -> Result<()> {
    let header = ours.header;
    let wrapper = [
        header.message.into(),
        header.source.0.into(),
        header.destination.0.into(),
        header.idd.into(),
        header.wants_acknowledgement.into(),
        ours.data.len() as u64,
        header.sum.length() as u64,
    ];
    let theirs_has = [
        theirs.message,
        theirs.source,
        theirs.destination,
        theirs.idd,
        theirs.acknowledge.into(),
        theirs.length,
        theirs.sum_length,
    ];
    ensure!(wrapper == theirs_has, "{ours:?} and {theirs:?}");
    if header.message != INERTIAL_STATES {
        return Ok(());
    }
    let values = INERTIAL_STATES_LAYOUT.values(ours.data)?;
    let fields = theirs.fields.as_ref().context("they know #4000")?;
    for field in 0..INERTIAL_STATES_LAYOUT.sizes.len() {
        let raw = &fields["values"][(field + 1).to_string()]["raw"];
        // Altitude Type and Time Stamp are Unsigned, and so are BAM as they have it on the wire or not.
        let is_same = match raw.as_i64() {
            None => values.bytes(field).is_none(),
            Some(raw) => {
                values.integer(field) == Some(raw)
                    || values.unsigned(field).map(u64::cast_signed) == Some(raw)
            }
        };
        ensure!(
            is_same,
            "field {}: {raw}, ours {:?}",
            field + 1,
            values.bytes(field)
        );
    }
    Ok(())
}
