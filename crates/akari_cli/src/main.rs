//! The akari command line.

fn main() {}
