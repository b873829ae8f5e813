//! All that differs between the systems that a verb may run on: Linux, macOS and Windows.

use std::io;
use std::path::Path;
use std::process::{Child, Command, ExitCode};

use anyhow::{Context, Result};

/// What a serial line is called here.
pub const SERIAL_LINE: &str = if cfg!(windows) {
    "serial:COM3:115200"
} else if cfg!(target_os = "macos") {
    "serial:/dev/tty.usbmodem1101:115200"
} else {
    "serial:/dev/ttyACM0:115200"
};

/// Whether there is a serial port of that name. On Windows it is no file.
pub fn has_serial_port(name: &str) -> bool {
    if cfg!(windows) {
        let ports = serialport::available_ports().unwrap_or_default();
        return ports
            .iter()
            .any(|port| port.port_name.eq_ignore_ascii_case(name));
    }
    Path::new(name).exists()
}

/// Becomes a tool: it takes over this process with its id, so that whoever signals or waits for the one
/// that was started has the tool itself. Returns only the reason why it cannot be started.
#[cfg(unix)]
pub fn become_it(command: &mut Command) -> Result<ExitCode> {
    use std::os::unix::process::CommandExt as _;
    let error = command.exec();
    Err(error).with_context(|| format!("cannot start {command:?}"))
}

/// Runs a tool to its end and ends as it does. Ctrl-C reaches both, and is the tool's to handle.
#[cfg(not(unix))]
pub fn become_it(command: &mut Command) -> Result<ExitCode> {
    ctrlc::set_handler(|| {})?;
    let ended = command.status();
    let ended = ended.with_context(|| format!("cannot start {command:?}"))?;
    let code = ended.code().and_then(|code| u8::try_from(code).ok());
    Ok(ExitCode::from(code.unwrap_or(1)))
}

/// Keeps Ctrl-C from a program that is to be started: it is ours to handle.
pub fn keep_ctrl_c_from(command: &mut Command) -> &mut Command {
    #[cfg(unix)]
    {
        use std::os::unix::process::CommandExt as _;
        command.process_group(0)
    }
    #[cfg(windows)]
    {
        use std::os::windows::process::CommandExt as _;
        /// CREATE_NEW_PROCESS_GROUP of the Windows API's process creation flags.
        const NEW_GROUP: u32 = 0x200;
        command.creation_flags(NEW_GROUP)
    }
    #[cfg(not(any(unix, windows)))]
    command
}

/// Where a virtual environment of Python's has its program.
pub const IN_VENV: &str = if cfg!(windows) {
    "Scripts/python.exe"
} else {
    "bin/python"
};

/// Ends a program as Ctrl-C does; where no signal can be sent it is ended at once.
///
/// # Errors
///
/// It has ended by itself, or may not be ended.
pub fn interrupt(child: &mut Child) -> io::Result<()> {
    if cfg!(unix) {
        let id = child.id().to_string();
        return Command::new("kill").args(["-INT", &id]).status().map(drop);
    }
    child.kill()
}

/// The name of a program's file.
pub fn program(name: &str) -> String {
    format!("{name}{}", std::env::consts::EXE_SUFFIX)
}
