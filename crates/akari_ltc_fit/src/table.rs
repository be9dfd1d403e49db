//! The table: its cells, its bytes and its bilinear lookup.

use crate::lobe::{Lobe, Model};
use half::f16;

/// Number of f16 components of a cell over both layers.
const CELL: usize = 8;
/// Components of one layer's texel.
const TEXEL: usize = 4;

/// Everything a cell of the table says, as stored or interpolated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Layer 0: B = M⁻¹ \[X Z\] in the frame of the mirror direction, \[0\]\[0\], \[0\]\[2\], \[2\]\[0\], \[2\]\[2\].
    ///
    /// There a narrow lobe's entries hardly depend on the view, which is what interpolation needs.
    pub mirror: [f64; 4],
    /// Layer 1, x: A₀ − A₁, the factor of f0.
    pub scale: f64,
    /// Layer 1, y: A₁, the factor of f90.
    pub bias: f64,
    /// Layer 1, z: the part of the energy in the tail.
    pub tail_z: f64,
    /// Layer 1, w: the slope of the tail.
    pub tail_x: f64,
}

impl Entry {
    /// The eight components, layer 0 first.
    pub fn to_array(self) -> [f64; CELL] {
        let [a, b, c, d] = self.mirror;
        [a, b, c, d, self.scale, self.bias, self.tail_z, self.tail_x]
    }

    /// The entry of eight components, layer 0 first.
    pub fn from_array([a, b, c, d, scale, bias, tail_z, tail_x]: [f64; CELL]) -> Self {
        Self {
            mirror: [a, b, c, d],
            scale,
            bias,
            tail_z,
            tail_x,
        }
    }

    /// What the renderer shades with at this `n_dot_v`.
    pub fn model(&self, n_dot_v: f64) -> Model {
        Model {
            lobe: Lobe::from_mirror_frame(self.mirror, n_dot_v),
            tail_z: self.tail_z,
            tail_x: self.tail_x,
        }
    }

    /// Directional albedo for F = 1.
    pub fn albedo(&self) -> f64 {
        self.scale + self.bias
    }
}

/// A square table over x = perceptual roughness and y = √(1 − n·v), both in [0, 1] with samples at both ends.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    resolution: usize,
    /// Row-major, x fastest.
    cells: Vec<[f16; CELL]>,
}

/// Why bytes are not a table.
#[derive(Clone, Debug, PartialEq)]
pub enum TableError {
    /// The number of bytes is not `16 n²` for an `n ≥ 2`.
    Length(usize),
    /// A component is infinite or not a number: (x, y, component).
    NotFinite(usize, usize, usize),
}

impl std::fmt::Display for TableError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Length(n) => write!(f, "{n} bytes are not two square layers of RGBA f16"),
            Self::NotFinite(x, y, c) => write!(f, "component {c} of cell ({x}, {y}) is not finite"),
        }
    }
}

impl std::error::Error for TableError {}

impl Table {
    /// A table of `resolution`² cells from their entries, row-major, rounded to f16.
    ///
    /// # Panics
    /// When `entries` has another length or the resolution is below 2.
    pub fn from_entries(resolution: usize, entries: &[Entry]) -> Self {
        assert!(
            resolution >= 2 && entries.len() == resolution * resolution,
            "a square table"
        );
        Self {
            resolution,
            cells: entries
                .iter()
                .map(|e| e.to_array().map(f16::from_f64))
                .collect(),
        }
    }

    /// Cells along an edge.
    pub fn resolution(&self) -> usize {
        self.resolution
    }

    /// The stored cell; x counts roughness, y counts √(1 − n·v).
    pub fn cell(&self, x: usize, y: usize) -> Entry {
        Entry::from_array(self.cells[y * self.resolution + x].map(f16::to_f64))
    }

    /// Layer after layer, row-major, four f16 a texel, little endian.
    pub fn to_bytes(&self) -> Vec<u8> {
        let layer = |from: usize| {
            self.cells.iter().flat_map(move |cell| {
                cell[from..from + TEXEL]
                    .iter()
                    .flat_map(|c| c.to_le_bytes())
            })
        };
        layer(0).chain(layer(TEXEL)).collect()
    }

    /// The inverse of [`Table::to_bytes`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, TableError> {
        let cell_bytes = CELL * size_of::<f16>();
        let resolution = (bytes.len() / cell_bytes).isqrt();
        if resolution < 2 || resolution * resolution * cell_bytes != bytes.len() {
            return Err(TableError::Length(bytes.len()));
        }
        let (count, texel_bytes) = (resolution * resolution, cell_bytes / 2);
        let mut cells = vec![[f16::ZERO; CELL]; count];
        for (i, cell) in cells.iter_mut().enumerate() {
            for (c, value) in cell.iter_mut().enumerate() {
                let at = (c / TEXEL * count + i) * texel_bytes + c % TEXEL * size_of::<f16>();
                *value = f16::from_le_bytes([bytes[at], bytes[at + 1]]);
                if !value.is_finite() {
                    return Err(TableError::NotFinite(i % resolution, i / resolution, c));
                }
            }
        }
        Ok(Self { resolution, cells })
    }

    /// Bilinear interpolation of the stored halves at table coordinates in cells, clamped to the edge.
    pub fn interpolate(&self, x: f64, y: f64) -> Entry {
        let last = (self.resolution - 1) as f64;
        let (x, y) = (x.clamp(0.0, last), y.clamp(0.0, last));
        let (x0, y0) = (
            (x as usize).min(self.resolution - 2),
            (y as usize).min(self.resolution - 2),
        );
        let (tx, ty) = (x - x0 as f64, y - y0 as f64);
        let at = |dx: usize, dy: usize| self.cell(x0 + dx, y0 + dy).to_array();
        let (a, b, c, d) = (at(0, 0), at(1, 0), at(0, 1), at(1, 1));
        Entry::from_array(std::array::from_fn(|i| {
            (1.0 - ty) * ((1.0 - tx) * a[i] + tx * b[i]) + ty * ((1.0 - tx) * c[i] + tx * d[i])
        }))
    }

    /// What the renderer reads for a perceptual roughness and an n·v, both clamped to [0, 1].
    pub fn sample(&self, perceptual_roughness: f64, n_dot_v: f64) -> Entry {
        let last = (self.resolution - 1) as f64;
        let y = (1.0 - n_dot_v.clamp(0.0, 1.0)).sqrt();
        self.interpolate(perceptual_roughness * last, y * last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> Table {
        let entries: Vec<Entry> = (0..9)
            .map(|i| Entry::from_array(std::array::from_fn(|c| (8 * i + c) as f64)))
            .collect();
        Table::from_entries(3, &entries)
    }

    #[test]
    fn bytes_round_trip_and_have_the_layout() {
        let table = small();
        let bytes = table.to_bytes();
        assert_eq!(bytes.len(), 9 * 16);
        assert_eq!(Table::from_bytes(&bytes).as_ref(), Ok(&table));
        let half_at = |i: usize| f16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]]).to_f64();
        // Texel (x 1, y 2) is number 7; its second component in layer 0 is 8 · 7 + 1, in layer 1 it is 4 more.
        assert_eq!(half_at(7 * 4 + 1), 57.0);
        assert_eq!(half_at(9 * 4 + 7 * 4 + 1), 61.0);
    }

    #[test]
    fn bad_bytes_are_refused() {
        let mut bytes = small().to_bytes();
        assert_eq!(Table::from_bytes(&bytes[1..]), Err(TableError::Length(143)));
        assert_eq!(Table::from_bytes(&[]), Err(TableError::Length(0)));
        // Second byte of the third component of cell (1, 0): an f16 infinity.
        (bytes[12], bytes[13]) = (0x00, 0x7c);
        assert_eq!(
            Table::from_bytes(&bytes),
            Err(TableError::NotFinite(1, 0, 2))
        );
    }

    #[test]
    fn interpolation_is_bilinear_and_clamped() {
        let table = small();
        let middle = table.interpolate(0.5, 1.5);
        // Cells 3, 4, 6, 7: the mean of their first components.
        assert_eq!(middle.mirror[0], 8.0 * 5.0);
        assert_eq!(table.interpolate(-3.0, 9.0), table.cell(0, 2));
        assert_eq!(table.sample(1.0, 0.0), table.cell(2, 2));
        assert_eq!(table.sample(0.5, 1.0), table.cell(1, 0));
    }
}
