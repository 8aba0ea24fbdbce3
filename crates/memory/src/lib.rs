//! An allocator that puts large arrays on huge pages.
//!
//! The first touch of fresh memory costs a page fault for every 4 KiB, which on meshes of a million vertices is dearer than the arithmetic.
//! On Linux blocks of at least [`LARGE`] bytes are therefore made of whole huge pages of 2 MiB: one fault instead of 512. Pages given back are kept for
//! the next blocks, a quarter as many as are in use at most. Smaller blocks, stricter alignments and other systems are left to the
//! allocator of the system.
//!
//! ```
//! #[global_allocator]
//! static ALLOCATOR: memory::HugePages = memory::HugePages;
//!
//! assert_eq!(vec![0u8; 5 << 20].as_ptr() as usize % (2 << 20), 0);
//! ```

// An allocator cannot be written without: `GlobalAlloc` is an unsafe trait, and its methods deal in raw pointers. Every block says why it holds.
#![allow(unsafe_code)]

#[cfg(target_os = "linux")]
mod mapping;
#[cfg(target_os = "linux")]
mod pool;

use std::alloc::{GlobalAlloc, Layout, System};

/// Size of a huge page, in bytes.
pub const HUGE_PAGE: usize = 2 << 20;

/// Blocks of at least so many bytes are mapped on huge pages.
pub const LARGE: usize = HUGE_PAGE;

/// The allocator: large blocks on huge pages, the others from the system.
#[derive(Clone, Copy, Debug, Default)]
pub struct HugePages;

/// Whether a block is mapped by this crate. Depends on nothing but size and alignment, so that the block is given back where it came from.
fn is_large(size: usize, align: usize) -> bool {
    cfg!(target_os = "linux") && size >= LARGE && align <= HUGE_PAGE
}

// SAFETY: a block belongs to `mapping` or to `System` by its layout alone, and each of them gets back, with their layout, only blocks that it
// made: `dealloc` and `realloc` are called with the layout of the block's allocation, and `realloc` hands a block over only by copying it.
// Nothing here unwinds: `mapping` makes system calls and compares numbers.
unsafe impl GlobalAlloc for HugePages {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if is_large(layout.size(), layout.align()) {
            return large::map(layout.size(), false);
        }
        // SAFETY: the caller's promise, a layout of non-zero size, is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if is_large(layout.size(), layout.align()) {
            return large::map(layout.size(), true);
        }
        // SAFETY: as in `alloc`.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        if is_large(layout.size(), layout.align()) {
            // SAFETY: a block of this layout came from `large`, and the caller has given it up.
            unsafe { large::unmap(block, layout.size()) }
        } else {
            // SAFETY: a block of this layout came from `System`, and the caller has given it up.
            unsafe { System.dealloc(block, layout) }
        }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        let (was, is) = (
            is_large(layout.size(), layout.align()),
            is_large(new_size, layout.align()),
        );
        if !was && !is {
            // SAFETY: the block came from `System` with this layout; the promises about `new_size` are passed on.
            return unsafe { System.realloc(block, layout, new_size) };
        }
        if was && is {
            // SAFETY: the block came from `large` with this size.
            let moved = unsafe { large::resize(block, layout.size(), new_size) };
            if !moved.is_null() {
                return moved;
            }
        }
        // SAFETY: `new_size` is not zero and does not overflow when rounded up to the alignment, by the contract of `realloc`; the new
        // block is another one than the old, and both hold at least as many bytes as are copied; the old one is given back with its layout,
        // and is left alone when there is no new one.
        unsafe {
            let new = self.alloc(Layout::from_size_align_unchecked(new_size, layout.align()));
            if !new.is_null() {
                std::ptr::copy_nonoverlapping(block, new, layout.size().min(new_size));
                self.dealloc(block, layout);
            }
            new
        }
    }
}

#[cfg(target_os = "linux")]
use mapping as large;

/// Where nothing is large, none of these is called.
#[cfg(not(target_os = "linux"))]
mod large {
    pub fn map(_: usize, _: bool) -> *mut u8 {
        std::ptr::null_mut()
    }

    pub unsafe fn unmap(_: *mut u8, _: usize) {}

    pub unsafe fn resize(_: *mut u8, _: usize, _: usize) -> *mut u8 {
        std::ptr::null_mut()
    }
}
