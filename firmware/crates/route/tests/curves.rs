//! Curves: figures computed elsewhere, what must hold of any, and `kurbo` on a flat earth.

use kurbo::{CubicBez, ParamCurve as _, ParamCurveArclen as _};
use proptest::prelude::*;
use route::ellipsoid::scale;
use route::{Bam, Curve, Place, Refusal};

/// By name: the points, the length in m, the place at ½ in rad, headings at 0, ¼, ½, ¾, 1 in degrees,
/// pieces for 1, 0.1 and 0.01 m. NaN where there is none or the figure is by rule.
struct Known {
    points: [[u32; 2]; 4],
    length_m: f64,
    middle: [f64; 2],
    headings: [f64; 5],
    pieces: [u32; 3],
}

const NAN: f64 = f64::NAN;

const KNOWN: [Known; 6] = [
    // A, a corner.
    Known {
        points: [
            [0x1a85_958f, 0x5a74_4594],
            [0x1a85_a127, 0x5a74_4594],
            [0x1a85_aa8e, 0x5a74_5158],
            [0x1a85_aa8e, 0x5a74_5fdc],
        ],
        length_m: 78.551_710_629,
        middle: [0.650_948_793_624_387, 2.220_082_635_444_397],
        headings: [0.0, 22.926_437, 44.997_446, 67.070_536, 90.0],
        pieces: [5, 14, 42],
    },
    // B, over the antimeridian.
    Known {
        points: [
            [0xf40d_a741, 0x7fff_d166],
            [0xf40d_a741, 0x8000_12fa],
            [0xf40d_d9c9, 0x7fff_fd1e],
            [0xf40d_d9c9, 0x8000_3eb2],
        ],
        length_m: 289.753_002_960,
        middle: [-0.293_205_851_966_349, -3.141_589_639_978_55],
        headings: [90.0, 59.037_431, 39.806_951, 59.037_531, 90.0],
        pieces: [14, 42, 133],
    },
    // C, 78° north.
    Known {
        points: [
            [0x379b_e024, 0x0b17_e4b1],
            [0x379b_e024, 0x0b1e_4532],
            [0x379e_5245, 0x0b21_7572],
            [0x379e_5245, 0x0b27_d5f3],
        ],
        length_m: 2_585.493_646_029,
        middle: [1.364_964_719_299_399, 0.273_035_592_456_937],
        headings: [90.0, 49.122_539, 38.644_027, 49.100_634, 90.0],
        pieces: [35, 108, 342],
    },
    // D, straight: the handles are the ends.
    Known {
        points: [
            [0x1a85_958f, 0x5a74_4594],
            [0x1a85_958f, 0x5a74_4594],
            [0x1a85_d8bf, 0x5a74_84a7],
            [0x1a85_d8bf, 0x5a74_84a7],
        ],
        length_m: 200.002_771_729,
        middle: [0.650_955_814_899_709, 2.220_091_563_633_435],
        headings: [36.869_7, 36.869_659, 36.869_476, 36.869_293, 36.869_2],
        pieces: [13, 39, 123],
    },
    // E, a point.
    Known {
        points: [[0x1a85_958f, 0x5a74_4594]; 4],
        length_m: 0.0,
        middle: [NAN, NAN],
        headings: [NAN; 5],
        pieces: [1; 3],
    },
    // F, a cusp.
    Known {
        points: [[0, 0], [0x2a26, 0x29dd], [0x2a26, 0], [0, 0x29dd]],
        length_m: 182.846_174_293,
        middle: [0.000_011_838_664_556, 0.000_007_839_046_528],
        headings: [44.997_948, 26.563_410, NAN, 153.436_590, 135.002_052],
        pieces: [13, 41, 130],
    },
];

fn place([latitude, longitude]: [u32; 2]) -> Place {
    Place {
        latitude: Bam(latitude.cast_signed()),
        longitude: Bam(longitude.cast_signed()),
    }
}

fn curve(points: [[u32; 2]; 4]) -> Curve {
    Curve::new(points.map(place)).expect("latitudes below 85°")
}

#[test]
fn known_curves_to_their_digits() {
    for (name, known) in ('A'..).zip(KNOWN) {
        let curve = curve(known.points);
        let length_m = curve.length_m();
        assert!(
            (length_m - known.length_m).abs() < 1e-5,
            "{name}: {length_m}"
        );
        let (latitude, longitude) = curve.at(0.5);
        if known.middle[0].is_finite() {
            let off = [latitude - known.middle[0], longitude - known.middle[1]];
            assert!(off.iter().all(|it| it.abs() < 1e-14), "{name}: {off:?}");
        }
        for (n, expected) in (0..).zip(known.headings) {
            let heading = curve.heading(f64::from(n) / 4.0).map(f64::to_degrees);
            if expected.is_finite() {
                // At the ends of D by rule: some digits are enough.
                let limit = if name == 'D' && n % 4 == 0 {
                    1e-3
                } else {
                    1e-6
                };
                let off = heading.expect("a heading") - expected;
                assert!(off.abs() < limit, "{name} {n}: {heading:?}");
            } else if name == 'E' {
                assert_eq!(heading, None);
            }
        }
        let pieces = [1.0, 0.1, 0.01].map(|it| curve.pieces(it));
        assert_eq!(pieces, known.pieces.map(Some), "{name}");
    }
}

#[test]
fn at_a_cusp_the_heading_is_the_one_after() {
    let curve = curve(KNOWN[5].points);
    let [at, after] = [0.5, 0.5 + 1e-6].map(|t| curve.heading(t).unwrap());
    assert!((at - after).abs() < 1e-3, "{at} {after}");
}

#[test]
fn a_split_has_the_lengths_of_its_parts() {
    for (known, lengths_m) in [
        (&KNOWN[0], [39.274_036, 39.277_675]),
        (&KNOWN[2], [1_293.058_131, 1_292.435_515]),
    ] {
        let (before, behind) = curve(known.points).split(0.5);
        let off = [
            before.length_m() - lengths_m[0],
            behind.length_m() - lengths_m[1],
        ];
        assert!(off.iter().all(|it| it.abs() < 2e-6), "{off:?}");
    }
}

#[test]
fn how_fast_the_corner_goes() {
    let curve = curve(KNOWN[0].points);
    for (t, speed_m) in [
        (0.0, 82.829_501_652),
        (0.5, 76.779_989_898),
        (1.0, 82.849_458_561),
    ] {
        assert!((curve.speed_m(t) - speed_m).abs() < 1e-8, "{t}");
    }
}

#[test]
fn latitudes_beyond_85_degrees_are_refused() {
    let limit = Bam::from_radians(85.0_f64.to_radians()).0;
    for (latitude, is_good) in [
        (limit, true),
        (limit + 2, false),
        (-limit, true),
        (-limit - 2, false),
    ] {
        for at in 0..4 {
            let mut points = [Place::default(); 4];
            points[at].latitude = Bam(latitude);
            let expected = if is_good {
                None
            } else {
                Some(Refusal::Latitude)
            };
            assert_eq!(Curve::new(points).err(), expected, "{latitude} {at}");
        }
    }
    // No latitude at all.
    let mut points = [Place::default(); 4];
    points[2].latitude = Bam(i32::MIN);
    assert_eq!(Curve::new(points), Err(Refusal::Latitude));
}

#[test]
fn no_tolerance_is_too_small_for_an_answer() {
    let curve = curve(KNOWN[0].points);
    for tolerance_m in [0.0, -1.0, NAN, 1e-12] {
        assert_eq!(curve.pieces(tolerance_m), None);
    }
    assert_eq!(curve.pieces(f64::INFINITY), Some(1));
}

/// In metres: how far `p` is from the straight piece between `a` and `b`, in radians on a plane whose
/// scale is that of `p`.
fn apart_m(p: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let scale = scale(p[0]);
    let metres = |q: [f64; 2]| [(q[0] - p[0]) * scale.north_m, (q[1] - p[1]) * scale.east_m];
    let (a, b) = (metres(a), metres(b));
    let d = [b[0] - a[0], b[1] - a[1]];
    let square = d[0] * d[0] + d[1] * d[1];
    let along = if square > 0.0 {
        -(a[0] * d[0] + a[1] * d[1]) / square
    } else {
        0.0
    };
    let along = along.clamp(0.0, 1.0);
    (a[0] + along * d[0]).hypot(a[1] + along * d[1])
}

/// Handles up to 50 km from a place anywhere that is allowed, over the antimeridian too.
fn any_curve() -> impl Strategy<Value = [Place; 4]> {
    let near = -5_000_000..5_000_000_i32;
    let offsets = prop::array::uniform4((near.clone(), near));
    let latitude = -80.0..80.0_f64;
    (latitude, any::<i32>(), offsets).prop_map(|(latitude, longitude, offsets)| {
        let latitude = Bam::from_radians(latitude.to_radians()).0;
        offsets.map(|(north, east)| Place {
            latitude: Bam(latitude + north),
            longitude: Bam(longitude.wrapping_add(east)),
        })
    })
}

proptest! {
    #[test]
    fn it_stays_in_the_box_of_its_points(points in any_curve(), t in 0.0..=1.0_f64) {
        let curve = Curve::new(points).unwrap();
        let bounds = curve.bounds();
        let (latitude, longitude) = curve.at(t);
        let turn = std::f64::consts::TAU;
        let east = (longitude - bounds.longitudes[0] + 1e-12).rem_euclid(turn) - 1e-12;
        prop_assert!(latitude >= bounds.latitudes[0] - 1e-12);
        prop_assert!(latitude <= bounds.latitudes[1] + 1e-12);
        prop_assert!(east <= bounds.longitudes[1] - bounds.longitudes[0] + 1e-12);
    }

    #[test]
    fn parts_are_where_the_whole_is(points in any_curve(), at in 0.0..=1.0_f64, t in 0.0..=1.0_f64) {
        let curve = Curve::new(points).unwrap();
        let (before, behind) = curve.split(at);
        for (part, t, whole) in [(before, t, at * t), (behind, t, at + (1.0 - at) * t)] {
            let ((a, b), (c, d)) = (part.at(t), curve.at(whole));
            prop_assert!((a - c).abs() < 1e-13 && (b - d).sin().abs() < 1e-13);
        }
    }

    #[test]
    fn back_and_forth_are_the_same_way(points in any_curve(), t in 0.0..=1.0_f64) {
        let curve = Curve::new(points).unwrap();
        let back = curve.reversed();
        let ((a, b), (c, d)) = (curve.at(t), back.at(1.0 - t));
        prop_assert!((a - c).abs() < 1e-13 && (b - d).sin().abs() < 1e-13);
        prop_assert!((curve.length_m() - back.length_m()).abs() < 1e-6);
    }

    #[test]
    fn a_turn_of_longitude_changes_nothing_but_the_longitude(points in any_curve(), turn in any::<i32>()) {
        let turned = points.map(|it| Place {
            longitude: Bam(it.longitude.0.wrapping_add(turn)),
            ..it
        });
        let (curve, turned) = (Curve::new(points).unwrap(), Curve::new(turned).unwrap());
        prop_assert!((curve.length_m() - turned.length_m()).abs() < 1e-9);
        prop_assert_eq!(curve.pieces(1.0), turned.pieces(1.0));
        prop_assert_eq!(curve.heading(0.3), turned.heading(0.3));
    }

    #[test]
    fn straight_pieces_stay_within_the_tolerance(points in any_curve(), exponent in 0..3) {
        let tolerance_m = 100.0 * 0.1_f64.powi(exponent);
        let curve = Curve::new(points).unwrap();
        let Some(pieces) = curve.pieces(tolerance_m) else { return Ok(()); };
        let origin = curve.at(0.0).1;
        let near = |(latitude, longitude): (f64, f64)| {
            let turn = std::f64::consts::TAU;
            let pi = std::f64::consts::PI;
            [latitude, (longitude - origin + pi).rem_euclid(turn) - pi]
        };
        for piece in (0..pieces).step_by(1 + pieces as usize / 50) {
            let t = |part: f64| (f64::from(piece) + part) / f64::from(pieces);
            let [a, b] = [t(0.0), t(1.0)].map(|t| near(curve.at(t)));
            for part in [0.25, 0.5, 0.75] {
                let off_m = apart_m(near(curve.at(t(part))), a, b);
                prop_assert!(off_m <= tolerance_m * (1.0 + 1e-9), "{off_m} of {tolerance_m}");
            }
        }
    }

    #[test]
    fn a_length_is_where_it_is_travelled(points in any_curve(), share in 0.0..=1.0_f64) {
        let curve = Curve::new(points).unwrap();
        let length_m = share * curve.length_m();
        let t = curve.t_at_length(length_m);
        prop_assert!((curve.length_to_m(t) - length_m).abs() < 1e-6);
    }

    /// On the equator, on 200 m, the ellipsoid is a plane with two scales to 1e-9.
    #[test]
    fn kurbo_agrees_on_a_flat_earth(offsets in prop::array::uniform4((-20_000..20_000_i32, -20_000..20_000_i32)), t in 0.0..=1.0_f64) {
        let points = offsets.map(|(north, east)| Place { latitude: Bam(north), longitude: Bam(east) });
        let curve = Curve::new(points).unwrap();
        let scale = scale(0.0);
        let [a, b, c, d] = points.map(|it| {
            let (north, east) = (it.latitude.radians(), it.longitude.radians());
            kurbo::Point::new(north * scale.north_m, east * scale.east_m)
        });
        let judge = CubicBez::new(a, b, c, d);
        let expected = judge.eval(t);
        let (latitude, longitude) = curve.at(t);
        let off = kurbo::Point::new(latitude * scale.north_m, longitude * scale.east_m) - expected;
        prop_assert!(off.hypot() < 1e-8);
        let length_m = curve.length_m();
        let length = judge.arclen(1e-9);
        // Five points on a quarter see little of a place where the curve all but stops.
        let speeds = (0..=64).map(|n| curve.speed_m(f64::from(n) / 64.0));
        let (slowest, fastest) = speeds.fold((f64::MAX, 0.0_f64), |(low, high), it| (low.min(it), high.max(it)));
        let limit = if slowest > fastest / 4.0 { 1e-4 } else { 1e-2 };
        prop_assert!((length_m - length).abs() < limit * length + 1e-6, "{length_m} {length}");
    }
}
