//! The firmware file of PX4 boards: `.px4`.
//!
//! *Purpose.* [`Px4File::to_json`] writes what ground stations, PX4's uploader and ours take;
//! [`Px4File::parse`] reads anybody's.
//!
//! *Design.* JSON with the image in it: base64 of a zlib stream. QGroundControl finds the image by the
//! text `"image": "` with its space, so the JSON is written on several lines, never compact. A file
//! of ours also says where in the image the word for the MAVLink system id is, so that boards on one
//! network need no second build.
//!
//! *Limits.* A file with parameter or airframe metadata loses these when it is written again.

use std::error::Error;
use std::fmt;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use miniz_oxide::deflate::compress_to_vec_zlib;
use miniz_oxide::inflate::decompress_to_vec_zlib_with_limit;
use serde_json::{Value, json};

use crate::board::{FLASH_ROOM, PIXHAWK_1};
use crate::image::Image;

/// More than any board of this family can hold, in bytes: what unpacks to more is no image.
const UNPACKED_MAX: usize = 4 << 20;

/// zlib's best compression.
const COMPRESSION: u8 = 9;

/// Our own key: the offset of the word for the system id in the image, in bytes.
const SYSTEM_ID_AT: &str = "pixclock_system_id_at";

/// A firmware file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Px4File {
    /// What is flashed.
    pub image: Image,
    /// The most that an image for this board may have, in bytes; PX4's own files name the half that old
    /// chips can use.
    pub image_maxsize: u32,
    /// What it is, for people.
    pub summary: String,
    /// Its version, as a tag or a commit has it.
    pub version: String,
    /// The commit that it was built from.
    pub git_hash: String,
    /// When that was made, in s since 1970.
    pub build_time: u64,
    /// The offset of the image's word for its MAVLink system id, in bytes; `None` in files that are
    /// not ours.
    pub system_id_at: Option<u32>,
}

/// Why a file is not taken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Px4Error {
    /// It is no JSON.
    NotJson(String),
    /// A key is missing, or what it has is of another kind.
    Lacks(&'static str),
    /// The image is no base64 of a zlib stream, or its checksum is wrong.
    Damaged(String),
    /// The image has another length than the file says.
    Length {
        /// What the file says, in bytes.
        said: u64,
        /// What it has, in bytes.
        found: usize,
    },
    /// The image is larger than the file itself allows.
    OverMaximum {
        /// What the file has, in bytes.
        size: usize,
        /// What it allows, in bytes.
        maximum: u32,
    },
    /// It has no word for a system id.
    NoSystemId,
}

impl fmt::Display for Px4Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotJson(why) => write!(f, "this is no .px4 file, which is JSON: {why}"),
            Self::Lacks(key) => write!(f, "this is no .px4 file: it has no proper \"{key}\""),
            Self::Damaged(why) => {
                write!(
                    f,
                    "the image in the file is damaged ({why}): get the file anew"
                )
            }
            Self::Length { said, found } => write!(
                f,
                "the image in the file is damaged: it has {found} bytes where {said} are said; get \
                 the file anew"
            ),
            Self::OverMaximum { size, maximum } => write!(
                f,
                "the image in the file has {size} bytes, and the file itself allows {maximum}"
            ),
            Self::NoSystemId => f.write_str(
                "this file does not say where its system id is, so it can be given none: \
                 `cargo xtask px4` writes files that do",
            ),
        }
    }
}

impl Error for Px4Error {}

impl Px4File {
    /// A file for the Pixhawk 1 that says nothing of itself yet.
    #[must_use]
    pub fn new(bytes: Vec<u8>) -> Self {
        Self {
            image: Image::new(PIXHAWK_1, bytes),
            image_maxsize: FLASH_ROOM,
            summary: String::new(),
            version: String::new(),
            git_hash: String::new(),
            build_time: 0,
            system_id_at: None,
        }
    }

    /// The file's text.
    #[must_use]
    pub fn to_json(&self) -> String {
        let packed = compress_to_vec_zlib(self.image.bytes(), COMPRESSION);
        let mut file = json!({
            "magic": "PX4FWv1",
            "board_id": self.image.board_id(),
            "board_revision": 0,
            "description": "Firmware for the Pixhawk 1 (FMUv2, FMUv3)",
            "summary": self.summary,
            "version": self.version,
            "git_identity": self.version,
            "git_hash": self.git_hash,
            "build_time": self.build_time,
            "image_size": self.image.bytes().len(),
            "image_maxsize": self.image_maxsize,
            "image": BASE64.encode(packed),
        });
        if let Some(offset) = self.system_id_at {
            file[SYSTEM_ID_AT] = offset.into();
        }
        format!("{file:#}\n")
    }

    /// Reads a file's text.
    ///
    /// # Errors
    ///
    /// What is wrong with it.
    pub fn parse(text: &str) -> Result<Self, Px4Error> {
        let file: Value =
            serde_json::from_str(text).map_err(|error| Px4Error::NotJson(error.to_string()))?;
        let number = |key: &'static str| {
            let number = file[key].as_u64().and_then(|number| number.try_into().ok());
            number.ok_or(Px4Error::Lacks(key))
        };
        let text = |key: &str| file[key].as_str().unwrap_or_default().to_owned();
        let damaged = |error: &dyn fmt::Display| Px4Error::Damaged(error.to_string());
        let packed = file["image"].as_str().ok_or(Px4Error::Lacks("image"))?;
        let packed = BASE64.decode(packed).map_err(|error| damaged(&error))?;
        let bytes = decompress_to_vec_zlib_with_limit(&packed, UNPACKED_MAX)
            .map_err(|error| damaged(&error))?;
        let found = bytes.len();
        let said = file["image_size"]
            .as_u64()
            .ok_or(Px4Error::Lacks("image_size"))?;
        if said != found as u64 {
            return Err(Px4Error::Length { said, found });
        }
        let image_maxsize = number("image_maxsize").unwrap_or(FLASH_ROOM);
        if found > image_maxsize as usize {
            return Err(Px4Error::OverMaximum {
                size: found,
                maximum: image_maxsize,
            });
        }
        Ok(Self {
            image: Image::new(number("board_id")?, bytes),
            image_maxsize,
            summary: text("summary"),
            version: text("git_identity"),
            git_hash: text("git_hash"),
            build_time: file["build_time"].as_u64().unwrap_or_default(),
            system_id_at: number(SYSTEM_ID_AT).ok(),
        })
    }

    /// Writes the MAVLink system id into the image.
    ///
    /// # Errors
    ///
    /// The file does not say where that is.
    pub fn set_system_id(&mut self, id: u8) -> Result<(), Px4Error> {
        let start = self.system_id_at.ok_or(Px4Error::NoSystemId)? as usize;
        let mut bytes = self.image.bytes().to_vec();
        let word = bytes.get_mut(start..start.saturating_add(4));
        word.ok_or(Px4Error::NoSystemId)?
            .copy_from_slice(&u32::from(id).to_le_bytes());
        self.image = Image::new(self.image.board_id(), bytes);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file() -> Px4File {
        Px4File {
            summary: "a test".into(),
            version: "v1.2".into(),
            git_hash: "0123abcd".into(),
            build_time: 1_795_320_000,
            system_id_at: Some(8),
            ..Px4File::new((0..=251).collect())
        }
    }

    #[test]
    fn what_is_written_is_read() {
        let text = file().to_json();
        assert_eq!(Px4File::parse(&text), Ok(file()));
        // What QGroundControl looks for, and what it wants to be numbers.
        assert_eq!(text.matches("\"image\": \"").count(), 1);
        assert!(text.contains("\"board_id\": 9,") && text.contains("\"image_size\": 252,"));
        assert!(text.contains("\"image_maxsize\": 2080768,"));
        assert!(text.contains("\"magic\": \"PX4FWv1\""));
    }

    #[test]
    fn the_system_id_is_one_word_of_the_image() {
        let mut changed = file();
        changed.set_system_id(7).unwrap();
        let expected: Vec<u8> = (0..8).chain([7, 0, 0, 0]).chain(12..=251).collect();
        assert_eq!(changed.image.bytes(), expected);
        for system_id_at in [None, Some(250), Some(u32::MAX)] {
            let mut other = Px4File {
                system_id_at,
                ..file()
            };
            assert_eq!(other.set_system_id(7), Err(Px4Error::NoSystemId));
        }
    }

    #[test]
    fn other_peoples_files_need_no_more_than_board_image_and_size() {
        let ours: Value = serde_json::from_str(&file().to_json()).unwrap();
        let theirs = json!({
            "board_id": 9, "image_size": 252, "image": ours["image"], "parameter_xml": "...",
        });
        let read = Px4File::parse(&theirs.to_string()).unwrap();
        assert_eq!(read.image, file().image);
        assert_eq!(read.system_id_at, None);
    }

    #[test]
    fn a_file_that_is_damaged_or_none_says_so() {
        let with = |key: &str, value: Value| {
            let mut json: Value = serde_json::from_str(&file().to_json()).unwrap();
            json[key] = value;
            Px4File::parse(&json.to_string()).unwrap_err()
        };
        assert!(matches!(
            Px4File::parse("\x7fELF"),
            Err(Px4Error::NotJson(_))
        ));
        assert!(matches!(
            Px4File::parse("[]"),
            Err(Px4Error::Lacks("image"))
        ));
        assert_eq!(with("board_id", json!("nine")), Px4Error::Lacks("board_id"));
        assert_eq!(
            with("image_size", json!(null)),
            Px4Error::Lacks("image_size")
        );
        let length = Px4Error::Length {
            said: 256,
            found: 252,
        };
        assert_eq!(with("image_size", json!(256)), length);
        assert!(matches!(with("image", json!("***")), Px4Error::Damaged(_)));
        let maximum = Px4Error::OverMaximum {
            size: 252,
            maximum: 100,
        };
        assert_eq!(with("image_maxsize", json!(100)), maximum);
        // Any one bit of the stream: its own checksum finds it.
        let text = file().to_json();
        let json: Value = serde_json::from_str(&text).unwrap();
        let packed = BASE64.decode(json["image"].as_str().unwrap()).unwrap();
        for bit in 0..packed.len() * 8 {
            let mut packed = packed.clone();
            packed[bit / 8] ^= 1 << (bit % 8);
            let error = match with_image(&json, &packed) {
                Err(error) => error,
                // Bits of the header that say how it was packed, not what.
                Ok(same) => {
                    assert_eq!(same.image, file().image, "bit {bit}");
                    continue;
                }
            };
            let is_damage = matches!(error, Px4Error::Damaged(_) | Px4Error::Length { .. });
            assert!(is_damage, "bit {bit}: {error}");
        }
    }

    fn with_image(json: &Value, packed: &[u8]) -> Result<Px4File, Px4Error> {
        let mut json = json.clone();
        json["image"] = BASE64.encode(packed).into();
        Px4File::parse(&json.to_string())
    }
}
