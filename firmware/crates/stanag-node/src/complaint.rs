//! What is wrong with what others sent, in words for them.
//!
//! *Design.* One place for each kind, so that a flood of bad input costs one alert of a kind for each time
//! that the caller polls, and no queue can fill.

use stanag_wire::NodeId;

/// What is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Complaint {
    /// A station wants LOI 3 or more.
    Loi,
    /// A message asks for a change.
    NoKey,
    /// One of our own numbers that has no meaning yet, or a parameter that is not there.
    NotKnown,
    /// The data are not as long as their presence vector says.
    Malformed,
    /// A frame came from our own id.
    OurId,
    /// A datagram does not divide into whole frames.
    NotWhole,
    /// A frame of an edition that is not spoken.
    Idd,
    /// A frame on a serial line has no sum that could be checked.
    NoSum,
}

impl Complaint {
    const ALL: [Self; 8] = [
        Self::Loi,
        Self::NoKey,
        Self::NotKnown,
        Self::Malformed,
        Self::OurId,
        Self::NotWhole,
        Self::Idd,
        Self::NoSum,
    ];

    /// In words, shorter than the text of an alert.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Loi => "LOI 2 granted, no more: nothing here flies",
            Self::NoKey => "not changed: nothing changes without a key",
            Self::NotKnown => "not known here",
            Self::Malformed => "refused: length is not the presence vector's",
            Self::OurId => "another node has our id",
            Self::NotWhole => "refused whole: does not divide into frames",
            Self::Idd => "refused: IDD 30 is spoken, 32 read",
            Self::NoSum => "refused: on a line a frame needs a sum",
        }
    }
}

/// Who is to receive which of them.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Complaints([Option<NodeId>; Complaint::ALL.len()]);

impl Complaints {
    pub(crate) fn push(&mut self, to: NodeId, what: Complaint) {
        if let Some(place) = self.0.get_mut(what as usize) {
            *place = Some(to);
        }
    }

    pub(crate) fn poll(&mut self) -> Option<(NodeId, Complaint)> {
        let mut places = self.0.iter_mut().zip(Complaint::ALL);
        places.find_map(|(place, what)| Some((place.take()?, what)))
    }
}
