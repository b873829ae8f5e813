//! Missions out of a file: QGroundControl's `.plan`, or the text that begins with `QGC WPL 110`.
//!
//! *Design.* Of the items those count that lead to a place; two handles before a waypoint make the way
//! to it a curve. What leads nowhere (a change of speed) is passed over.
//!
//! *Limits.* A survey or another item that QGroundControl expands by itself is refused: its waypoints are
//! not in the file's items. Splines are taken for straight lines.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use route::message::{MissionItem, curve_of_items};
use serde_json::Value;

use super::track::{Leg, Track};

/// MAV_CMDs with a place that is flown to: waypoint, loiter (3), land, take-off, spline.
const FLOWN_TO: [u16; 7] = [16, 17, 18, 19, 21, 22, 82];
/// MAVLink's degrees. \[1e-7°\]
const UNITS: f64 = 1e7;

/// The track of the mission in `file`.
///
/// # Errors
///
/// When it cannot be read, with the item that is wrong.
pub fn read(file: &Path) -> Result<Track> {
    let text = fs::read_to_string(file).with_context(|| format!("{}", file.display()))?;
    let items = if text.starts_with("QGC WPL 110") {
        of_text(&text)
    } else {
        of_plan(&text)
    };
    track(&items?).with_context(|| format!("{}", file.display()))
}

fn of_text(text: &str) -> Result<Vec<MissionItem>> {
    let mut items = Vec::new();
    for (line, row) in (1..).zip(text.lines()).skip(1) {
        let fields: Vec<_> = row.split_whitespace().collect();
        let number = |at: usize| fields.get(at).and_then(|it| it.parse::<f64>().ok());
        match (number(0), number(3), number(8), number(9)) {
            _ if fields.is_empty() => {}
            // Item 0 is home.
            (Some(0.0), ..) => {}
            (_, Some(command), Some(latitude), Some(longitude)) => {
                items.extend(item(command, latitude, longitude, items.len())?);
            }
            _ => bail!("line {line} is no item"),
        }
    }
    Ok(items)
}

fn of_plan(text: &str) -> Result<Vec<MissionItem>> {
    let plan: Value = serde_json::from_str(text).context("neither a plan nor QGC WPL 110")?;
    let listed = plan["mission"]["items"].as_array();
    let mut items = Vec::new();
    for (n, it) in listed
        .context("a plan without a mission")?
        .iter()
        .enumerate()
    {
        ensure!(it["type"] == "SimpleItem", "item {n} is {}", it["type"]);
        let number = |at: usize| it["params"][at].as_f64().unwrap_or(0.0);
        let command = it["command"]
            .as_f64()
            .context("an item without a command")?;
        items.extend(item(command, number(4), number(5), items.len())?);
    }
    Ok(items)
}

/// The item, if it has a place: none is at 0, 0.
fn item(command: f64, latitude: f64, longitude: f64, at: usize) -> Result<Option<MissionItem>> {
    let command = command as u16;
    let is_handle = [MissionItem::HANDLE_2, MissionItem::HANDLE_3].contains(&command);
    if !(is_handle || FLOWN_TO.contains(&command)) || (latitude, longitude) == (0.0, 0.0) {
        return Ok(None);
    }
    ensure!(
        latitude.abs() <= 85.0 && longitude.abs() <= 180.0,
        "no place on a route: {latitude}, {longitude}"
    );
    Ok(Some(MissionItem {
        sequence: u16::try_from(at)?,
        command: if is_handle {
            command
        } else {
            MissionItem::WAYPOINT
        },
        frame: 0,
        latitude: (latitude * UNITS).round() as i32,
        longitude: (longitude * UNITS).round() as i32,
        height_m: 0.0,
    }))
}

fn track(items: &[MissionItem]) -> Result<Track> {
    let first = items.first().context("no item has a place")?;
    ensure!(
        first.command == MissionItem::WAYPOINT,
        "it begins with a handle"
    );
    let (mut before, mut rest) = (first, &items[1..]);
    let mut legs = Vec::new();
    while let Some(next) = rest.first() {
        if next.command == MissionItem::WAYPOINT {
            legs.push(Leg::Straight(next.place()));
            (before, rest) = (next, &rest[1..]);
        } else {
            let (three, behind) = rest
                .split_first_chunk()
                .context("a curve without its end")?;
            let curve = curve_of_items(before, three);
            legs.push(Leg::Curved(curve.map_err(anyhow::Error::new)?));
            (before, rest) = (&three[2], behind);
        }
    }
    Track::of_legs(first.place(), &legs).context("a mission of one place has no way")
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t47.0\t8.0\t400\t1
1\t0\t3\t16\t0\t0\t0\t0\t47.1\t8.0\t50\t1
2\t0\t3\t178\t0\t0\t0\t0\t0\t0\t0\t1
3\t0\t3\t16\t0\t0\t0\t0\t47.101\t8.0\t50\t1
";

    #[test]
    fn a_text_and_a_plan_lead_the_same_way() {
        let length_m = track(&of_text(TEXT).unwrap()).unwrap().length_m();
        // A thousandth of a degree.
        assert!((length_m - 111.17).abs() < 0.05, "{length_m}");
        let simple = |latitude: f64| {
            serde_json::json!({"type": "SimpleItem", "command": 16,
                "params": [0, 0, 0, null, latitude, 8.0, 50]})
        };
        let plan = serde_json::json!({"mission": {"items": [simple(47.1), simple(47.101)]}});
        let again = track(&of_plan(&plan.to_string()).unwrap()).unwrap();
        assert!((again.length_m() - length_m).abs() < 1e-9);
    }

    #[test]
    fn two_handles_make_a_curve_and_one_is_refused() {
        let handles = "4\t0\t3\t31005\t0\t0\t0\t0\t47.1015\t8.0\t50\t1
5\t0\t3\t31006\t0\t0\t0\t0\t47.102\t8.0005\t50\t1
";
        let end = "6\t0\t3\t16\t0\t0\t0\t0\t47.102\t8.001\t50\t1\n";
        let straight = track(&of_text(TEXT).unwrap()).unwrap().length_m();
        let curved = track(&of_text(&format!("{TEXT}{handles}{end}")).unwrap()).unwrap();
        let more_m = curved.length_m() - straight;
        assert!((120.0..190.0).contains(&more_m), "{more_m}");
        let cut = of_text(&format!("{TEXT}{handles}")).unwrap();
        assert!(track(&cut).is_err());
    }

    #[test]
    fn what_is_no_mission_is_refused() {
        assert!(of_plan("nothing").is_err());
        assert!(of_plan("{}").is_err());
        assert!(of_text("QGC WPL 110\n1 0 3 16").is_err());
        assert!(track(&of_text("QGC WPL 110\n").unwrap()).is_err());
        let survey = r#"{"mission": {"items": [{"type": "ComplexItem"}]}}"#;
        assert!(
            of_plan(survey)
                .unwrap_err()
                .to_string()
                .contains("ComplexItem")
        );
    }
}
