//! The messages against known bytes, which `synapse-cdm` 3.9.1 accepts as frames.

use route::message::{
    Altitude, CurveMessage, Handles, MissionItem, RouteMessage, Speed, StudyCurve, Waypoint,
    curve_items, curve_of_items,
};
use route::{Bam, Curve, Place, Refusal};
use stanag_wire::Frame;

const TIME_MS: u64 = 849_163_200_123;
const WAYPOINTS: [&str; 2] = [
    "ffff001d00505f010050430132ca1e40000f7fc5b612267b00011a85958f5a74459400001770030028020002010b97",
    "ffff001d00505f010050430132ca1e40000f7fc5b612267b00021a85aa8e5a745fdc00001770030028020000010c0c",
];
const CURVE: &str =
    "ffff001a00505f0100504301cb2a1e407fc5b612267b000100021a85a1275a7445941a85aa8e5a7451580dbb";
const STUDY: &str = "ffff003400505f0100504301cb2b1e404268b6c244cf60000050430100505f01000100023fe4d49002a78a454001c2b92c6513843fe4d497651b9aef4001c2bb7bccb59b1975";

fn place(latitude: i32, longitude: i32) -> Place {
    Place {
        latitude: Bam(latitude),
        longitude: Bam(longitude),
    }
}

fn corner() -> [Place; 4] {
    [
        place(0x1a85_958f, 0x5a74_4594),
        place(0x1a85_a127, 0x5a74_4594),
        place(0x1a85_aa8e, 0x5a74_5158),
        place(0x1a85_aa8e, 0x5a74_5fdc),
    ]
}

fn waypoint(number: u16, place: Place, next: u16) -> Waypoint {
    Waypoint {
        time_ms: Some(TIME_MS),
        number,
        place,
        altitude: Some(Altitude {
            height_2cm: 6_000,
            kind: 3,
        }),
        speed: Some(Speed {
            half_m_s: 40,
            kind: 2,
        }),
        next,
        turn: Some(1),
    }
}

fn bytes(hex: &str) -> Vec<u8> {
    let digit = |it: u8| char::from(it).to_digit(16).expect("hexadecimal") as u8;
    let pairs = hex.as_bytes().as_chunks::<2>().0.iter();
    pairs
        .map(|pair| digit(pair[0]) << 4 | digit(pair[1]))
        .collect()
}

#[test]
fn waypoints_are_read_and_written_to_the_byte() {
    let [p1, _, _, p4] = corner();
    let expected = [waypoint(1, p1, 2), waypoint(2, p4, 0)];
    for (hex, expected) in WAYPOINTS.iter().zip(expected) {
        let bytes = bytes(hex);
        let (frame, _) = Frame::read(&bytes).unwrap();
        assert_eq!(frame.header.message, Waypoint::NUMBER);
        assert_eq!(Waypoint::read(frame.data), Ok(expected));
        assert_eq!(expected.write().data(), frame.data);
    }
}

#[test]
fn a_curve_is_read_and_written_to_the_byte() {
    let [p1, p2, p3, p4] = corner();
    let bytes = bytes(CURVE);
    let (frame, _) = Frame::read(&bytes).unwrap();
    let mut curve = CurveMessage::read(frame.header.message, frame.data).unwrap();
    let handles = Handles {
        places: [p2, p3],
        heights_2cm: None,
    };
    let expected = CurveMessage {
        time_ms: Some(TIME_MS),
        p1: 1,
        p4: 2,
        handles,
    };
    assert_eq!(curve, expected);
    assert_eq!(curve.write().data(), frame.data);

    // With altitudes it is 7 bytes longer: two heights, and a byte of the vector.
    curve.handles.heights_2cm = Some([6_000, -1]);
    let solid = curve.write();
    assert_eq!(solid.data().len(), frame.data.len() + 7);
    assert_eq!(CurveMessage::read(curve.number(), solid.data()), Ok(curve));

    let [first, last] = [waypoint(1, p1, 2), waypoint(2, p4, 0)];
    assert_eq!(curve.between(&first, &last), Curve::new(corner()));
    let elsewhere = waypoint(1, p1, 3);
    assert_eq!(curve.between(&elsewhere, &last), Err(Refusal::NotNext));
    assert_eq!(curve.between(&last, &first), Err(Refusal::NotNext));
}

#[test]
fn the_studys_form_is_read_and_written_to_the_byte() {
    let bytes = bytes(STUDY);
    let (frame, _) = Frame::read(&bytes).unwrap();
    assert_eq!(frame.header.message, StudyCurve::NUMBER);
    let curve = StudyCurve::read(frame.data).unwrap();
    assert_eq!((curve.vehicle, curve.station), (0x0050_4301, 0x0050_5f01));
    assert_eq!((curve.p1, curve.p4, curve.time_ms), (1, 2, TIME_MS as f64));
    let [_, p2, p3, _] = corner();
    assert_eq!(curve.places(), [p2, p3]);
    assert_eq!(curve.write(), frame.data);

    let mut no_number = curve;
    no_number.handles[1][0] = f64::NAN;
    assert_eq!(StudyCurve::read(&no_number.write()), Err(Refusal::NoPlace));
    assert_eq!(StudyCurve::read(&frame.data[1..]), Err(Refusal::Data));
}

#[test]
fn a_route_has_a_name_and_a_beginning() {
    let mut id = [0; 32];
    id[..7].copy_from_slice(b"curve A");
    let route = RouteMessage {
        time_ms: None,
        initial: 1,
        id,
        kind: 2,
    };
    let data = route.write();
    assert_eq!(data.data().len(), 1 + 2 + 33 + 1);
    assert_eq!(RouteMessage::read(data.data()), Ok(route));
    assert_eq!(RouteMessage::read(&[0]), Err(Refusal::Data));
}

#[test]
fn what_lacks_a_place_or_has_another_length_is_refused() {
    let good = waypoint(1, corner()[0], 2);
    let data = good.write();
    let data = data.data();
    for end in 0..data.len() {
        assert_eq!(Waypoint::read(&data[..end]), Err(Refusal::Data));
    }
    // Presence vector 2: a number and nothing else.
    assert_eq!(Waypoint::read(&[0, 0, 2, 0, 1]), Err(Refusal::NoPlace));
    assert_eq!(
        CurveMessage::read(CurveMessage::FLAT, &[6, 0, 1, 0, 2]),
        Err(Refusal::NoPlace)
    );
    assert_eq!(CurveMessage::read(13_002, data), Err(Refusal::Data));
}

#[test]
fn mavlinks_items_say_the_same_curve_to_a_centimetre() {
    let [p1, p2, p3, p4] = corner();
    let items = curve_items([p2, p3, p4], 120.0, 5, 7);
    let [first, ..] = curve_items([p1; 3], 120.0, 5, 6);
    let first = MissionItem {
        command: MissionItem::WAYPOINT,
        ..first
    };
    for item in items {
        let payload = item.write(1, 1);
        assert_eq!(MissionItem::read(&payload), Ok(item));
        // What MAVLink 2 sends of it ends with the last byte that is not 0.
        assert_eq!(payload[36], 1);
    }
    let said = curve_of_items(&first, &items).unwrap();
    let exact = Curve::new(corner()).unwrap();
    for t in [0.0, 0.3, 1.0] {
        let ((a, b), (c, d)) = (said.at(t), exact.at(t));
        assert!((a - c).abs() < 2e-9 && (b - d).abs() < 2e-9, "{t}");
    }
    let [a, b, c] = items;
    assert_eq!(curve_of_items(&first, &[b, a, c]), Err(Refusal::NotNext));
    let late = MissionItem {
        sequence: 9,
        ..first
    };
    assert_eq!(curve_of_items(&late, &items), Err(Refusal::NotNext));
}
