//! Firmware goes on through the bootloader, over TELEM1 or USB, and never half of it is booted.

mod others;
mod station;

use std::io::{BufRead as _, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::common::{BAUD, BYTE_NS, MS, SECOND, image};
use mavlink_node::client::{Client, GROUND_STATION};
use mavlink_node::{Address, Version};
use upload::{Device, FLASH_ROOM, Failure, Image, PIXHAWK_1, Px4File};
use virtual_pixhawk::{Builder, Connector, Firmware, Host, Pixhawk, TcpLine, UploadBootloader};
use world::{Transmission, WorldNanos};

use others::{GREETING, others};
use station::{Record, Station};

/// The command that has pixclock restart into the bootloader.
fn call(start: WorldNanos) -> Transmission {
    let node = Address {
        system: 1,
        component: 1,
    };
    Transmission {
        start,
        bytes: Client::new(GROUND_STATION, Version::V1)
            .bootloader(node)
            .to_vec(),
        baud: BAUD,
    }
}

/// What the tests need; `None` if they have to be skipped, which has been printed.
fn images() -> Option<(Firmware, UploadBootloader)> {
    let firmware = image()?;
    let bootloader = UploadBootloader::from_environment().expect("the bootloader can be read");
    Some((firmware, bootloader?))
}

/// A board behind its bootloader, with a station that uploads `image`.
fn board(
    (firmware, bootloader): &(Firmware, UploadBootloader),
    application: Vec<u8>,
    station: Station,
) -> Pixhawk {
    Builder::new(firmware.clone())
        .upload_bootloader(bootloader.clone(), application)
        .telem1(station)
        .power_on()
        .expect("the board has power")
}

/// Runs until the upload has ended, and then for as long as a greeting takes; what the board sent since.
fn finish(
    board: &mut Pixhawk,
    record: &Mutex<Record>,
) -> (Option<Result<Device, Failure>>, Vec<u8>) {
    let until = board.now().plus(30 * SECOND);
    let outcome = || {
        record
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .outcome
    };
    while outcome().is_none() && board.now() < until {
        board.run_for(10 * MS).unwrap();
    }
    board.take_received(Connector::Telem1).unwrap();
    // The bootloader leaves 100 ms after its answer.
    board.run_for(150 * MS).unwrap();
    let received = board.take_received(Connector::Telem1).unwrap();
    (
        outcome(),
        received.into_iter().map(|received| received.byte).collect(),
    )
}

const DEVICE: Device = Device {
    protocol: 5,
    board_id: PIXHAWK_1,
    revision: 0,
    flash_room: FLASH_ROOM,
};

#[test]
fn a_plug_pulled_at_any_byte_never_boots_half_an_image() {
    let Some(images) = images() else { return };
    let application = images.0.application().unwrap();
    let others = others().image;
    let begins = WorldNanos(1_500 * MS);
    let whole_upload = || {
        let station = Station::new(others.clone(), begins.plus(SECOND), Some(call(begins)));
        let record = station.record();
        (board(&images, application.clone(), station), record)
    };
    // One upload shows when each of its commands is on the line.
    let (mut first, record) = whole_upload();
    let (outcome, greeting) = finish(&mut first, &record);
    assert_eq!(outcome, Some(Ok(DEVICE)));
    assert_eq!(greeting, GREETING);
    assert!(first.gaps().unwrap().misuse.is_empty());
    let commands = std::mem::take(&mut record.lock().unwrap().commands);
    assert!(commands.len() > 27, "{}", commands.len());
    let mut random = fastrand::Rng::with_seed(20_260_101);
    let drawn = (0..40).map(|_| {
        let (start, end) = commands[random.usize(..commands.len())];
        WorldNanos(random.u64(start.0..end.0) / BYTE_NS * BYTE_NS)
    });
    let boundaries = commands.iter().flat_map(|&(start, end)| [start, end]);
    let mut cuts: Vec<_> = boundaries.chain(drawn).collect();
    cuts.sort();
    // The same again: at each cut the flash is what a board without power keeps.
    let (mut again, _) = whole_upload();
    let mut kept = Vec::new();
    for cut in cuts {
        again.run_to(cut).unwrap();
        let flash = again
            .application(application.len().next_multiple_of(4) as u32)
            .unwrap();
        if kept.last() != Some(&flash) {
            kept.push(flash);
        }
    }
    println!(
        "{} commands, {} states of the flash",
        commands.len(),
        kept.len()
    );
    assert!(kept.len() > 20);
    let mut stayed = 0;
    for flash in kept {
        let is_old = flash.starts_with(&application[..4]);
        let is_new = flash.starts_with(others.bytes());
        let station = Station::new(others.clone(), WorldNanos(300 * MS), None);
        let record = station.record();
        let mut cut_off = board(&images, flash, station);
        cut_off.run_to(WorldNanos(250 * MS)).unwrap();
        let said = cut_off.take_received(Connector::Telem1).unwrap();
        let said: Vec<u8> = said.into_iter().map(|received| received.byte).collect();
        if is_old || is_new {
            // Before the erase, or after the last word: one of the two, and whole.
            assert_eq!(said == GREETING, is_new);
            continue;
        }
        stayed += 1;
        assert_eq!(said, b"", "something was booted");
        let (outcome, greeting) = finish(&mut cut_off, &record);
        assert_eq!((outcome, greeting.as_slice()), (Some(Ok(DEVICE)), GREETING));
    }
    assert!(stayed > 18, "{stayed}");
}

#[test]
fn over_usb_pixclock_restarts_into_the_bootloader_and_another_image_goes_on() {
    let Some((firmware, bootloader)) = images() else {
        return;
    };
    let application = firmware.application().unwrap();
    // With a cable in the bootloader waits for 5 s; then the host finds pixclock.
    let begins = WorldNanos(7 * SECOND);
    let station = Station::new(others().image, begins.plus(SECOND), Some(call(begins)));
    let record = station.record();
    let mut board = Builder::new(firmware)
        .upload_bootloader(bootloader, application)
        .usb(Host::new(station))
        .power_on()
        .expect("the board has power");
    board.run_to(WorldNanos(4_900 * MS)).unwrap();
    assert!(board.take_log().unwrap().is_empty(), "it has not waited");
    board.run_to(begins).unwrap();
    assert!(!board.take_log().unwrap().is_empty());
    let products = |board: &mut Pixhawk| -> Vec<[u8; 4]> {
        let transfers = board.with_usb(Host::take_transfers).unwrap();
        let devices = transfers
            .iter()
            .filter(|transfer| transfer.setup[..4] == [0x80, 6, 0, 1]);
        let data = devices.filter_map(|transfer| transfer.data.as_ref());
        data.filter_map(|data| data.get(8..12)?.try_into().ok())
            .collect()
    };
    let before = products(&mut board);
    let (outcome, greeting) = finish(&mut board, &record);
    assert_eq!((outcome, greeting.as_slice()), (Some(Ok(DEVICE)), GREETING));
    // The bootloader, pixclock, and the bootloader again.
    const BOOTLOADER: [u8; 4] = [0xAC, 0x26, 0x11, 0x00];
    const PIXCLOCK: [u8; 4] = [0x09, 0x12, 0x01, 0x00];
    assert_eq!(
        (before.first(), before.last()),
        (Some(&BOOTLOADER), Some(&PIXCLOCK))
    );
    assert_eq!(products(&mut board).last(), Some(&BOOTLOADER));
}

#[test]
fn an_image_for_another_board_changes_nothing() {
    let Some(images) = images() else { return };
    let application = images.0.application().unwrap();
    let begins = WorldNanos(1_500 * MS);
    let foreign = Image::new(50, others().image.bytes().to_vec());
    let station = Station::new(foreign, begins.plus(SECOND), Some(call(begins)));
    let record = station.record();
    let mut board = board(&images, application.clone(), station);
    let (outcome, said) = finish(&mut board, &record);
    let failure = Failure::WrongBoard {
        board: PIXHAWK_1,
        image: 50,
    };
    assert_eq!((outcome, said.as_slice()), (Some(Err(failure)), &b""[..]));
    let length = application.len().next_multiple_of(4);
    let mut expected = application;
    expected.resize(length, 0xFF);
    assert_eq!(board.application(length as u32).unwrap(), expected);
}

/// A board in the time of this host, for programs on it.
struct Served {
    board: Pixhawk,
    port: u16,
}

impl Served {
    fn new((firmware, bootloader): &(Firmware, UploadBootloader), application: Vec<u8>) -> Self {
        let line = TcpLine::listen(0).unwrap();
        let port = line.port().unwrap();
        let builder = Builder::new(firmware.clone());
        let builder = builder.upload_bootloader(bootloader.clone(), application);
        Self {
            board: builder.telem1(line).power_on().unwrap(),
            port,
        }
    }

    /// Runs while `program` does; whether that succeeded, and what it printed.
    fn while_runs(&mut self, program: &mut Command) -> (bool, String) {
        let mut child = program
            .stdout(Stdio::piped())
            .stderr(Stdio::inherit())
            .spawn()
            .unwrap();
        let printed = printed(&mut child);
        let mut began = Instant::now();
        let mut since = self.board.now();
        loop {
            self.board.run_for(2 * MS).unwrap();
            let due = Duration::from_nanos(self.board.now().0 - since.0);
            match due.checked_sub(began.elapsed()) {
                Some(early) => thread::sleep(early),
                // What was late stays late: to catch up would shorten the bootloader's limits.
                None => (began, since) = (Instant::now(), self.board.now()),
            }
            if let Some(status) = child.try_wait().unwrap() {
                return (status.success(), printed.join().unwrap());
            }
        }
    }

    /// What runs a second later: pixclock's log says so, and has this system id.
    fn pixclock_runs_as(&mut self, system: u8) -> bool {
        self.board.take_log().unwrap();
        self.board.run_for(2 * SECOND).unwrap();
        let log = self.board.take_log().unwrap();
        let ending = format!("system {system}");
        log.iter().any(|logged| logged.line.text.ends_with(&ending))
    }
}

/// Reads on, so that the program never waits for its reader.
fn printed(child: &mut Child) -> thread::JoinHandle<String> {
    let lines = BufReader::new(child.stdout.take().unwrap()).lines();
    thread::spawn(move || {
        let lines = lines
            .map_while(Result::ok)
            .inspect(|line| println!("{line}"));
        lines.collect::<Vec<_>>().join("\n")
    })
}

/// A program that `cargo xtask board-test` names in `variable`.
fn program(variable: &str) -> Option<Command> {
    let path = std::env::var_os(variable);
    if path.is_none() {
        println!("SKIPPED: {variable} is not set; `cargo xtask board-test` sets it");
    }
    path.map(Command::new)
}

/// `file` in a folder of its own.
fn written(folder: &tempfile::TempDir, file: &Px4File) -> PathBuf {
    let path = folder.path().join("image.px4");
    std::fs::write(&path, file.to_json()).unwrap();
    path
}

/// pixclock as `cargo xtask px4` has it.
fn pixclock(firmware: &Firmware) -> Px4File {
    let word = firmware.symbol("PIXCLOCK_SYSTEM_ID").unwrap().address;
    Px4File {
        system_id_at: Some(word - 0x0800_4000),
        ..Px4File::new(firmware.application().unwrap())
    }
}

#[test]
fn xtask_uploads_to_a_running_board_and_refuses_what_does_not_belong() {
    let Some(images) = images() else { return };
    let Some(xtask) = std::env::var_os("PIXCLOCK_XTASK") else {
        println!("SKIPPED: PIXCLOCK_XTASK is not set; `cargo xtask board-test` sets it");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let mut served = Served::new(&images, images.0.application().unwrap());
    let address = format!("tcp:127.0.0.1:{}", served.port);
    let mut upload = |file: &Px4File, more: &[&str]| {
        let path = written(&folder, file);
        let mut command = Command::new(&xtask);
        served.while_runs(command.arg("upload").arg(&address).arg(path).args(more))
    };
    let foreign = Px4File {
        image: Image::new(50, others().image.bytes().to_vec()),
        ..others()
    };
    assert!(!upload(&foreign, &[]).0);
    // The board is in its bootloader now, as the refusal has left it.
    let file = pixclock(&images.0);
    let (has_succeeded, printed) = upload(&file, &["--system-id", "7"]);
    assert!(
        has_succeeded && printed.contains("programmed, checked and booted"),
        "{printed}"
    );
    assert!(served.pixclock_runs_as(7));
    let mut status = Command::new(&xtask);
    let (has_succeeded, printed) = served.while_runs(status.args(["status", &address, "--json"]));
    assert!(
        has_succeeded && printed.contains("\"variant\": \"pixclock\""),
        "{printed}"
    );
    let mut upload = |file: &Px4File| {
        let path = written(&folder, file);
        let mut command = Command::new(&xtask);
        served.while_runs(command.arg("upload").arg(&address).arg(path))
    };
    let (has_succeeded, printed) = upload(&others());
    assert!(
        has_succeeded && printed.contains("system 7 restarts"),
        "{printed}"
    );
}

#[test]
fn px4s_own_uploader_does_the_same() {
    let Some(images) = images() else { return };
    let Some(mut python) = program("PIXCLOCK_UPLOADER_PYTHON") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let mut served = Served::new(&images, others().image.bytes()[..4].to_vec());
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../px_uploader/upload.py");
    let path = written(&folder, &pixclock(&images.0));
    python.arg(script).arg(served.port.to_string()).arg(path);
    assert!(served.while_runs(&mut python).0);
    assert!(served.pixclock_runs_as(1));
}
