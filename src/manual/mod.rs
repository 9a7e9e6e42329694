//! The user's manual, one page a subject.

/// Every flag, file and exit code.
#[doc = include_str!("command_line.md")]
pub mod command_line {}

/// Coordinates, numbering, rays, hits and colours: what every part agrees on.
#[doc = include_str!("conventions.md")]
pub mod conventions {}

/// The editor, in ten steps.
#[doc = include_str!("editor.md")]
pub mod editor {}

/// The numerically hard cases: what each stands for, its truth and its bar.
#[doc = include_str!("hard_cases.md")]
pub mod hard_cases {}

/// What is read of OBJ, MTL and glTF, and the test of each.
#[doc = include_str!("imports.md")]
pub mod imports {}

/// Renderings that outlive a process or a machine: resuming, parts, frames, and the engines that start them.
#[doc = include_str!("jobs.md")]
pub mod jobs {}

/// How materials of model files become terms of the shading formula.
#[doc = include_str!("materials.md")]
pub mod materials {}

/// How to read what `whitted report` measures.
#[doc = include_str!("report.md")]
pub mod report {}

/// The scene file, section by section.
#[doc = include_str!("scene_format.md")]
pub mod scene_format {}
