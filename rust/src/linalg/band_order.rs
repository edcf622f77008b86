//! Orders of coordinates that bring the entries of a sparse symmetric pattern near the diagonal.

/// Reverse Cuthill-McKee (E. Cuthill and J. McKee, ACM National Conference 1969): old indices in their new order.
pub fn order(neighbours: &[Vec<usize>]) -> Vec<usize> {
    let n = neighbours.len();
    let mut by_degree: Vec<usize> = (0..n).collect();
    by_degree.sort_by_key(|i| neighbours[*i].len());
    let mut seen = vec![false; n];
    let mut all = Vec::with_capacity(n);
    for first in by_degree {
        if seen[first] {
            continue;
        }
        // from one end to the other
        let (mut part, mut depth) = breadth_first(first, neighbours, &mut seen);
        while let Some(&end) = part.last() {
            part.iter().for_each(|i| seen[*i] = false);
            let (other, farther) = breadth_first(end, neighbours, &mut seen);
            let deeper = farther > depth;
            (part, depth) = (other, farther);
            if !deeper {
                break;
            }
        }
        all.append(&mut part);
    }
    all.reverse();
    all
}

/// All that is connected with `first`, level by level, of few neighbours before those of many, and the number of levels.
fn breadth_first(first: usize, neighbours: &[Vec<usize>], seen: &mut [bool]) -> (Vec<usize>, usize) {
    let (mut found, mut begin, mut depth) = (vec![first], 0, 0);
    seen[first] = true;
    while begin < found.len() {
        let end = found.len();
        for at in begin..end {
            let from = found.len();
            for &j in &neighbours[found[at]] {
                if !seen[j] {
                    seen[j] = true;
                    found.push(j);
                }
            }
            found[from..].sort_by_key(|j| neighbours[*j].len());
        }
        (begin, depth) = (end, depth + 1);
    }
    (found, depth)
}
