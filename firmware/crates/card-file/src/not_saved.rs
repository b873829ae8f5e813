//! Why there is no file: every failure below, as one small reason.

use core::fmt;

use crate::disk::DiskError;
use crate::medium::Failure;
use crate::volume::NoVolume;

/// Why there is no file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum NotSaved {
    /// There is no FAT16 or FAT32 volume in the first partition, or a damaged one.
    NotFat,
    /// The card is write-protected.
    WriteProtected,
    /// The card has no room for the file, or every number has been used.
    Full,
    /// The card is gone, or another one has been put in.
    Gone,
    /// The card fails.
    Failed,
    /// `read` gave fewer bytes than announced.
    Short,
}

impl fmt::Display for NotSaved {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::NotFat => "the card has no FAT16 or FAT32 volume, or a damaged one",
            Self::WriteProtected => "the card is write-protected",
            Self::Full => "the card has no room for the file",
            Self::Gone => "the card is gone, or another one has been put in",
            Self::Failed => "the card fails",
            Self::Short => "the contents came to an early end",
        })
    }
}

impl core::error::Error for NotSaved {}

impl From<DiskError> for NotSaved {
    fn from(error: DiskError) -> Self {
        match error {
            DiskError::Gone => Self::Gone,
            DiskError::WriteProtected => Self::WriteProtected,
            DiskError::Beyond => Self::NotFat,
            DiskError::Failed => Self::Failed,
        }
    }
}

impl From<Failure> for NotSaved {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Disk(error) => error.into(),
            Failure::Damaged => Self::NotFat,
        }
    }
}

impl From<NoVolume> for NotSaved {
    fn from(error: NoVolume) -> Self {
        match error {
            NoVolume::Disk(error) => error.into(),
            NoVolume::NotFat => Self::NotFat,
        }
    }
}

impl From<embedded_sdmmc::Error<Failure>> for NotSaved {
    fn from(error: embedded_sdmmc::Error<Failure>) -> Self {
        use embedded_sdmmc::Error;
        match error {
            Error::DeviceError(failure) => failure.into(),
            Error::DiskFull | Error::NotEnoughSpace => Self::Full,
            _ => Self::NotFat,
        }
    }
}
