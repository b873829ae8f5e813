//! `qemu`: the firmware on QEMU, in real time: the second opinion.
//!
//! *Purpose.* As `sim`, with an emulator that other people made.
//!
//! *Design.* QEMU connects the board's UART4 to a port of ours, where the simulated
//! receiver sits, and offers USART2 on the MAVLink port. The log comes out of its
//! standard output. One thread plays the receiver, one reads the log.
//!
//! *Limits.* No baud timing: a burst arrives as fast as the firmware reads it, at
//! any rate that the two ends may be set to. Virtual time is the host's, with its
//! scheduling noise; ticks that QEMU lost are made good and counted by the firmware.

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use anyhow::{Context, Result, bail};
use clap::Args;
use console::{LogDecoder, Screen, Verdict};
use variant::{Image, Variant};
use world::{Receiver, ReceiverSettings, Recording, Talker, WorldNanos};

use crate::image::{self, Board, Build};

/// The emulator and its machine: an STM32F405 with SysTick at 168 MHz.
const QEMU: &str = "qemu-system-arm";
const MACHINE: &str = "netduinoplus2";

/// The one command that installs QEMU on Debian and its children.
const INSTALL: &str = "apt-get install -y qemu-system-arm";

/// How long the receiver's thread waits for bytes at most, before it looks at the
/// time and at Ctrl-C again.
const PATIENCE: Duration = Duration::from_millis(20);

/// What `qemu` can be asked for.
#[derive(Args)]
pub struct QemuOptions {
    #[command(flatten)]
    run: console::Options,
    /// Install QEMU (by apt-get, as root) and end
    #[arg(long)]
    install: bool,
}

static ASKED_TO_END: AtomicBool = AtomicBool::new(false);

/// Whether QEMU is on this machine.
pub fn is_there() -> bool {
    Command::new(QEMU)
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// Runs boards on QEMU until the end of `--duration` or Ctrl-C.
///
/// # Errors
///
/// When QEMU is not there, with how to get it; when the image cannot be built or a
/// port is taken.
pub fn run(options: &QemuOptions) -> Result<ExitCode> {
    if options.install {
        image::run(Command::new("sh").args(["-c", INSTALL]))?;
        return Ok(ExitCode::SUCCESS);
    }
    if !is_there() {
        bail!(
            "{QEMU} is not on this machine; `{INSTALL}` installs it, and so does `cargo xtask qemu --install`"
        );
    }
    let options = &options.run;
    let image = match &options.image {
        Some(image) => image.clone(),
        None => build(options.variant())?,
    };
    ctrlc::set_handler(|| ASKED_TO_END.store(true, Ordering::Relaxed))?;
    let screens = thread::scope(|scope| {
        let boards: Vec<_> = (0..options.boards)
            .map(|index| {
                let image = &image;
                scope.spawn(move || run_board(options, image, index))
            })
            .collect();
        boards
            .into_iter()
            .map(|board| {
                board
                    .join()
                    .unwrap_or_else(|_| bail!("a board's thread panicked"))
            })
            .collect::<Result<Vec<_>>>()
    })?;
    if options.json {
        let boards: Vec<_> = screens.iter().map(Screen::summary).collect();
        println!("{}", serde_json::json!({ "boards": boards }));
    } else {
        for screen in &screens {
            println!("{}", screen.closing_line());
        }
    }
    let never_set = screens
        .iter()
        .any(|screen| matches!(screen.verdict(), Verdict::NeverSet));
    Ok(if never_set && options.duration().is_some() {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    })
}

/// Builds the image for QEMU.
///
/// # Errors
///
/// When the build fails.
pub fn build(variant: Variant) -> Result<PathBuf> {
    image::build(Build {
        image: Image::of(variant),
        ..Build::standard(Board::Qemu)
    })
}

/// QEMU with an image, not started yet: no window, the log on standard output.
pub fn command(image: &Path) -> Command {
    let mut qemu = Command::new(QEMU);
    qemu.args(["-machine", MACHINE, "-display", "none", "-monitor", "none"])
        .args(["-semihosting-config", "enable=on,target=native"])
        .arg("-kernel")
        .arg(image)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        // Ctrl-C is ours to handle.
        .process_group(0);
    qemu
}

/// One board with its receiver, to the end.
fn run_board(options: &console::Options, image: &Path, index: u16) -> Result<Screen> {
    let elf = std::fs::read(image).with_context(|| format!("cannot read {}", image.display()))?;
    let mut decoder = LogDecoder::new(&elf)?;
    let mut screen = Screen::new(options, index);
    let port = options.mavlink_port_of(index);
    let mavlink = format!("tcp:127.0.0.1:{port},server=on,wait=off");
    let (mut qemu, line) = power_on(&mut command(image), &mavlink)?;
    if !options.json {
        println!(
            "QEMU {MACHINE} on tcp:127.0.0.1:{port}, {}, tick {} µs",
            options.variant().name(),
            options.variant().tick_us()
        );
    }
    let started = Instant::now();
    let mut talker = talker(options, index)?;
    let mut log = qemu.0.stdout.take().context("QEMU has no output")?;
    let is_over = || {
        ASKED_TO_END.load(Ordering::Relaxed)
            || options
                .duration()
                .is_some_and(|limit| started.elapsed() >= limit)
    };
    thread::scope(|scope| {
        let reading = scope.spawn(|| {
            let mut buffer = [0; 4096];
            while let Ok(count) = log.read(&mut buffer) {
                let Some(bytes) = buffer.get(..count).filter(|bytes| !bytes.is_empty()) else {
                    break;
                };
                for line in decoder.push(bytes) {
                    screen.show(started.elapsed(), &line);
                }
            }
        });
        let played = play(&mut talker, line, started, is_over);
        // The log ends with it.
        drop(qemu);
        let read = reading.join();
        played?;
        read.or_else(|_| bail!("reading the log failed"))
    })?;
    Ok(screen)
}

/// Starts `qemu` with its USART2 at `mavlink`, and returns it with the line of its UART4.
///
/// # Errors
///
/// When QEMU cannot be started or ends at once, a port being taken.
pub fn power_on(qemu: &mut Command, mavlink: &str) -> Result<(Running, TcpStream)> {
    let receiver_port = TcpListener::bind("127.0.0.1:0")?;
    let gps = format!("tcp:{}", receiver_port.local_addr()?);
    // In QEMU's order: USART1, 2, 3, UART4.
    let mut qemu = Running(
        qemu.args(["-serial", "null", "-serial", mavlink])
            .args(["-serial", "null", "-serial", &gps])
            .spawn()
            .context("cannot start QEMU")?,
    );
    receiver_port.set_nonblocking(true)?;
    loop {
        match receiver_port.accept() {
            Ok((line, _)) => {
                line.set_nonblocking(false)?;
                return Ok((qemu, line));
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(error) => return Err(error.into()),
        }
        if qemu.0.try_wait()?.is_some() {
            bail!("QEMU ended by itself, having said why; is a port taken?");
        }
        thread::sleep(PATIENCE);
    }
}

/// A QEMU that ends when it is dropped.
pub struct Running(pub Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Who talks on a board's GPS line.
enum Player {
    Receiver(Box<Receiver>),
    Recording(Recording),
}

impl Player {
    /// QEMU has no rates: whatever the board is set to is understood.
    fn baud(&self) -> u32 {
        match self {
            Self::Receiver(receiver) => receiver.port().baud,
            Self::Recording(_) => 115_200,
        }
    }

    fn talker(&mut self) -> &mut dyn Talker {
        match self {
            Self::Receiver(receiver) => &mut **receiver,
            Self::Recording(recording) => recording,
        }
    }
}

fn talker(options: &console::Options, index: u16) -> Result<Player> {
    if let Some(path) = &options.ubx {
        let bytes =
            std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
        return match Recording::new(&bytes) {
            Ok(recording) => Ok(Player::Recording(recording)),
            Err(none) => bail!("{}: {none}", path.display()),
        };
    }
    let utc_ns = match options.start {
        Some(start) => start.0,
        None => {
            let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH)?;
            i64::try_from(now.as_nanos())?
        }
    };
    let mut settings = ReceiverSettings::new(utc_ns);
    settings.seed = u64::from(index);
    Ok(Player::Receiver(Box::new(Receiver::new(settings))))
}

/// Plays a receiver like `settings` in real time on `line` until `is_over`.
///
/// # Errors
///
/// When QEMU has ended.
pub fn play_receiver(
    settings: ReceiverSettings,
    line: TcpStream,
    started: Instant,
    is_over: impl Fn() -> bool,
) -> Result<()> {
    let mut player = Player::Receiver(Box::new(Receiver::new(settings)));
    play(&mut player, line, started, is_over)
}

/// Plays the receiver in real time until `is_over`.
fn play(
    player: &mut Player,
    mut line: TcpStream,
    started: Instant,
    is_over: impl Fn() -> bool,
) -> Result<()> {
    let now = || WorldNanos(u64::try_from(started.elapsed().as_nanos()).unwrap_or(u64::MAX));
    let mut buffer = [0; 256];
    while !is_over() {
        while let Some(burst) = player.talker().poll(now()) {
            if line.write_all(&burst.bytes).is_err() {
                bail!("QEMU ended by itself");
            }
        }
        let until_next = player.talker().next_event().map_or(PATIENCE, |next| {
            Duration::from_nanos(next.0.saturating_sub(now().0))
        });
        let patience = until_next.clamp(Duration::from_millis(1), PATIENCE);
        line.set_read_timeout(Some(patience))?;
        match line.read(&mut buffer) {
            Ok(0) => bail!("QEMU ended by itself"),
            Ok(count) => {
                let baud = player.baud();
                let heard = buffer.get(..count).unwrap_or_default();
                player.talker().handle_bytes(now(), baud, heard);
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(_) => bail!("QEMU ended by itself"),
        }
    }
    Ok(())
}
