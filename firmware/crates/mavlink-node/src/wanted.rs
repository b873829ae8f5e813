//! The frames that a node wants: requests, and where each names its target.

use mavlink::MessageData;
use mavlink::dialects::common::{
    COMMAND_INT_DATA, COMMAND_LONG_DATA, LOG_ERASE_DATA, LOG_REQUEST_DATA_DATA,
    LOG_REQUEST_END_DATA, LOG_REQUEST_LIST_DATA, PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA,
    PARAM_SET_DATA, TIMESYNC_DATA,
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
        targeted::<COMMAND_LONG_DATA>(),
        targeted::<COMMAND_INT_DATA>(),
        targeted::<PARAM_REQUEST_LIST_DATA>(),
        targeted::<LOG_REQUEST_LIST_DATA>(),
        targeted::<LOG_REQUEST_DATA_DATA>(),
        targeted::<LOG_ERASE_DATA>(),
        targeted::<LOG_REQUEST_END_DATA>(),
        // Their lengths in MAVLink 1 are also ids of parameter messages: see the
        // framer's *Cost*.
        targeted::<PARAM_REQUEST_READ_DATA>().not_in_v1(),
        targeted::<PARAM_SET_DATA>().not_in_v1(),
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
        // PARAM_REQUEST_LIST, LOG_ERASE, LOG_REQUEST_END.
        _ => 0,
    }
}
