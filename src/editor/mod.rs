//! The editor: a scene changed by commands, without a window, and the window that shows it.

pub mod viewport;
