//! A face of the cube as bits.

/// What is seen through the texels of one face, and which of them matter.
///
/// Texel `(x, y)` has its centre at `((2x + 1)/size − 1, (2y + 1)/size − 1)` of the face (see
/// [`akari_visibility::face`]).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FaceMask {
    size: u32,
    /// Words per row.
    stride: usize,
    cared: Vec<u64>,
    visible: Vec<u64>,
}

impl FaceMask {
    /// A face of which nothing matters. `size` is one of [`crate::FACE_SIZES`].
    #[must_use]
    pub fn new(size: u32) -> Self {
        let stride = size.div_ceil(64) as usize;
        let words = stride * size as usize;
        Self {
            size,
            stride,
            cared: vec![0; words],
            visible: vec![0; words],
        }
    }

    /// A face made from a function of the texel: `None` where it does not matter, else whether it is visible.
    #[must_use]
    pub fn from_fn(size: u32, texel: impl Fn(u32, u32) -> Option<bool>) -> Self {
        let mut mask = Self::new(size);
        for y in 0..size {
            for x in 0..size {
                mask.set(x, y, texel(x, y));
            }
        }
        mask
    }

    /// Texels along a side.
    #[must_use]
    pub fn size(&self) -> u32 {
        self.size
    }

    fn word(&self, x: u32, y: u32) -> usize {
        y as usize * self.stride + x as usize / 64
    }

    /// Sets a texel.
    pub fn set(&mut self, x: u32, y: u32, state: Option<bool>) {
        let (word, bit) = (self.word(x, y), 1 << (x % 64));
        self.cared[word] &= !bit;
        self.visible[word] &= !bit;
        if state.is_some() {
            self.cared[word] |= bit;
        }
        if state == Some(true) {
            self.visible[word] |= bit;
        }
    }

    /// Whether a texel is visible; none where that does not matter.
    #[must_use]
    pub fn get(&self, x: u32, y: u32) -> Option<bool> {
        let (word, bit) = (self.word(x, y), 1 << (x % 64));
        (self.cared[word] & bit != 0).then_some(self.visible[word] & bit != 0)
    }

    /// Makes nothing matter.
    pub(crate) fn clear(&mut self) {
        self.cared.fill(0);
        self.visible.fill(0);
    }

    /// Texels that matter.
    #[must_use]
    pub fn cared_count(&self) -> u32 {
        self.cared.iter().map(|w| w.count_ones()).sum()
    }

    /// Texels that matter and are visible.
    #[must_use]
    pub fn visible_count(&self) -> u32 {
        self.visible.iter().map(|w| w.count_ones()).sum()
    }

    /// How many texels of a square matter, and how many of them are visible. It does not cross words: `side` divides 64.
    pub(crate) fn block_counts(&self, x: usize, y: usize, side: usize) -> (u32, u32) {
        let bits = (u64::MAX >> (64 - side)) << (x % 64);
        let mut counts = (0, 0);
        for row in y..y + side {
            let word = row * self.stride + x / 64;
            counts.0 += (self.cared[word] & bits).count_ones();
            counts.1 += (self.visible[word] & bits).count_ones();
        }
        counts
    }

    /// Words of a row: those that matter and those that are visible, which is a subset.
    pub(crate) fn row(&self, y: u32) -> (&[u64], &[u64]) {
        let words = y as usize * self.stride..(y as usize + 1) * self.stride;
        (&self.cared[words.clone()], &self.visible[words])
    }

    pub(crate) fn row_mut(&mut self, y: u32) -> (&mut [u64], &mut [u64]) {
        let words = y as usize * self.stride..(y as usize + 1) * self.stride;
        (&mut self.cared[words.clone()], &mut self.visible[words])
    }
}
