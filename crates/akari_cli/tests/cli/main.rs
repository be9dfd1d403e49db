//! The command line as a user and as somebody with bad files meets it: exit codes, messages, what is left on disk.

mod bad_scenes;
mod bake;
mod buffers;
mod compare;
mod denoise;
mod gltf;
mod interrupt;
mod outputs;
mod report;
mod run;
mod usage;
