//! Distance from a point to the nearest of many segments: a tree of boxes, split at the median.
//!
//! Building costs O(n log n), a query O(log n) for points near the segments. Boxes instead of a grid: on a graded mesh the
//! segments differ in length by many orders.

/// A segment by its ends.
pub(super) type Segment = [[f64; 2]; 2];

/// Segments in a leaf.
const LEAF: usize = 6;

struct Node {
    low: [f64; 2],
    high: [f64; 2],
    /// Range of segments below.
    range: std::ops::Range<usize>,
    /// The second child; the first follows its parent. 0 for a leaf.
    second: usize,
}

/// Segments that can be searched.
pub(super) struct Nearest {
    segments: Vec<Segment>,
    nodes: Vec<Node>,
}

impl Nearest {
    pub fn new(mut segments: Vec<Segment>) -> Nearest {
        let mut nodes = Vec::with_capacity(2 * segments.len() / LEAF + 1);
        let count = segments.len();
        if count > 0 {
            build(&mut segments, 0..count, &mut nodes);
        }
        Nearest { segments, nodes }
    }

    /// The nearest segment to `p` and its squared distance; none if there are no segments.
    pub fn find(&self, p: [f64; 2]) -> Option<(&Segment, f64)> {
        let mut best = (None, f64::INFINITY);
        // The depth of the tree is the logarithm of a number that fits into memory.
        let mut stack = [0usize; 64];
        let mut height = usize::from(!self.nodes.is_empty());
        while height > 0 {
            height -= 1;
            let at = stack[height];
            let node = &self.nodes[at];
            if node.squared_distance(p) >= best.1 {
                continue;
            }
            if node.second == 0 {
                for segment in &self.segments[node.range.clone()] {
                    let d = squared_distance(p, segment);
                    if d < best.1 {
                        best = (Some(segment), d);
                    }
                }
                continue;
            }
            let children = [at + 1, node.second];
            let [a, b] = children.map(|c| self.nodes[c].squared_distance(p));
            // The nearer child on top.
            let order = if a <= b { [1, 0] } else { [0, 1] };
            for c in order {
                stack[height] = children[c];
                height += 1;
            }
        }
        best.0.map(|segment| (segment, best.1))
    }
}

fn build(segments: &mut [Segment], range: std::ops::Range<usize>, nodes: &mut Vec<Node>) {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for p in segments[range.clone()].iter().flatten() {
        for k in 0..2 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    let at = nodes.len();
    nodes.push(Node {
        low,
        high,
        range: range.clone(),
        second: 0,
    });
    if range.len() <= LEAF {
        return;
    }
    let axis = usize::from(high[1] - low[1] > high[0] - low[0]);
    let middle = range.start + range.len() / 2;
    let key = |s: &Segment| s[0][axis] + s[1][axis];
    segments[range.clone()]
        .select_nth_unstable_by(range.len() / 2, |s, t| key(s).total_cmp(&key(t)));
    build(segments, range.start..middle, nodes);
    nodes[at].second = nodes.len();
    build(segments, middle..range.end, nodes);
}

impl Node {
    fn squared_distance(&self, p: [f64; 2]) -> f64 {
        let outside = |k: usize| (self.low[k] - p[k]).max(p[k] - self.high[k]).max(0.0);
        outside(0).powi(2) + outside(1).powi(2)
    }
}

/// Squared distance of a point to a segment, which may be a point.
pub(super) fn squared_distance(p: [f64; 2], [a, b]: &Segment) -> f64 {
    let d = [b[0] - a[0], b[1] - a[1]];
    let v = [p[0] - a[0], p[1] - a[1]];
    let length = d[0] * d[0] + d[1] * d[1];
    let along = v[0] * d[0] + v[1] * d[1];
    let t = if along <= 0.0 {
        0.0
    } else if along >= length {
        1.0
    } else {
        along / length
    };
    // From the nearer end, so that a point at the far end of a long segment keeps its digits.
    let (q, t) = if t > 0.5 { (b, t - 1.0) } else { (a, t) };
    let rest = [p[0] - q[0] - t * d[0], p[1] - q[1] - t * d[1]];
    rest[0] * rest[0] + rest[1] * rest[1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_what_trying_all_finds() {
        // A fixed sequence without pattern; lengths over six orders.
        let mut state = 1u64;
        let mut next = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        for count in [0, 1, 6, 7, 500] {
            let segments: Vec<Segment> = (0..count)
                .map(|_| {
                    let (a, size) = ([next(), next()], 10f64.powf(-6.0 * next()));
                    [a, [a[0] + size * next(), a[1] - size * next()]]
                })
                .collect();
            let tree = Nearest::new(segments.clone());
            for _ in 0..200 {
                let p = [3.0 * next() - 1.0, 3.0 * next() - 1.0];
                let all = segments
                    .iter()
                    .map(|s| squared_distance(p, s))
                    .fold(f64::INFINITY, f64::min);
                match tree.find(p) {
                    Some((segment, d)) => {
                        assert_eq!(d, all);
                        assert_eq!(squared_distance(p, segment), d);
                    }
                    None => assert_eq!(count, 0),
                }
            }
        }
    }

    #[test]
    fn distances_to_a_segment() {
        let s = [[1.0, 1.0], [4.0, 5.0]];
        assert_eq!(squared_distance([0.0, 1.0], &s), 1.0);
        assert_eq!(squared_distance([4.0, 7.0], &s), 4.0);
        assert_eq!(squared_distance([1.0 - 4.0, 1.0 + 3.0], &s), 25.0);
        assert_eq!(squared_distance([3.0, 4.0], &[[0.0, 0.0]; 2]), 25.0);
    }
}
