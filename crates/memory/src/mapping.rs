//! Blocks made of whole huge pages: mapped straight from the kernel, or put together from pages that earlier blocks gave back.
//!
//! Pages are kept because their first touch is what costs. A kept page is moved to where a block needs it (`mremap`), which changes page tables
//! and copies nothing; so any block can be made of the pages of any others, and no page is fresh while one is kept.

use std::io::Error;
use std::ptr::null_mut;
use std::sync::{Mutex, MutexGuard, PoisonError};

use libc::{
    ENOMEM, MADV_HUGEPAGE, MAP_ANONYMOUS, MAP_FAILED, MAP_NORESERVE, MAP_PRIVATE, MREMAP_FIXED,
    MREMAP_MAYMOVE, PROT_NONE, PROT_READ, PROT_WRITE,
};

use crate::HUGE_PAGE;
use crate::pool::{Pool, Run};

// Locking it allocates nothing, and nothing that could panic or allocate is done while it is locked.
static POOL: Mutex<Pool> = Mutex::new(Pool::new());

fn pool() -> MutexGuard<'static, Pool> {
    POOL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Huge pages of a block.
fn pages(size: usize) -> usize {
    size.div_ceil(HUGE_PAGE)
}

/// Number of a huge page in the address space.
fn number(page: *mut u8) -> usize {
    page as usize / HUGE_PAGE
}

/// Address of a huge page. Its pages were exposed by [`number`].
fn address(number: usize) -> *mut u8 {
    std::ptr::with_exposed_provenance_mut(number * HUGE_PAGE)
}

/// Maps `count` fresh huge pages; null when there is no room.
fn reserve(count: usize, protection: i32, flags: i32) -> *mut u8 {
    let Some(span) = count
        .checked_add(1)
        .and_then(|pages| pages.checked_mul(HUGE_PAGE))
    else {
        return null_mut();
    };
    // SAFETY: without MAP_FIXED a new mapping touches none that exists.
    let start = unsafe {
        libc::mmap(
            null_mut(),
            span,
            protection,
            MAP_PRIVATE | MAP_ANONYMOUS | flags,
            -1,
            0,
        )
    };
    if start == MAP_FAILED {
        return null_mut();
    }
    let start = start.cast::<u8>();
    let before = start.align_offset(HUGE_PAGE);
    // SAFETY: `before + count * HUGE_PAGE + (HUGE_PAGE - before)` is the mapping just made, which nobody else knows yet; its pieces are whole
    // small pages, because the kernel's addresses and HUGE_PAGE are. A piece that the kernel refuses to take back stays mapped and unused.
    // Advice on a mapping of our own changes no contents; a kernel without huge pages refuses, and the block is as good as any.
    unsafe {
        let block = start.add(before);
        if before > 0 {
            libc::munmap(start.cast(), before);
        }
        libc::munmap(block.add(count * HUGE_PAGE).cast(), HUGE_PAGE - before);
        libc::madvise(block.cast(), count * HUGE_PAGE, MADV_HUGEPAGE);
        block
    }
}

/// A new block, aligned to [`HUGE_PAGE`], of zeros if so wished; null when there is no room.
pub fn map(size: usize, zeroed: bool) -> *mut u8 {
    let count = pages(size);
    if let Some(first) = pool().take(count) {
        let block = address(first);
        if zeroed {
            // SAFETY: the run's pages were given up by their last owner, are mapped for reading and writing, and hold `size` bytes.
            unsafe { block.write_bytes(0, size) };
        }
        return block;
    }
    let block = reserve(count, PROT_READ | PROT_WRITE, 0);
    if block.is_null() {
        return null_mut();
    }
    let Some(filled) = fill(block, count) else {
        // The block may have a hole now, which another thread may have mapped since: it is left alone for good.
        let block = reserve(count, PROT_READ | PROT_WRITE, 0);
        if !block.is_null() {
            pool().used(count);
        }
        return block;
    };
    pool().used(count);
    if zeroed {
        // SAFETY: the block has just been mapped and is ours alone. The pages that were not filled are fresh, and therefore zero.
        unsafe { block.write_bytes(0, size.min(filled * HUGE_PAGE)) };
    }
    block
}

/// Replaces the first of `count` fresh pages at `block` by kept ones; how many, or `None` when the kernel stopped half-way.
fn fill(block: *mut u8, count: usize) -> Option<usize> {
    let mut filled = 0;
    while filled < count {
        let Some(run) = pool().take_some(count - filled) else {
            break;
        };
        for page in run.first..run.first + run.count {
            // SAFETY: the page was kept, so nobody uses it, and the pool has forgotten it; the target is a fresh page of the block, which is ours. Page by
            // page, because the pages of a run may belong to several mappings, while a page never does.
            let moved = unsafe {
                libc::mremap(
                    address(page).cast(),
                    HUGE_PAGE,
                    HUGE_PAGE,
                    MREMAP_MAYMOVE | MREMAP_FIXED,
                    block.add(filled * HUGE_PAGE),
                )
            };
            if moved == MAP_FAILED {
                return None;
            }
            filled += 1;
        }
    }
    Some(filled)
}

/// Gives a block back.
///
/// # Safety
/// `block` came from [`map`] or [`resize`] with this size, and is not used again.
pub unsafe fn unmap(block: *mut u8, size: usize) {
    // SAFETY: these are all pages of the block.
    unsafe { give_back(block, pages(size)) };
}

/// # Safety
/// The `count` pages from `first` on belong to a block and are not used again.
unsafe fn give_back(first: *mut u8, count: usize) {
    let run = Run {
        first: number(first),
        count,
    };
    first.expose_provenance();
    let refused = pool().put(run);
    if refused.count > 0 {
        // SAFETY: whoever calls has given up these pages, and the pool has not taken them.
        unsafe { libc::munmap(address(refused.first).cast(), refused.count * HUGE_PAGE) };
    }
}

/// The block at another size, with its contents up to the smaller one: in its place, or moved without a copy to an address with the same
/// alignment, which keeps its huge pages. Null when neither can be had: the block is then as it was.
///
/// # Safety
/// `block` came from [`map`] or this function with size `old`; if the result is not null, `block` is not used again.
pub unsafe fn resize(block: *mut u8, old: usize, new: usize) -> *mut u8 {
    let (old, new) = (pages(old), pages(new));
    if new <= old {
        if new < old {
            // SAFETY: these pages lie beyond the new size.
            unsafe { give_back(block.add(new * HUGE_PAGE), old - new) };
        }
        return block;
    }
    // SAFETY: as `grow` wants it.
    let grown = unsafe { grow(block, old, new) };
    if !grown.is_null() {
        let mut pool = pool();
        pool.used(new - old);
        // Fresh pages came while others were kept: as many of these go.
        let surplus = pool.take_some(new - old);
        drop(pool);
        if let Some(run) = surplus {
            // SAFETY: nobody uses kept pages, and the pool has forgotten these.
            unsafe { libc::munmap(address(run.first).cast(), run.count * HUGE_PAGE) };
        }
    }
    grown
}

/// # Safety
/// As for [`resize`]; sizes in pages, `new` above `old`.
unsafe fn grow(block: *mut u8, old: usize, new: usize) -> *mut u8 {
    let Some(length) = new.checked_mul(HUGE_PAGE) else {
        return null_mut();
    };
    // SAFETY: `old` pages are mapped at `block`. Without MREMAP_MAYMOVE the mapping stays where it is and grows only into free addresses.
    let same = unsafe { libc::mremap(block.cast(), old * HUGE_PAGE, length, 0) };
    if same != MAP_FAILED {
        return block;
    }
    // Any other reason than lack of room: the block consists of several mappings, which cannot be moved as one.
    if Error::last_os_error().raw_os_error() != Some(ENOMEM) {
        return null_mut();
    }
    let target = reserve(new, PROT_NONE, MAP_NORESERVE);
    if target.is_null() {
        return null_mut();
    }
    // SAFETY: the target range is a mapping of our own that nothing points into, apart from the old one; the kernel replaces it in one
    // step, so that no other thread can come between. On failure the old block is as it was, and the target, which may have been unmapped and
    // mapped anew by another thread, is left alone for good.
    let moved = unsafe {
        libc::mremap(
            block.cast(),
            old * HUGE_PAGE,
            length,
            MREMAP_MAYMOVE | MREMAP_FIXED,
            target,
        )
    };
    if moved == MAP_FAILED {
        return null_mut();
    }
    moved.cast()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_beyond_the_address_space_are_refused() {
        assert!(map(usize::MAX - (4 << 20), true).is_null());
        assert!(map(isize::MAX as usize, false).is_null());
        let block = map(HUGE_PAGE, false);
        assert!(!block.is_null());
        // SAFETY: the block was mapped with this size, and is given back once.
        unsafe {
            block.write(7);
            assert!(resize(block, HUGE_PAGE, isize::MAX as usize).is_null());
            assert_eq!(block.read(), 7);
            unmap(block, HUGE_PAGE);
        }
    }
}
