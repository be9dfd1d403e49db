//! Polygonal, textured area lights on GGX for Bevy, by linearly transformed cosines.
