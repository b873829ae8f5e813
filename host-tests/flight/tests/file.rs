//! Files of flights: any text is read or refused, what is written is read again.

use flight::{
    Crystal, Event, EventKind, Flight, Header, Knot, LeapStep, PulseName, PulseShape, Window,
    WorldPicos,
};
use proptest::prelude::*;

fn busy() -> impl Strategy<Value = Option<u64>> {
    proptest::option::of(0..1_000_000_000_000_u64)
}

fn kind() -> impl Strategy<Value = EventKind> {
    let name =
        (any::<u32>(), any::<u16>(), any::<u8>()).prop_map(|(tow_ms, week, flags)| PulseName {
            tow_ms,
            week,
            flags,
        });
    prop_oneof![
        (any::<i64>(), any::<u32>(), any::<u8>(), busy()).prop_map(
            |(utc_ns, t_acc_ns, valid, busy_us)| EventKind::Mark {
                utc_ns,
                t_acc_ns,
                valid,
                busy_us
            }
        ),
        (any::<i32>(), busy()).prop_map(|(nano, busy_us)| EventKind::Mark60 { nano, busy_us }),
        Just(EventKind::Rise),
        Just(EventKind::Fall),
        (any::<i32>(), proptest::option::of(name), busy()).prop_map(|(late_ps, names, busy_us)| {
            EventKind::TimTp {
                late_ps,
                names,
                busy_us,
            }
        }),
        (any::<u8>(), any::<i8>(), any::<i8>(), any::<i32>(), busy()).prop_map(
            |(source, count, change, to_event_s, busy_us)| EventKind::TimeLs {
                source,
                count,
                change,
                to_event_s,
                busy_us
            }
        ),
    ]
}

fn at() -> impl Strategy<Value = WorldPicos> {
    (-60_000_000_000_000..1_000_000_000_000_000_000_i64).prop_map(WorldPicos)
}

prop_compose! {
    fn header()(
        knots in proptest::collection::vec((0.0..1e9, -1e4..1e4), 0..4),
        start_utc_ns: i64,
        leaps in proptest::collection::vec((at(), any::<i64>()), 0..3),
        latency_us: u32,
        pulse in proptest::option::of((0..=1_000_000_000_u32, any::<bool>())),
        is_bare: bool,
        windows in proptest::collection::vec((-1e9..1e9, -1e9..1e9, "[a-z][a-z0-9 ]{0,9}[a-z]"), 0..3),
    ) -> Header {
        let mut knots: Vec<Knot> = knots.into_iter().map(|(at_s, ppm)| Knot { at_s, ppm }).collect();
        knots.sort_by(|one, next| one.at_s.total_cmp(&next.at_s));
        if let [only] = &mut knots[..] {
            // One knot is written as `ppm`, which has no time.
            only.at_s = 0.0;
        }
        Header {
            crystal: Crystal::new(knots),
            start_utc_ns,
            leaps: leaps.into_iter().map(|(at, by_ns)| LeapStep { at, by_ns }).collect(),
            latency_us,
            pulse: pulse.map(|(width_ns, is_high)| PulseShape { width_ns, is_high }),
            is_bare,
            windows: windows
                .into_iter()
                .map(|(from_s, until_s, name)| Window { from_s, until_s, name })
                .collect(),
            comments: vec!["made up".to_owned()],
        }
    }
}

proptest! {
    #[test]
    fn what_is_written_is_read_again(
        header in header(),
        mut events in proptest::collection::vec(
            (at(), kind()).prop_map(|(at, kind)| Event { at, kind }),
            0..40,
        ),
    ) {
        events.sort_by_key(|event| event.at);
        let flight = Flight { header, events };
        let read = Flight::parse(&flight.to_string());
        prop_assert_eq!(read, Ok(flight));
    }

    #[test]
    fn no_text_makes_it_panic(text in ".{0,200}") {
        let _ = Flight::parse(&text);
        let _ = Flight::is_one(text.as_bytes());
    }

    /// Nearer to the format than any text.
    #[test]
    fn no_line_makes_it_panic(
        lines in proptest::collection::vec(
            "(# ?)?(ppm|crystal|leap|pulse|window|-?[0-9.]{0,22})[ ,](mark|mark60|pulse|fall|tp|ls|[0-9]{0,3})([ ,]-?[0-9a-f.]{0,20}){0,7}",
            0..9,
        ),
    ) {
        if let Err(error) = Flight::parse(&lines.join("\n")) {
            prop_assert!((1..=lines.len()).contains(&error.line));
            let printed = error.to_string();
            prop_assert!(printed.contains("allowed") || printed.contains("behind the last"), "{}", printed);
        }
    }
}
