#define_import_path akari_interreflection::bindings

// What the shading pass reads.

#import bevy_render::view::View
#import akari_interreflection::types::{Cluster, ClusterLight, InterreflectionView, ReflectorMaterial, Triangle}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> settings: InterreflectionView;
@group(0) @binding(2) var depth_texture: texture_depth_2d;
@group(0) @binding(3) var gbuffer_texture: texture_2d<u32>;
@group(0) @binding(4) var pass_id_texture: texture_2d<u32>;
@group(0) @binding(5) var<storage, read> triangles: array<Triangle>;
@group(0) @binding(6) var<storage, read> lights: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read> patch_light: array<vec4<f32>>;
@group(0) @binding(8) var<storage, read> materials: array<ReflectorMaterial>;
@group(0) @binding(9) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(10) var<storage, read> cluster_lights: array<ClusterLight>;
@group(0) @binding(11) var ltc_table: texture_2d_array<f32>;
@group(0) @binding(12) var table_sampler: sampler;
