// Makes bricks of the cascades from triangles: one workgroup a brick, one invocation a voxel.
//
// The workgroup finds the instances, then their clusters, then the triangles that reach the brick, 64 at a time, and
// each invocation adds the exact area of each triangle in its voxel. What is found is worked on in the order of memory,
// so that a brick that is made again comes out the same, bit by bit.

#import akari_math::voxel::coverage::triangle_in_cube
#import akari_math::voxel::mirror::{metal_pack, spread_roughness}
#import akari_math::voxel::packing::{
    VoxelSurface, coverage_pack, unorm_unpack, voxel_radiance_pack, voxel_radiance_unpack, voxel_surface_pack,
}
#import akari_voxel_gi::store::{VoxelRecord, clipmap, dirty_bricks, job, pool, store_brick}
#import akari_voxel_gi::types::{
    COUNTER_CLIPPED, INSTANCE_LAMPS_ELSEWHERE, INSTANCE_METAL, INSTANCE_MIRRORED, INSTANCE_ROUGHNESS_BIT,
    INSTANCE_TWO_SIDED, INWARD_SHIFT, LAMPS_ELSEWHERE_BIT, ONE_SURFACE, VoxelCluster, VoxelInstance, slot_of_brick,
}

@group(1) @binding(0) var<storage, read> instances: array<VoxelInstance>;
@group(1) @binding(1) var<storage, read> clusters: array<VoxelCluster>;
@group(1) @binding(2) var<storage, read> triangles: array<f32>;
@group(1) @binding(3) var<storage, read> surfaces: array<vec2<u32>>;

// Half of the smallest step of an unorm8: a voxel with less on every face is not worth a record.
const LEAST_COVERAGE: f32 = 1.0 / 510.0;
// Slack of the tests that rule out, in voxels: more than the inward shift and the rounding together.
const SLACK: f32 = 0.01;

var<workgroup> votes: array<atomic<u32>, 2>;
var<workgroup> voted: vec2<u32>;
// Triangles in voxels from the brick's low corner.
var<workgroup> corner_a: array<vec3<f32>, 64>;
var<workgroup> corner_b: array<vec3<f32>, 64>;
var<workgroup> corner_c: array<vec3<f32>, 64>;
var<workgroup> triangle_surface: array<vec2<u32>, 64>;
// Perceptual roughness of metal; NO_METAL of what is none.
var<workgroup> triangle_metal: array<f32, 64>;
const NO_METAL: f32 = -1.0;

// For which of the invocations `yes` holds, as 64 bits.
fn vote(lane: u32, yes: bool) -> vec2<u32> {
    if lane == 0u {
        atomicStore(&votes[0], 0u);
        atomicStore(&votes[1], 0u);
    }
    workgroupBarrier();
    if yes {
        atomicOr(&votes[lane >> 5u], 1u << (lane & 31u));
    }
    workgroupBarrier();
    if lane == 0u {
        voted = vec2<u32>(atomicLoad(&votes[0]), atomicLoad(&votes[1]));
    }
    return workgroupUniformLoad(&voted);
}

// The lowest of 64 bits, of which one at least is set.
fn lowest(bits: vec2<u32>) -> u32 {
    if bits.x != 0u {
        return firstTrailingBit(bits.x);
    }
    return 32u + firstTrailingBit(bits.y);
}

fn without_lowest(bits: vec2<u32>) -> vec2<u32> {
    if bits.x != 0u {
        return vec2<u32>(bits.x & (bits.x - 1u), bits.y);
    }
    return vec2<u32>(0u, bits.y & (bits.y - 1u));
}

fn reaches_brick(low: vec3<f32>, high: vec3<f32>) -> bool {
    return all(low < vec3<f32>(4.0 + SLACK)) && all(high > vec3<f32>(-SLACK));
}

// What the triangles of a voxel add up to, by face.
struct Sums {
    area: array<f32, 6>,
    albedo: array<vec3<f32>, 6>,
    normal: array<vec3<f32>, 6>,
    place: array<vec3<f32>, 6>,
    // What reflects lamps elsewhere, of the area.
    elsewhere: array<f32, 6>,
    // What is metal, of the area.
    metal: array<f32, 6>,
    // Over all faces: metal, and its perceptual roughness weighted with that.
    metal_area: f32,
    roughness: f32,
#ifdef EMISSIVE
    emission: array<vec3<f32>, 6>,
#endif
}

var<private> sums: Sums;

fn add_to_face(face: u32, weight: f32, albedo: vec3<f32>, normal: vec3<f32>, place: vec3<f32>, elsewhere: f32, metal: f32, shine: vec3<f32>) {
    sums.area[face] += weight;
    sums.albedo[face] += weight * albedo;
    sums.normal[face] += weight * normal;
    sums.place[face] += weight * place;
    sums.elsewhere[face] += weight * elsewhere;
    if metal != NO_METAL {
        sums.metal[face] += weight;
        sums.metal_area += weight;
        sums.roughness += weight * metal;
    }
#ifdef EMISSIVE
    sums.emission[face] += weight * shine;
#endif
}

// Adds triangle `index` of the workgroup to the voxel whose low corner is `voxel`.
fn add_triangle(index: u32, voxel: vec3<f32>) {
    let a = corner_a[index] - voxel;
    let b = corner_b[index] - voxel;
    let c = corner_c[index] - voxel;
    if any(max(max(a, b), c) < vec3<f32>(0.0)) || any(min(min(a, b), c) > vec3<f32>(1.0)) {
        return;
    }
    let normal = cross(b - a, c - a);
    let extent = 0.5 * (abs(normal.x) + abs(normal.y) + abs(normal.z));
    if abs(dot(normal, vec3<f32>(0.5) - a)) > extent * (1.0 + SLACK) {
        return;
    }
    let covered = triangle_in_cube(a, b, c);
    let length = sqrt(dot(covered.area, covered.area));
    if length <= 0.0 {
        return;
    }
    let unit = covered.area / length;
    let packed = triangle_surface[index];
    let albedo = vec3<f32>(unorm_unpack(packed.x), unorm_unpack(packed.x >> 8u), unorm_unpack(packed.x >> 16u));
    // The top byte is the coverage; its low bits, which coverage does not need, say that both sides reflect, and that what
    // lamps send is reflected elsewhere.
    let there = f32(packed.x >> 26u) / 63.0;
    let two_sided = (packed.x & 0x1000000u) != 0u;
    let elsewhere = select(0.0, 1.0, (packed.x & 0x2000000u) != 0u);
#ifdef EMISSIVE
    let shine = voxel_radiance_unpack(packed.y);
#else
    let shine = vec3<f32>(0.0);
#endif
    let metal = triangle_metal[index];
    let place = clamp(covered.centroid, vec3<f32>(0.0), vec3<f32>(1.0));
    for (var axis = 0u; axis < 3u; axis += 1u) {
        let weight = abs(covered.area[axis]) * there;
        let face = 2u * axis + select(0u, 1u, covered.area[axis] < 0.0);
        add_to_face(face, weight, albedo, unit, place, elsewhere, metal, shine);
        if two_sided {
            add_to_face(face ^ 1u, weight, albedo, -unit, place, elsewhere, metal, shine);
        }
    }
}

// Loads a triangle of an instance for the workgroup. Whether it reaches the brick.
fn load_triangle(lane: u32, instance: VoxelInstance, index: u32, corner: vec3<f32>, voxel_size: f32) -> bool {
    let base = 9u * index;
    let turn = mat3x3<f32>(instance.x_axis, instance.y_axis, instance.z_axis);
    let place = instance.offset + corner;
    let to_voxels = 1.0 / voxel_size;
    var a = (turn * vec3(triangles[base], triangles[base + 1u], triangles[base + 2u]) + place) * to_voxels;
    var b = (turn * vec3(triangles[base + 3u], triangles[base + 4u], triangles[base + 5u]) + place) * to_voxels;
    var c = (turn * vec3(triangles[base + 6u], triangles[base + 7u], triangles[base + 8u]) + place) * to_voxels;
    if (instance.flags & INSTANCE_MIRRORED) != 0u {
        let swapped = b;
        b = c;
        c = swapped;
    }
    let normal = cross(b - a, c - a);
    let length = sqrt(dot(normal, normal));
    if length <= 0.0 {
        return false;
    }
    let inward = normal * (-INWARD_SHIFT / length);
    a += inward;
    b += inward;
    c += inward;
    if !reaches_brick(min(min(a, b), c), max(max(a, b), c)) {
        return false;
    }
    let extent = 2.0 * (abs(normal.x) + abs(normal.y) + abs(normal.z));
    if abs(dot(normal, vec3<f32>(2.0) - a)) > extent * (1.0 + SLACK) {
        return false;
    }
    var packed = vec2<u32>(instance.albedo, instance.emission);
    if instance.first_surface != ONE_SURFACE {
        packed = surfaces[instance.first_surface + index - instance.first_triangle];
    }
    packed.x &= ~0x3000000u;
    if (instance.flags & INSTANCE_LAMPS_ELSEWHERE) != 0u {
        packed.x |= 0x2000000u;
    }
    if (instance.flags & INSTANCE_TWO_SIDED) != 0u {
        packed.x |= 0x1000000u;
    }
    corner_a[lane] = a;
    corner_b[lane] = b;
    corner_c[lane] = c;
    triangle_surface[lane] = packed;
    triangle_metal[lane] = NO_METAL;
    if (instance.flags & INSTANCE_METAL) != 0u {
        triangle_metal[lane] = unorm_unpack(instance.flags >> INSTANCE_ROUGHNESS_BIT);
    }
    return (packed.x >> 25u) != 0u;
}

// Whether the bounds of a cluster, turned and moved with its instance, reach the brick.
fn cluster_reaches(cluster: VoxelCluster, instance: VoxelInstance, corner: vec3<f32>, voxel_size: f32) -> bool {
    let turn = mat3x3<f32>(instance.x_axis, instance.y_axis, instance.z_axis);
    let half = 0.5 * (cluster.high - cluster.low);
    let middle = turn * (0.5 * (cluster.low + cluster.high)) + instance.offset + corner;
    let extent = abs(instance.x_axis) * half.x + abs(instance.y_axis) * half.y + abs(instance.z_axis) * half.z;
    return reaches_brick((middle - extent) / voxel_size, (middle + extent) / voxel_size);
}

// Low corner of an instance's cell from the brick's low corner, metres. Cells are bricks of the coarsest cascade: the
// difference is one of whole numbers, exact however far both are from the world's origin.
fn cell_corner(instance: VoxelInstance, brick: vec3<i32>, coarser: u32, voxel_size: f32) -> vec3<f32> {
    let difference = (instance.cell << vec3<u32>(coarser)) - brick;
    return vec3<f32>(difference) * (4.0 * voxel_size);
}

@compute @workgroup_size(64, 1, 1)
fn voxelize(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let dirty = dirty_bricks[job.first + group.x];
    let level = clipmap.levels[dirty.level];
    let voxel_size = level.voxel_size;
    let coarser = clipmap.cascades - 1u - dirty.level;
    let voxel = vec3<f32>(vec3<u32>(lane & 3u, (lane >> 2u) & 3u, lane >> 4u));
    var clipped = 0u;
    for (var first_instance = 0u; first_instance < job.instances; first_instance += 64u) {
        var reaches = false;
        if first_instance + lane < job.instances {
            let candidate = instances[first_instance + lane];
            let corner = cell_corner(candidate, dirty.brick, coarser, voxel_size);
            reaches = reaches_brick((candidate.low + corner) / voxel_size, (candidate.high + corner) / voxel_size);
        }
        var instance_bits = vote(lane, reaches);
        while any(instance_bits != vec2<u32>(0u)) {
            let instance = instances[first_instance + lowest(instance_bits)];
            instance_bits = without_lowest(instance_bits);
            let corner = cell_corner(instance, dirty.brick, coarser, voxel_size);
            for (var first_cluster = 0u; first_cluster < instance.clusters; first_cluster += 64u) {
                var cluster_hit = false;
                if first_cluster + lane < instance.clusters {
                    let candidate = clusters[instance.first_cluster + first_cluster + lane];
                    cluster_hit = cluster_reaches(candidate, instance, corner, voxel_size);
                }
                var cluster_bits = vote(lane, cluster_hit);
                while any(cluster_bits != vec2<u32>(0u)) {
                    let cluster = clusters[instance.first_cluster + first_cluster + lowest(cluster_bits)];
                    cluster_bits = without_lowest(cluster_bits);
                    var triangle_hit = false;
                    if lane < cluster.triangles {
                        let index = instance.first_triangle + cluster.first_triangle + lane;
                        triangle_hit = load_triangle(lane, instance, index, corner, voxel_size);
                    }
                    // The vote is a barrier: all triangles are loaded, and nobody overwrites one before the next vote.
                    var triangle_bits = vote(lane, triangle_hit);
                    clipped += countOneBits(triangle_bits.x) + countOneBits(triangle_bits.y);
                    while any(triangle_bits != vec2<u32>(0u)) {
                        add_triangle(lowest(triangle_bits), voxel);
                        triangle_bits = without_lowest(triangle_bits);
                    }
                    workgroupBarrier();
                }
            }
        }
    }
    if lane == 0u {
        atomicAdd(&pool[COUNTER_CLIPPED], i32(clipped));
    }
    var record: VoxelRecord;
    var most = 0.0;
    var metal_faces = 0u;
    // Of the normals of metal, over all faces.
    var mean_length = 0.0;
    for (var face = 0u; face < 6u; face += 1u) {
        let area = sums.area[face];
        most = max(most, area);
        // Rounded to the nearest step, 0 too: packing would round what is above 0 up, which adds up.
        sums.area[face] = select(area, 0.0, area < LEAST_COVERAGE);
        let scale = 1.0 / max(area, 1e-20);
        let axis = face >> 1u;
        var normal = sums.normal[face];
        let length = sqrt(dot(normal, normal));
        if 2.0 * sums.metal[face] > area {
            metal_faces |= 1u << face;
        }
        mean_length += sums.metal[face] * min(length * scale, 1.0);
        if length > 1e-12 {
            normal = normal / length;
        } else {
            normal = vec3<f32>(0.0);
            normal[axis] = select(1.0, -1.0, (face & 1u) == 1u);
        }
        record.surface[face] = voxel_surface_pack(
            VoxelSurface(sums.albedo[face] * scale, sums.place[face] * scale, normal),
            face,
        );
#ifdef EMISSIVE
        record.emission[face] = voxel_radiance_pack(sums.emission[face] * scale, vec3<f32>(0.5));
#endif
    }
    record.coverage = coverage_pack(
        vec3<f32>(sums.area[0], sums.area[2], sums.area[4]),
        vec3<f32>(sums.area[1], sums.area[3], sums.area[5]),
    );
    for (var face = 0u; face < 6u; face += 1u) {
        if 2.0 * sums.elsewhere[face] > sums.area[face] {
            record.coverage.y |= 1u << (LAMPS_ELSEWHERE_BIT + face);
        }
    }
    if metal_faces != 0u {
        let metal = 1.0 / max(sums.metal_area, 1e-20);
        record.coverage.y |= metal_pack(metal_faces, spread_roughness(sums.roughness * metal, mean_length * metal));
    }
    store_brick(lane, slot_of_brick(level, dirty.brick), most >= LEAST_COVERAGE, record);
}
