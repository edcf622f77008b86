//! A spring in series with a slider: the element of Jenkins, of which Iwan's model is a parallel set.
use super::Scalar;

/// k (u - z) while it does not exceed `slip`; beyond, the slider follows. `z` is where the slider stands.
pub fn force<D: Scalar>(u: D, k: D, slip: D, z: D, z_new: &mut D) -> D {
    let trial = k * (u - z);
    if trial.re().abs() <= slip.re() {
        *z_new = z;
        return trial;
    }
    let force = if trial.re() > 0.0 { slip } else { -slip };
    *z_new = u - force / k;
    force
}
