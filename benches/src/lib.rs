//! Benches of `bevy_akari`.

pub mod instructions;
pub mod plot;
