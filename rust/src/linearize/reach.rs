//! How far coordinates move bodies: what a size of a coordinate is measured by.
use nalgebra::DMatrix;

/// How far a unit of each coordinate moves the bodies, in characteristic lengths and radians.
pub fn reach(body_map: &DMatrix<f64>, length: f64) -> Vec<f64> {
    if body_map.is_empty() {
        return vec![1.0; body_map.ncols()];
    }
    let square = |t: &[f64]| t[0] * t[0] + t[1] * t[1] + t[2] * t[2];
    let farthest = |column: &[f64]| {
        let mut most = 0.0_f64;
        // those far out come last and move most; (a + b)^2 <= 2 (a^2 + b^2) tells that a body moves less without roots
        for twist in column.rchunks_exact(6) {
            let (place, angle) = (square(&twist[..3]) / (length * length), square(&twist[3..]));
            if 2.0 * (place + angle) > most * most {
                most = most.max(place.sqrt() + angle.sqrt());
            }
        }
        most
    };
    let rows = body_map.nrows();
    body_map.as_slice().chunks_exact(rows).map(farthest).collect()
}
