//! All integration tests in one binary, so that it links once.

mod accelerators;
mod architecture;
mod common;
mod shading;
