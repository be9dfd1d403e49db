//! Glossy real-time global illumination for Bevy on any GPU, with its error known.
