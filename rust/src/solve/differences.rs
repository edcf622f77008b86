//! Jacobians by forward differences, dense or over a known pattern with columns evaluated in groups.
use faer::Mat;

use super::Residual;
use crate::error::Result;
use crate::linalg::sparse::Csc;

/// Increment of one unknown.
pub fn increment(relative: f64, x: f64) -> f64 {
    relative * x.abs().max(1.0)
}

/// Column j is (F(x + h_j e_j) - F(x))/h_j; backward where the forward point has no finite residual. n evaluations or a few more.
pub fn dense(
    problem: &mut dyn Residual,
    x: &[f64],
    f: &[f64],
    relative: f64,
    evaluations: &mut u64,
) -> Result<Mat<f64>> {
    let n = x.len();
    let mut jacobian = Mat::zeros(n, n);
    let mut at = x.to_vec();
    let mut out = vec![0.0; n];
    for j in 0..n {
        let step = increment(relative, x[j]);
        for h in [step, -step] {
            at[j] = x[j] + h;
            // what was added after rounding
            let h = at[j] - x[j];
            problem.residual(&at, &mut out)?;
            *evaluations += 1;
            (0..n).for_each(|i| jacobian[(i, j)] = (out[i] - f[i]) / h);
            if out.iter().all(|v| v.is_finite()) {
                break;
            }
        }
        at[j] = x[j];
    }
    Ok(jacobian)
}

/// Over a pattern: columns that share no row are moved together (A. R. Curtis, M. J. D. Powell and J. K. Reid, J. Inst. Maths
/// Applics 13 (1974) 117-119), so that a band of width w costs w evaluations, whatever n is.
pub fn sparse(
    problem: &mut dyn Residual,
    x: &[f64],
    f: &[f64],
    relative: f64,
    pattern: &Csc,
    evaluations: &mut u64,
) -> Result<Csc> {
    let n = x.len();
    let mut out = vec![0.0; n];
    let mut jacobian = pattern.clone();
    for group in groups(pattern) {
        let mut at = x.to_vec();
        for &j in &group {
            at[j] += increment(relative, x[j]);
        }
        problem.residual(&at, &mut out)?;
        *evaluations += 1;
        for &j in &group {
            for k in pattern.start[j] as usize..pattern.start[j + 1] as usize {
                let i = pattern.row[k] as usize;
                jacobian.value[k] = (out[i] - f[i]) / (at[j] - x[j]);
            }
        }
    }
    Ok(jacobian)
}

/// Columns in the order of their index, each put in the first group where it meets nobody.
fn groups(pattern: &Csc) -> Vec<Vec<usize>> {
    let mut groups: Vec<(Vec<usize>, Vec<bool>)> = Vec::new();
    for j in 0..pattern.cols {
        let rows = &pattern.row[pattern.start[j] as usize..pattern.start[j + 1] as usize];
        let free = |used: &[bool]| rows.iter().all(|r| !used[*r as usize]);
        let place = groups.iter().position(|(_, used)| free(used));
        let place = place.unwrap_or_else(|| {
            groups.push((Vec::new(), vec![false; pattern.rows]));
            groups.len() - 1
        });
        groups[place].0.push(j);
        rows.iter().for_each(|r| groups[place].1[*r as usize] = true);
    }
    groups.into_iter().map(|(columns, _)| columns).collect()
}
