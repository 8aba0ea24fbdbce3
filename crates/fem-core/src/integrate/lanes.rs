//! The loops over a block of elements, compiled twice: for every processor of the target, and for those with registers of four numbers (AVX2).
//!
//! Both do the same IEEE operations on every element, so that they give the same bits.

use super::whole::{Block, Fits, Table, Values};

/// Finds the points and areas of a block, see [`Block::place`].
pub(super) fn place(block: &mut Block, table: &Table) {
    #[cfg(target_arch = "x86_64")]
    if x86::place(block, table) {
        return;
    }
    block.place(table);
}

/// Fits affine functions, see [`Table::fit`].
pub(super) fn fit(table: &Table, values: &Values, stride: usize, fits: &mut Fits) {
    #[cfg(target_arch = "x86_64")]
    if x86::fit(table, values, stride, fits) {
        return;
    }
    table.fit(values, stride, fits);
}

/// The same for AVX2; false, and nothing done, where the processor has none.
#[cfg(target_arch = "x86_64")]
#[allow(
    unsafe_code,
    reason = "functions for AVX2 are called where the processor was found to have it"
)]
mod x86 {
    use super::{Block, Fits, Table, Values};

    pub(super) fn place(block: &mut Block, table: &Table) -> bool {
        let wide = is_x86_feature_detected!("avx2");
        if wide {
            // SAFETY: the processor has AVX2.
            unsafe { place_wide(block, table) };
        }
        wide
    }

    pub(super) fn fit(table: &Table, values: &Values, stride: usize, fits: &mut Fits) -> bool {
        let wide = is_x86_feature_detected!("avx2");
        if wide {
            // SAFETY: the processor has AVX2.
            unsafe { fit_wide(table, values, stride, fits) };
        }
        wide
    }

    #[target_feature(enable = "avx2")]
    fn place_wide(block: &mut Block, table: &Table) {
        block.place(table);
    }

    #[target_feature(enable = "avx2")]
    fn fit_wide(table: &Table, values: &Values, stride: usize, fits: &mut Fits) {
        table.fit(values, stride, fits);
    }
}
