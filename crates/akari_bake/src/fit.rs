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

    fn leaf(&mut self, Counts { texels, visible }: Counts) {
        // What lies below the horizon receives nothing.
        let mean = if texels == 0 {
            0.0
        } else {
            f64::from(visible) / f64::from(texels)
        };
        let quality = &mut self.quality;
        quality.leaves += 1;
        quality.texels += texels;
        quality.misclassified += visible.min(texels - visible);
        quality.absolute_error += 2.0 * f64::from(texels - visible) * mean;
        self.outline.0.push((mean * 255.0).round() as u32);
    }

    fn build(&mut self, cell: &Cell, depth: u32) {
        let Counts { texels, visible } = cell.counts;
        let allowed = f64::from(self.settings.tolerance) * f64::from(self.table.size.pow(2));
        let wrong = visible.min(texels - visible);
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
        self.table
            .cut(cell, &line, [&mut negative, &mut positive]);
        self.build(&negative, depth + 1);
        self.build(&positive, depth + 1);
        self.spare.extend([negative, positive]);
    }
}
