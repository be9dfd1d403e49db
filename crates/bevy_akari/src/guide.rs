//! A page for each effect: what it is for, what it costs, how wrong it is, where it ends.
//!
//! | page | effect |
//! |---|---|
//! | [`area_lights`] | light from polygons and disks, plain or textured |
//! | [`shadows`] | soft shadows of area lights from baked visibility |
//! | [`lobes`] | specular lobes and filtered roughness |
//! | [`denoise`] | filtering, accumulation and upsampling of noisy light |
//! | [`voxel_gi`] | indirect light of dynamic scenes |
//! | [`interreflection`] | one bounce between marked surfaces |
//! | [`quality`] | presets, knobs, a frame's budget, and which setting for which time |
//! | [`next_bevy`] | notes for the move to Bevy 0.20 |

#[doc = include_str!("../docs/guide/area_lights.md")]
pub mod area_lights {}

#[doc = include_str!("../docs/guide/shadows.md")]
pub mod shadows {}

#[doc = include_str!("../docs/guide/lobes.md")]
pub mod lobes {}

#[doc = include_str!("../docs/guide/denoise.md")]
pub mod denoise {}

#[doc = include_str!("../docs/guide/voxel_gi.md")]
pub mod voxel_gi {}

#[doc = include_str!("../docs/guide/interreflection.md")]
pub mod interreflection {}

#[doc = include_str!("../docs/guide/quality.md")]
#[doc = include_str!("../docs/measured/llvmpipe/cost.md")]
pub mod quality {}

#[doc = include_str!("../docs/guide/next_bevy.md")]
pub mod next_bevy {}
