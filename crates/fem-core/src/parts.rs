//! The parts that a triangle falls into when some of its edges are split: tables, one entry for each set of split edges.
//!
//! A triangle (v0, v1, v2) is bisected into (v2, v0, p) and (v1, v2, p), in this order where the generation is even and in the other where it is
//! odd; the halves are bisected in turn if their refinement edges, (v2, v0) and (v1, v2), are split. Everything else follows from that:
//! who touches whom, and through which edges.

/// The refinement edge: the face opposite to local vertex 2.
pub(crate) const REFINEMENT_EDGE: usize = 2;

/// Faces in the order in which the vertices born on them are numbered.
pub(crate) const FACES: [usize; 3] = [2, 1, 0];

/// Marks a link to another part of the same triangle; without it a link is `2 * face + end` of the triangle.
const INNER: u8 = 16;

/// What becomes of a triangle with certain edges split.
///
/// Corners are numbered 0, 1, 2 and the vertices born on faces 0, 1, 2 have the numbers 3, 4, 5. A face has two ends: end 0 is the corner after the one it is opposite to,
/// in the direction of the triangle, end 1 the one after that. A place is `part << 2 | face of the part`.
#[derive(Clone, Copy)]
pub(crate) struct Parts {
    /// How many, 1 to 4.
    pub count: u8,
    /// Corners of every part.
    pub corners: [[u8; 3]; 4],
    /// Bisections between the triangle and every part.
    pub depth: [u8; 4],
    /// What lies behind every face of every part.
    links: [[u8; 3]; 4],
    /// The place that touches a face of the triangle near one of its ends; the same for both where the face is not split.
    touching: [[u8; 2]; 3],
}

/// What lies behind a face of a part.
pub(crate) enum Link {
    /// A place in the same triangle.
    Inner(u32),
    /// What lies behind the triangle, as `2 * face + end`.
    Outer(usize),
}

impl Parts {
    /// What lies behind face `face` of part `part`.
    #[inline]
    pub fn link(&self, part: usize, face: usize) -> Link {
        let link = self.links[part][face];
        if link & INNER != 0 {
            Link::Inner((link & !INNER) as u32)
        } else {
            Link::Outer((link & 7) as usize)
        }
    }

    const NONE: Parts = Parts {
        count: 0,
        corners: [[0; 3]; 4],
        depth: [0; 4],
        links: [[0; 3]; 4],
        touching: [[0; 2]; 3],
    };

    const fn with(mut self, corners: [u8; 3], depth: u8) -> Parts {
        self.corners[self.count as usize] = corners;
        self.depth[self.count as usize] = depth;
        self.count += 1;
        self
    }

    const fn of(split: usize, odd: bool) -> Parts {
        if split & 1 << REFINEMENT_EDGE == 0 {
            return Parts::NONE.with([0, 1, 2], 0).linked();
        }
        let left = if split & 2 != 0 {
            Parts::NONE.with([0, 5, 4], 2).with([5, 2, 4], 2)
        } else {
            Parts::NONE.with([2, 0, 5], 1)
        };
        let mut all = if split & 1 != 0 {
            left.with([2, 5, 3], 2).with([5, 1, 3], 2)
        } else {
            left.with([1, 2, 5], 1)
        };
        if odd {
            let even = all;
            let mut k = 0;
            while k < even.count as usize {
                all.corners[k] = even.corners[even.count as usize - 1 - k];
                all.depth[k] = even.depth[even.count as usize - 1 - k];
                k += 1;
            }
        }
        all.linked()
    }

    /// Finds what lies behind every face, from the corners alone.
    const fn linked(mut self) -> Parts {
        let mut place = 0;
        while place < 4 * self.count {
            if place % 4 < 3 {
                let (part, face) = (place as usize / 4, place as usize % 4);
                let (from, to) = self.face(place);
                self.links[part][face] = match self.place(to, from) {
                    Some(other) => INNER | other,
                    None => {
                        let (outer, end) = outer(from, to);
                        self.touching[outer][end] = place;
                        if from < 3 && to < 3 {
                            self.touching[outer][1 - end] = place;
                        }
                        (2 * outer + end) as u8
                    }
                };
            }
            place += 1;
        }
        self
    }

    const fn face(&self, place: u8) -> (u8, u8) {
        let corners = &self.corners[place as usize / 4];
        let face = place as usize % 4;
        (corners[(face + 1) % 3], corners[(face + 2) % 3])
    }

    const fn place(&self, from: u8, to: u8) -> Option<u8> {
        let mut place = 0;
        while place < 4 * self.count {
            if place % 4 < 3 {
                let (a, b) = self.face(place);
                if a == from && b == to {
                    return Some(place);
                }
            }
            place += 1;
        }
        None
    }
}

/// Face and end of the triangle where an edge on its rim lies; end 0 for a whole face.
const fn outer(from: u8, to: u8) -> (usize, usize) {
    if from < 3 && to < 3 {
        return (3 - from as usize - to as usize, 0);
    }
    let (corner, born) = if from < to { (from, to) } else { (to, from) };
    let face = born as usize - 3;
    (
        face,
        if corner as usize == (face + 1) % 3 {
            0
        } else {
            1
        },
    )
}

/// The parts for every set of split edges (bit `i`: face `i`) and parity of the generation (bit 3: odd).
///
/// Sets without the refinement edge do not occur, apart from the empty one.
pub(crate) static PARTS: [Parts; 16] = PARTS_OF_KEYS;

const PARTS_OF_KEYS: [Parts; 16] = {
    let mut all = [Parts::NONE; 16];
    let mut key = 0;
    while key < 16 {
        all[key] = Parts::of(key & 7, key & 8 != 0);
        key += 1;
    }
    all
};

/// [`Parts::touching`] of all parts in one table, at `key << 2 | face`.
pub(crate) static TOUCHING: [[u8; 2]; 64] = {
    let mut all = [[0; 2]; 64];
    let mut place = 0;
    while place < 64 {
        if place % 4 < 3 {
            all[place] = PARTS_OF_KEYS[place / 4].touching[place % 4];
        }
        place += 1;
    }
    all
};
