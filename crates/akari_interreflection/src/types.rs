//! What the GPU reads, field by field as in `types.wgsl`.

use bevy::math::{Vec3, Vec4};
use bevy::render::render_resource::ShaderType;

/// Invocations of a workgroup of the pass that lights patches, as in `irradiance.wgsl`.
pub const IRRADIANCE_WORKGROUP: u32 = 64;
/// Invocations of the one workgroup that sums up clusters, as in `aggregate.wgsl`.
pub const AGGREGATE_WORKGROUP: u32 = 256;
/// Material of a cluster of several.
pub const MIXED_MATERIAL: u32 = u32::MAX;
/// Bit of [`GpuTriangle::flags`]: its back reflects, too.
pub const FLAG_TWO_SIDED: u32 = 1;
/// Receivers that reflect diffusely alone.
pub const RECEIVERS_MATTE: u32 = 1;
/// Receivers with a specular lobe.
pub const RECEIVERS_GLOSSY: u32 = 2;
/// Bits of [`GpuBlockerNode::leaf`] that hold the number of triangles.
pub const BLOCKER_COUNT_BITS: u32 = 3;

/// A triangle of a reflector, or a patch of one.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuTriangle {
    /// Corners in the world, metres, counter-clockwise as seen from the front.
    pub a: Vec3,
    /// Index of its material.
    pub material: u32,
    /// Second corner.
    pub b: Vec3,
    /// Combination of `FLAG_…`.
    pub flags: u32,
    /// Third corner.
    pub c: Vec3,
    /// Render layers would go here; not used.
    pub pad: u32,
    /// Unit normal at each corner.
    pub normal_a: Vec3,
    /// Unit normal at the second corner.
    pub normal_b: Vec3,
    /// Unit normal at the third corner.
    pub normal_c: Vec3,
}

/// How a reflector reflects (`akari_math::area_light::SurfaceReflectance`).
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuReflectorMaterial {
    /// Albedo of the diffuse part before what the dielectric interface keeps from it.
    pub diffuse_color: Vec3,
    /// Perceptual roughness.
    pub perceptual_roughness: f32,
    /// Fresnel reflectance at normal incidence.
    pub normal_reflectance: Vec3,
    /// The same at grazing incidence.
    pub grazing_reflectance: f32,
    /// Of the dielectric alone, at normal and grazing incidence.
    pub dielectric_normal_reflectance: f32,
    /// See above.
    pub dielectric_grazing_reflectance: f32,
}

/// A cluster of triangles (`akari_math::cluster_tree::ClusterNode`).
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuCluster {
    /// Middle of its rectangle.
    pub center: Vec3,
    /// The cluster after all below this one.
    pub skip: u32,
    /// Half a side.
    pub axis_u: Vec3,
    /// First triangle.
    pub first: u32,
    /// Half of the other side.
    pub axis_v: Vec3,
    /// Triangles, if no cluster is below this one; else 0.
    pub count: u32,
    /// Unit mean normal.
    pub normal: Vec3,
    /// Material of all triangles, or [`MIXED_MATERIAL`].
    pub material: u32,
    /// Largest distance of a corner from the middle.
    pub radius: f32,
    /// See `akari_math::cluster`.
    pub turn: f32,
    /// See `akari_math::cluster`.
    pub deviation: f32,
    /// See `akari_math::cluster`.
    pub mismatch: f32,
    /// See `akari_math::cluster`.
    pub rim: f32,
    /// Of the triangles, m².
    pub area: f32,
    /// Flags of the triangles, or of any of them.
    pub flags: u32,
    /// See `akari_math::cluster`.
    pub stray: f32,
    /// Change of the normal over half a side.
    pub bend_u: Vec3,
    /// Change of the normal over half of the other side.
    pub bend_v: Vec3,
}

/// What the diffuse triangles of a cluster are lit by: irradiance over π, as a plane over the rectangle.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuClusterLight {
    /// In the middle.
    pub mean: Vec3,
    /// At the brightest corner.
    pub brightest: f32,
    /// Change over half a side.
    pub slope_u: Vec3,
    /// Largest difference from the plane.
    pub residual: f32,
    /// Change over half of the other side.
    pub slope_v: Vec3,
    /// Padding.
    pub pad: f32,
}

/// What the passes know beside Bevy's view uniform.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuInterreflectionView {
    /// Diffuse patches: the first entries of the triangles.
    pub patches: u32,
    /// Glossy triangles: the entries after those.
    pub glossy: u32,
    /// Lights.
    pub lights: u32,
    /// Lighting pass id of Bevy's standard deferred materials.
    pub lighting_pass_id: u32,
    /// Clusters of the patches: the first ones.
    pub patch_clusters: u32,
    /// All clusters.
    pub clusters: u32,
    /// Depths of the patches' clusters.
    pub levels: u32,
    /// Error that a cluster may have; 0 looks at every triangle.
    pub cut: f32,
    /// Rays that each contribution may send.
    pub shadow_rays: u32,
    /// Combination of `RECEIVERS_…`: the kinds whose pixels are told apart.
    pub receivers: u32,
    /// Least coordinates of all reflectors in the world.
    pub low: Vec3,
    /// Largest coordinates.
    pub high: Vec3,
}

/// The environment map that reflectors see, field by field as in `types.wgsl`.
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuReflectedSky {
    /// Quaternion that turns directions of the world into those of the map.
    pub to_map: Vec4,
    /// Nits per unit of the map.
    pub intensity: f32,
    /// Level of the map that is filtered for a roughness of 1.
    pub last_level: f32,
}

/// A box of the tree that rays walk (`akari_math::bounds_tree`).
#[derive(ShaderType, Debug, Clone, Copy, Default, PartialEq)]
pub struct GpuBlockerNode {
    /// Least coordinates in the world.
    pub low: Vec3,
    /// The node after all below this one.
    pub skip: u32,
    /// Largest coordinates.
    pub high: Vec3,
    /// First triangle and, in the lowest [`BLOCKER_COUNT_BITS`], how many; those are 0 where nodes are below this one.
    pub leaf: u32,
}
