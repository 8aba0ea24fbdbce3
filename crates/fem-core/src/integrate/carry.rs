//! Which elements of a refined mesh are new.

use crate::index::TriangleId;

/// The number that a triangle had before, if it was not bisected; `parent` is that of [`crate::Refinement`].
///
/// Children take their parent's place in the order, so that a triangle is its parent where its parent differs from those of both neighbours in the
/// order.
#[inline]
pub(super) fn kept(parent: &[TriangleId], t: usize) -> Option<usize> {
    let own = parent[t];
    let alone = (t == 0 || parent[t - 1] != own) && parent.get(t + 1) != Some(&own);
    alone.then_some(own.index())
}
