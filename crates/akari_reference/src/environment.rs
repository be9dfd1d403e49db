//! Importance sampling of an environment map.

use akari_scene::{Environment, tonemap::LUMINANCE};
use glam::Vec3;
use std::f32::consts::PI;

/// A table of texels, chosen by luminance × solid angle.
pub(crate) struct EnvironmentSampler<'a> {
    map: &'a Environment,
    width: usize,
    height: usize,
    /// Cumulative over rows, `height + 1` values from 0 to 1.
    rows: Vec<f32>,
    /// Cumulative over the texels of each row, `height × (width + 1)` values.
    columns: Vec<f32>,
}

impl<'a> EnvironmentSampler<'a> {
    /// None for a black map.
    pub(crate) fn new(map: &'a Environment) -> Option<Self> {
        let (w, h) = (map.image.width as usize, map.image.height as usize);
        let luminance: Vec<f64> = map
            .image
            .data
            .iter()
            .map(|p| f64::from(Vec3::from(*p).dot(LUMINANCE).max(0.0)))
            .collect();
        let mut rows = vec![0.0_f64];
        let mut columns = Vec::with_capacity(h * (w + 1));
        for j in 0..h {
            let sin = (std::f64::consts::PI * (j as f64 + 0.5) / h as f64).sin();
            let mut row = vec![0.0_f64];
            for i in 0..w {
                // The bilinear lookup inside of a texel reaches its neighbours: where one of them is lit, the density
                // must not be 0.
                let mut sum = 0.0;
                for dj in [j.saturating_sub(1), j, (j + 1).min(h - 1)] {
                    for di in [(i + w - 1) % w, i, (i + 1) % w] {
                        sum += luminance[dj * w + di];
                    }
                }
                // Half own luminance, half the neighbourhood's: sharp where it counts.
                let value = 0.5 * luminance[j * w + i] + 0.5 * sum / 9.0;
                row.push(row[i] + value * sin);
            }
            let total = row[w];
            rows.push(rows[j] + total);
            columns.extend(
                row.iter()
                    .map(|c| if total > 0.0 { (c / total) as f32 } else { 0.0 }),
            );
        }
        let total = rows[h];
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        Some(Self {
            map,
            width: w,
            height: h,
            rows: rows.iter().map(|r| (r / total) as f32).collect(),
            columns,
        })
    }

    pub(crate) fn radiance(&self, direction: Vec3) -> Vec3 {
        self.map.radiance(direction)
    }

    fn row(&self, j: usize) -> &[f32] {
        &self.columns[j * (self.width + 1)..(j + 1) * (self.width + 1)]
    }

    /// Unit direction and density per solid angle.
    pub(crate) fn sample(&self, u: [f32; 2]) -> Option<(Vec3, f32)> {
        let (j, y) = invert(&self.rows, u[0]);
        let (i, x) = invert(self.row(j), u[1]);
        let direction = Environment::direction(
            (i as f32 + x) / self.width as f32,
            (j as f32 + y) / self.height as f32,
        );
        let pdf = self.pdf(direction);
        (pdf > 0.0).then_some((direction, pdf))
    }

    /// Density per solid angle with which [`Self::sample`] takes `direction`.
    pub(crate) fn pdf(&self, direction: Vec3) -> f32 {
        let (u, v) = Environment::uv(direction);
        let i = ((u * self.width as f32) as usize).min(self.width - 1);
        let j = ((v * self.height as f32) as usize).min(self.height - 1);
        let row = self.row(j);
        let texel = (self.rows[j + 1] - self.rows[j]) * (row[i + 1] - row[i]);
        let sin = (1.0 - direction.y * direction.y).max(0.0).sqrt();
        if sin <= 0.0 {
            return 0.0;
        }
        texel * (self.width * self.height) as f32 / (2.0 * PI * PI * sin)
    }
}

/// The cell of a cumulative table that holds `u`, and the place in it.
fn invert(table: &[f32], u: f32) -> (usize, f32) {
    let cells = table.len() - 1;
    let i = table.partition_point(|c| *c <= u).clamp(1, cells) - 1;
    let (a, b) = (table[i], table[i + 1]);
    let x = if b > a { (u - a) / (b - a) } else { 0.5 };
    (i, x.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use akari_scene::exr_io::RgbImage;

    #[test]
    fn estimates_the_integral() {
        let (w, h) = (32, 16);
        let mut image = RgbImage::filled(w, h, [0.1; 3]);
        image.data[5 * 32 + 20] = [500.0; 3];
        let map = Environment::from_image("test".as_ref(), image).unwrap();
        let sampler = EnvironmentSampler::new(&map).unwrap();
        // Against a fine midpoint sum of radiance over the sphere.
        let n = 1024;
        let mut expected = 0.0;
        for j in 0..n / 2 {
            for i in 0..n {
                let v = (j as f32 + 0.5) / (n / 2) as f32;
                let d = Environment::direction((i as f32 + 0.5) / n as f32, v);
                expected += f64::from(map.radiance(d).x * (PI * v).sin());
            }
        }
        expected *= std::f64::consts::TAU * std::f64::consts::PI / f64::from(n * n / 2);
        let count = 1 << 14;
        let sum: f64 = (0..count)
            .filter_map(|k| {
                let u = sobol_burley::sample_4d(k, 0, 2);
                let (d, pdf) = sampler.sample([u[0], u[1]])?;
                Some(f64::from(sampler.radiance(d).x / pdf))
            })
            .sum();
        let mean = sum / f64::from(count);
        assert!((mean / expected - 1.0).abs() < 0.01, "{mean} {expected}");
        assert!(EnvironmentSampler::new(&Environment::uniform([0.0; 3])).is_none());
    }
}
