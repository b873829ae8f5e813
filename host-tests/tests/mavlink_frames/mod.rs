//! MAVLink frames for tests, built without the crate that is tested.

#![allow(
    dead_code,
    clippy::allow_attributes,
    reason = "each test file compiles this module and uses a part of it"
)]

/// The incompatibility flag of a signed frame.
pub const SIGNED: u8 = 1;

/// CRC-16/MCRF4XX, bit by bit.
pub fn crc(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xffff, |register, &byte| {
        (0..8).fold(register ^ u16::from(byte), |register, _| {
            (register >> 1) ^ if register & 1 == 1 { 0x8408 } else { 0 }
        })
    })
}

/// A frame by its fields.
#[derive(Clone, Debug)]
pub struct Frame {
    pub v2: bool,
    /// Incompatibility flags; a signature is 13 bytes of 0x5a.
    pub flags: u8,
    pub sequence: u8,
    pub system: u8,
    pub component: u8,
    pub id: u32,
    pub extra: u8,
    /// As it goes over the line: trailing zeros are the caller's business.
    pub payload: Vec<u8>,
}

impl Frame {
    /// A PING as pymavlink sends it, from 255/190 with time 2.
    pub fn ping(v2: bool, seq: u32, target_system: u8) -> Self {
        let mut payload = 2_u64.to_le_bytes().to_vec();
        payload.extend(seq.to_le_bytes());
        payload.extend([target_system, 0]);
        Self::message(v2, 4, 237, payload)
    }

    /// A TIMESYNC; in MAVLink 2 with its targets.
    pub fn timesync(v2: bool, tc1: i64, ts1: i64, target: [u8; 2]) -> Self {
        let mut payload = tc1.to_le_bytes().to_vec();
        payload.extend(ts1.to_le_bytes());
        if v2 {
            payload.extend(target);
        }
        Self::message(v2, 111, 34, payload)
    }

    /// A COMMAND_LONG with seven parameters of 1.0.
    pub fn command_long(v2: bool, number: u16, target: [u8; 2]) -> Self {
        let mut payload = 1_f32.to_le_bytes().repeat(7);
        payload.extend(number.to_le_bytes());
        payload.extend(target);
        payload.push(0);
        Self::message(v2, 76, 152, payload)
    }

    /// A COMMAND_INT with parameters of 1.
    pub fn command_int(v2: bool, number: u16, target: [u8; 2]) -> Self {
        let mut payload = 1_i32.to_le_bytes().repeat(7);
        payload.extend(number.to_le_bytes());
        payload.extend(target);
        payload.extend([3, 0, 0]);
        Self::message(v2, 75, 158, payload)
    }

    /// Any message from 255/190; trailing zeros are left out in MAVLink 2.
    pub fn message(v2: bool, id: u32, extra: u8, mut payload: Vec<u8>) -> Self {
        while v2 && payload.len() > 1 && payload.last() == Some(&0) {
            payload.pop();
        }
        Self {
            v2,
            flags: 0,
            sequence: 0,
            system: 255,
            component: 190,
            id,
            extra,
            payload,
        }
    }

    pub fn bytes(&self) -> Vec<u8> {
        let len = self.payload.len() as u8;
        let [low, middle, high, _] = self.id.to_le_bytes();
        let mut bytes = if self.v2 {
            vec![
                0xfd,
                len,
                self.flags,
                0,
                self.sequence,
                self.system,
                self.component,
                low,
                middle,
                high,
            ]
        } else {
            vec![0xfe, len, self.sequence, self.system, self.component, low]
        };
        bytes.extend(&self.payload);
        let mut covered = bytes[1..].to_vec();
        covered.push(self.extra);
        bytes.extend(crc(&covered).to_le_bytes());
        if self.flags & SIGNED != 0 {
            bytes.extend([0x5a; 13]);
        }
        bytes
    }
}
