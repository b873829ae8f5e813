//! The two lists of device types.
//!
//! *Sources.* [`GUIDE`]: PX4's guide, "Hardware/Device IDs". [`TODAY`]: PX4's source,
//! `src/drivers/drv_sensor.h` of 2024 and later, at commit `023ba6e0`. Names are as there, without the
//! words that all of a kind have; u-blox receivers are called by their maker.

use core::fmt;

/// What a device measures or does, with the word that PX4's source has for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `MAG`.
    Magnetometer,
    /// `ACC`.
    Accelerometer,
    /// `GYR`.
    Gyroscope,
    /// `IMU`: accelerometers and gyroscopes.
    Imu,
    /// `INS`: computes attitude and position by itself.
    Ins,
    /// `BARO`.
    Barometer,
    /// `DIFF_PRESS`: what airspeed is measured with.
    DifferentialPressure,
    /// `FLOW`.
    OpticalFlow,
    /// `RNG` and `DIST`.
    Rangefinder,
    /// `GPS`.
    Gnss,
    /// `HYGRO`.
    Hygrometer,
    /// `TEMP`.
    Thermometer,
    /// `BAT`.
    Battery,
    /// `POWER`.
    PowerMonitor,
    /// `ADC`.
    AnalogInput,
    /// `GPIO`.
    Pins,
    /// `PWM`.
    Outputs,
    /// `LED`.
    Light,
    /// `OSD`.
    Display,
    /// `TEL`.
    Telemetry,
    /// `TRNS`.
    Transponder,
    /// `SENS`: infrared beacons, counters.
    OtherSensor,
}

/// In words, in the singular.
impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Magnetometer => "magnetometer",
            Self::Accelerometer => "accelerometer",
            Self::Gyroscope => "gyroscope",
            Self::Imu => "inertial unit",
            Self::Ins => "inertial navigation system",
            Self::Barometer => "barometer",
            Self::DifferentialPressure => "airspeed sensor",
            Self::OpticalFlow => "optical flow sensor",
            Self::Rangefinder => "rangefinder",
            Self::Gnss => "GNSS receiver",
            Self::Hygrometer => "hygrometer",
            Self::Thermometer => "thermometer",
            Self::Battery => "battery",
            Self::PowerMonitor => "power monitor",
            Self::AnalogInput => "analog input",
            Self::Pins => "port expander",
            Self::Outputs => "PWM outputs",
            Self::Light => "light",
            Self::Display => "on-screen display",
            Self::Telemetry => "telemetry",
            Self::Transponder => "transponder",
            Self::OtherSensor => "sensor",
        })
    }
}

/// What a list calls a device type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Name {
    /// The name.
    pub name: &'static str,
    /// What it measures or does.
    pub kind: Kind,
}

/// Numbers with what they mean, in their order.
type List = [(u8, Kind, &'static str)];

/// What `list` calls the device type `number`.
pub(crate) fn find(list: &List, number: u8) -> Option<Name> {
    let at = list.binary_search_by_key(&number, |row| row.0).ok()?;
    list.get(at).map(|&(_, kind, name)| Name { name, kind })
}

/// The guide's.
pub(crate) const GUIDE: &List = &[
    (0x01, Kind::Magnetometer, "HMC5883"),
    (0x02, Kind::Magnetometer, "LSM303D"),
    (0x03, Kind::Magnetometer, "MAGSIM"),
    (0x04, Kind::Magnetometer, "MPU9250"),
    (0x11, Kind::Accelerometer, "LSM303D"),
    (0x12, Kind::Accelerometer, "BMA180"),
    (0x13, Kind::Accelerometer, "MPU6000"),
    (0x14, Kind::Accelerometer, "ACCSIM"),
    (0x15, Kind::Gyroscope, "GYROSIM"),
    (0x16, Kind::Accelerometer, "MPU9250"),
    (0x21, Kind::Gyroscope, "MPU6000"),
    (0x22, Kind::Gyroscope, "L3GD20"),
    (0x23, Kind::Gyroscope, "GYROSIM"),
    (0x24, Kind::Gyroscope, "MPU9250"),
    (0x31, Kind::Rangefinder, "MB12XX"),
    (0x32, Kind::Rangefinder, "LL40LS"),
];

/// Today's.
pub(crate) const TODAY: &List = &[
    (0x01, Kind::Magnetometer, "HMC5883"),
    (0x03, Kind::Magnetometer, "MAGSIM"),
    (0x04, Kind::Magnetometer, "AK8963"),
    (0x05, Kind::Magnetometer, "LIS3MDL"),
    (0x06, Kind::Magnetometer, "IST8310"),
    (0x07, Kind::Magnetometer, "RM3100"),
    (0x08, Kind::Magnetometer, "QMC5883L"),
    (0x09, Kind::Magnetometer, "AK09916"),
    (0x0A, Kind::Magnetometer, "VCM1193L"),
    (0x0B, Kind::Magnetometer, "IST8308"),
    (0x0D, Kind::Magnetometer, "MMC5983MA"),
    (0x0E, Kind::Magnetometer, "IIS2MDC"),
    (0x0F, Kind::Magnetometer, "QMC5883P"),
    (0x11, Kind::Imu, "LSM303D"),
    (0x12, Kind::Imu, "LSM6DSV"),
    (0x14, Kind::Imu, "SIM"),
    (0x15, Kind::DifferentialPressure, "SIM"),
    (0x16, Kind::OpticalFlow, "SIM"),
    (0x21, Kind::Imu, "MPU6000"),
    (0x22, Kind::Gyroscope, "L3GD20"),
    (0x24, Kind::Imu, "MPU9250"),
    (0x25, Kind::Imu, "ICM20649"),
    (0x26, Kind::Imu, "ICM42688P"),
    (0x27, Kind::Imu, "ICM40609D"),
    (0x28, Kind::Imu, "ICM20948"),
    (0x29, Kind::Imu, "ICM42605"),
    (0x2A, Kind::Imu, "ICM42670P"),
    (0x2B, Kind::Imu, "IIM42652"),
    (0x2C, Kind::Imu, "IAM20680HP"),
    (0x2D, Kind::Imu, "ICM42686P"),
    (0x2E, Kind::Imu, "IIM42653"),
    (0x31, Kind::Rangefinder, "MB12XX"),
    (0x32, Kind::Rangefinder, "LL40LS"),
    (0x33, Kind::Accelerometer, "MPU6050"),
    (0x34, Kind::Imu, "ICM45686"),
    (0x35, Kind::Gyroscope, "MPU6050"),
    (0x36, Kind::Imu, "MPU6500"),
    (0x37, Kind::Imu, "BMI270"),
    (0x38, Kind::Imu, "ICM20602"),
    (0x3A, Kind::Imu, "ICM20608G"),
    (0x3C, Kind::Imu, "ICM20689"),
    (0x3D, Kind::Barometer, "MS5611"),
    (0x3E, Kind::Barometer, "MS5607"),
    (0x3F, Kind::Barometer, "BMP280"),
    (0x40, Kind::Barometer, "LPS25H"),
    (0x41, Kind::Accelerometer, "BMI055"),
    (0x42, Kind::Gyroscope, "BMI055"),
    (0x43, Kind::Magnetometer, "BMM150"),
    (0x44, Kind::Imu, "LSM9DS1_AG"),
    (0x45, Kind::Magnetometer, "LSM9DS1_M"),
    (0x46, Kind::DifferentialPressure, "ETS3"),
    (0x47, Kind::DifferentialPressure, "MS4515"),
    (0x48, Kind::DifferentialPressure, "MS4525DO"),
    (0x49, Kind::DifferentialPressure, "MS5525DSO"),
    (0x4A, Kind::DifferentialPressure, "SDP31"),
    (0x4B, Kind::DifferentialPressure, "SDP32"),
    (0x4C, Kind::DifferentialPressure, "SDP33"),
    (0x4D, Kind::Barometer, "TCBP001TA"),
    (0x4E, Kind::Barometer, "MS5837"),
    (0x4F, Kind::Barometer, "SPL06"),
    (0x50, Kind::Barometer, "LPS33HW"),
    (0x51, Kind::Barometer, "MPL3115A2"),
    (0x52, Kind::Accelerometer, "FXOS8701C"),
    (0x54, Kind::Gyroscope, "FXAS2100C"),
    (0x57, Kind::Imu, "ADIS16448"),
    (0x58, Kind::Imu, "ADIS16470"),
    (0x59, Kind::Imu, "ADIS16477"),
    (0x5A, Kind::Imu, "ADIS16507"),
    (0x5B, Kind::Imu, "SCH16T"),
    (0x5C, Kind::Imu, "ADIS16607"),
    (0x5D, Kind::Imu, "ADIS1650X"),
    (0x5F, Kind::Barometer, "MPC2520"),
    (0x60, Kind::Barometer, "LPS22HB"),
    (0x61, Kind::Accelerometer, "LSM303AGR"),
    (0x62, Kind::Magnetometer, "LSM303AGR"),
    (0x63, Kind::Imu, "ADIS16497"),
    (0x65, Kind::Barometer, "BAROSIM"),
    (0x66, Kind::Gyroscope, "BMI088"),
    (0x67, Kind::Barometer, "BMP388"),
    (0x68, Kind::Barometer, "DPS310"),
    (0x69, Kind::Outputs, "PCA9685"),
    (0x6A, Kind::Accelerometer, "BMI088"),
    (0x6B, Kind::Display, "ATXXXX"),
    (0x6C, Kind::Accelerometer, "BMI085"),
    (0x6D, Kind::Gyroscope, "BMI085"),
    (0x6E, Kind::Barometer, "BMP390"),
    (0x6F, Kind::Barometer, "BMP581"),
    (0x70, Kind::Rangefinder, "LL40LS"),
    (0x71, Kind::Rangefinder, "MAPPYDOT"),
    (0x72, Kind::Rangefinder, "MB12XX"),
    (0x73, Kind::Rangefinder, "LIGHTWARE_LASER"),
    (0x74, Kind::Rangefinder, "SRF02"),
    (0x75, Kind::Rangefinder, "TERARANGER"),
    (0x76, Kind::Rangefinder, "VL53L0X"),
    (0x7A, Kind::Light, "RGBLED"),
    (0x7B, Kind::Light, "RGBLED_NCP5623C"),
    (0x7C, Kind::Battery, "SMBUS"),
    (0x7D, Kind::OtherSensor, "IRLOCK"),
    (0x7E, Kind::OtherSensor, "PCF8583"),
    (0x7F, Kind::Telemetry, "BST"),
    (0x80, Kind::Accelerometer, "UAVCAN"),
    (0x81, Kind::Barometer, "UAVCAN"),
    (0x82, Kind::Battery, "UAVCAN"),
    (0x83, Kind::DifferentialPressure, "UAVCAN"),
    (0x84, Kind::OpticalFlow, "UAVCAN"),
    (0x85, Kind::Gnss, "UAVCAN"),
    (0x86, Kind::Gyroscope, "UAVCAN"),
    (0x87, Kind::Imu, "UAVCAN"),
    (0x88, Kind::Magnetometer, "UAVCAN"),
    (0x89, Kind::Rangefinder, "UAVCAN"),
    (0x8A, Kind::Hygrometer, "UAVCAN"),
    (0x90, Kind::AnalogInput, "ADS1115"),
    (0x91, Kind::Rangefinder, "VL53L1X"),
    (0x92, Kind::Rangefinder, "CM8JL65"),
    (0x93, Kind::Rangefinder, "LEDDARONE"),
    (0x94, Kind::Rangefinder, "MAVLINK"),
    (0x95, Kind::Rangefinder, "PGA460"),
    (0x96, Kind::Rangefinder, "PX4FLOW"),
    (0x97, Kind::Rangefinder, "TFMINI"),
    (0x98, Kind::Rangefinder, "ULANDING"),
    (0x99, Kind::Rangefinder, "AFBRS50"),
    (0x9A, Kind::Rangefinder, "SIM"),
    (0x9B, Kind::Rangefinder, "SRF05"),
    (0x9C, Kind::Rangefinder, "GY_US42"),
    (0x9D, Kind::Battery, "BATMON_SMBUS"),
    (0x9E, Kind::Pins, "MCP23017"),
    (0x9F, Kind::Pins, "MCP23009"),
    (0xA0, Kind::Gnss, "ASHTECH"),
    (0xA1, Kind::Gnss, "EMLID_REACH"),
    (0xA2, Kind::Gnss, "FEMTOMES"),
    (0xA3, Kind::Gnss, "MTK"),
    (0xA4, Kind::Gnss, "SBF"),
    (0xA5, Kind::Gnss, "u-blox"),
    (0xA6, Kind::Gnss, "u-blox 6"),
    (0xA7, Kind::Gnss, "u-blox 7"),
    (0xA8, Kind::Gnss, "u-blox 8"),
    (0xA9, Kind::Gnss, "u-blox 9"),
    (0xAA, Kind::Gnss, "u-blox F9P"),
    (0xAB, Kind::Gnss, "NMEA"),
    (0xAC, Kind::Gnss, "u-blox 10"),
    (0xAD, Kind::Gnss, "u-blox 20"),
    (0xAF, Kind::Gnss, "SIM"),
    (0xB0, Kind::Transponder, "MXS"),
    (0xB1, Kind::Hygrometer, "SHT3X"),
    (0xB2, Kind::OpticalFlow, "MAVLINK"),
    (0xB3, Kind::OpticalFlow, "PMW3901"),
    (0xB4, Kind::OpticalFlow, "PAW3902"),
    (0xB5, Kind::OpticalFlow, "PX4FLOW"),
    (0xB6, Kind::OpticalFlow, "PAA3905"),
    (0xB7, Kind::Barometer, "ICP101XX"),
    (0xB8, Kind::Barometer, "ICP201XX"),
    (0xBF, Kind::Light, "RGBLED_IS31FL3195"),
    (0xC0, Kind::Light, "RGBLED_LP5562"),
    (0xD0, Kind::PowerMonitor, "INA226"),
    (0xD1, Kind::PowerMonitor, "INA228"),
    (0xD2, Kind::PowerMonitor, "VOXLPM"),
    (0xD3, Kind::PowerMonitor, "INA220"),
    (0xD4, Kind::PowerMonitor, "INA238"),
    (0xE0, Kind::Rangefinder, "TF02PRO"),
    (0xE1, Kind::Ins, "VN100"),
    (0xE2, Kind::Ins, "VN200"),
    (0xE3, Kind::Ins, "VN300"),
    (0xE4, Kind::DifferentialPressure, "ASP5033"),
    (0xE5, Kind::Magnetometer, "BMM350"),
    (0xE6, Kind::DifferentialPressure, "AUAV"),
    (0xE7, Kind::Barometer, "AUAV"),
    (0xE8, Kind::Barometer, "SPA06"),
    (0xE9, Kind::Ins, "ILABS"),
    (0xEA, Kind::Ins, "MICROSTRAIN"),
    (0xEB, Kind::Ins, "BAHRS"),
    (0xEC, Kind::Ins, "SBG"),
    (0xED, Kind::AnalogInput, "ADS7953"),
    (0xEE, Kind::Thermometer, "MCP9808"),
    (0xEF, Kind::AnalogInput, "TLA2528"),
    (0xF0, Kind::Thermometer, "TMP102"),
    (0xF1, Kind::AnalogInput, "ADS7128"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_lists_are_in_order() {
        for list in [GUIDE, TODAY] {
            assert!(list.is_sorted_by(|a, b| a.0 < b.0));
            for &(number, kind, name) in list {
                assert_eq!(find(list, number), Some(Name { name, kind }));
            }
        }
    }
}
