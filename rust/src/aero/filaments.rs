//! Velocities that straight vortex filaments induce, by the law of Biot and Savart.
use std::f64::consts::PI;
use std::num::NonZeroUsize;
use std::thread;

use super::kernels::{Kernel, LANES, LambOseen, Lanes, RosenheadMoore, Segment, Vatistas, add};
use crate::error::{Error, Result};
use crate::run::Cancel;

/// Model of the core of a filament.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Core {
    RosenheadMoore,
    LambOseen,
    /// With its exponent, 1 or more.
    Vatistas(f64),
}

/// Filaments from `start` to `end`.
#[derive(Debug, Clone, Copy)]
pub struct Filaments<'a> {
    pub start: &'a [[f64; 3]],
    pub end: &'a [[f64; 3]],
    pub circulation: &'a [f64],
    pub core_radius: &'a [f64],
}

/// Segments between two looks for Ctrl-C: some milliseconds of work per lane of points.
const LOOK: usize = 1 << 16;

impl Filaments<'_> {
    fn segments(&self) -> Result<Vec<Segment>> {
        let n = self.start.len();
        if self.end.len() != n || self.circulation.len() != n || self.core_radius.len() != n {
            return Err(Error::model(format!("{n} filaments need as many ends, circulations and core radii")));
        }
        let one = |i: usize| {
            let (start, end) = (self.start[i], self.end[i]);
            let length2 = (0..3).map(|k| (end[k] - start[k]).powi(2)).sum();
            let strength = self.circulation[i] / (4.0 * PI);
            Segment { start, end, length2, strength, core2: self.core_radius[i].powi(2) }
        };
        // a filament without length induces nothing
        Ok((0..n).map(one).filter(|s| s.length2 > 0.0).collect())
    }
}

/// Velocities at `points`, with so many threads (0: as the machine has). Each point sums over the filaments in their order on one
/// thread, so that the bits are the same for any number of threads.
///
/// # Errors
/// Lists of different lengths; an exponent below 1; Ctrl-C.
pub fn velocities(
    filaments: &Filaments<'_>,
    core: Core,
    points: &[[f64; 3]],
    threads: usize,
    cancel: &Cancel,
) -> Result<Vec<[f64; 3]>> {
    let segments = filaments.segments()?;
    match core {
        Core::RosenheadMoore => distribute(RosenheadMoore, &segments, points, threads, cancel),
        Core::LambOseen => distribute(LambOseen, &segments, points, threads, cancel),
        Core::Vatistas(n) if n >= 1.0 => distribute(Vatistas(n), &segments, points, threads, cancel),
        Core::Vatistas(n) => Err(Error::model(format!("the exponent of Vatistas' core must be 1 or more, it is {n}"))),
    }
}

/// The points dealt out to threads in runs of whole lanes.
fn distribute<K: Kernel>(
    kernel: K,
    segments: &[Segment],
    points: &[[f64; 3]],
    threads: usize,
    cancel: &Cancel,
) -> Result<Vec<[f64; 3]>> {
    let machine = thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let threads = if threads == 0 { machine } else { threads };
    let run = points.len().div_ceil(threads).next_multiple_of(LANES).max(LANES);
    let mut out = vec![[0.0; 3]; points.len()];
    if run >= points.len() {
        sum(kernel, segments, points, &mut out, cancel)?;
        return Ok(out);
    }
    let pieces = points.chunks(run).zip(out.chunks_mut(run));
    let ends: Vec<Result<()>> = thread::scope(|scope| {
        let started: Vec<_> = pieces.map(|(p, v)| scope.spawn(move || sum(kernel, segments, p, v, cancel))).collect();
        started.into_iter().map(|one| one.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
    });
    ends.into_iter().collect::<Result<()>>()?;
    Ok(out)
}

fn sum<K: Kernel>(
    kernel: K,
    segments: &[Segment],
    points: &[[f64; 3]],
    out: &mut [[f64; 3]],
    cancel: &Cancel,
) -> Result<()> {
    for (chunk, velocities) in points.chunks(LANES).zip(out.chunks_mut(LANES)) {
        // the last lanes repeat a point: every point goes through the same operations
        let p: [Lanes; 3] = std::array::from_fn(|k| std::array::from_fn(|i| chunk[i.min(chunk.len() - 1)][k]));
        let mut v = [[0.0; LANES]; 3];
        for part in segments.chunks(LOOK) {
            cancel.check()?;
            for segment in part {
                add(kernel, segment, &p, &mut v);
            }
        }
        for (i, velocity) in velocities.iter_mut().enumerate() {
            *velocity = std::array::from_fn(|k| v[k][i]);
        }
    }
    Ok(())
}
