//! A grid of boxes to look up what lies near a point, in about constant time.

/// Boxes of equal size over a rectangle, each with the items that touch it.
pub(crate) struct Grid {
    low: [f64; 2],
    size: [f64; 2],
    count: [usize; 2],
    boxes: Vec<Vec<u32>>,
}

impl Grid {
    /// Sorts items, given by the corners of the rectangles that hold them, into about one box an item. Rectangles grow by `margin`.
    pub fn new(items: &[[[f64; 2]; 2]], margin: f64) -> Grid {
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for [l, h] in items {
            for k in 0..2 {
                low[k] = low[k].min(l[k]);
                high[k] = high[k].max(h[k]);
            }
        }
        let side = ((items.len() as f64).sqrt().ceil() as usize).max(1);
        let mut grid = Grid {
            low,
            size: [0, 1].map(|k| (high[k] - low[k]) / side as f64),
            count: [side; 2],
            boxes: vec![Vec::new(); side * side],
        };
        for (number, [l, h]) in items.iter().enumerate() {
            let first = [0, 1].map(|k| grid.place(l[k] - margin, k));
            let last = [0, 1].map(|k| grid.place(h[k] + margin, k));
            for i in first[0]..=last[0] {
                for j in first[1]..=last[1] {
                    grid.boxes[i * side + j].push(number as u32);
                }
            }
        }
        grid
    }

    /// Row or column of a coordinate; those outside belong to the nearest box.
    fn place(&self, x: f64, k: usize) -> usize {
        // A cast from a double saturates; not a number becomes 0.
        (((x - self.low[k]) / self.size[k]).floor() as usize).min(self.count[k] - 1)
    }

    /// The items near a point.
    pub fn near(&self, p: [f64; 2]) -> impl Iterator<Item = usize> + '_ {
        let [i, j] = [0, 1].map(|k| self.place(p[k], k));
        self.boxes[i * self.count[1] + j]
            .iter()
            .map(|&n| n as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_is_found_wherever_it_lies() {
        let items: Vec<[[f64; 2]; 2]> = (0..50)
            .map(|k| {
                let x = f64::from(k % 10);
                let y = f64::from(k / 10);
                [[x, y], [x + 1.5, y + 0.2]]
            })
            .collect();
        let grid = Grid::new(&items, 1e-9);
        for (k, [low, high]) in items.iter().enumerate() {
            for p in [*low, *high, [low[0] - 1e-10, low[1]]] {
                assert!(grid.near(p).any(|n| n == k), "{k} {p:?}");
            }
        }
        assert!(grid.near([f64::NAN, -1e9]).count() > 0);
    }
}
