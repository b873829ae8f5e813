//! Why there is no file: every failure, as one small reason with a word that stays and with what
//! to do about it.

use core::fmt;

use crate::disk::DiskError;

/// Why there is no file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum NotSaved {
    /// Nowhere on the card is a volume of a kind that is known here.
    NoFileSystem,
    /// The card's volume is exFAT.
    Exfat,
    /// The card's volume is NTFS.
    Ntfs,
    /// The card's volume is ext2, ext3 or ext4.
    Ext4,
    /// The card's volume has tables of 12 bits.
    Fat12,
    /// The volume's sectors are not of 512 bytes.
    SectorSize,
    /// The volume is longer than its partition or the card, or reaches into another partition.
    Beyond,
    /// The volume's boot record contradicts itself, its backup, or what is on the card.
    BootDamaged,
    /// A table of clusters is not one, or the two differ where it matters.
    TableDamaged,
    /// The root directory is not where it is said to be, goes round, or is none.
    RootDamaged,
    /// The card is write-protected.
    WriteProtected,
    /// The card has no room for the file.
    NoRoom,
    /// The root directory has no room for an entry, and cannot grow.
    NoEntry,
    /// Each number is in a name already.
    NoNumber,
    /// The card is gone.
    Gone,
    /// Another card has taken its place meanwhile.
    Swapped,
    /// The card fails.
    Failed,
    /// The card took blocks and gave other ones back.
    NotKept,
    /// It took longer than it may.
    TooSlow,
    /// Somebody asked to stop.
    Stopped,
    /// `read` gave fewer bytes than announced.
    Short,
}

impl NotSaved {
    /// The reason as one word, which never changes: programs may look for it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::NoFileSystem => "no_file_system",
            Self::Exfat => "exfat",
            Self::Ntfs => "ntfs",
            Self::Ext4 => "ext4",
            Self::Fat12 => "fat12",
            Self::SectorSize => "sector_size",
            Self::Beyond => "beyond",
            Self::BootDamaged => "boot_damaged",
            Self::TableDamaged => "table_damaged",
            Self::RootDamaged => "root_damaged",
            Self::WriteProtected => "write_protected",
            Self::NoRoom => "no_room",
            Self::NoEntry => "no_entry",
            Self::NoNumber => "no_number",
            Self::Gone => "gone",
            Self::Swapped => "swapped",
            Self::Failed => "failed",
            Self::NotKept => "not_kept",
            Self::TooSlow => "too_slow",
            Self::Stopped => "stopped",
            Self::Short => "short",
        }
    }

    /// What is wrong and what to do, in at most 35 characters: a STATUSTEXT has 50, and needs some
    /// for what was to be saved.
    #[must_use]
    pub const fn advice(self) -> &'static str {
        match self {
            Self::NoFileSystem => "card is blank: format it as FAT32",
            Self::Exfat => "card is exFAT: format it as FAT32",
            Self::Ntfs => "card is NTFS: format it as FAT32",
            Self::Ext4 => "card is ext4: format it as FAT32",
            Self::Fat12 => "card is FAT12: format it as FAT32",
            Self::SectorSize => "sectors not of 512 B: format again",
            Self::Beyond => "volume exceeds its place: format it",
            Self::BootDamaged => "boot record damaged: fsck or chkdsk",
            Self::TableDamaged => "FAT damaged: run fsck or chkdsk",
            Self::RootDamaged => "root damaged: run fsck or chkdsk",
            Self::WriteProtected => "card is write-protected: unlock it",
            Self::NoRoom => "card is full: delete files",
            Self::NoEntry => "root is full: move files to folders",
            Self::NoNumber => "all numbers taken: move TEST files",
            Self::Gone => "card was pulled: put it in again",
            Self::Swapped => "card was swapped: save again",
            Self::Failed => "card fails: use another one",
            Self::NotKept => "card kept nothing: use another one",
            Self::TooSlow => "card is too slow: use another one",
            Self::Stopped => "stopped; the log is kept",
            Self::Short => "a new test has begun",
        }
    }

    /// How much it says about a card; the most is said of several places on it.
    pub(crate) const fn weight(self) -> u8 {
        match self {
            Self::NoFileSystem => 0,
            Self::Ext4 => 1,
            Self::Ntfs | Self::Exfat => 2,
            _ => 3,
        }
    }

    /// Whether it is of the card itself, and no other place on it has to be looked at.
    pub(crate) const fn is_of_the_card(self) -> bool {
        matches!(
            self,
            Self::WriteProtected
                | Self::Gone
                | Self::Swapped
                | Self::Failed
                | Self::TooSlow
                | Self::Stopped
        )
    }
}

impl fmt::Display for NotSaved {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.advice())
    }
}

impl core::error::Error for NotSaved {}

impl From<DiskError> for NotSaved {
    fn from(error: DiskError) -> Self {
        match error {
            DiskError::Gone => Self::Gone,
            DiskError::Swapped => Self::Swapped,
            DiskError::WriteProtected => Self::WriteProtected,
            DiskError::Beyond => Self::Beyond,
            DiskError::TooSlow => Self::TooSlow,
            DiskError::Stopped => Self::Stopped,
            DiskError::Failed => Self::Failed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_advice_has_room_in_a_statustext() {
        for why in [
            NotSaved::NoFileSystem,
            NotSaved::Exfat,
            NotSaved::Ntfs,
            NotSaved::Ext4,
            NotSaved::Fat12,
            NotSaved::SectorSize,
            NotSaved::Beyond,
            NotSaved::BootDamaged,
            NotSaved::TableDamaged,
            NotSaved::RootDamaged,
            NotSaved::WriteProtected,
            NotSaved::NoRoom,
            NotSaved::NoEntry,
            NotSaved::NoNumber,
            NotSaved::Gone,
            NotSaved::Swapped,
            NotSaved::Failed,
            NotSaved::NotKept,
            NotSaved::TooSlow,
            NotSaved::Stopped,
            NotSaved::Short,
        ] {
            assert!(why.advice().len() <= 35, "{why:?}");
            assert!(!why.word().contains(' '), "{why:?}");
        }
    }
}
