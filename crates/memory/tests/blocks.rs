//! Blocks of all sizes keep their contents, alignment and zeros, alone and among threads.

// The allocator's interface is unsafe; the tests keep its rules: each block is given back once, with its layout.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout};

use memory::{HUGE_PAGE, HugePages, LARGE};

#[global_allocator]
static ALLOCATOR: HugePages = HugePages;

const MIB: usize = 1 << 20;

/// A number that depends on place and seed, so that no shifted or stale block passes.
fn value(place: usize, seed: usize) -> u8 {
    (place.wrapping_mul(0x9e37_79b9) >> 13).wrapping_add(seed) as u8
}

/// Places to look at: the ends and one in every small page.
fn places(size: usize) -> impl Iterator<Item = usize> {
    (0..size).step_by(4096 - 64).chain([size - 1])
}

unsafe fn fill(block: *mut u8, size: usize, seed: usize) {
    for place in places(size) {
        unsafe { block.add(place).write(value(place, seed)) };
    }
}

unsafe fn check(block: *mut u8, size: usize, seed: usize, upto: usize) {
    for place in places(size).filter(|&place| place < upto) {
        assert_eq!(unsafe { block.add(place).read() }, value(place, seed));
    }
}

#[test]
fn contents_survive_every_way_up_and_down() {
    let sizes = [
        100,
        LARGE - 1,
        LARGE,
        3 * MIB + 5,
        17 * MIB,
        16 * MIB + 1,
        2 * MIB,
        64 * MIB,
        MIB,
        5 * MIB,
        5 * MIB + 4096,
        40,
    ];
    for align in [1, 64, 4096, HUGE_PAGE] {
        unsafe {
            let mut size = sizes[0];
            let layout = |size| Layout::from_size_align(size, align).unwrap();
            let mut block = ALLOCATOR.alloc(layout(size));
            fill(block, size, 0);
            for (step, &next) in sizes.iter().enumerate().skip(1) {
                block = ALLOCATOR.realloc(block, layout(size), next);
                assert!(!block.is_null());
                assert_eq!(block as usize % align, 0, "{size} to {next}");
                if next >= LARGE && cfg!(target_os = "linux") {
                    assert_eq!(block as usize % HUGE_PAGE, 0, "{size} to {next}");
                }
                check(block, size, step - 1, next);
                size = next;
                fill(block, size, step);
            }
            ALLOCATOR.dealloc(block, layout(size));
        }
    }
}

#[test]
fn a_block_that_cannot_grow_in_place_moves() {
    let layout = Layout::from_size_align(4 * MIB, 8).unwrap();
    unsafe {
        // Neighbours on all sides: at least one of three blocks in a row cannot grow where it is.
        let blocks = [(); 3].map(|()| ALLOCATOR.alloc(layout));
        for (seed, &block) in blocks.iter().enumerate() {
            fill(block, 4 * MIB, seed);
        }
        let grown = blocks.map(|block| ALLOCATOR.realloc(block, layout, 256 * MIB));
        assert_ne!(blocks, grown);
        for (seed, &block) in grown.iter().enumerate() {
            check(block, 4 * MIB, seed, usize::MAX);
            // What was added is usable up to its end.
            block.add(256 * MIB - 1).write(1);
            ALLOCATOR.dealloc(block, Layout::from_size_align(256 * MIB, 8).unwrap());
        }
    }
}

#[test]
fn alignments_beyond_a_huge_page_are_kept() {
    for align in [4 * MIB, 16 * MIB] {
        for size in [100, 3 * MIB, 9 * MIB] {
            let layout = Layout::from_size_align(size, align).unwrap();
            unsafe {
                let block = ALLOCATOR.alloc_zeroed(layout);
                assert_eq!(block as usize % align, 0);
                fill(block, size, 3);
                let grown = ALLOCATOR.realloc(block, layout, size + 2 * MIB);
                assert_eq!(grown as usize % align, 0);
                check(grown, size, 3, usize::MAX);
                ALLOCATOR.dealloc(
                    grown,
                    Layout::from_size_align(size + 2 * MIB, align).unwrap(),
                );
            }
        }
    }
}

#[test]
fn zeroed_is_zero_after_other_blocks_were_used() {
    // In use all the time, so that pages are kept.
    let others = std::hint::black_box(vec![1u8; 128 * MIB]);
    for round in 0..4 {
        for size in [LARGE / 2, LARGE, 3 * MIB + 7, 8 * MIB] {
            let mut used = vec![0xffu8; size];
            used[size / 2] = round;
            drop(std::hint::black_box(used));
            let fresh = std::hint::black_box(vec![0u64; size / 8]);
            assert!(fresh.iter().all(|&v| v == 0));
        }
    }
    assert_eq!(others[MIB], 1);
}

#[test]
fn vectors_grow_by_pushing() {
    let mut numbers = Vec::new();
    for i in 0..3_000_000u64 {
        numbers.push(i * i);
    }
    numbers.shrink_to_fit();
    assert!(numbers.iter().zip(0u64..).all(|(&n, i)| n == i * i));
}

#[test]
fn pages_of_many_blocks_make_one() {
    let others = std::hint::black_box(vec![1u8; 256 * MIB]);
    let used: Vec<Vec<u8>> = (0..12).map(|_| vec![0xff; 2 * MIB]).collect();
    // Every second one, so that the pages given back do not lie side by side.
    let stay: Vec<Vec<u8>> = used.into_iter().step_by(2).collect();
    for size in [5 * MIB, 14 * MIB, 31 * MIB] {
        let mut block = std::hint::black_box(vec![0u8; size]);
        assert!(block.iter().all(|&v| v == 0));
        for place in places(size) {
            block[place] = value(place, size);
        }
        block.reserve_exact(size + 9 * MIB);
        assert!(places(size).all(|place| block[place] == value(place, size)));
    }
    assert!(stay.iter().flatten().all(|&v| v == 0xff));
    assert_eq!(others[MIB], 1);
}

#[test]
fn threads_pass_blocks_around() {
    let (send, receive) = std::sync::mpsc::channel::<(usize, Vec<u8>)>();
    std::thread::scope(|scope| {
        for thread in 0..4 {
            let send = send.clone();
            scope.spawn(move || {
                for round in 0..60 {
                    let seed = thread * 100 + round;
                    let size = MIB / 2 + seed * 37 * 1021;
                    let mut block = vec![0u8; size];
                    assert!(places(size).all(|place| block[place] == 0));
                    for place in places(size) {
                        block[place] = value(place, seed);
                    }
                    block.reserve_exact(size * (round % 3));
                    send.send((seed, block)).unwrap();
                }
            });
        }
        drop(send);
        for (seed, block) in receive {
            assert!(places(block.len()).all(|place| block[place] == value(place, seed)));
        }
    });
}
