//! What holds for every structure, preset and tree.

mod box_trees;
mod builds;
mod compare;
mod hits;
mod intervals;
mod meshes;
