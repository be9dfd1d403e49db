//! Which pages of voxels are lit in a frame, and how much a visit counts in the mean over visits.
//!
//! WGSL module: `akari_math::voxel::schedule`.

/// Growth of the weights of visits: that of visit n is about n^(`MEAN_GROWTH` − 1).
///
/// What a voxel gathers has one more bounce in it from visit to visit, and each bounce is a mean of means. With equal
/// weights (1) the share of light that is missing after n visits falls by n^−(1 − ρ) only for an albedo ρ; with these by
/// n^−4 (1 − ρ), for a variance that is 16 / 7 of that of equal weights.
const MEAN_GROWTH: f32 = 4.0;

/// Fractional part of the golden ratio in 32 bits, made odd: its multiples are a permutation of the 32-bit numbers, in
/// which any run of consecutive pages lies evenly.
const TURN_STEP: u32 = 0x9e37_79b1;

/// `span` of a frame in which all pages have their turn.
pub const WHOLE_TURN: u32 = u32::MAX;

/// Share of a visit in the mean, after `visits` visits: `max(k / (visits + k), least)` with k = 4. 1 for the first.
#[must_use]
pub fn visit_rate(visits: u32, least: f32) -> f32 {
    (MEAN_GROWTH / (visits as f32 + MEAN_GROWTH)).max(least)
}

/// Whether it is a page's turn in a frame whose turn goes from `cursor` on over `span` of 2³² positions, around the end.
///
/// Whoever moves the cursor on by `span` in each frame, whatever the spans are, visits each page once while it goes
/// round. Of `n` pages with consecutive numbers, a frame has `n span / 2³²`, give or take two.
#[must_use]
pub fn page_has_turn(page: u32, cursor: u32, span: u32) -> bool {
    span == WHOLE_TURN || page.wrapping_mul(TURN_STEP).wrapping_sub(cursor) < span
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_page_has_one_turn_a_round_and_frames_are_even() {
        const PAGES: u32 = 5000;
        let mut visits = vec![0; PAGES as usize];
        let mut cursor = 0xf000_0000_u32;
        let mut gone = 0_u64;
        let mut frame = 0_u32;
        while gone < 1 << 32 {
            // Spans that differ from frame to frame.
            let span = (0x0800_0000 + (frame % 3) * 0x0123_4567)
                .min((((1_u64 << 32) - gone) as u32).max(1));
            let had: Vec<u32> = (0..PAGES)
                .filter(|&page| page_has_turn(page, cursor, span))
                .collect();
            let even = f64::from(PAGES) * f64::from(span) / f64::from(1 << 16) / f64::from(1 << 16);
            assert!(
                (had.len() as f64 - even).abs() <= 2.5,
                "{} is not {even}",
                had.len()
            );
            had.iter().for_each(|&page| visits[page as usize] += 1);
            cursor = cursor.wrapping_add(span);
            gone += u64::from(span);
            frame += 1;
        }
        assert!(visits.iter().all(|&count| count == 1));
        assert!((0..PAGES).all(|page| page_has_turn(page, cursor, WHOLE_TURN)));
    }

    #[test]
    fn bounces_do_not_wait_for_each_other() {
        // A room of albedo 1/2: each visit sees half of the mean, and what shines.
        let after = |rate: fn(u32) -> f32| {
            let mut mean = 0.0_f32;
            for visits in 0..32 {
                mean += rate(visits) * (0.5 + 0.5 * mean - mean);
            }
            1.0 - mean
        };
        let missing = after(|visits| visit_rate(visits, 0.0));
        assert!(missing < 0.006, "{missing}");
        let equal = after(|visits| 1.0 / (visits + 1) as f32);
        assert!(equal > 0.09, "{equal}");
        assert_eq!(visit_rate(0, 0.1), 1.0);
        assert_eq!(visit_rate(1000, 0.1), 0.1);
    }
}
