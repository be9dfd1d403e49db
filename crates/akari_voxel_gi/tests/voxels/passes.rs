//! The lighting passes over voxels from the CPU, run outside of Bevy.

use crate::build::Voxels;
use akari_gpu_test::{Gpu, Program, ProgramSource, ShaderDefinition, Words};
use akari_math::voxel::packing::voxel_radiance_unpack;
use akari_math::voxel::schedule::WHOLE_TURN;

/// Words of a record of irradiance, as `IRRADIANCE_STRIDE`.
const STRIDE: usize = 7;
const UNKNOWN: u32 = u32::MAX;
/// Words of `VoxelSurroundings`.
const SURROUNDINGS: usize = 12 + 16 * 12;

/// Modules of the crate, as their sources are, after those of `akari_math`.
pub fn modules() -> Vec<(&'static str, &'static str)> {
    let mut modules = akari_math::WGSL_MODULES.to_vec();
    modules.extend([
        (
            "akari_voxel_gi::types",
            include_str!("../../src/types.wgsl"),
        ),
        (
            "akari_voxel_gi::casters",
            include_str!("../../src/casters.wgsl"),
        ),
        (
            "akari_voxel_gi::trace",
            include_str!("../../src/trace.wgsl"),
        ),
        (
            "akari_render::scene_lights",
            include_str!("../../../akari_render/src/scene_lights.wgsl"),
        ),
        (
            "akari_voxel_gi::mirrors",
            include_str!("../../src/mirrors.wgsl"),
        ),
        (
            "akari_render::sky",
            include_str!("../../../akari_render/src/sky.wgsl"),
        ),
        ("akari_voxel_gi::sky", include_str!("../../src/sky.wgsl")),
        (
            "akari_voxel_gi::records",
            include_str!("../../src/records.wgsl"),
        ),
        (
            "akari_voxel_gi::diffuse",
            include_str!("../../src/diffuse.wgsl"),
        ),
        (
            "akari_voxel_gi::lighting",
            include_str!("../../src/lighting.wgsl"),
        ),
    ]);
    modules
}

/// Voxels on the device, and the passes over them.
pub struct Lit<'a> {
    gpu: &'a Gpu,
    inject: Program,
    gather: Program,
    clipmap: Words,
    bricks: Words,
    coverage: Words,
    surface: Words,
    emission: Words,
    owners: Words,
    lights: Words,
    light_count: u32,
    irradiance: Words,
    radiance: Words,
    lighting: Words,
    surroundings: Words,
    pool: Words,
    pages: u32,
    plain: bool,
    frame: u32,
}

/// How the faces gather.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    pub cones: u32,
    /// Width of the cones over that of their cells of the hemisphere.
    pub aperture: f32,
    /// Least share of a visit in the mean.
    pub least_rate: f32,
    /// Visits that count at most.
    pub most_visits: u32,
}

pub fn definitions(plain: bool, more: &[&'static str]) -> Vec<(&'static str, ShaderDefinition)> {
    let mut definitions = vec![("VOXEL_GROUP", ShaderDefinition::Number(1))];
    if plain {
        definitions.push(("PLAIN_CONES", ShaderDefinition::Set));
    }
    definitions.extend(more.iter().map(|&name| (name, ShaderDefinition::Set)));
    definitions
}

impl<'a> Lit<'a> {
    /// `lights`: four vectors a light, then corners.
    pub fn new(
        gpu: &'a Gpu,
        voxels: &Voxels,
        lights: &[[f32; 4]],
        light_count: u32,
        plain: bool,
    ) -> Self {
        let modules = modules();
        let compile = |source, entry: &str, more: &[&'static str]| {
            let definitions = definitions(plain, more);
            let source = ProgramSource {
                modules: &modules,
                source,
                definitions: &definitions,
            };
            Program::new(gpu, &source, entry).unwrap_or_else(|error| panic!("{entry}: {error}"))
        };
        let elements = voxels.emission.len();
        let mut irradiance = vec![UNKNOWN; elements / 6 * STRIDE];
        irradiance
            .iter_mut()
            .skip(6)
            .step_by(STRIDE)
            .for_each(|visits| *visits = 0);
        let lights: Vec<u32> = lights
            .iter()
            .flatten()
            .map(|x| x.to_bits())
            .chain([0; 4])
            .collect();
        Self {
            gpu,
            inject: compile(
                include_str!("../../src/inject.wgsl"),
                "inject",
                &["EMISSIVE", "FEEDBACK"],
            ),
            gather: compile(
                include_str!("../../src/gather.wgsl"),
                "gather",
                &["TRACE_RADIANCE"],
            ),
            clipmap: Words::new(gpu, &voxels.clipmap),
            bricks: Words::new(gpu, &voxels.bricks),
            coverage: Words::new(gpu, &voxels.coverage),
            surface: Words::new(gpu, &voxels.surface),
            emission: Words::new(gpu, &voxels.emission),
            owners: Words::new(gpu, &voxels.owners),
            lights: Words::new(gpu, &lights),
            light_count,
            irradiance: Words::new(gpu, &irradiance),
            pool: Words::new(gpu, &[0; 8]),
            radiance: Words::new(gpu, &vec![0; elements]),
            lighting: Words::new(gpu, &[0; 12]),
            surroundings: Words::new(gpu, &[0; SURROUNDINGS]),
            pages: voxels.owners.len() as u32,
            plain,
            frame: 0,
        }
    }

    fn buffers(&self) -> Vec<((u32, u32), &Words)> {
        vec![
            ((0, 0), &self.lighting),
            ((0, 1), &self.owners),
            ((0, 2), &self.lights),
            ((0, 3), &self.emission),
            ((0, 4), &self.irradiance),
            ((0, 5), &self.radiance),
            ((0, 6), &self.pool),
            ((1, 0), &self.clipmap),
            ((1, 1), &self.bricks),
            ((1, 2), &self.coverage),
            ((1, 3), &self.surface),
            ((1, 4), &self.radiance),
            ((1, 5), &self.surroundings),
        ]
    }

    /// What shines from beside all voxels, nits, and boxes that it does not reach: low and high corners from the anchor.
    pub fn surround(&mut self, ambient: f32, interiors: &[[[f32; 3]; 2]]) {
        let mut words = vec![0.0_f32.to_bits(); SURROUNDINGS];
        words[..3].fill(ambient.to_bits());
        words[9] = interiors.len() as u32;
        for (i, [low, high]) in interiors.iter().enumerate() {
            for axis in 0..3 {
                let row = 12 + 12 * i + 4 * axis;
                let size = high[axis] - low[axis];
                words[row + axis] = size.recip().to_bits();
                words[row + 3] = (-0.5 * (low[axis] + high[axis]) / size).to_bits();
            }
        }
        self.surroundings.write(self.gpu, &words);
    }

    /// One frame: what leaves the voxels, then what they gather of it.
    pub fn frame(&mut self, settings: Settings) {
        let words = [
            self.light_count,
            self.frame,
            settings.cones,
            settings.least_rate.to_bits(),
            settings.aperture.to_bits(),
            1e6_f32.to_bits(),
            4,
            settings.most_visits,
            0,
            WHOLE_TURN,
            0,
        ];
        self.lighting.write(self.gpu, &words);
        let groups = [self.pages, 1, 1];
        self.inject
            .run(self.gpu, &self.buffers(), groups)
            .expect("inject");
        self.gather
            .run(self.gpu, &self.buffers(), groups)
            .expect("gather");
        self.frame += 1;
    }

    /// Radiance that leaves each face.
    pub fn outgoing(&self) -> Vec<f64> {
        let words = self.radiance.read(self.gpu);
        let radiance = words.iter().map(|word| voxel_radiance_unpack(*word).x);
        radiance.map(f64::from).collect()
    }

    /// Mean irradiance over the area of the faces of one level.
    pub fn mean_irradiance(&self, voxels: &Voxels, level: usize) -> f64 {
        let words = self.irradiance.read(self.gpu);
        let (mut sum, mut area) = (0.0, 0.0);
        let faces = words.chunks_exact(STRIDE).flat_map(|record| &record[..6]);
        for (word, &(part, at)) in faces.zip(&voxels.areas) {
            if part > 0.0 && at == level {
                assert_ne!(*word, UNKNOWN, "a face that nothing was gathered for");
                sum += part * f64::from(voxel_radiance_unpack(*word).x);
                area += part;
            }
        }
        assert!(area > 0.0, "no faces");
        sum / area
    }

    /// Runs a kernel over points: position relative to the anchor, normal, cones, aperture; returns irradiance,
    /// openness and mean distance of each.
    pub fn probe(&self, points: &[[f32; 8]], frame: u32) -> Vec<[f32; 4]> {
        const SOURCE: &str = "
#import akari_voxel_gi::diffuse::gather_diffuse
@group(0) @binding(0) var<storage, read> points: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> results: array<vec4<f32>>;
@group(0) @binding(2) var<uniform> frame: vec4<u32>;
@compute @workgroup_size(64)
fn probe(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&results) { return; }
    let a = points[2u * id.x];
    let b = points[2u * id.x + 1u];
    let light = gather_diffuse(a.xyz, b.xyz, u32(a.w), b.w, 1e6, id.xy, frame.x);
    results[id.x] = vec4(light.irradiance.x, light.irradiance.y, light.open, light.distance);
}";
        let modules = modules();
        let definitions = definitions(self.plain, &["TRACE_RADIANCE"]);
        let source = ProgramSource {
            modules: &modules,
            source: SOURCE,
            definitions: &definitions,
        };
        let program =
            Program::new(self.gpu, &source, "probe").unwrap_or_else(|error| panic!("{error}"));
        let words: Vec<u32> = points.iter().flatten().map(|x| x.to_bits()).collect();
        let given = Words::new(self.gpu, &words);
        let results = Words::new(self.gpu, &vec![f32::NAN.to_bits(); 4 * points.len()]);
        let frame = Words::new(self.gpu, &[frame, 0, 0, 0]);
        let mut buffers = self.buffers();
        buffers.retain(|((group, _), _)| *group == 1);
        buffers.extend([((0, 0), &given), ((0, 1), &results), ((0, 2), &frame)]);
        let groups = (points.len() as u32).div_ceil(64);
        program
            .run(self.gpu, &buffers, [groups, 1, 1])
            .expect("probe");
        let words = results.read(self.gpu);
        words
            .chunks_exact(4)
            .map(|row| [0, 1, 2, 3].map(|i| f32::from_bits(row[i])))
            .collect()
    }
}
