/// The number of the log: there is one.
pub(crate) const LOG_ID: u16 = 1;
