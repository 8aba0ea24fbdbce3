//! The diameter of a set of points.

/// Largest distance of two of the points; 0 for fewer than two.
///
/// Scaled exactly when all coordinates are scaled by a power of two.
pub(crate) fn diameter(points: &[[f64; 2]]) -> f64 {
    let hull = convex_hull(points);
    let n = hull.len();
    let distance = |i: usize, j: usize| (hull[i][0] - hull[j][0]).hypot(hull[i][1] - hull[j][1]);
    if n < 3 {
        return if n == 2 { distance(0, 1) } else { 0.0 };
    }
    // The farthest vertex from an edge only moves on as the edge goes round.
    let mut far = 1;
    let mut largest = 0.0f64;
    for i in 0..n {
        let next = (i + 1) % n;
        while cross(hull[i], hull[next], hull[(far + 1) % n])
            > cross(hull[i], hull[next], hull[far])
        {
            far = (far + 1) % n;
        }
        for j in [far, (far + 1) % n] {
            largest = largest.max(distance(i, j)).max(distance(next, j));
        }
    }
    largest
}

fn cross(o: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])
}

/// Corners of the convex hull, counter-clockwise (Andrew's monotone chain).
fn convex_hull(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    sorted.dedup();
    if sorted.len() < 3 {
        return sorted;
    }
    let mut hull: Vec<[f64; 2]> = Vec::new();
    let mut half = |points: &mut dyn Iterator<Item = &[f64; 2]>| {
        let start = hull.len();
        for &p in points {
            while hull.len() >= start + 2
                && cross(hull[hull.len() - 2], hull[hull.len() - 1], p) <= 0.0
            {
                hull.pop();
            }
            hull.push(p);
        }
        // The last point begins the other half.
        hull.pop();
    };
    half(&mut sorted.iter());
    half(&mut sorted.iter().rev());
    hull
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn diameters_by_hand() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]];
        assert_eq!(diameter(&square), 2f64.sqrt());
        assert_eq!(diameter(&[[0.0, 0.0], [3.0, 4.0]]), 5.0);
        assert_eq!(diameter(&[[1.0, 1.0], [1.0, 1.0]]), 0.0);
        assert_eq!(diameter(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]), 2.0);
        assert_eq!(diameter(&[]), 0.0);
    }

    #[test]
    fn it_agrees_with_trying_all_pairs() {
        let mut state = 1u64;
        let mut random = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        for n in 3..60 {
            let points: Vec<[f64; 2]> = (0..n).map(|_| [random(), random()]).collect();
            let mut brute = 0.0f64;
            for p in &points {
                for q in &points {
                    brute = brute.max((p[0] - q[0]).hypot(p[1] - q[1]));
                }
            }
            assert_eq!(diameter(&points), brute, "{n}");
        }
    }
}
