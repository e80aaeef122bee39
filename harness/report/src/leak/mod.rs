//! Leaks: the path as a polyline for VTK ([`polyline`]), and a slice through its narrowest place ([`picture`]).

pub mod picture;
pub mod polyline;
