//! Friction without memory.
use super::Scalar;

/// limit tanh(v / v_ref). Written with expm1 of a negative number: sinh/cosh, which duals use, overflows.
pub fn coulomb_tanh<D: Scalar>(v: D, limit: D, v_ref: D) -> D {
    let x = v / v_ref;
    let positive = x.re() >= 0.0;
    let y = if positive { x } else { -x } * -2.0;
    let t = -y.exp_m1() / (y.exp() + 1.0);
    limit * if positive { t } else { -t }
}
