//! All integration tests in one binary, so that it links once.

mod accelerators;
mod architecture;
mod batches;
mod bench;
mod both_formats;
mod built;
mod command_line;
mod common;
mod detail;
mod diff;
mod doctor;
mod explain;
mod explain_command;
mod far_from_origin;
mod golden;
mod golden_models;
mod hard_cases;
mod jobs;
mod memory;
mod metamorphic;
mod models;
mod nasty;
mod query;
mod reference;
mod report;
mod shading;
