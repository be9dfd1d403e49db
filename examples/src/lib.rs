//! Examples of bevy_akari.
