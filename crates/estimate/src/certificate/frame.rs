//! The edges that leave a corner of an element.

use fem_core::Mesh;

use super::fan::Corner;

/// Products of the two edges a, b that leave a corner counter-clockwise, and the area of the element.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub aa: f64,
    pub ab: f64,
    pub bb: f64,
    pub area: f64,
}

/// A frame with the normal of its first edge.
pub(super) struct CornerFrame {
    pub products: Frame,
    /// The first edge turned by a right angle counter-clockwise: its normal times its length.
    pub first_normal: [f64; 2],
}

impl Frame {
    /// The frame of a corner.
    #[inline]
    pub fn of(mesh: &Mesh, corner: Corner) -> CornerFrame {
        let v = mesh.triangles()[corner.index()];
        let k = corner.corner();
        let [p, q, r] = [0, 1, 2].map(|l| mesh.points()[v[(k + l) % 3].index()]);
        let a = [q[0] - p[0], q[1] - p[1]];
        let b = [r[0] - p[0], r[1] - p[1]];
        CornerFrame {
            products: Frame {
                aa: a[0] * a[0] + a[1] * a[1],
                ab: a[0] * b[0] + a[1] * b[1],
                bb: b[0] * b[0] + b[1] * b[1],
                area: 0.5 * (a[0] * b[1] - a[1] * b[0]),
            },
            first_normal: [-a[1], a[0]],
        }
    }
}

/// The sum over the three pairs of (p_k - p_l)^2.
#[inline]
pub(super) fn pairs(p: [f64; 3]) -> f64 {
    let d = [p[0] - p[1], p[1] - p[2], p[2] - p[0]];
    d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
}
