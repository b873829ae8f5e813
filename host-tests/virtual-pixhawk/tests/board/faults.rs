//! Faults, provoked from outside: shown by the LED, recorded, and reported after the restart; and the board
//! that stops instead of restarting for ever.

use crate::common::{BAUD, MS, SECOND, image, messages};
use console::Level;
use mavlink_node::client::{Client, Message};
use mavlink_node::{Address, Parameter, Version};
use virtual_pixhawk::{Builder, Connector, CrystalStart, Firmware, Logged, Pixhawk, Script};
use world::{Transmission, WorldNanos};

/// GPIOE's mode and output data; the LED is at its pin 12, lit when low.
const GPIOE: u64 = 0x4002_1000;
const LED: u32 = 12;

/// Registers of the core: the second words of ISER and ISPR, the control of SysTick, and ICSR.
const ISER2: u32 = 0xE000_E108;
const ISPR2: u32 = 0xE000_E208;
const SYST_CSR: u32 = 0xE000_E010;
const ICSR: u32 = 0xE000_ED04;

/// Runs each ms, at the alarm's priority.
const ALARM: &str = "firmware::start::on_alarm";
/// Runs within the status line's frame.
const IN_A_FRAME: &str = "firmware::tasks::status::count";
/// The control block of the log, and in it the offsets of the board and the probe, and the flags.
const RTT: &str = "_SEGGER_RTT";
const RTT_SIZE: u32 = 8 * 1_024;
const RTT_WRITE: usize = 36;
const RTT_READ: u32 = 40;
const RTT_FLAGS: u32 = 44;
/// `SEGGER_RTT_MODE_BLOCK_IF_FULL`.
const BLOCK_IF_FULL: u32 = 2;
/// Takes the peripherals, which is possible once.
const MAIN: &str = "firmware::start::__cortex_m_rt_main";

/// UDF: undefined for ever.
const UNDEFINED: u16 = 0xDE00;
/// `bx lr`: a function that does nothing.
const RETURN: u16 = 0x4770;
/// Stays where it is, for ever.
const STAYS: u16 = 0xE7FE;
/// Masks all interrupts, and stays where it is.
const MASKED_FOR_EVER: [u16; 2] = [0xB672, 0xE7FE];
/// Stores below SRAM, at 0x1FFF_FFFC, where no memory is.
const STORE_TO_NOWHERE: [u16; 4] = [0x2020, 0x0600, 0x3804, 0x6000];
/// Where no memory is, as a chip has it.
const BELOW_SRAM: (u32, u32) = (0x1FFF_C008, 0x2000_0000);
/// Pushes nine registers and begins again.
const RECURSION: [u16; 2] = [0xB5FF, 0xE7FD];

/// From one look at the LED to the next.
const LOOK: u64 = 10 * MS;

/// When a fault is provoked.
const PROVOKED: WorldNanos = WorldNanos(2_500 * MS);

const BOARD: Address = Address {
    system: 1,
    component: 1,
};

fn is_lit(board: &mut Pixhawk) -> bool {
    let is_output = board.peek(GPIOE).unwrap() >> (2 * LED) & 0b11 == 0b01;
    let is_high = board.peek(GPIOE + 0x14).unwrap() >> LED & 1 == 1;
    is_output && !is_high
}

/// How long the LED is lit and dark in turns, in ms, from now on and beginning with lit.
fn flashes(board: &mut Pixhawk, for_ns: u64) -> Vec<u64> {
    let end = board.now().plus(for_ns);
    let mut runs: Vec<(bool, u64)> = Vec::new();
    while board.now() < end {
        let lit = is_lit(board);
        match runs.last_mut() {
            Some((was_lit, ns)) if *was_lit == lit => *ns += LOOK,
            _ => runs.push((lit, LOOK)),
        }
        board.run_for(LOOK).unwrap();
    }
    let runs = runs.into_iter().skip_while(|(lit, _)| !lit);
    runs.map(|(_, ns)| ns / MS).collect()
}

fn is_about(found: &[u64], expected: &[u64]) -> bool {
    found.len() >= expected.len()
        && found
            .iter()
            .zip(expected)
            .all(|(found, expected)| found.abs_diff(*expected) <= 20)
}

/// Runs until the LED has flashed twice shortly, and long for 0.3 s of the third time; when that began.
fn ended_group(board: &mut Pixhawk, limit: WorldNanos) -> Option<WorldNanos> {
    let mut changes = vec![board.now()];
    let mut was_lit = false;
    while board.now() < limit {
        let now = board.now();
        let lit = is_lit(board);
        if lit != was_lit {
            changes.push(now);
            was_lit = lit;
        }
        if let [.., first, second, third, fourth, last] = changes[..] {
            let apart = |from: WorldNanos, to: WorldNanos| (to.0 - from.0) / MS;
            let found = [
                apart(first, second),
                apart(second, third),
                apart(third, fourth),
                apart(fourth, last),
                apart(last, now),
            ];
            if lit && is_about(&found, &[100, 100, 100, 100, 300]) {
                return Some(first);
            }
        }
        board.run_for(LOOK).unwrap();
    }
    None
}

/// Runs until the LED is dark: what is found a little later would lengthen a flash of before.
fn wait_for_dark(board: &mut Pixhawk) {
    while is_lit(board) {
        board.run_for(LOOK).unwrap();
    }
}

/// `b.w` has not the range everywhere: r0 is loaded with the address, and jumped to.
fn jump_to(address: u32) -> [u16; 5] {
    let half = |first: u16, value: u32| {
        let (imm4, i) = ((value >> 12) as u16, (value >> 11 & 1) as u16);
        let (imm3, imm8) = ((value >> 8 & 0b111) as u16, (value & 0xFF) as u16);
        [first | i << 10 | imm4, imm3 << 12 | imm8]
    };
    let address = address | 1;
    let [first, second] = half(0xF240, address & 0xFFFF);
    let [third, fourth] = half(0xF2C0, address >> 16);
    [first, second, third, fourth, 0x4700]
}

/// The function that runs the task of the module `of`.
fn task(of: &str) -> String {
    format!(
        "<embassy_executor::raw::TaskStorage<firmware::tasks::{of}::__run_task::__run_task_inner_function::{{closure#0}}>>::poll"
    )
}

/// A board that is asked for the parameter at 7 s.
fn board(firmware: &Firmware) -> Pixhawk {
    let ground = Address {
        system: 255,
        component: 190,
    };
    let mut client = Client::new(ground, Version::V2);
    let ask = Transmission {
        start: WorldNanos(7 * SECOND),
        bytes: client.parameter(BOARD, Parameter::Fault).to_vec(),
        baud: BAUD,
    };
    Builder::new(firmware.clone())
        .telem1(Script::new([ask]))
        .power_on()
        .unwrap()
}

/// What is provoked, and what has to be reported of it.
struct Case {
    /// What the log says at once; nothing when nobody is left to say it.
    at_once: Option<String>,
    /// How the log of the next run begins to report it.
    later: String,
    text: String,
    number: f32,
}

fn texts_and_value(board: &mut Pixhawk) -> (Vec<String>, Option<f32>) {
    let received = board.take_received(Connector::Telem1).unwrap();
    let mut texts = Vec::new();
    let mut value = None;
    for (_, what) in messages(&received) {
        match what {
            Message::StatusText { text, .. } => texts.push(text.as_str().to_owned()),
            Message::Parameter {
                name, value: found, ..
            } if Parameter::named(name) == Some(Parameter::Fault) => value = Some(found),
            _ => {}
        }
    }
    (texts, value)
}

fn errors(log: &[Logged]) -> Vec<&str> {
    log.iter()
        .filter(|logged| logged.line.level == Some(Level::Error))
        .map(|logged| logged.line.text.as_str())
        .collect()
}

/// Provokes a fault once, and judges what is shown and reported.
fn judge(
    firmware: &Firmware,
    case: &Case,
    (is_shown_within, is_over_within): (Option<u64>, u64),
    provoke: impl FnOnce(&mut Pixhawk) -> Option<(String, Vec<u16>)>,
) {
    let Case { later, text, .. } = case;
    let mut board = board(firmware);
    board.run_to(PROVOKED).unwrap();
    assert!(board.restarts().unwrap().is_empty());
    board.take_log().unwrap();
    let patched = provoke(&mut board);
    let provoked = board.now();
    if let Some(within) = is_shown_within {
        let began = ended_group(&mut board, provoked.plus(within + SECOND));
        let began = began.unwrap_or_else(|| panic!("{text}: no group of flashes"));
        let after = began.0 - provoked.0;
        assert!(after <= within + 2 * LOOK, "{text}: {} ms", after / MS);
    } else {
        let end = provoked.plus(is_over_within);
        // Looked at this often, the next run has not come as far as what was patched.
        while board.restarts().unwrap().is_empty() && board.now() < end {
            board.run_for(MS / 10).unwrap();
        }
    }
    if let Some((name, before)) = patched {
        // Only the first run meets it.
        board.patch(&name, &before).unwrap();
    }
    board.run_to(provoked.plus(is_over_within + LOOK)).unwrap();
    let restarts = board.restarts().unwrap();
    assert_eq!(restarts.len(), 1, "{text}: {restarts:?}");
    board.run_to(WorldNanos(8 * SECOND)).unwrap();
    let log = board.take_log().unwrap();
    let errors = errors(&log);
    if let Some(at_once) = &case.at_once {
        assert!(
            errors.iter().any(|line| line.starts_with(at_once)),
            "{at_once}: {errors:#?}"
        );
    }
    let later = format!("before the restart: {later}");
    assert!(
        errors.iter().any(|line| line.starts_with(&later)),
        "{later}: {errors:#?}"
    );
    let (texts, value) = texts_and_value(&mut board);
    let text = format!("restarted: {text}");
    assert!(texts.contains(&text), "{text}: {texts:?}");
    assert_eq!(value, Some(case.number), "{text}");
    assert_eq!(board.restarts().unwrap().len(), 1, "{text}: it goes on");
}

/// The LED shows it at the latest 100 ms after it, and the restart comes within 2 s.
const SHOWN: (Option<u64>, u64) = (Some(100 * MS), 2 * SECOND);

fn patches(name: &str, code: &[u16]) -> impl FnOnce(&mut Pixhawk) -> Option<(String, Vec<u16>)> {
    move |board| Some((name.to_owned(), board.patch(name, code).unwrap()))
}

#[test]
fn a_hard_fault_is_shown_and_reported_with_its_place() {
    let Some(firmware) = image() else { return };
    let at = firmware.symbol(ALARM).unwrap().address;
    let case = Case {
        at_once: Some(format!("hard fault at {at:#010x}")),
        later: format!("hard fault at {at:#010x}"),
        text: format!("hard fault at {at:#010x}"),
        number: 2.0,
    };
    judge(&firmware, &case, SHOWN, patches(ALARM, &[UNDEFINED]));
}

#[test]
fn a_bus_error_is_shown_and_reported_with_its_address() {
    let Some(firmware) = image() else { return };
    let at = firmware.symbol(ALARM).unwrap().address + 6;
    let case = Case {
        at_once: Some(format!("hard fault at {at:#010x}")),
        later: format!("hard fault at {at:#010x}"),
        text: format!("hard fault at {at:#010x}"),
        number: 2.0,
    };
    judge(&firmware, &case, SHOWN, |board| {
        let (from, to) = BELOW_SRAM;
        board.fail_next_access(from, to).unwrap();
        patches(ALARM, &STORE_TO_NOWHERE)(board)
    });
}

#[test]
fn a_stack_overflow_is_shown_and_reported() {
    let Some(firmware) = image() else { return };
    let case = Case {
        at_once: Some("hard fault: stack overflow".to_owned()),
        later: "hard fault: stack overflow".to_owned(),
        text: "stack overflow".to_owned(),
        number: 2.0,
    };
    judge(&firmware, &case, SHOWN, |board| {
        let (from, to) = BELOW_SRAM;
        board.fail_next_access(from, to).unwrap();
        patches(ALARM, &RECURSION)(board)
    });
}

#[test]
fn a_panic_is_shown_and_reported_with_its_line() {
    let Some(firmware) = image() else { return };
    let main = firmware.symbol(MAIN).unwrap().address;
    let mut board = board(&firmware);
    board.run_to(PROVOKED).unwrap();
    let before = board.patch(ALARM, &jump_to(main)).unwrap();
    board.run_for(50 * MS).unwrap();
    assert!(is_lit(&mut board));
    board.patch(ALARM, &before).unwrap();
    board.run_to(PROVOKED.plus(2 * SECOND)).unwrap();
    assert_eq!(board.restarts().unwrap().len(), 1);
    board.run_to(WorldNanos(8 * SECOND)).unwrap();
    assert_eq!(board.restarts().unwrap().len(), 1);
    let log = board.take_log().unwrap();
    let errors = errors(&log);
    let place = "panic at firmware/src/bring_up.rs:";
    assert!(
        errors.contains(&"panicked: the board was brought up twice"),
        "{errors:#?}"
    );
    assert!(
        errors.iter().any(|line| line.starts_with(place)),
        "{errors:#?}"
    );
    let later = format!("before the restart: {place}");
    assert!(
        errors.iter().any(|line| line.starts_with(&later)),
        "{errors:#?}"
    );
    let (texts, value) = texts_and_value(&mut board);
    let text = "restarted: panic, ";
    let reported = texts.iter().find(|reported| reported.starts_with(text));
    assert!(
        reported.is_some_and(|reported| reported.contains("bring_up.rs:")),
        "{texts:?}"
    );
    assert_eq!(value, Some(1.0));
}

#[test]
fn a_fault_inside_a_frame_of_the_log_is_shown_and_reported() {
    let Some(firmware) = image() else { return };
    let at = firmware.symbol(IN_A_FRAME).unwrap().address;
    let case = Case {
        at_once: Some(format!("hard fault at {at:#010x}")),
        later: format!("hard fault at {at:#010x}"),
        text: format!("hard fault at {at:#010x}"),
        number: 2.0,
    };
    // The status line comes within a second.
    let times = (Some(600 * MS), 3 * SECOND);
    judge(&firmware, &case, times, patches(IN_A_FRAME, &[UNDEFINED]));
}

#[test]
fn an_interrupt_without_a_handler_is_shown_and_reported() {
    let Some(firmware) = image() else { return };
    let case = Case {
        at_once: Some("interrupt 68 has no handler".to_owned()),
        later: "interrupt 68 has no handler".to_owned(),
        text: "no handler for exception 84".to_owned(),
        number: 3.0,
    };
    judge(&firmware, &case, SHOWN, |board| {
        board.poke_core(ISER2, 1 << 4);
        board.poke_core(ISPR2, 1 << 4);
        None
    });
    let case = Case {
        at_once: Some("exception 2 has no handler".to_owned()),
        later: "exception 2 has no handler".to_owned(),
        text: "no handler for exception 2".to_owned(),
        number: 3.0,
    };
    judge(&firmware, &case, SHOWN, |board| {
        board.poke_core(ICSR, 1 << 31);
        None
    });
}

#[test]
fn a_crystal_that_dies_is_shown_on_the_other_clock_and_reported() {
    let Some(firmware) = image() else { return };
    let case = Case {
        at_once: Some("the crystal failed".to_owned()),
        later: "the crystal failed".to_owned(),
        text: "the crystal failed".to_owned(),
        number: 4.0,
    };
    judge(&firmware, &case, SHOWN, |board| {
        board.fail_crystal().unwrap();
        None
    });
}

#[test]
fn a_crystal_that_does_not_start_is_said_on_the_line_at_hsis_speed_and_shown() {
    let Some(firmware) = image() else { return };
    let mut board = Builder::new(firmware)
        .crystal_start(CrystalStart::Never)
        .power_on()
        .unwrap();
    // Each run waits 100 ms for it.
    board.run_to(WorldNanos(7 * SECOND)).unwrap();
    let restarts = board.restarts().unwrap();
    assert_eq!(restarts.len(), 2, "{restarts:?}");
    assert!(restarts[0].0 < 1_200 * MS, "{restarts:?}");
    let received = board.take_received(Connector::Telem1).unwrap();
    let messages = messages(&received);
    let said = messages.iter().filter(|(_, what)| {
        matches!(what, Message::StatusText { severity: 3, text } if text.as_str() == "stopped by a fault: crystal")
    });
    // Once a run, and then again and again, 3.4 s apart.
    assert!(said.count() >= 4, "{messages:?}");
    let beats = messages
        .iter()
        .filter(|(_, what)| *what == Message::Heartbeat);
    assert!(beats.count() >= 4, "{messages:?}");
    let log = board.take_log().unwrap();
    assert!(
        errors(&log)
            .iter()
            .any(|line| line.starts_with("the crystal failed, after 0 ms"))
    );
    let mut runs = flashes(&mut board, 14 * SECOND);
    let cycle = [
        100, 100, 100, 100, 400, 1_000, 150, 250, 150, 250, 150, 250, 150, 850,
    ];
    runs.drain(..runs.iter().position(|ms| *ms > 900).unwrap() + 9);
    assert!(is_about(&runs, &cycle), "{runs:?}");
}

#[test]
fn a_crystal_that_starts_late_is_reported_and_used() {
    let Some(firmware) = image() else { return };
    let mut board = Builder::new(firmware)
        .crystal_start(CrystalStart::After(40 * MS))
        .power_on()
        .unwrap();
    board.run_to(WorldNanos(3 * SECOND)).unwrap();
    assert!(board.restarts().unwrap().is_empty());
    let (texts, _) = texts_and_value(&mut board);
    let after_us: u64 = texts
        .iter()
        .find_map(|text| {
            text.strip_prefix("the crystal started late: ")?
                .strip_suffix(" us")
        })
        .unwrap_or_else(|| panic!("{texts:?}"))
        .parse()
        .unwrap();
    // HSI, which times it, is off by 1 % at most (DS9484).
    assert!(after_us.abs_diff(40_000) <= 400, "{after_us}");
}

#[test]
fn a_task_that_stops_is_found_shown_and_reported() {
    let Some(firmware) = image() else { return };
    for (of, name) in [("gnss", "GNSS"), ("mavlink", "MAVLink")] {
        let case = Case {
            at_once: Some(format!("the {name} task stopped")),
            later: format!("the {name} task stopped"),
            text: format!("the task stopped: {name}"),
            number: 5.0,
        };
        let task = task(of);
        // It has a second to come by.
        let times = (Some(1_100 * MS), 2 * SECOND);
        judge(&firmware, &case, times, patches(&task, &[RETURN]));
    }
}

#[test]
fn the_papers_task_that_stops_is_found_shown_and_reported() {
    let variable = "PIXCLOCK_IMAGE_PAPER_STEP1";
    let Some(firmware) = Firmware::from_variable(variable).unwrap() else {
        return;
    };
    let case = Case {
        at_once: Some("the GNSS task stopped".to_owned()),
        later: "the GNSS task stopped".to_owned(),
        text: "the task stopped: GNSS".to_owned(),
        number: 5.0,
    };
    let times = (Some(1_100 * MS), 2 * SECOND + 100 * MS);
    judge(&firmware, &case, times, patches(&task("paper"), &[RETURN]));
}

#[test]
fn a_tick_that_stops_is_shown_and_reported_with_what_ran_instead() {
    let Some(firmware) = image() else { return };
    let case = Case {
        at_once: Some("the tick stopped; found at 0x".to_owned()),
        later: "the tick stopped; found at 0x".to_owned(),
        text: "the tick stopped".to_owned(),
        number: 6.0,
    };
    judge(&firmware, &case, SHOWN, |board| {
        wait_for_dark(board);
        board.poke_core(SYST_CSR, 0);
        None
    });
    // The same of what keeps the core from the tasks, and has the tick running.
    judge(&firmware, &case, SHOWN, |board| {
        wait_for_dark(board);
        patches(ALARM, &[STAYS])(board)
    });
}

/// With all interrupts masked nothing is left that could light the LED: the one case that waits for the
/// watchdog.
#[test]
fn what_masks_all_interrupts_is_reported_after_the_watchdog() {
    let Some(firmware) = image() else { return };
    let case = Case {
        at_once: None,
        later: "the watchdog was not fed".to_owned(),
        text: "the watchdog was not fed".to_owned(),
        number: 6.0,
    };
    let times = (None, 2 * SECOND);
    judge(&firmware, &case, times, patches(ALARM, &MASKED_FOR_EVER));
}

#[test]
fn a_fault_is_shown_though_the_log_is_full_and_asked_to_wait_for_a_probe_that_is_gone() {
    let Some(firmware) = image() else { return };
    let at = firmware.symbol(ALARM).unwrap().address;
    let case = Case {
        at_once: Some(format!("hard fault at {at:#010x}")),
        later: format!("hard fault at {at:#010x}"),
        text: format!("hard fault at {at:#010x}"),
        number: 2.0,
    };
    judge(&firmware, &case, SHOWN, |board| {
        let block = board.read(RTT).unwrap();
        let write = u32::from_le_bytes(*block[RTT_WRITE..].first_chunk().unwrap());
        // As a probe leaves it that was pulled: no room but for what the last words give up.
        board.set_word(RTT, RTT_FLAGS, BLOCK_IF_FULL).unwrap();
        board
            .set_word(RTT, RTT_READ, (write + 1) % RTT_SIZE)
            .unwrap();
        patches(ALARM, &[UNDEFINED])(board)
    });
}

#[test]
fn the_third_restart_for_one_reason_is_not_made() {
    let Some(firmware) = image() else { return };
    let firmware = firmware.with_instruction(ALARM, UNDEFINED).unwrap();
    let mut board = Builder::new(firmware).power_on().unwrap();
    board.run_to(WorldNanos(10 * SECOND)).unwrap();
    assert_eq!(board.restarts().unwrap().len(), 2);
    let log = board.take_log().unwrap();
    let last = log.last().unwrap();
    assert_eq!(last.line.text, "stopped: restarting does not help");
    // The group, a pause, and the number of the reason: 2, a hard fault.
    let mut runs = flashes(&mut board, 10 * SECOND);
    let cycle = [100, 100, 100, 100, 400, 1_000, 150, 250, 150, 850];
    runs.drain(..runs.iter().position(|ms| *ms > 900).unwrap() + 5);
    assert!(is_about(&runs, &cycle), "{runs:?}");
    board.run_for(60 * SECOND).unwrap();
    assert_eq!(board.restarts().unwrap().len(), 2, "it stays");
}

#[test]
fn no_vector_is_a_branch_to_itself() {
    let Some(firmware) = image() else { return };
    let mut board = Builder::new(firmware.clone()).power_on().unwrap();
    let mut vectors = 0;
    for number in 1.. {
        let Some(vector) = firmware.vector(number) else {
            break;
        };
        if vector != 0 {
            vectors += 1;
            let first = board.code_at(vector & !1).unwrap();
            assert_ne!(first, 0xE7FE, "vector {number} is `b .`");
        }
    }
    assert!(vectors > 80, "{vectors}");
}

#[test]
fn no_loop_is_missed_without_receiver_or_client_in_any_variant() {
    let variables = [
        "PIXCLOCK_IMAGE",
        "PIXCLOCK_IMAGE_PAPER_DEFAULT",
        "PIXCLOCK_IMAGE_PAPER_STEP1",
        "PIXCLOCK_IMAGE_PAPER_STEP2_50",
        "PIXCLOCK_IMAGE_PAPER_STEP2_1000",
    ];
    for variable in variables {
        let Some(firmware) = Firmware::from_variable(variable).unwrap() else {
            continue;
        };
        let mut board = Builder::new(firmware).power_on().unwrap();
        board.run_to(WorldNanos(20 * SECOND)).unwrap();
        assert_eq!(board.restarts().unwrap(), [], "{variable}");
    }
}
