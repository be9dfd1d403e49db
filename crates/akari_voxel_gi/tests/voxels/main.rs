//! Light in voxels that the CPU made: energy, leaks, feedback. On a device, without Bevy.

mod build;
mod furnace;
mod lamps;
mod leaks;
mod passes;
mod shadows;
