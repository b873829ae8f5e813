//! The measuring ground: our clock and the baselines on the same arrivals.
//!
//! *Purpose.* How far apart two equal boards are, in every case that the bounds
//! name, and whether the bounds hold.
//!
//! *Design.* A [`case`] describes a world. A [`trial`] runs two boards in
//! one, with our very clock on a [`board_model`] and the [`baselines`] beside it. A
//! [`campaign`] runs the trials of many seeds on all cores and pools them into
//! [`figures`]; [`bounds`] judge those, [`report`] prints them. Everything comes
//! from the seed: the order of the threads changes no figure.
//!
//! *Limits.* A world of formulas; recordings of real receivers go through
//! [`trace`].
#![forbid(unsafe_code)]

pub mod baselines;
pub mod bounds;
pub mod campaign;
pub mod case;
pub mod figures;
pub mod report;
pub mod smooth;
pub mod spread;
pub mod trace;
pub mod trial;
