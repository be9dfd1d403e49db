#define_import_path akari_voxel_gi::diffuse

// Light that a surface gathers over its hemisphere, by a set of cones of equal weight.

#import akari_math::frame::orthonormal_basis
#import akari_math::random::{random_hash, random_sequence}
#import akari_math::voxel::cone::{cone_cell, cone_cell_direction, cone_cell_tangent}
#import akari_voxel_gi::sky::trace_light
#import akari_voxel_gi::trace::VoxelRay

struct DiffuseLight {
    // Irradiance, nits times sr.
    irradiance: vec3<f32>,
    // Part of the hemisphere, cosine weighted, that is open.
    open: f32,
    // Mean distance of what was met, metres.
    distance: f32,
}

const PI: f32 = 3.1415927;
// The set whose cells are the smallest.
const FINEST_SET: u32 = 16u;
// Width at which a cone sees the sky over that of a cell of that set. One sun may be most of the sky: what is narrower than
// some degrees would be met by one cone in thousands; what is wide brings light around corners (with 1, 9 % too much in a
// room that a window of the sky stands beside).
const SKY_APERTURE: f32 = 0.3;

// `id` tells the surface point from others, `frame` the same point's directions in time; `aperture` is the width of
// the cones over that of a cell of the finest set; their directions are drawn from cells that tile the hemisphere.
fn gather_diffuse(
    origin: vec3<f32>, normal: vec3<f32>, cones: u32, aperture: f32, reach: f32, id: vec2<u32>, frame: u32,
) -> DiffuseLight {
    let basis = orthonormal_basis(normal);
    // Directions are drawn from the whole of their cells, which is all the width that an integral needs: cones of a set
    // of few would otherwise end in voxels as large as rooms, a fifth too bright in a Cornell box.
    let cell_tangent = cone_cell_tangent(cone_cell(FINEST_SET, 0u));
    let tangent = aperture * cell_tangent;
    var light = DiffuseLight(vec3(0.0), 0.0, 0.0);
    var met = 0.0;
    for (var i = 0u; i < cones; i++) {
        let cell = cone_cell(cones, i);
        let shift = random_hash(vec3(id, i));
        let direction = basis * cone_cell_direction(cell, random_sequence(frame, shift.x, shift.y));
        let ray = VoxelRay(origin, direction, normal, tangent, reach, shift.z ^ (frame * 0x9e3779b9u));
        let traced = trace_light(ray, SKY_APERTURE * cell_tangent);
        light.irradiance += traced.radiance;
        light.open += traced.transmittance;
        light.distance += (1.0 - traced.transmittance) * traced.distance;
        met += 1.0 - traced.transmittance;
    }
    light.irradiance *= PI / f32(cones);
    light.open /= f32(cones);
    light.distance /= max(met, 1e-6);
    return light;
}
