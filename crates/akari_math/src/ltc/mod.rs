//! Linearly transformed cosines: the integral of a GGX lobe over a polygon in closed form.
//!
//! Heitz, Dupuy, Hill, Neubelt 2016, "Real-Time Polygonal-Light Shading with Linearly Transformed Cosines".

pub mod lookup;
pub mod polygon;
pub mod table;
