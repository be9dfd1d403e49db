//! From the bits of a face to its tree.
//!
//! The whole face is split by the line that leaves the least variance, and so are its parts, until a part has hardly
//! any texel on the wrong side of ½ ([`FitSettings::tolerance`]) or lies as deep as is allowed. A leaf has the mean of
//! its bits. Texels that do not matter are in no sum: they cost no leaves, and get the value of whatever leaf they fall
//! into. A face of which nothing matters is one leaf that sees nothing.

use akari_visibility::face::PackedLine;
use akari_visibility::tree::{BuiltNode, MAX_DEPTH, Tree, TreeBuilder, TreeError};

use crate::mask::FaceMask;
use crate::split::{Cell, Counts, Search, Table};

/// When a tree is fine enough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitSettings {
    /// A leaf may have this share of a face's texels wrong.
    pub tolerance: f32,
    /// Most lines from the root to a leaf.
    pub max_depth: u32,
}

/// How well a tree fits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FitQuality {
    /// Leaves before equal siblings are joined.
    pub leaves: u32,
    /// Texels that matter.
    pub texels: u32,
    /// Of these, how many the leaf's mean puts on the wrong side of ½.
    pub misclassified: u32,
    /// Sum over the texels of |mean of the leaf − bit|.
    pub absolute_error: f64,
}

impl FitQuality {
    /// Adds another face.
    pub fn add(&mut self, other: &Self) {
        self.leaves += other.leaves;
        self.texels += other.texels;
        self.misclassified += other.misclassified;
        self.absolute_error += other.absolute_error;
    }
}

/// A tree as the fitter writes it down, a word per node and leaf, each node before its negative and its positive side.
///
/// Top bit set: a node, with the bits of its [`PackedLine`]. Else a leaf, with its visibility in 1/255.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Outline(pub(crate) Vec<u32>);

impl Outline {
    const NODE: u32 = 1 << 31;

    /// Reads one tree off the front of `words`. None if they are no tree.
    pub(crate) fn read(words: &mut impl Iterator<Item = u32>) -> Option<Self> {
        let mut outline = Self::default();
        let mut missing = 1_u32;
        while missing > 0 {
            let word = words.next()?;
            let is_node = word & Self::NODE != 0;
            let valid = if is_node {
                PackedLine::from_bits(word & !Self::NODE).is_some()
            } else {
                word <= 255
            };
            if !valid {
                return None;
            }
            missing = if is_node { missing + 1 } else { missing - 1 };
            outline.0.push(word);
        }
        Some(outline)
    }

    /// Encodes it.
    pub(crate) fn tree(&self, builder: &mut TreeBuilder) -> Result<Tree, TreeError> {
        let mut words = self.0.iter().copied();
        let root = Self::build(&mut words, builder, 0)?;
        builder.finish(root)
    }

    fn build(
        words: &mut impl Iterator<Item = u32>,
        builder: &mut TreeBuilder,
        depth: usize,
    ) -> Result<BuiltNode, TreeError> {
        let word = words.next().unwrap_or(0);
        match PackedLine::from_bits(word & !Self::NODE) {
            Some(line) if word & Self::NODE != 0 => {
                if depth >= MAX_DEPTH {
                    return Err(TreeError::TooDeep);
                }
                let negative = Self::build(words, builder, depth + 1)?;
                let positive = Self::build(words, builder, depth + 1)?;
                Ok(builder.split(line, negative, positive))
            }
            _ => Ok(builder.leaf(word as f32 / 255.0)),
        }
    }
}

/// Fits trees. Its memory is kept from face to face.
#[derive(Debug)]
pub struct Fitter {
    settings: FitSettings,
    table: Table,
    search: Search,
    outline: Outline,
    /// Cells that are free for use.
    spare: Vec<Cell>,
    quality: FitQuality,
}

impl Fitter {
    /// A fitter.
    #[must_use]
    pub fn new(settings: FitSettings) -> Self {
        Self {
            settings,
            table: Table::default(),
            search: Search::default(),
            outline: Outline::default(),
            spare: Vec::new(),
            quality: FitQuality::default(),
        }
    }

    /// The tree of a face. It depends on the face and the settings alone. Refused only where
    /// [`FitSettings::max_depth`] is beyond what a tree may have.
    pub fn fit(&mut self, mask: &FaceMask) -> Result<(Tree, FitQuality), TreeError> {
        let quality = self.fit_outline(mask);
        Ok((self.outline.tree(&mut TreeBuilder::new())?, quality))
    }

    /// The same, not encoded.
    pub(crate) fn fit_outline(&mut self, mask: &FaceMask) -> FitQuality {
        self.outline.0.clear();
        self.table.load(mask);
        self.quality = FitQuality::default();
        let mut cell = self.spare.pop().unwrap_or_default();
        self.table.whole(&mut cell);
        self.build(&cell, 0);
        self.spare.push(cell);
        self.quality
    }

    /// What [`Fitter::fit_outline`] found.
    pub(crate) fn outline(&self) -> &Outline {
        &self.outline
    }

    /// How many lines have been evaluated since the fitter was made.
    #[must_use]
    pub fn lines(&self) -> u64 {
        self.search.lines
    }

    fn leaf(&mut self, counts: Counts) {
        let (texels, visible) = (counts.texels(), counts.visible);
        // What lies below the horizon receives nothing.
        let mean = if texels == 0 {
            0.0
        } else {
            f64::from(visible) / f64::from(texels)
        };
        let quality = &mut self.quality;
        quality.leaves += 1;
        quality.texels += texels;
        quality.misclassified += counts.blocked.min(visible);
        quality.absolute_error += 2.0 * f64::from(counts.blocked) * mean;
        self.outline.0.push((mean * 255.0).round() as u32);
    }

    fn build(&mut self, cell: &Cell, depth: u32) {
        let allowed = f64::from(self.settings.tolerance) * f64::from(self.table.size.pow(2));
        let wrong = cell.counts.blocked.min(cell.counts.visible);
        let line = if f64::from(wrong) <= allowed || depth >= self.settings.max_depth {
            None
        } else {
            self.search.best(&self.table, cell)
        };
        let Some((line, packed)) = line.and_then(|line| Some((line, line.packed()?))) else {
            self.leaf(cell.counts);
            return;
        };
        self.outline.0.push(Outline::NODE | packed.bits());
        let mut negative = self.spare.pop().unwrap_or_default();
        let mut positive = self.spare.pop().unwrap_or_default();
        self.table.cut(cell, &line, [&mut negative, &mut positive]);
        self.build(&negative, depth + 1);
        self.build(&positive, depth + 1);
        self.spare.extend([negative, positive]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    const SIZE: u32 = 64;

    fn centre(i: u32, size: u32) -> f32 {
        (2 * i + 1) as f32 / size as f32 - 1.0
    }

    fn mask(size: u32, visible: impl Fn(f32, f32) -> bool) -> FaceMask {
        FaceMask::from_fn(size, |x, y| Some(visible(centre(x, size), centre(y, size))))
    }

    fn fitter(tolerance: f32) -> Fitter {
        Fitter::new(FitSettings {
            tolerance,
            max_depth: 48,
        })
    }

    /// What the encoded tree says, held against the bits.
    fn measure(mask: &FaceMask, tree: &Tree) -> (u32, f64) {
        let (mut wrong, mut absolute) = (0, 0.0);
        for y in 0..mask.size() {
            for x in 0..mask.size() {
                let Some(bit) = mask.get(x, y) else { continue };
                let at = Vec2::new(centre(x, mask.size()), centre(y, mask.size()));
                let bit = f64::from(u8::from(bit));
                let off = (f64::from(tree.visibility_at(at)) - bit).abs();
                absolute += off;
                wrong += u32::from(off > 0.5);
            }
        }
        (wrong, absolute)
    }

    fn check(mask: &FaceMask, tolerance: f32) -> FitQuality {
        let (tree, quality) = fitter(tolerance).fit(mask).unwrap();
        assert!(tree.leaf_count() <= quality.leaves as usize);
        assert_eq!(quality.texels, mask.cared_count());
        let (wrong, absolute) = measure(mask, &tree);
        // A leaf of equal parts is on neither side.
        assert!(wrong <= quality.misclassified, "{wrong} {quality:?}");
        // Means are stored in 1/255, and f32 may put a centre that is on a line on either side.
        let slack = f64::from(quality.texels) * (0.5 / 255.0) + 1.0;
        assert!((absolute - quality.absolute_error).abs() < slack);
        let allowed = tolerance * (mask.size() * mask.size()) as f32;
        assert!(
            quality.misclassified as f32 <= allowed * quality.leaves as f32,
            "{quality:?}"
        );
        quality
    }

    #[test]
    fn a_half_plane_is_two_leaves() {
        for k in 0..40 {
            let (sin, cos) = (0.157 * k as f32).sin_cos();
            for offset in [0.0, 0.31, -0.7] {
                let mask = mask(SIZE, |x, y| x * cos + y * sin > offset);
                let quality = check(&mask, 0.0);
                assert!(quality.leaves <= 3, "angle {k}, {offset}: {quality:?}");
                assert_eq!(quality.misclassified, 0);
            }
        }
    }

    #[test]
    fn shapes_take_no_more_leaves_than_the_study() {
        // METHODS, section 9: leaves at zero error of the exhaustive search with refinement, in Python.
        let fence = mask(SIZE, |x, _| {
            (0..6).all(|k| (x - (-0.8 + 0.3 * k as f32)).abs() >= 0.05)
        });
        assert!(check(&fence, 0.0).leaves <= 13);
        let blob = mask(SIZE, |x, y| {
            let angle = y.atan2(x);
            let radius = 0.55 + 0.12 * (5.0 * angle).sin() + 0.06 * (13.0 * angle + 1.0).sin();
            x.hypot(y) >= radius
        });
        let quality = check(&blob, 0.0);
        assert!(quality.leaves <= 60, "{quality:?}");
        assert_eq!(quality.misclassified, 0);
        let coarse = check(&blob, 0.001);
        assert!(coarse.leaves < quality.leaves, "{coarse:?} {quality:?}");
    }

    #[test]
    fn what_does_not_matter_costs_nothing() {
        // Bits of noise below a horizon.
        let noise = |x: u32, y: u32| (x * 7919 + y * 104_729 + x * y * 31) % 7 < 3;
        let above = |x: u32, y: u32| centre(x, SIZE) + 2.0 * centre(y, SIZE) > 0.2;
        let cared = FaceMask::from_fn(SIZE, |x, y| above(x, y).then_some(x < 30 || y > 50));
        let quality = check(&cared, 0.0);
        assert!(quality.leaves <= 4, "{quality:?}");
        // The wrong way, so that this is known to be able to fail: the noise matters.
        let all = FaceMask::from_fn(SIZE, |x, y| {
            Some(if above(x, y) {
                x < 30 || y > 50
            } else {
                noise(x, y)
            })
        });
        assert!(fitter(0.0).fit(&all).unwrap().1.leaves > 100);
        let nothing = FaceMask::new(SIZE);
        let (tree, quality) = fitter(0.0).fit(&nothing).unwrap();
        assert_eq!((tree, quality.leaves), (Tree::leaf(0.0), 1));
    }

    #[test]
    fn noise_ends_and_every_size_fits() {
        for size in crate::FACE_SIZES {
            let noise = FaceMask::from_fn(size, |x, y| {
                let h = (x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b))
                    .wrapping_mul(0xc2b2_ae35);
                Some((h >> 16) & 1 == 1)
            });
            let tolerance = if size == 256 { 0.01 } else { 0.0005 };
            let (tree, quality) = Fitter::new(FitSettings {
                tolerance,
                max_depth: 12,
            })
            .fit(&noise)
            .unwrap();
            assert!(tree.leaf_count() > 16 && tree.leaf_count() <= 1 << 12);
            assert_eq!(quality.texels, size * size);
            let disc = mask(size, |x, y| x.hypot(y - 0.2) > 0.6);
            let quality = check(&disc, 0.0005);
            assert!((6..60).contains(&quality.leaves), "{size}: {quality:?}");
        }
        // One texel of a full face, in a corner and within.
        for (x, y) in [(0, 0), (63, 0), (20, 41)] {
            let one = FaceMask::from_fn(SIZE, |i, j| Some((i, j) == (x, y)));
            let quality = check(&one, 0.0);
            assert!(
                quality.misclassified == 0 && quality.leaves <= 5,
                "{quality:?}"
            );
        }
    }

    #[test]
    fn outlines_survive_the_journal_and_nonsense_does_not() {
        let disc = mask(SIZE, |x, y| x.hypot(y) > 0.5);
        let mut fitter = fitter(0.001);
        fitter.fit_outline(&disc);
        let outline = fitter.outline().clone();
        let mut words = outline.0.iter().copied().chain([77]);
        assert_eq!(Outline::read(&mut words).unwrap(), outline);
        assert_eq!(words.next(), Some(77));
        for bad in [vec![], vec![256], vec![Outline::NODE | outline.0[0]], {
            let mut cut = outline.0.clone();
            cut.pop();
            cut
        }] {
            assert_eq!(Outline::read(&mut bad.into_iter()), None);
        }
        let deep: Vec<u32> = std::iter::repeat_n(outline.0[0], MAX_DEPTH + 1)
            .chain(std::iter::repeat_n(0, MAX_DEPTH + 2))
            .collect();
        let deep = Outline::read(&mut deep.into_iter()).unwrap();
        assert_eq!(deep.tree(&mut TreeBuilder::new()), Err(TreeError::TooDeep));
    }
}
