//! Work that outlives a process or a machine: tiles that are kept as they are finished, shares of a picture, and what puts
//! them together.
//!
//! Every tile file, whoever wrote it, is the same: a [`Header`] that says of which picture of which scene its tiles are, and a
//! checksummed [record](tile_file) a tile. A [`Kept`] file grows while a picture is rendered, so that the next process goes on where
//! one was killed; a part file holds a [`Share`] and is written whole; [`merge()`] makes one picture of parts. Since a
//! tile's bytes depend on scene and settings alone, it does not matter who renders it, or how often.

pub mod estimate;
pub mod header;
pub mod kept;
pub mod merge;
pub mod share;
pub mod tile_file;

pub use header::Header;
pub use kept::Kept;
pub use merge::merge;
pub use share::Share;
