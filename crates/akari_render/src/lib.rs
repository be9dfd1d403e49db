//! What the passes of bevy_akari share: census, demand, knobs, quality, accounting.
