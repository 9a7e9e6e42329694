//! The editor: a scene changed by commands, without a window, and the window that shows it.
//!
//! A [`Session`] holds the text of a scene file and what it says. Every change is a [`Command`], which edits the text and reads
//! it again: what cannot be read is not done, what is undone is the same text, and what is saved is what is seen. The window
//! and its panels show a session and send it commands.

pub mod command;
pub mod document;
pub mod gizmo;
pub mod history;
pub mod item;
pub mod job;
pub mod navigate;
pub mod numbers;
pub mod placement;
pub mod presets;
pub mod session;
#[cfg(test)]
mod tests;
pub mod viewport;
pub mod window;

pub use command::Command;
pub use item::{Item, Kind};
pub use session::Session;
