//! Files that were changed at random: never a panic, never more memory than the format states.
//!
//! The changes are the same in each run. `AKARI_FUZZ_MUTATIONS=1000000 cargo test -p akari_visibility --release --test
//! fuzz` makes a long run of it; `AKARI_FUZZ_SEED` begins elsewhere. A failure prints the number of its change.

#[path = "common/bakes.rs"]
mod bakes;
mod common;
#[path = "common/sealed.rs"]
mod sealed;

use akari_visibility::container::MAX_RATIO;
use akari_visibility::fuzz::load_and_use;
use common::Random;
use sealed::{ENTRY, HEADER, files, put, reseal};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::panic::catch_unwind;

/// Changed files of a run of the tests.
const MUTATIONS: u64 = 20_000;
const SEED: u64 = 1;

thread_local! {
    /// Bytes that this thread holds, and the most that it held.
    static HELD: Cell<[usize; 2]> = const { Cell::new([0; 2]) };
}

/// The system's allocator, counted.
struct Counted;

impl Counted {
    fn change(by: impl Fn(usize) -> usize) {
        // Threads that are ending have no counters any more.
        let _ = HELD.try_with(|held| {
            let [now, most] = held.get();
            let now = by(now);
            held.set([now, most.max(now)]);
        });
    }
}

// SAFETY: everything is passed on as it is.
#[allow(unsafe_code, reason = "allocators are unsafe by nature")]
unsafe impl GlobalAlloc for Counted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        Self::change(|now| now + layout.size());
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        Self::change(|now| now + layout.size());
        // SAFETY: the caller's promise.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        Self::change(|now| now.saturating_sub(layout.size()));
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counted = Counted;

/// Most bytes that `f` holds at once beyond what was there before.
fn peak<R>(f: impl FnOnce() -> R) -> (usize, R) {
    let before = HELD.with(|held| {
        let [now, _] = held.get();
        held.set([now, now]);
        now
    });
    let result = f();
    (HELD.with(Cell::get)[1] - before, result)
}

fn number(name: &str, default: u64) -> u64 {
    match std::env::var(name) {
        Ok(text) => text.parse().expect(name),
        Err(_) => default,
    }
}

/// A change of one of our files, with its checksums set right in most cases: what is behind them is to be tested.
fn mutated(random: &mut Random) -> Vec<u8> {
    const WORDS: [u32; 8] = [
        0,
        1,
        2,
        255,
        0x7fff_ffff,
        0x8000_0000,
        0x7fc0_0000,
        u32::MAX,
    ];
    let mut bytes = files()[random.below(2)].clone();
    for _ in 0..=random.below(4) {
        let length = bytes.len();
        let at = match random.below(3) {
            // Header and table.
            0 => random.below(length.min(HEADER + 10 * ENTRY)),
            _ => random.below(length),
        };
        match random.below(6) {
            0 => bytes[at] ^= 1 << random.below(8),
            1 => bytes[at] = random.below(256) as u8,
            2 => {
                let at = at / 4 * 4;
                let word = WORDS[random.below(WORDS.len())].to_le_bytes();
                let end = length.min(at + 4);
                bytes[at..end].copy_from_slice(&word[..end - at]);
            }
            3 => {
                // An offset, a length or a name of the table.
                let field = HEADER + random.below(9) * ENTRY + 8 * random.below(4);
                if field + 8 <= length {
                    let value = random.next() >> random.below(64);
                    put(&mut bytes, field, &value.to_le_bytes());
                }
            }
            4 => {
                // A stretch from elsewhere.
                let from = random.below(length);
                let count = random.below(64).min(length - from).min(length - at);
                bytes.copy_within(from..from + count, at);
            }
            _ => bytes.truncate(at.max(HEADER + 1)),
        }
    }
    if random.below(8) > 0 {
        reseal(&mut bytes);
    }
    bytes
}

#[test]
fn changed_files_do_no_harm() {
    let mutations = number("AKARI_FUZZ_MUTATIONS", MUTATIONS);
    let seed = number("AKARI_FUZZ_SEED", SEED);
    let mut accepted = 0;
    for mutation in 0..mutations {
        let mut random = Random::new(seed.wrapping_add(mutation));
        let bytes = mutated(&mut random);
        let outcome = catch_unwind(|| peak(|| load_and_use(&bytes)));
        let Ok((held, was_accepted)) = outcome else {
            panic!(
                "a panic for AKARI_FUZZ_SEED={} AKARI_FUZZ_MUTATIONS=1",
                seed + mutation
            );
        };
        accepted += u64::from(was_accepted);
        // Each content at its largest, and what is made of all of them: grids and trees of a merge.
        let most = MAX_RATIO as usize * bytes.len();
        assert!(
            held <= most,
            "{held} bytes for a file of {} by AKARI_FUZZ_SEED={}",
            bytes.len(),
            seed + mutation
        );
    }
    println!("{accepted} of {mutations} changed files were accepted");
    // Enough gets through to test what comes after the checks, and not all: the changes are felt.
    assert!(accepted * 50 > mutations, "{accepted} of {mutations}");
    assert!(accepted * 2 < mutations, "{accepted} of {mutations}");
}

#[test]
fn memory_is_counted() {
    let (held, whole) = peak(|| vec![1_u8; 1 << 20].len());
    assert_eq!(whole, 1 << 20);
    assert!((1 << 20..2 << 20).contains(&held), "{held}");
    assert_eq!(peak(|| 1).0, 0);
    // The unchanged files are accepted, within a small multiple of their size.
    for bytes in files() {
        let (held, accepted) = peak(|| load_and_use(bytes));
        assert!(accepted);
        assert!(held > bytes.len() && held < 64 * bytes.len(), "{held}");
    }
}
