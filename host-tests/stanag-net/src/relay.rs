//! Between datagrams and a serial line.

use stanag_wire::{Frame, Header, MAX_FRAME, Refusal, Sum};

/// The frames of a datagram as a line has them: with ffff, of Edition 3, with a sum.
///
/// # Errors
///
/// When it does not divide into whole frames: then none of them goes on.
pub fn for_line(datagram: &[u8]) -> Result<Vec<u8>, Refusal> {
    let mut line = Vec::new();
    let mut rest = datagram;
    while !rest.is_empty() {
        let (frame, behind) = Frame::read(rest)?;
        let header = Header {
            idd: Header::EDITION_3,
            sum: match frame.header.sum {
                Sum::None | Sum::Crc32 => Sum::Bytes2,
                sum => sum,
            },
            ..frame.header
        };
        let mut out = [0; MAX_FRAME];
        let length = header.write(frame.data, &mut out).unwrap_or_default();
        line.extend_from_slice(&out[..length]);
        rest = behind;
    }
    Ok(line)
}

/// Takes the frames out of a line's bytes. A line that was just opened may begin in the middle of one.
#[derive(Clone, Debug, Default)]
pub struct FromLine(Vec<u8>);

impl FromLine {
    /// Takes bytes, and returns the frames that are whole.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<Vec<u8>> {
        self.0.extend_from_slice(bytes);
        let mut frames = Vec::new();
        let mut at = 0;
        while at < self.0.len() {
            let rest = &self.0[at..];
            match Frame::read(rest) {
                Ok((frame, behind)) if frame.header.sum != Sum::None => {
                    let length = rest.len() - behind.len();
                    frames.push(rest[..length].to_vec());
                    at += length;
                }
                Err(Refusal::Short) if rest.starts_with(&[0xFF, 0xFF]) || rest.len() < 2 => break,
                _ => at += 1,
            }
        }
        self.0.drain(..at);
        frames
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::station;
    use stanag_wire::NodeId;

    #[test]
    fn frames_are_found_between_noise_in_any_pieces() {
        let one = station::clock_request(NodeId(1), NodeId(2), 1_795_848_000_123_456_789, 7);
        let two = station::discovery(NodeId(1));
        let stream = [&[0x7F, 0xFF, 0x00][..], &one, b"\xffnoise", &two].concat();
        for size in 1..stream.len() {
            let mut line = FromLine::default();
            let found: Vec<_> = stream.chunks(size).flat_map(|it| line.push(it)).collect();
            assert_eq!(found, [one.clone(), two.clone()], "{size}");
        }
    }

    #[test]
    fn a_frame_without_a_sum_gets_one_and_half_a_datagram_stays_out() {
        let bare = [
            0xff, 0xff, 0, 1, 0, 0x50, 0x5f, 1, 0xff, 0xff, 0xff, 0xff, 0x3e, 0x82, 0x1e, 0, 0,
        ];
        let line = for_line(&bare).unwrap();
        let (frame, rest) = Frame::read(&line).unwrap();
        assert_eq!(
            (frame.header.sum, frame.data, rest.len()),
            (Sum::Bytes2, &[0][..], 0)
        );
        assert_eq!(for_line(&bare[..16]), Err(Refusal::Short));
        assert_eq!(
            for_line(&[&bare[..], &[0xff]].concat()),
            Err(Refusal::Short)
        );
    }
}
