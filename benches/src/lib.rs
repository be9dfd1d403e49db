//! Benches of `bevy_akari`.
