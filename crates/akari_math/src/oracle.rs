//! f64 oracles (slow).
