//! All integration tests in one binary, so that it links once.

mod accelerators;
mod architecture;
#[cfg(feature = "cli")]
mod command_line;
mod common;
mod golden;
mod models;
mod shading;
mod spawned_rays;
