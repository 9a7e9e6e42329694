//! Named quadrics.
