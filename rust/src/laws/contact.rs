//! Contact without memory: linear beyond a gap, and after Hertz.
use super::Scalar;

/// k max(u - gap, 0); with smoothing s > 0 the hyperbola k (d + sqrt(d^2 + s^2)) / 2 of d = u - gap.
pub fn gap<D: Scalar>(u: D, k: D, gap: D, smoothing: D) -> D {
    let d = u - gap;
    if smoothing.re() > 0.0 {
        let root = (d * d + smoothing * smoothing).sqrt();
        // the second form is the first without its cancellation
        let opening = if d.re() >= 0.0 { d + root } else { smoothing * smoothing / (root - d) };
        k * opening * 0.5
    } else if d.re() > 0.0 {
        k * d
    } else {
        D::from(0.0)
    }
}

/// k max(u - gap, 0)^exponent
pub fn hertz<D: Scalar>(u: D, k: D, exponent: D, gap: D) -> D {
    let d = u - gap;
    if d.re() > 0.0 { k * d.powd(exponent) } else { D::from(0.0) }
}
