//! Filtering of normal maps: what comes out, how near it comes to the light of all texels, and what an app sees of it.

mod accuracy;
mod app;
mod maps;
mod render;
