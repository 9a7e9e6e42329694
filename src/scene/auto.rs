//! The camera and lights of a bare model.
