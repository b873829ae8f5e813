//! Where nodes of STANAG 4586 are, as it is typed.

use std::fmt;
use std::str::FromStr;

use stanag_net::Place;
use stanag_wire::NodeId;

/// Where a group meets, and which of its nodes is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Target {
    pub(super) place: Place,
    pub(super) id: Option<NodeId>,
}

impl FromStr for Target {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (place, id) = text
            .split_once('/')
            .map_or((text, None), |(a, b)| (a, Some(b)));
        let place = if place.is_empty() {
            Place::default()
        } else {
            place.parse()?
        };
        let id = id.map(|id| {
            let digits = id.replace(':', "");
            u32::from_str_radix(&digits, 16)
                .ok()
                .filter(|_| digits.len() == 8)
                .map(NodeId)
                .ok_or_else(|| format!("`{id}` is no id, as in 00:50:43:01"))
        });
        let id = id.transpose()?;
        Ok(Self { place, id })
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "stanag:{}", self.place)?;
        match self.id {
            Some(id) => write!(f, "/{id}"),
            None => Ok(()),
        }
    }
}
