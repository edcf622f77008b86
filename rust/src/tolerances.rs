//! Every number that decides: without units, against a bound of rounding.

/// Straight rolling: B''' and the third power of E, over the speed (lengths over the characteristic length) to the same power, and
/// forces along the path over their terms. Larger: motion on slow curves is linearised as if straight; smaller: rounding of a drawn
/// model refuses it. Pinned by `a_curve_and_a_trailer_are_refused` and the bicycle of tests/truth/test_rolling.py.
pub const ROLLS_STEADILY: f64 = 1e-9;

/// Rounding that forces which cancel leave in their tangent, over the sum of their sizes. Larger: a weak force along the path of
/// rolling passes unseen; smaller: weight alone refuses. Pinned by the bicycle of tests/truth/test_rolling.py.
pub const ROUNDING_OF_FORCES: f64 = 1e-12;
