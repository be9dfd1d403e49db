// Makes bricks of the tails from the level below: one workgroup a brick, one invocation a voxel of 2³ finer ones.
//
// Along the axis of each face, of two voxels in a row the front one hides its share of the one behind; of the four rows
// side by side the mean is taken (Crassin et al. 2011, "Interactive Indirect Illumination Using Voxel Cone Tracing",
// §4.2, with coverage and surface in place of radiance).

#import akari_math::voxel::brick::{mask_holds, mask_rank, record_index, voxel_index}
#import akari_math::voxel::mirror::{metal_of_face, metal_pack, metal_roughness, spread_roughness}
#import akari_math::voxel::packing::{
    VoxelSurface, coverage_of_face, coverage_pack, face_direction, voxel_radiance_pack, voxel_radiance_unpack,
    voxel_surface_pack, voxel_surface_unpack,
}
#import akari_voxel_gi::store::{
    VoxelRecord, bricks, clipmap, coverage, dirty_bricks, job, store_brick, surface,
}
#ifdef EMISSIVE
#import akari_voxel_gi::store::emission
#endif
#import akari_voxel_gi::types::{LAMPS_ELSEWHERE_BIT, slot_of_brick}

// As in `voxelize.wgsl`.
const LEAST_COVERAGE: f32 = 1.0 / 510.0;
const NO_RECORD: u32 = 0xffffffffu;

@compute @workgroup_size(64, 1, 1)
fn downsample(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let dirty = dirty_bricks[job.first + group.x];
    let level = clipmap.levels[dirty.level];
    let finer = clipmap.levels[level.finer];
    let voxel = vec3<u32>(lane & 3u, (lane >> 2u) & 3u, lane >> 4u);
    // All eight finer voxels lie in one brick.
    let finer_brick = 2 * dirty.brick + vec3<i32>(voxel >> vec3<u32>(1u));
    let from_origin = finer_brick - finer.origin;
    let held = all(from_origin >= vec3<i32>(0)) && all(from_origin < vec3<i32>(i32(finer.bricks)));
    var records: array<u32, 8>;
    var source = vec4<u32>(0u);
    if held {
        source = bricks[slot_of_brick(finer, finer_brick)];
    }
    for (var child = 0u; child < 8u; child += 1u) {
        let offset = vec3<u32>(child & 1u, (child >> 1u) & 1u, child >> 2u);
        let index = voxel_index(2u * (voxel & vec3<u32>(1u)) + offset);
        records[child] = NO_RECORD;
        if mask_holds(source.xy, index) {
            records[child] = record_index(source.zw, mask_rank(source.xy, index));
        }
    }
    var record: VoxelRecord;
    var areas: array<f32, 6>;
    var most = 0.0;
    var elsewhere_bits = 0u;
    var metal_faces = 0u;
    // Over all faces: metal, and its roughness and length of the mean normal weighted with that.
    var metal_area = 0.0;
    var roughness = 0.0;
    var mean_length = 0.0;
    for (var face = 0u; face < 6u; face += 1u) {
        let axis = face >> 1u;
        // Bit of the child number that tells the two of a row apart, and its value for the front one.
        let step = 1u << axis;
        let front_bit = select(step, 0u, (face & 1u) == 1u);
        var area = 0.0;
        var albedo = vec3<f32>(0.0);
        var normal = vec3<f32>(0.0);
        var place = vec3<f32>(0.0);
        var elsewhere = 0.0;
        var metal = 0.0;
#ifdef EMISSIVE
        var shine = vec3<f32>(0.0);
#endif
        for (var row = 0u; row < 8u; row += 1u) {
            if (row & step) != 0u {
                continue;
            }
            var seen = 1.0;
            for (var depth = 0u; depth < 2u; depth += 1u) {
                let bit = select(step - front_bit, front_bit, depth == 0u);
                let from_record = records[row | bit];
                if from_record == NO_RECORD {
                    continue;
                }
                let bits = coverage[from_record];
                let facing = coverage_of_face(bits, face);
                // Over the four rows: a quarter of the cross-section each.
                let weight = 0.25 * seen * facing;
                let part = voxel_surface_unpack(surface[6u * from_record + face], face);
                area += weight;
                elsewhere += weight * f32((bits.y >> (LAMPS_ELSEWHERE_BIT + face)) & 1u);
                if metal_of_face(bits.y, face) {
                    metal += weight;
                    metal_area += weight;
                    roughness += weight * metal_roughness(bits.y);
                }
                albedo += weight * part.albedo;
                normal += weight * part.normal;
                let child = row | bit;
                let corner = vec3<f32>(vec3<u32>(child & 1u, (child >> 1u) & 1u, child >> 2u));
                place += weight * 0.5 * (part.centroid + corner);
#ifdef EMISSIVE
                shine += weight * voxel_radiance_unpack(emission[6u * from_record + face]);
#endif
                seen *= 1.0 - max(facing, coverage_of_face(bits, face ^ 1u));
            }
        }
        let scale = 1.0 / max(area, 1e-20);
        let length = sqrt(dot(normal, normal));
        if 2.0 * metal > area {
            metal_faces |= 1u << face;
        }
        mean_length += metal * min(length * scale, 1.0);
        if length > 1e-12 {
            normal = normal / length;
        } else {
            normal = face_direction(face);
        }
        // As in voxelization: rounded to the nearest step, 0 too.
        areas[face] = select(area, 0.0, area < LEAST_COVERAGE);
        most = max(most, area);
        if 2.0 * elsewhere > area {
            elsewhere_bits |= 1u << (LAMPS_ELSEWHERE_BIT + face);
        }
        record.surface[face] = voxel_surface_pack(VoxelSurface(albedo * scale, place * scale, normal), face);
#ifdef EMISSIVE
        record.emission[face] = voxel_radiance_pack(shine * scale, vec3<f32>(0.5));
#endif
    }
    record.coverage = coverage_pack(
        vec3<f32>(areas[0], areas[2], areas[4]),
        vec3<f32>(areas[1], areas[3], areas[5]),
    );
    record.coverage.y |= elsewhere_bits;
    if metal_faces != 0u {
        let scale = 1.0 / max(metal_area, 1e-20);
        record.coverage.y |= metal_pack(metal_faces, spread_roughness(roughness * scale, mean_length * scale));
    }
    store_brick(lane, slot_of_brick(level, dirty.brick), most >= LEAST_COVERAGE, record);
}
