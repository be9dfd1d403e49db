#define_import_path akari_math::voxel::schedule

// Twin: `voxel/schedule.rs`, where the formulas are. Change both or neither.

// Growth of the weights of visits.
const MEAN_GROWTH: f32 = 4.0;
// Fractional part of the golden ratio in 32 bits, made odd.
const TURN_STEP: u32 = 0x9e3779b1u;
// Span of a frame in which all pages have their turn.
const WHOLE_TURN: u32 = 0xffffffffu;

// Share of a visit in the mean, after `visits` visits.
fn visit_rate(visits: u32, least: f32) -> f32 {
    return max(MEAN_GROWTH / (f32(visits) + MEAN_GROWTH), least);
}

// Whether it is a page's turn in a frame whose turn goes from `cursor` on over `span` positions.
fn page_has_turn(page: u32, cursor: u32, span: u32) -> bool {
    return span == WHOLE_TURN || page * TURN_STEP - cursor < span;
}
