//! How two markers move relative to each other: derived by hand once, shared by all joints and elements.
pub mod relative;
