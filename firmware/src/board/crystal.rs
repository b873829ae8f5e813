//! What is wrong with a crystal.

/// The crystal does not start.
#[derive(Clone, Copy, Debug)]
pub struct CrystalFailed;
