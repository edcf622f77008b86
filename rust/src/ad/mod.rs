//! Numbers that differentiate: many directions at once, and a tape that is read backwards.
pub mod lanes;
pub mod tape;
