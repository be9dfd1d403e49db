use super::*;
use std::collections::HashSet;

fn shape() -> ClipmapShape {
    ClipmapShape::new(32, 2, 0.25)
}

/// Does what a GPU would: keeps for each slot the brick that was made there last.
struct Model {
    clipmap: Clipmap,
    slots: Vec<Option<GpuDirtyBrick>>,
    content: (DVec3, DVec3),
}

impl Model {
    fn new(shape: ClipmapShape) -> Self {
        Self {
            clipmap: Clipmap::new(shape),
            slots: vec![None; shape.slots() as usize],
            content: (DVec3::splat(-1e4), DVec3::splat(1e4)),
        }
    }

    fn step(&mut self, camera: DVec3, cap: u32) -> Work {
        for entered in self.clipmap.follow(camera) {
            self.clipmap.fill(self.content.0, self.content.1, &entered);
        }
        let work = self.clipmap.take(cap);
        for &(slot, _) in &work.released {
            self.slots[slot as usize] = None;
        }
        for brick in work.made.iter().chain(work.tails.iter().flatten()) {
            let slot = self.clipmap.slot(brick.level, brick.brick);
            self.slots[slot as usize] = Some(*brick);
        }
        work
    }

    /// Slots that hold another brick than they should, or none.
    fn faults(&self) -> usize {
        let shape = self.clipmap.shape();
        (0..shape.levels())
            .flat_map(|level| {
                self.clipmap
                    .held(level)
                    .iter()
                    .map(move |brick| (level, brick))
            })
            .filter(|&(level, brick)| {
                let slot = self.clipmap.slot(level, brick);
                self.slots[slot as usize] != Some(GpuDirtyBrick { brick, level })
            })
            .count()
    }
}

#[test]
fn levels_halve_and_slots_follow_each_other() {
    let shape = ClipmapShape::new(128, 3, 0.1);
    let bricks: Vec<u32> = (0..shape.levels())
        .map(|level| shape.bricks(level))
        .collect();
    assert_eq!(bricks, [32, 32, 32, 16, 8, 4, 2]);
    assert_eq!(shape.slots(), 3 * 32768 + 4096 + 512 + 64 + 8);
    assert_eq!(ClipmapShape::new(256, 5, 0.1).levels(), MOST_LEVELS);
    assert_eq!(
        ClipmapShape::new(100, 9, f32::NAN),
        ClipmapShape::new(128, 5, 1.0)
    );
}

#[test]
fn a_scrolled_clipmap_holds_what_a_fresh_one_holds() {
    let mut model = Model::new(shape());
    let mut camera = DVec3::new(-0.3, 0.2, 7.0);
    model.step(camera, u32::MAX);
    for step in 0..60 {
        // Forth, and now and then far.
        camera += DVec3::new(0.37, -0.21, 0.13) * if step % 20 == 19 { 40.0 } else { 1.0 };
        model.step(camera, u32::MAX);
    }
    for _ in 0..40 {
        model.step(camera, u32::MAX);
    }
    assert_eq!(model.faults(), 0);
    // A slot that was forgotten would be noticed.
    model.slots[17] = None;
    assert_eq!(model.faults(), 1);
}

#[test]
fn the_cap_is_kept_and_nothing_waits_for_ever() {
    let mut model = Model::new(shape());
    let cap = 50;
    let mut frames = 0;
    loop {
        let work = model.step(DVec3::ZERO, cap);
        assert!(work.made.len() <= cap as usize);
        // Something near the camera changes in every frame, and would take all of the cap.
        model.clipmap.touch(DVec3::splat(-2.0), DVec3::splat(2.0));
        frames += 1;
        if model.faults() == 0 {
            break;
        }
        assert!(frames < 2000, "{} bricks were never made", model.faults());
    }
    assert!(frames > 10, "the cap was not needed");
}

#[test]
fn what_changes_comes_before_what_enters() {
    let mut model = Model::new(shape());
    model.step(DVec3::ZERO, 1);
    // At the edge of the first cascade, farther than most of what waits.
    let place = DVec3::new(3.5, 3.5, 3.5);
    model.clipmap.touch(place - 0.1, place + 0.1);
    let work = model.step(DVec3::ZERO, 8);
    let brick = (place / 1.0).floor().as_ivec3();
    assert!(
        work.made
            .iter()
            .any(|made| made.level == 0 && made.brick == brick),
        "{:?}",
        work.made
    );
}

#[test]
fn near_bricks_come_first() {
    let mut model = Model::new(shape());
    let work = model.step(DVec3::splat(0.1), 16);
    assert_eq!(work.made.len(), 16);
    for made in work.made {
        let middle = made.brick.as_dvec3() + 0.5;
        assert!(middle.length() < 2.0, "{made:?}");
    }
}

#[test]
fn a_flight_costs_much_the_same_in_each_frame() {
    let mut model = Model::new(ClipmapShape::new(64, 3, 0.125));
    let mut work = Vec::new();
    for frame in 0..600 {
        let made = model
            .step(DVec3::X * 0.05 * f64::from(frame), 4096)
            .made
            .len();
        // The first fill takes a while.
        if frame >= 200 {
            work.push(made);
        }
    }
    work.sort_unstable();
    let (median, high) = (work[work.len() / 2], work[work.len() * 99 / 100]);
    assert!(median > 0, "nothing was made");
    assert!(
        2 * high <= 3 * median,
        "99th percentile {high}, median {median}"
    );
}

#[test]
fn empty_space_is_not_made_and_released_bricks_know_whether_they_wait() {
    let mut model = Model::new(shape());
    model.content = (DVec3::splat(0.1), DVec3::splat(0.2));
    let work = model.step(DVec3::ZERO, 1);
    assert_eq!(work.made.len(), 1);
    assert_eq!(work.waiting, 1, "the same box in the other cascade");
    let pending = work.released.iter().filter(|(_, waits)| *waits).count();
    assert_eq!(pending, 1);
    assert_eq!(work.released.len() as u32, shape().slots());
    model.step(DVec3::ZERO, 1);
    assert!(
        model.step(DVec3::ZERO, 1).is_empty(),
        "a still scene costs nothing"
    );
}

#[test]
fn a_change_reaches_the_tails() {
    let mut model = Model::new(shape());
    model.step(DVec3::ZERO, u32::MAX);
    while !model.step(DVec3::ZERO, u32::MAX).is_empty() {}
    let place = DVec3::splat(-0.7);
    model.clipmap.touch(place, place);
    let work = model.step(DVec3::ZERO, u32::MAX);
    assert_eq!(work.made.len(), 2, "one brick a cascade");
    let tails: HashSet<u32> = work
        .tails
        .iter()
        .flatten()
        .map(|brick| brick.level)
        .collect();
    assert_eq!(tails, HashSet::from([2, 3]));
}

#[test]
fn far_from_the_origin_positions_stay_exact() {
    let mut clipmap = Clipmap::new(ClipmapShape::new(128, 3, 0.0625));
    let camera = DVec3::new(1e6 + 0.03125, -1e6, 1e6);
    clipmap.follow(camera);
    let uniform = clipmap.uniform(7);
    for level in &uniform.levels[..uniform.level_count as usize] {
        let size = f64::from(level.voxel_size) * 4.0;
        let corner = level.origin.as_dvec3() * size;
        let error = (corner + level.anchor.as_dvec3() - camera)
            .abs()
            .max_element();
        assert!(error < 1e-5 * size.max(1.0) * 4.0, "{error}");
    }
    clipmap.touch(DVec3::splat(f64::NAN), DVec3::ONE);
    assert!(
        clipmap.follow(DVec3::NAN).is_empty(),
        "bad data change nothing"
    );
}
