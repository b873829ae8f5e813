//! The frames that a node wants: requests, and where each names its target.

use mavlink::MessageData;
use mavlink::dialects::common::{
    COMMAND_INT_DATA, COMMAND_LONG_DATA, FILE_TRANSFER_PROTOCOL_DATA, LOG_ERASE_DATA,
    LOG_REQUEST_DATA_DATA, LOG_REQUEST_END_DATA, LOG_REQUEST_LIST_DATA, MISSION_REQUEST_LIST_DATA,
    PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, TIMESYNC_DATA,
};

use crate::kind::{Kind, Wanted};
use crate::ping::Ping;

/// The kinds of frames that a [`Node`](crate::Node) wants.
#[derive(Debug)]
pub struct Requests;

impl Wanted for Requests {
    const KINDS: &'static [Kind] = &[
        Ping::KIND,
        Kind::of::<TIMESYNC_DATA>(16, 1),
        targeted::<COMMAND_LONG_DATA>().guarded(),
        targeted::<COMMAND_INT_DATA>().guarded(),
        targeted::<PARAM_REQUEST_READ_DATA>(),
        targeted::<PARAM_REQUEST_LIST_DATA>(),
        targeted::<PARAM_SET_DATA>().guarded(),
        targeted::<LOG_REQUEST_LIST_DATA>(),
        targeted::<LOG_REQUEST_DATA_DATA>().guarded(),
        targeted::<LOG_ERASE_DATA>().guarded(),
        targeted::<LOG_REQUEST_END_DATA>().guarded(),
        // Its type of mission is an extension.
        Kind::of::<MISSION_REQUEST_LIST_DATA>(2, 1),
        // In MAVLink 1 its payload would be longer than all answers.
        Kind::of::<FILE_TRANSFER_PROTOCOL_DATA>(254, 2).not_in_v1(),
    ];
}

/// A kind of request with a target. In MAVLink 2 it must be long enough to have the target's
/// system: where trailing zeros cut that off, the request is not for us.
const fn targeted<M: MessageData>() -> Kind {
    Kind::of::<M>(M::ENCODED_LEN as u8, target_at(M::ID) as u8 + 1)
}

/// The offset of a request's target in its payload, in bytes: system, then component.
pub(crate) const fn target_at(id: u32) -> usize {
    match id {
        COMMAND_INT_DATA::ID | COMMAND_LONG_DATA::ID => 30,
        LOG_REQUEST_DATA_DATA::ID => 10,
        LOG_REQUEST_LIST_DATA::ID | PARAM_SET_DATA::ID => 4,
        PARAM_REQUEST_READ_DATA::ID => 2,
        FILE_TRANSFER_PROTOCOL_DATA::ID => 1,
        // PARAM_REQUEST_LIST, LOG_ERASE, LOG_REQUEST_END, MISSION_REQUEST_LIST.
        _ => 0,
    }
}
