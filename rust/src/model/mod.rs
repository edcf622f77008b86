//! What the user described, as read from the Tables: bodies, joints, elements and loads, and what geometry follows from the numbers.
pub mod air;
pub mod constraint;
pub mod flexible;
pub mod geometry;
pub mod layout;
pub mod motion;
mod table_checks;
pub mod tables;
