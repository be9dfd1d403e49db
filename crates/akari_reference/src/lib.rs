//! CPU path tracer and image metrics: the ground truth of bevy_akari.
