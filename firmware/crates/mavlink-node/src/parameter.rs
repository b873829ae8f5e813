//! Parameters that are still to be sent.
//!
//! *Design.* A request is noted as a bit for each parameter that it wants, so that a second request
//! costs nothing. The values are looked up and sent one at a time, when the line has room
//! ([`Node::poll`](crate::Node::poll)). All values are REAL32, which every client understands.
//!
//! *Limits.* PARAM_SET changes nothing. It is answered with PARAM_ERROR, for clients that know it, and
//! with the present value, which is how MAVLink refused it before.

use mavlink::dialects::common::{MavParamType, PARAM_VALUE_DATA};
use node_values::{Name, Parameter, Parameters};

use crate::frame::{Frame, Sender, Version};

/// The parameters that are still to be sent.
#[derive(Debug)]
pub(crate) struct PendingParameters {
    version: Version,
    /// A bit for each, by index.
    bits: u16,
}

const _: () = assert!(Parameter::ALL.len() <= u16::BITS as usize);

impl PendingParameters {
    pub(crate) const NONE: Self = Self {
        version: Version::V1,
        bits: 0,
    };

    pub(crate) const fn all(&mut self, version: Version) {
        self.version = version;
        self.bits = (1 << Parameter::ALL.len()) - 1;
    }

    pub(crate) const fn one(&mut self, version: Version, parameter: Parameter) {
        self.version = version;
        self.bits |= 1 << parameter.index();
    }

    pub(crate) const fn is_none(&self) -> bool {
        self.bits == 0
    }

    pub(crate) fn poll(
        &mut self,
        sender: &mut Sender,
        parameters: &impl Parameters,
    ) -> Option<Frame> {
        let index = self.bits.trailing_zeros();
        let parameter = *Parameter::ALL.get(index as usize)?;
        self.bits &= !(1 << index);
        let value = PARAM_VALUE_DATA {
            param_value: parameters.parameter(parameter),
            param_count: Parameter::ALL.len() as u16,
            param_index: parameter.index(),
            param_id: Name::from(parameter.name()).bytes().into(),
            param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
        };
        Some(sender.message(self.version, &value))
    }
}
