//! Headless render tests of bevy_akari.
