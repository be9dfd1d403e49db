//! Headless GPU device, runner of WGSL functions against their Rust twins, image comparison for tests.
