//! What a run counts and how it is stopped: shared by all analyses.
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};

/// Work counts by name. They are deterministic, so tests assert them; wall times are measured outside.
#[derive(Debug, Clone, Default)]
pub struct Counts(pub BTreeMap<&'static str, u64>);

impl Counts {
    /// Counts n more.
    pub fn add(&mut self, what: &'static str, n: u64) {
        *self.0.entry(what).or_insert(0) += n;
    }

    /// Adds what another run counted.
    pub fn merge(&mut self, other: &Counts) {
        for (what, n) in &other.0 {
            self.add(what, *n);
        }
    }
}

/// Set by the border when Ctrl-C arrives; long loops call `check`.
#[derive(Debug, Default)]
pub struct Cancel(AtomicBool);

impl Cancel {
    /// Loops that run end at their next check.
    pub fn stop(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// An error once `stop` was called.
    pub fn check(&self) -> Result<()> {
        if self.0.load(Ordering::Relaxed) { Err(Error::Interrupted) } else { Ok(()) }
    }
}
