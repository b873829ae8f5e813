//! The client of PX4's bootloader.
//!
//! *Purpose.* [`Uploader`] brings an [`Image`] into a board's flash: it waits for the bootloader,
//! identifies the board, has it erased and programmed, compares the checksum and has it booted.
//!
//! *Design.* One command at a time, each in one piece, because the bootloader waits no longer than
//! 50 ms for some of a command's bytes and has no room for a second one. An answer ends with two
//! bytes, INSYNC and a status; a refusal is these two alone, where otherwise a word comes before
//! them. Only silence behind them tells such a refusal from the beginning of a word, so it is
//! believed at the answer's deadline.
//!
//! What a board sends before its bootloader answers (telemetry, half of another answer) can look like
//! an answer. So the line has to have been quiet for a while before the first question that matters.
//!
//! *Limits.* A damaged answer ends the upload: it is begun anew by the caller, as often as wanted,
//! because the bootloader boots nothing that was not programmed to its end.

use std::collections::VecDeque;
use std::time::Duration;

use crate::crc::crc32;
use crate::failure::{Failure, Phase};
use crate::image::Image;

/// The bytes of the protocol (PX4-Bootloader, `bl.c`).
mod wire {
    pub(super) const GET_SYNC: u8 = 0x21;
    pub(super) const GET_DEVICE: u8 = 0x22;
    pub(super) const CHIP_ERASE: u8 = 0x23;
    pub(super) const PROG_MULTI: u8 = 0x27;
    pub(super) const GET_CRC: u8 = 0x29;
    pub(super) const BOOT: u8 = 0x30;
    pub(super) const END: u8 = 0x20;

    pub(super) const INSYNC: u8 = 0x12;
    pub(super) const OK: u8 = 0x10;
    pub(super) const BAD_SILICON: u8 = 0x14;

    /// What GET_DEVICE asks for: the protocol, the board's id and revision, and the flash's size.
    pub(super) const DEVICE: [u8; 4] = [1, 2, 3, 4];
}

/// The most that one PROG_MULTI may carry, in bytes.
const PIECE: usize = 252;

/// From one GET_SYNC to the next, until one is answered.
const SYNC_EVERY: Duration = Duration::from_millis(250);
/// How long the line has to be quiet after GET_SYNC was answered.
const QUIET: Duration = Duration::from_millis(60);
/// How long an answer may take.
const ANSWER: Duration = Duration::from_secs(2);
/// A checksum is computed over up to 2 MB.
const CRC_ANSWER: Duration = Duration::from_secs(10);
/// An erase answers when it is done: 23 sectors, 2 s each at most (DS9484, flash memory).
const ERASE_ANSWER: Duration = Duration::from_secs(50);

/// What a bootloader has said of its board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Device {
    /// The protocol that it speaks.
    pub protocol: u32,
    /// The board's id: 9 for the Pixhawk 1.
    pub board_id: u32,
    /// The board's revision.
    pub revision: u32,
    /// The flash for an application, in bytes.
    pub flash_room: u32,
}

/// How far an upload has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// What it does.
    pub phase: Phase,
    /// Bytes that are programmed.
    pub programmed: usize,
    /// Bytes to be programmed.
    pub size: usize,
}

/// What is waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// An answer to GET_SYNC.
    Sync,
    /// A line that is quiet.
    Quiet,
    /// The answer to GET_DEVICE for the parameter with this index.
    Device(usize),
    Erase,
    /// The answer to PROG_MULTI for the bytes up to this offset.
    Program(usize),
    Crc,
    Boot,
}

impl Step {
    const fn phase(self) -> Phase {
        match self {
            Self::Sync | Self::Quiet => Phase::Connecting,
            Self::Device(_) => Phase::Identifying,
            Self::Erase => Phase::Erasing,
            Self::Program(_) => Phase::Programming,
            Self::Crc => Phase::Checking,
            Self::Boot => Phase::Booting,
        }
    }

    /// Whether the answer has a word before its status.
    const fn has_word(self) -> bool {
        matches!(self, Self::Device(_) | Self::Crc)
    }
}

/// One upload. Moments are times since one of the caller's choice.
#[derive(Debug)]
pub struct Uploader {
    image: Image,
    step: Step,
    device: Device,
    /// What has come of the present answer.
    inbox: Vec<u8>,
    outbox: VecDeque<Vec<u8>>,
    /// When [`Self::handle_timeout`] has something to do.
    due: Duration,
    /// When no bootloader is waited for any more.
    patience: Duration,
    outcome: Option<Result<Device, Failure>>,
}

impl Uploader {
    /// An upload of `image` that begins at `now` and waits for the bootloader until `patience`.
    #[must_use]
    pub fn new(image: Image, now: Duration, patience: Duration) -> Self {
        let mut uploader = Self {
            image,
            step: Step::Sync,
            device: Device::default(),
            inbox: Vec::new(),
            outbox: VecDeque::new(),
            due: now,
            patience,
            outcome: None,
        };
        uploader.ask(Step::Sync, now);
        uploader
    }

    /// The next command, to be sent in one piece and at once.
    pub fn poll_transmit(&mut self) -> Option<Vec<u8>> {
        self.outbox.pop_front()
    }

    /// When to call [`Self::handle_timeout`] if nothing comes before; `None` at the end.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Duration> {
        self.outcome.is_none().then_some(self.due)
    }

    /// How it ended; `None` while it goes on.
    #[must_use]
    pub const fn outcome(&self) -> Option<Result<Device, Failure>> {
        self.outcome
    }

    /// How far it has come.
    #[must_use]
    pub fn progress(&self) -> Progress {
        let size = self.image.bytes().len();
        Progress {
            phase: self.step.phase(),
            programmed: match self.step {
                Step::Sync | Step::Quiet | Step::Device(_) | Step::Erase => 0,
                // The last piece is under way.
                Step::Program(end) => (end - 1) / PIECE * PIECE,
                Step::Crc | Step::Boot => size,
            },
            size,
        }
    }

    /// Takes what the board has sent.
    pub fn handle_bytes(&mut self, bytes: &[u8], now: Duration) {
        for &byte in bytes {
            if self.outcome.is_some() {
                return;
            }
            self.inbox.push(byte);
            match self.step {
                Step::Sync if self.inbox.ends_with(&[wire::INSYNC, wire::OK]) => {
                    self.step = Step::Quiet;
                    self.due = now + QUIET;
                }
                // Of anything else only the newest byte can begin an answer.
                Step::Sync => drop(self.inbox.drain(..self.inbox.len() - 1)),
                Step::Quiet => {
                    self.inbox.clear();
                    self.due = now + QUIET;
                }
                _ => self.handle_answer(now),
            }
        }
    }

    /// Does what is due. A call that comes too early does nothing.
    pub fn handle_timeout(&mut self, now: Duration) {
        if self.outcome.is_some() || now < self.due {
            return;
        }
        match self.step {
            Step::Sync if now >= self.patience => self.end(Err(Failure::NoBootloader)),
            Step::Sync => self.ask(Step::Sync, now),
            Step::Quiet => self.ask(Step::Device(0), now),
            step => match self.inbox.as_slice() {
                &[wire::INSYNC, status] if step.has_word() => self.refused(status),
                // What looked like an answer to GET_SYNC was none.
                _ if step == Step::Device(0) && now < self.patience => self.ask(Step::Sync, now),
                _ => self.end(Err(Failure::Silent(step.phase()))),
            },
        }
    }

    fn handle_answer(&mut self, now: Duration) {
        let (word, status) = match (self.inbox.as_slice(), self.step.has_word()) {
            (&[a, b, c, d, wire::INSYNC, status], true) => {
                (u32::from_le_bytes([a, b, c, d]), status)
            }
            (&[wire::INSYNC, status], false) => (0, status),
            (&[_, _, _, _, _, _], true) | (&[_, _], false) => {
                return self.end(Err(Failure::Garbled(self.step.phase())));
            }
            _ => return,
        };
        if status != wire::OK {
            return self.refused(status);
        }
        self.next(word, now);
    }

    fn refused(&mut self, status: u8) {
        self.end(Err(match status {
            wire::BAD_SILICON => Failure::BadSilicon,
            status => Failure::Refused(self.step.phase(), status),
        }));
    }

    /// The present command was answered with `word`.
    fn next(&mut self, word: u32, now: Duration) {
        let size = self.image.bytes().len();
        match self.step {
            Step::Sync | Step::Quiet => {}
            Step::Device(index) => {
                let device = &mut self.device;
                let fields = [
                    &mut device.protocol,
                    &mut device.board_id,
                    &mut device.revision,
                    &mut device.flash_room,
                ];
                if let Some(field) = fields.into_iter().nth(index) {
                    *field = word;
                }
                if index + 1 < wire::DEVICE.len() {
                    self.ask(Step::Device(index + 1), now);
                } else {
                    match self.check() {
                        Ok(()) => self.ask(Step::Erase, now),
                        Err(failure) => self.end(Err(failure)),
                    }
                }
            }
            Step::Erase => self.ask(Step::Program(PIECE.min(size)), now),
            Step::Program(end) if end < size => {
                self.ask(Step::Program((end + PIECE).min(size)), now);
            }
            Step::Program(_) => self.ask(Step::Crc, now),
            Step::Crc => {
                let image = crc32(self.image.bytes(), self.device.flash_room as usize);
                if word == image {
                    self.ask(Step::Boot, now);
                } else {
                    self.end(Err(Failure::Damaged { image, flash: word }));
                }
            }
            Step::Boot => self.end(Ok(self.device)),
        }
    }

    /// Whether the image belongs on this board.
    fn check(&self) -> Result<(), Failure> {
        let (device, size) = (self.device, self.image.bytes().len());
        if !(4..=5).contains(&device.protocol) {
            return Err(Failure::Protocol(device.protocol));
        }
        if device.board_id != self.image.board_id() {
            return Err(Failure::WrongBoard {
                board: device.board_id,
                image: self.image.board_id(),
            });
        }
        if size > device.flash_room as usize {
            return Err(Failure::TooLarge {
                size,
                room: device.flash_room,
            });
        }
        if !self.image.can_boot(device.flash_room) {
            return Err(Failure::NotBootable);
        }
        Ok(())
    }

    fn ask(&mut self, step: Step, now: Duration) {
        let (command, limit) = match step {
            Step::Sync | Step::Quiet => (vec![wire::GET_SYNC], SYNC_EVERY),
            Step::Device(index) => (vec![wire::GET_DEVICE, wire::DEVICE[index]], ANSWER),
            Step::Erase => (vec![wire::CHIP_ERASE], ERASE_ANSWER),
            Step::Program(end) => {
                let piece = &self.image.bytes()[(end - 1) / PIECE * PIECE..end];
                let mut command = vec![wire::PROG_MULTI, piece.len() as u8];
                command.extend(piece);
                (command, ANSWER)
            }
            Step::Crc => (vec![wire::GET_CRC], CRC_ANSWER),
            Step::Boot => (vec![wire::BOOT], ANSWER),
        };
        let command = [command, vec![wire::END]].concat();
        self.step = step;
        self.inbox.clear();
        self.outbox.push_back(command);
        self.due = now + limit;
    }

    fn end(&mut self, outcome: Result<Device, Failure>) {
        self.outbox.clear();
        self.outcome = Some(outcome);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::{FLASH_ROOM, PIXHAWK_1};

    const PATIENCE: Duration = Duration::from_secs(3);

    /// A bootloader as far as its answers go, each to one whole command.
    struct Board {
        device: [u32; 4],
        flash: Vec<u8>,
        /// What it answers to the command with this number, in place of what it should.
        answers: Vec<(usize, Vec<u8>)>,
        commands: Vec<Vec<u8>>,
    }

    impl Board {
        fn new() -> Self {
            Self {
                device: [5, PIXHAWK_1, 0, FLASH_ROOM],
                flash: Vec::new(),
                answers: Vec::new(),
                commands: Vec::new(),
            }
        }

        fn answering(nth: usize, answer: &[u8]) -> Self {
            Self {
                answers: vec![(nth, answer.to_vec())],
                ..Self::new()
            }
        }

        fn answer(&mut self, command: &[u8]) -> Vec<u8> {
            let word = |word: u32| [&word.to_le_bytes()[..], &[0x12, 0x10]].concat();
            let nth = self.commands.len();
            self.commands.push(command.to_vec());
            if let Some((_, answer)) = self.answers.iter().find(|(at, _)| *at == nth) {
                return answer.clone();
            }
            match *command {
                [0x22, parameter, 0x20] => word(self.device[usize::from(parameter) - 1]),
                [0x27, count, ref piece @ .., 0x20] if usize::from(count) == piece.len() => {
                    self.flash.extend(piece);
                    vec![0x12, 0x10]
                }
                [0x29, 0x20] => word(crc32(&self.flash, self.device[3] as usize)),
                [0x21 | 0x23 | 0x30, 0x20] => vec![0x12, 0x10],
                _ => panic!("{command:02x?}"),
            }
        }

        /// An upload to it, and how long that took.
        fn take(&mut self, image: Image) -> (Result<Device, Failure>, Duration) {
            let mut now = Duration::from_secs(100);
            let mut uploader = Uploader::new(image, now, now + PATIENCE);
            loop {
                if let Some(outcome) = uploader.outcome() {
                    return (outcome, now - Duration::from_secs(100));
                }
                let mut answer = Vec::new();
                while let Some(command) = uploader.poll_transmit() {
                    answer.extend(self.answer(&command));
                }
                // As from a line, in pieces.
                for byte in answer {
                    now += Duration::from_micros(87);
                    uploader.handle_bytes(&[byte], now);
                }
                if let Some(due) = uploader.poll_timeout()
                    && uploader.outbox.is_empty()
                {
                    now = now.max(due);
                    uploader.handle_timeout(now);
                }
            }
        }
    }

    fn image(size: usize) -> Image {
        let mut bytes: Vec<u8> = (0..size).map(|n| (n * 7) as u8).collect();
        bytes[..8].copy_from_slice(&[0, 0, 2, 0x20, 1, 0x41, 0, 8]);
        Image::new(PIXHAWK_1, bytes)
    }

    #[test]
    fn an_image_goes_on_and_is_booted_last() {
        for size in [8, 252, 253, 256, 504, 1_000] {
            let mut board = Board::new();
            let (outcome, _) = board.take(image(size));
            let expected = Device {
                protocol: 5,
                board_id: PIXHAWK_1,
                revision: 0,
                flash_room: FLASH_ROOM,
            };
            assert_eq!(outcome, Ok(expected));
            assert_eq!(board.flash, image(size).bytes());
            assert_eq!(board.commands.last().unwrap(), &[0x30, 0x20]);
            assert_eq!(board.commands.len(), 8 + size.div_ceil(PIECE));
        }
    }

    #[test]
    fn nothing_is_erased_on_a_board_that_the_image_is_not_for() {
        let on = |device| Board {
            device,
            ..Board::new()
        };
        for (mut board, failure) in [
            (
                on([5, 50, 0, FLASH_ROOM]),
                Failure::WrongBoard {
                    board: 50,
                    image: 9,
                },
            ),
            (
                on([5, 9, 0, 996]),
                Failure::TooLarge {
                    size: 1_000,
                    room: 996,
                },
            ),
            (on([3, 9, 0, FLASH_ROOM]), Failure::Protocol(3)),
            // The reset vector is 0x0800_4101.
            (
                on([5, 9, 0, 0x100]),
                Failure::TooLarge {
                    size: 1_000,
                    room: 0x100,
                },
            ),
        ] {
            assert_eq!(board.take(image(1_000)).0, Err(failure));
            assert!(
                board
                    .commands
                    .iter()
                    .all(|command| matches!(command[0], 0x21 | 0x22))
            );
        }
        let blank = Image::new(PIXHAWK_1, vec![0xFF; 64]);
        assert_eq!(Board::new().take(blank).0, Err(Failure::NotBootable));
    }

    #[test]
    fn each_refusal_is_told_from_silence_and_from_a_word_that_looks_like_it() {
        // 0 sync, 1 to 4 device, 5 erase, 6 to 9 program, 10 checksum, 11 boot.
        let phases = [
            (1..5, Phase::Identifying),
            (5..6, Phase::Erasing),
            (6..10, Phase::Programming),
            (10..11, Phase::Checking),
            (11..12, Phase::Booting),
        ];
        for (nth, phase) in phases
            .into_iter()
            .flat_map(|(nth, phase)| nth.map(move |n| (n, phase)))
        {
            let outcome = |answer: &[u8]| Board::answering(nth, answer).take(image(1_000)).0;
            assert_eq!(
                outcome(&[0x12, 0x13]),
                Err(Failure::Refused(phase, 0x13)),
                "{nth}"
            );
            assert_eq!(outcome(&[0x12, 0x14]), Err(Failure::BadSilicon), "{nth}");
            let is_asked_again = nth == 1;
            if !is_asked_again {
                assert_eq!(outcome(&[]), Err(Failure::Silent(phase)), "{nth}");
                assert_eq!(outcome(&[0x12]), Err(Failure::Silent(phase)), "{nth}");
            }
        }
        // Room of 0x1312 bytes: the word begins as a refusal does.
        let mut board = Board {
            device: [5, 9, 0, 0x1312],
            ..Board::new()
        };
        assert!(board.take(image(1_000)).0.is_ok());
        let garbled = Failure::Garbled(Phase::Erasing);
        assert_eq!(
            Board::answering(5, &[0x10, 0x12]).take(image(8)).0,
            Err(garbled)
        );
    }

    #[test]
    fn a_flash_that_is_not_the_image_is_not_booted() {
        let mut board = Board::answering(7, &[0x12, 0x10]);
        let (outcome, _) = board.take(image(1_000));
        assert!(
            matches!(outcome, Err(Failure::Damaged { .. })),
            "{outcome:?}"
        );
        assert_ne!(board.commands.last().unwrap()[0], 0x30);
    }

    #[test]
    fn a_bootloader_that_comes_late_is_waited_for_and_none_is_given_up() {
        let telemetry = [0xFE, 9, 0x12, 0x10, 1, 0xFE, 0x12];
        // What looked like an answer was telemetry: nothing answers the next question.
        let mut board = Board {
            answers: vec![(0, vec![]), (1, telemetry.to_vec()), (2, vec![])],
            ..Board::new()
        };
        assert!(board.take(image(64)).0.is_ok());
        let mut board = Board {
            answers: (0..100).map(|nth| (nth, vec![])).collect(),
            ..Board::new()
        };
        let (outcome, took) = board.take(image(64));
        assert_eq!(outcome, Err(Failure::NoBootloader));
        assert!(
            (PATIENCE..PATIENCE + SYNC_EVERY).contains(&took),
            "{took:?}"
        );
        assert!(
            board
                .commands
                .iter()
                .all(|command| command == &[0x21, 0x20])
        );
    }

    #[test]
    fn any_bytes_at_any_time_are_no_panic() {
        let mut random = 1_u32;
        for seed in 0..200 {
            let mut uploader = Uploader::new(image(600), Duration::ZERO, PATIENCE);
            random ^= seed;
            let mut now = Duration::ZERO;
            for _ in 0..400 {
                random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let byte = match random >> 29 {
                    0..3 => 0x12,
                    3..6 => 0x10,
                    _ => (random >> 16) as u8,
                };
                now += Duration::from_millis(u64::from(random >> 26));
                uploader.handle_bytes(&[byte], now);
                uploader.handle_timeout(now);
                let progress = uploader.progress();
                assert!(progress.programmed <= progress.size);
                while uploader.poll_transmit().is_some() {}
            }
        }
    }
}
