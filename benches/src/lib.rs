//! Benches of `bevy_akari`.

pub mod plot;
