//! What keeps a stamp waiting: the sections that mask every interrupt, and the waits themselves.

use mavlink_node::client::Client;
use mavlink_node::{Address, Test, Version};
use virtual_pixhawk::{Card, Script, Tally};
use world::{Transmission, WorldNanos};

use crate::board::{BAUD, HOST, MS, SECOND, Subject, receiver};
use crate::table::{Row, Sections};

/// Exception numbers of the vector table (RM0090, table 62): 16 and the interrupt's.
const TIM4: u16 = 16 + 30;
const USART2: u16 = 16 + 38;
const UART4: u16 = 16 + 52;

/// How many sections are named.
const NAMED: usize = 10;

/// The longest of two seconds in which everything happens: marks, the pulse, PINGs, the status
/// line, and a log that is written to the card.
pub fn all(subject: &Subject) -> anyhow::Result<(Vec<Row>, Sections)> {
    let board_address = Address {
        system: 1,
        component: 1,
    };
    let mut client = Client::new(HOST, Version::V2);
    let mut requests: Vec<_> = (0..1_300_u32)
        .map(|n| Transmission {
            start: WorldNanos(16 * SECOND + u64::from(n) * 4 * MS),
            bytes: client.ping(n.into(), n).to_vec(),
            baud: BAUD,
        })
        .collect();
    requests.push(Transmission {
        start: WorldNanos(20 * SECOND + 502 * MS),
        bytes: client.test(board_address, Test::Ends).to_vec(),
        baud: BAUD,
    });
    requests.sort_by_key(|request| request.start);
    let mut board = subject
        .board()
        .gps_and_pulse(receiver())
        .telem1(Script::new(requests))
        .card(Card::holding(&fat_image::formatted(fat_image::Kind::Fat16)))
        .power_on()?;
    board.run_to(WorldNanos(19 * SECOND + 500 * MS))?;
    board.start_meter(&[])?;
    board.run_for(2 * SECOND)?;
    let profile = board.stop_meter();
    let sections: Sections = profile
        .masked(&subject.firmware)
        .into_iter()
        .take(NAMED)
        .map(|(name, tally)| (name.to_owned(), tally.most))
        .collect();
    let most = |tally: Option<&Tally>| tally.map_or(0, |tally| tally.most) as f64;
    let stamps = profile.stamps();
    let uart = most(stamps.get(&UART4)).max(most(stamps.get(&USART2)));
    let capture = most(profile.entries().get(&TIM4));
    let masked = sections.first().map_or(0, |&(_, length)| length) as f64;
    anyhow::ensure!(
        uart > 0.0 && profile.entries().contains_key(&TIM4) && masked > 0.0,
        "an interrupt that should have come did not"
    );
    Ok((
        vec![
            Row::new(
                "longest section that masks every interrupt",
                masked,
                250.0,
                "",
            ),
            Row::new("from a UART's request to its stamp", uart, 500.0, ""),
            Row::new(
                "from an edge of the pulse to its handler",
                capture,
                2_500.0,
                "",
            ),
        ],
        sections,
    ))
}
