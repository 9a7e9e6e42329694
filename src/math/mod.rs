//! Arithmetic that gives the same bits everywhere.
//!
//! No fused multiply-add, no reassociation, no platform `pow` or trigonometry: sums are spelled out in one order, and
//! transcendental functions come from the crate `libm`, which is pure Rust.

pub mod eigen;
pub mod float;
pub mod lanes;
pub mod origin;
pub mod quadratic;
pub mod random;
pub mod simd;
pub mod transform;
pub mod vector;

pub use transform::Transform;
