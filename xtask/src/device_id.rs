//! `device-id`: PX4's device ids in words and as bits, and ids of what is named.
//!
//! *Design.* Each argument is answered by itself: a number is taken apart; words as they are shown are
//! put together again, to every id that they can mean; a name alone is looked up in both lists.
//!
//! *Limits.* What is no id, no words and no name ends with exit code 1, after all others were answered.

use std::fmt;
use std::process::ExitCode;

use ::device_id::{DeviceId, DeviceType, Name, NotAnId, in_words};

/// The options of `cargo xtask device-id`.
#[derive(clap::Args)]
pub struct Options {
    /// 73225, 73225.0, 0x11E09, "HMC5883, address 0x1E, I2C bus 1" or HMC5883
    #[arg(required = true, allow_negative_numbers = true)]
    ids: Vec<String>,
}

/// Answers every argument.
pub fn run(options: &Options) -> ExitCode {
    let mut code = ExitCode::SUCCESS;
    for text in &options.ids {
        match answer(text) {
            Ok(answer) => console::print_text!("{answer}"),
            Err(refusal) => {
                console::print_error!("error: {text}: {refusal}");
                code = ExitCode::FAILURE;
            }
        }
    }
    code
}

/// What `text` means, in lines; else why it means nothing.
fn answer(text: &str) -> Result<String, String> {
    match text.parse() {
        Ok(id) => return Ok(Shown(id).to_string()),
        Err(refusal @ NotAnId::MoreThan24Bits(_)) => return Err(refusal.to_string()),
        Err(NotAnId::NotANumber) => {}
    }
    let ids: String = in_words(text).map(|id| Shown(id).to_string()).collect();
    if !ids.is_empty() {
        return Ok(ids);
    }
    let types = DeviceType::named().filter(|it| it.is_called(text.trim()));
    let types: String = types
        .map(|it| format!("device type 0x{:02X}  {}\n", it.0, Lists(it)))
        .collect();
    if types.is_empty() {
        return Err("no device id, no words of one, and no name that PX4 has".to_owned());
    }
    Ok(types)
}

/// An id with all that is known of it.
struct Shown(DeviceId);

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (id, device_type) = (self.0, self.0.device_type());
        writeln!(f, "{}  {id}", id.number())?;
        writeln!(
            f,
            "    0x{:06X} = {id:b}: device type 0x{:02X}, address 0x{:02X}, bus {}, bus type {}",
            id.number(),
            device_type.0,
            id.address(),
            id.bus(),
            id.bus_type().number()
        )?;
        writeln!(f, "    {}", Lists(device_type))
    }
}

/// What both lists call a device type.
struct Lists(DeviceType);

impl fmt::Display for Lists {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shown = |name: Option<Name>| match name {
            Some(Name { name, kind }) => format!("{name} ({kind})"),
            None => "unknown".to_owned(),
        };
        let (guide, today) = (self.0.in_guide(), self.0.today());
        write!(f, "in PX4's guide: {}; ", shown(guide))?;
        write!(f, "in today's PX4: {}", shown(today))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_told_in_words_and_as_bits() {
        let printed = answer("73225.0").unwrap();
        for line in [
            "73225  HMC5883, address 0x1E, I2C bus 1",
            "00000001 00011110 00001 001",
            "in PX4's guide: HMC5883 (magnetometer); in today's PX4: HMC5883 (magnetometer)",
        ] {
            assert!(printed.contains(line), "{printed}");
        }
        assert_eq!(answer("0x11E09").unwrap(), printed);
        assert_eq!(answer("HMC5883, address 0x1E, I2C bus 1").unwrap(), printed);
    }

    #[test]
    fn both_names_are_told_where_they_differ() {
        let printed = answer("263178").unwrap();
        let lists = "in PX4's guide: MPU9250 (magnetometer); in today's PX4: AK8963 (magnetometer)";
        assert!(printed.contains(lists), "{printed}");
    }

    #[test]
    fn a_name_alone_is_looked_up() {
        let printed = answer("mpu9250").unwrap();
        assert_eq!(printed.lines().count(), 3, "{printed}");
        let last = "device type 0x24  in PX4's guide: MPU9250 (gyroscope)";
        assert!(
            printed.lines().nth(2).unwrap().starts_with(last),
            "{printed}"
        );
    }

    #[test]
    fn refusals_say_why() {
        let too_large = answer("16777216").unwrap_err();
        assert!(too_large.contains("25 bits"), "{too_large}");
        let unknown = answer("HMC").unwrap_err();
        assert!(unknown.contains("no name"), "{unknown}");
        // An unknown type in a good id is no error.
        let printed = answer("0x100009").unwrap();
        assert!(printed.contains("unknown device type 0x10"), "{printed}");
    }
}
