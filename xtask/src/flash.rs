//! Bare `cargo run`: flash a Pixhawk 1 and show its log.

use std::process::Command;

use anyhow::{Context as _, Result, bail, ensure};

use crate::image::{self, Board, Build};

/// What probe-rs calls the Pixhawk's chip.
const CHIP: &str = "STM32F427VITx";

/// Builds the image that is flashed and hands it to probe-rs.
///
/// # Errors
///
/// When probe-rs is not there, with how to get it; when the build or the flashing
/// fails.
pub fn flash() -> Result<()> {
    let is_there = Command::new("probe-rs").arg("--version").output().is_ok();
    if !is_there {
        bail!(
            "probe-rs is not on this machine: `cargo install probe-rs-tools --locked` gets it. \
             Without a board: `cargo xtask sim`"
        );
    }
    check_bootloader()?;
    let image = image::build(Build::standard(Board::Pixhawk1))?;
    image::run(
        Command::new("probe-rs")
            .args(["run", "--chip", CHIP])
            .arg(image),
    )
}

/// Reads the start of the flash and refuses a chip without a bootloader there: the image stands behind it,
/// and nothing would ever jump to it.
fn check_bootloader() -> Result<()> {
    let output = Command::new("probe-rs")
        .args(["read", "--chip", CHIP, "b32", "0x08000000", "2"])
        .output()?;
    ensure!(
        output.status.success(),
        "probe-rs cannot read the board: {}",
        String::from_utf8_lossy(&output.stderr).trim()
    );
    let words = words(&String::from_utf8_lossy(&output.stdout))?;
    ensure!(
        is_bootloader(words),
        "there is no bootloader at 0x08000000 (it begins with {:#010x} {:#010x}), so the image would \
         never start: flash PX4's bootloader for the FMUv2 or FMUv3 first (docs/hardware.md)",
        words[0],
        words[1]
    );
    Ok(())
}

/// The two words that `probe-rs read` has printed.
fn words(printed: &str) -> Result<[u32; 2]> {
    let words: Vec<u32> = printed
        .split_whitespace()
        .map(|word| u32::from_str_radix(word.trim_start_matches("0x"), 16))
        .collect::<Result<_, _>>()
        .with_context(|| format!("probe-rs has printed {printed:?}"))?;
    words[..]
        .try_into()
        .with_context(|| format!("probe-rs has printed {printed:?} for two words"))
}

/// Whether a bootloader begins with these words: a stack in RAM, and code before the application.
fn is_bootloader([stack, reset]: [u32; 2]) -> bool {
    const SRAM: std::ops::RangeInclusive<u32> = 0x2000_0000..=0x2003_0000;
    const CCM: std::ops::RangeInclusive<u32> = 0x1000_0000..=0x1001_0000;
    const BOOTLOADER: std::ops::Range<u32> = 0x0800_0000..0x0800_4000;
    (SRAM.contains(&stack) || CCM.contains(&stack)) && BOOTLOADER.contains(&reset) && reset % 2 == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bootloader_is_told_from_an_empty_flash_and_from_an_application() {
        assert!(is_bootloader([0x2002_0000, 0x0800_0141]));
        assert!(is_bootloader([0x1001_0000, 0x0800_01C5]));
        // Erased; an image that was linked for the start of the flash; zeros.
        assert!(!is_bootloader([u32::MAX, u32::MAX]));
        assert!(!is_bootloader([0x2000_8000, 0x0800_41A1]));
        assert!(!is_bootloader([0, 0]));
        assert!(!is_bootloader([0x2002_0000, 0x0800_0140]));
    }

    #[test]
    fn the_words_are_read_as_probe_rs_prints_them() {
        assert_eq!(
            words("20020000 08000141 \n").unwrap(),
            [0x2002_0000, 0x0800_0141]
        );
        assert_eq!(words("ffffffff ffffffff\n").unwrap(), [u32::MAX; 2]);
        assert!(words("").is_err());
        assert!(words("Error: no probe").is_err());
        assert!(words("20020000").is_err());
    }
}
