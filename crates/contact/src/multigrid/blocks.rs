//! Sums of blocks, as Galerkin products with arbitrary weights need them.

/// Block between two vertices.
pub(crate) trait Block: Copy + Default {
    /// x + t y.
    fn plus(self, t: f64, y: Self) -> Self;
    /// The transposed block.
    fn transposed(self) -> Self;
}

/// Symmetric diagonal block that goes with blocks of type `C`.
pub(crate) trait Symmetric<C>: Copy + Default + PartialEq {
    /// x + t y.
    fn plus(self, t: f64, y: Self) -> Self;
    /// x + t (c + c').
    fn plus_both(self, t: f64, c: C) -> Self;
    /// All components.
    fn full(self) -> C;
}

impl Block for f64 {
    #[inline]
    fn plus(self, t: f64, y: f64) -> f64 {
        self + t * y
    }
    #[inline]
    fn transposed(self) -> f64 {
        self
    }
}

impl Symmetric<f64> for f64 {
    #[inline]
    fn plus(self, t: f64, y: f64) -> f64 {
        self + t * y
    }
    #[inline]
    fn plus_both(self, t: f64, c: f64) -> f64 {
        self + 2.0 * t * c
    }
    #[inline]
    fn full(self) -> f64 {
        self
    }
}

impl Block for [[f64; 2]; 2] {
    #[inline]
    fn plus(self, t: f64, y: Self) -> Self {
        [0, 1].map(|i| [0, 1].map(|j| self[i][j] + t * y[i][j]))
    }
    #[inline]
    fn transposed(self) -> Self {
        [[self[0][0], self[1][0]], [self[0][1], self[1][1]]]
    }
}

impl Symmetric<[[f64; 2]; 2]> for [f64; 3] {
    #[inline]
    fn plus(self, t: f64, y: Self) -> Self {
        [0, 1, 2].map(|i| self[i] + t * y[i])
    }
    #[inline]
    fn plus_both(self, t: f64, c: [[f64; 2]; 2]) -> Self {
        [
            self[0] + 2.0 * t * c[0][0],
            self[1] + t * (c[0][1] + c[1][0]),
            self[2] + 2.0 * t * c[1][1],
        ]
    }
    #[inline]
    fn full(self) -> [[f64; 2]; 2] {
        [[self[0], self[1]], [self[1], self[2]]]
    }
}
