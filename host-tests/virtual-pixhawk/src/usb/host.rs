//! A host with a cable, and a program at its port.
//!
//! *Purpose.* Enumerates the device as Linux does, sets its line up, and moves what a [`Talker`] sends and what the
//! board answers.
//!
//! *Design.* The bus is taken one transaction at a time, each as long as its bits at 12 Mbit/s. What the program sends
//! begins with the next frame of 1 ms. An endpoint that answers NAK is asked again when the driver has touched a
//! register, and not before: nothing happens on an idle bus that the board could see.
//!
//! *Limits.* No hub, no errors on the wire; start-of-frame packets exist in the count of ms alone.

use std::collections::VecDeque;

use world::{Talker, WorldNanos};

use super::core::{Answer, Core};
use crate::wire::ReceivedByte;

const MS: u64 = 1_000_000;
/// What a packet takes beside its bytes, and a byte takes: token, handshake, gaps; 8 bits at 12 Mbit/s.
const OVERHEAD_BYTES: u64 = 13;
const BYTE_NS: u64 = 667;
/// An endpoint that answered NAK is asked again within this time of being ready.
const RETRY_NS: u64 = 4_000;
/// Bytes of a packet.
const PACKET: usize = 64;
/// A port's buffer holds two packets, and is handed over when it is full or a short packet comes.
const BUFFER: usize = 2 * PACKET;
/// The rate that a talker is given for what comes over USB.
const BAUD: u32 = 8_000_000;
/// The address that the host gives.
const ADDRESS: u32 = 5;

/// A control transfer that is over: its SETUP, and what the device answered; none for a stall.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Transfer {
    /// The SETUP's eight bytes.
    pub setup: [u8; 8],
    /// What was read.
    pub data: Option<Vec<u8>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Setup,
    Input,
    Output,
    StatusIn,
    StatusOut,
}

#[derive(Clone, Debug)]
enum Step {
    Pause(u64),
    BeginReset,
    EndReset,
    Control {
        setup: [u8; 8],
        data: Vec<u8>,
        stage: Stage,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pipe {
    Control,
    Out,
    In,
}

/// The host.
pub struct Host {
    talker: Box<dyn Talker + Send>,
    /// A cable connects it with the board.
    pub(super) is_plugged: bool,
    is_connected: bool,
    has_address: bool,
    is_configured: bool,
    is_suspended: bool,
    /// A program has the port open, and reads.
    is_open: bool,
    is_reading: bool,
    steps: VecDeque<Step>,
    /// The bus is free then, or the pause over.
    free: u64,
    running: Option<Pipe>,
    /// Pipes that were answered NAK.
    refused: [bool; 3],
    out: VecDeque<u8>,
    /// How long the frame has lasted in which the board gets power.
    frame_began_before: u64,
    /// The frame in which `out` begins to leave.
    out_from: u64,
    buffer: Vec<u8>,
    received: Vec<ReceivedByte>,
    transfers: Vec<Transfer>,
    endpoints: (usize, usize),
    last_was_in: bool,
    sent: u64,
}

impl std::fmt::Debug for Host {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Host")
            .field("is_plugged", &self.is_plugged)
            .field("is_connected", &self.is_connected)
            .field("is_configured", &self.is_configured)
            .field("steps", &self.steps.front())
            .field("refused", &self.refused)
            .finish_non_exhaustive()
    }
}

const fn control(setup: [u8; 8], data: Vec<u8>) -> Step {
    Step::Control {
        setup,
        data,
        stage: Stage::Setup,
    }
}

/// GET_DESCRIPTOR of a kind, at most `length` bytes.
const fn descriptor(kind: u8, index: u8, length: u8) -> Step {
    let language = if kind == 3 && index != 0 {
        [0x09, 0x04]
    } else {
        [0, 0]
    };
    control(
        [0x80, 6, index, kind, language[0], language[1], length, 0],
        Vec::new(),
    )
}

/// What a host asks a device that has just appeared.
fn enumeration() -> VecDeque<Step> {
    VecDeque::from([
        Step::Pause(100 * MS),
        Step::BeginReset,
        Step::Pause(10 * MS),
        Step::EndReset,
        Step::Pause(10 * MS),
        descriptor(1, 0, 64),
        Step::BeginReset,
        Step::Pause(10 * MS),
        Step::EndReset,
        Step::Pause(10 * MS),
        control([0, 5, ADDRESS as u8, 0, 0, 0, 0, 0], Vec::new()),
        Step::Pause(2 * MS),
        descriptor(1, 0, 18),
        descriptor(2, 0, 9),
        descriptor(2, 0, 255),
        descriptor(3, 0, 255),
        descriptor(3, 2, 255),
        descriptor(3, 1, 255),
        descriptor(3, 3, 255),
        control([0, 9, 1, 0, 0, 0, 0, 0], Vec::new()),
    ])
}

impl Host {
    /// With `talker` as the program that has the port open; the cable is in.
    #[must_use]
    pub fn new(talker: impl Talker + Send + 'static) -> Self {
        Self {
            talker: Box::new(talker),
            is_plugged: true,
            is_connected: false,
            has_address: false,
            is_configured: false,
            is_suspended: false,
            is_open: true,
            is_reading: true,
            steps: VecDeque::new(),
            free: 0,
            running: None,
            refused: [false; 3],
            out: VecDeque::new(),
            frame_began_before: 0,
            out_from: 0,
            buffer: Vec::new(),
            received: Vec::new(),
            transfers: Vec::new(),
            endpoints: (1, 2),
            last_was_in: false,
            sent: 0,
        }
    }

    /// The same with no cable in.
    #[must_use]
    pub const fn unplugged(mut self) -> Self {
        self.is_plugged = false;
        self
    }

    /// The same with frames of 1 ms of which one has lasted for `ns` when the board gets power: boards at one
    /// controller share its frames, whenever each gets power.
    #[must_use]
    pub const fn in_frame(mut self, ns: u64) -> Self {
        self.frame_began_before = ns % MS;
        self
    }

    /// Puts the cable in, or pulls it.
    pub const fn plug(&mut self, is_plugged: bool) {
        self.is_plugged = is_plugged;
    }

    /// The program opens the port, or closes it.
    pub fn open(&mut self, is_open: bool) {
        if self.is_open != is_open {
            self.is_open = is_open;
            if self.is_configured {
                self.steps.push_back(lines(is_open));
            }
        }
    }

    /// The program reads, or leaves what comes unread. A port that is not read asks for nothing.
    pub const fn read(&mut self, is_reading: bool) {
        self.is_reading = is_reading;
        self.refused[Pipe::In as usize] = false;
    }

    /// The program sends `bytes` now.
    pub fn send(&mut self, now: WorldNanos, bytes: &[u8]) {
        self.queue(now.0, bytes);
    }

    /// Bytes that the board has not taken yet.
    #[must_use]
    pub fn unsent(&self) -> usize {
        self.out.len()
    }

    /// Bytes that the board has taken.
    #[must_use]
    pub const fn sent(&self) -> u64 {
        self.sent
    }

    /// Whether the device is configured.
    #[must_use]
    pub const fn is_configured(&self) -> bool {
        self.is_configured
    }

    /// What the board has sent since the last call.
    pub fn take_received(&mut self) -> Vec<ReceivedByte> {
        std::mem::take(&mut self.received)
    }

    /// Control transfers that have ended since the last call.
    pub fn take_transfers(&mut self) -> Vec<Transfer> {
        std::mem::take(&mut self.transfers)
    }

    pub(super) fn suspend(&mut self, core: &mut Core, is_suspended: bool, now: u64) {
        if self.is_configured && self.is_suspended != is_suspended {
            self.is_suspended = is_suspended;
            self.running = None;
            if is_suspended {
                core.suspend();
            } else {
                core.resume();
                self.free = now + 20 * MS;
            }
        }
    }

    /// The driver has touched a register: who was refused may be answered.
    pub(super) fn handle_change(&mut self, now: u64) {
        if self.refused.iter().any(|refused| *refused) {
            self.refused = [false; 3];
            if self.running.is_none() {
                self.free = self.free.max(now + RETRY_NS);
            }
        }
    }

    /// When it has something to do next.
    pub(super) fn next(&self, core: &Core) -> Option<u64> {
        let talk = self.talker.next_event().map(|at| at.0);
        let is_connected = self.is_plugged && core.is_connected();
        let bus = if self.is_plugged != core.has_vbus() || self.is_connected != is_connected {
            Some(0)
        } else if self.is_suspended || !self.is_connected {
            None
        } else if self.running.is_some() {
            Some(self.free)
        } else {
            self.choose().map(|(_, from)| from.max(self.free))
        };
        talk.into_iter().chain(bus).min()
    }

    /// Does what is due.
    pub(super) fn act(&mut self, now: u64, core: &mut Core) {
        while let Some(transmission) = self.talker.poll(WorldNanos(now)) {
            if self.is_configured {
                self.queue(transmission.start.0, &transmission.bytes);
            }
        }
        core.set_vbus(self.is_plugged);
        let is_connected = self.is_plugged && core.is_connected();
        if is_connected != self.is_connected {
            self.forget(now);
            self.is_connected = is_connected;
            if is_connected {
                self.steps = enumeration();
            }
        }
        if !self.is_connected || self.is_suspended || now < self.free {
            return;
        }
        if let Some(pipe) = self.running.take() {
            self.complete(now, pipe, core);
        }
        self.begin(now, core);
    }

    fn forget(&mut self, now: u64) {
        self.has_address = false;
        self.is_configured = false;
        self.is_suspended = false;
        self.steps.clear();
        self.running = None;
        self.refused = [false; 3];
        self.out.clear();
        self.buffer.clear();
        self.free = now;
    }

    fn queue(&mut self, at: u64, bytes: &[u8]) {
        if self.out.is_empty() {
            let shift = self.frame_began_before;
            self.out_from = ((at + shift) / MS + 1) * MS - shift;
        }
        self.out.extend(bytes);
    }

    /// The pipe that is served next, and when it may begin.
    fn choose(&self) -> Option<(Pipe, u64)> {
        let may = |pipe: Pipe| !self.refused[pipe as usize];
        if !self.steps.is_empty() {
            return may(Pipe::Control).then_some((Pipe::Control, 0));
        }
        let out = (self.is_configured && !self.out.is_empty() && may(Pipe::Out))
            .then_some((Pipe::Out, self.out_from));
        let reads = self.is_configured && self.is_open && self.is_reading;
        let input = (reads && may(Pipe::In)).then_some((Pipe::In, 0));
        let both = if self.last_was_in {
            [out, input]
        } else {
            [input, out]
        };
        both.into_iter()
            .flatten()
            .min_by_key(|(_, from)| *from.max(&self.free))
    }

    /// Begins the next transaction, or does what needs none.
    fn begin(&mut self, now: u64, core: &mut Core) {
        let Some((pipe, from)) = self.choose() else {
            return;
        };
        if from > now {
            return;
        }
        let bytes = match pipe {
            Pipe::Control => match self.steps.front() {
                Some(Step::Pause(ns)) => {
                    self.free = now + ns;
                    self.steps.pop_front();
                    return;
                }
                Some(Step::BeginReset) => {
                    core.begin_reset();
                    self.has_address = false;
                    self.steps.pop_front();
                    return;
                }
                Some(Step::EndReset) => {
                    core.end_reset();
                    self.steps.pop_front();
                    return;
                }
                _ => 8,
            },
            Pipe::Out => self.out.len().min(PACKET),
            Pipe::In => 8,
        };
        self.running = Some(pipe);
        self.free = now + (bytes as u64 + OVERHEAD_BYTES) * BYTE_NS;
    }

    /// The transaction on `pipe` is over.
    fn complete(&mut self, now: u64, pipe: Pipe, core: &mut Core) {
        let answer = match pipe {
            // Another device is asked.
            _ if self.has_address && core.address() != ADDRESS => Answer::Silence,
            Pipe::Control => self.control(core),
            Pipe::Out => {
                let packet: Vec<u8> = self.out.iter().take(PACKET).copied().collect();
                let answer = core.output(self.endpoints.0, &packet);
                if matches!(answer, Answer::Ack(_)) {
                    self.out.drain(..packet.len());
                    self.sent += packet.len() as u64;
                }
                self.last_was_in = false;
                answer
            }
            Pipe::In => {
                let answer = core.input(self.endpoints.1);
                self.last_was_in = true;
                if let Answer::Ack(bytes) = &answer {
                    // The bytes take their time, too.
                    self.free = now + bytes.len() as u64 * BYTE_NS;
                    self.take_in(WorldNanos(self.free), bytes);
                }
                answer
            }
        };
        self.refused[pipe as usize] = matches!(answer, Answer::Nak | Answer::Silence);
    }

    fn take_in(&mut self, at: WorldNanos, bytes: &[u8]) {
        self.buffer.extend(bytes);
        if bytes.len() < PACKET || self.buffer.len() >= BUFFER {
            let bytes = std::mem::take(&mut self.buffer);
            self.received
                .extend(bytes.iter().map(|&byte| ReceivedByte { at, byte }));
            if !bytes.is_empty() {
                self.talker.handle_bytes(at, BAUD, &bytes);
            }
        }
    }

    /// A transaction of the control transfer that runs.
    fn control(&mut self, core: &mut Core) -> Answer {
        let Some(Step::Control { setup, data, stage }) = self.steps.front_mut() else {
            return Answer::Silence;
        };
        let (setup, length) = (
            *setup,
            usize::from(u16::from_le_bytes([setup[6], setup[7]])),
        );
        let is_in = setup[0] & 0x80 != 0;
        let answer = match stage {
            Stage::Setup => {
                core.setup(setup);
                Answer::Ack(Vec::new())
            }
            Stage::Input | Stage::StatusIn => core.input(0),
            Stage::Output => core.output(0, data),
            Stage::StatusOut => core.output(0, &[]),
        };
        let Answer::Ack(bytes) = &answer else {
            if answer == Answer::Stall {
                self.end_control(setup, None);
            }
            return answer;
        };
        *stage = match stage {
            Stage::Setup if length == 0 => Stage::StatusIn,
            Stage::Setup if is_in => Stage::Input,
            Stage::Setup => Stage::Output,
            Stage::Output => Stage::StatusIn,
            Stage::Input => {
                data.extend(bytes);
                if bytes.len() == PACKET && data.len() < length {
                    Stage::Input
                } else {
                    Stage::StatusOut
                }
            }
            Stage::StatusIn | Stage::StatusOut => {
                let data = std::mem::take(data);
                self.end_control(setup, Some(data));
                return answer;
            }
        };
        answer
    }

    fn end_control(&mut self, setup: [u8; 8], data: Option<Vec<u8>>) {
        self.steps.pop_front();
        match (setup[0], setup[1], &data) {
            (0x80, 6, Some(data)) if setup[3] == 2 => self.find_endpoints(data),
            (0, 5, Some(_)) => self.has_address = true,
            (0, 9, Some(_)) => {
                self.is_configured = true;
                // 115 200 Bd, one stop bit, no parity, eight bits.
                let coding = vec![0x00, 0xC2, 0x01, 0x00, 0, 0, 8];
                self.steps
                    .push_back(control([0x21, 0x20, 0, 0, 0, 0, 7, 0], coding));
                self.steps
                    .push_back(control([0xA1, 0x21, 0, 0, 0, 0, 7, 0], Vec::new()));
                self.steps.push_back(lines(self.is_open));
            }
            _ => {}
        }
        self.transfers.push(Transfer { setup, data });
    }

    /// The bulk endpoints of a configuration.
    fn find_endpoints(&mut self, mut descriptors: &[u8]) {
        while let [length, kind, ..] = *descriptors {
            if let (5, [_, _, address, attributes, ..]) = (kind, descriptors)
                && attributes & 3 == 2
            {
                let nth = usize::from(address & 3);
                if address & 0x80 == 0 {
                    self.endpoints.0 = nth;
                } else {
                    self.endpoints.1 = nth;
                }
            }
            descriptors = descriptors
                .get(usize::from(length.max(1))..)
                .unwrap_or_default();
        }
    }
}

/// SET_CONTROL_LINE_STATE: DTR and RTS.
const fn lines(is_open: bool) -> Step {
    let state = if is_open { 3 } else { 0 };
    control([0x21, 0x22, state, 0, 0, 0, 0, 0], Vec::new())
}
