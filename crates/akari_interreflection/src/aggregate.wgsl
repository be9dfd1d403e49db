// The light of diffuse clusters from that of their patches, the deepest first: a plane through it, and how far it is from
// that plane. One workgroup, so that a barrier is enough between levels.

#import akari_interreflection::types::{
    AGGREGATE_WORKGROUP, Cluster, ClusterLight, InterreflectionView, Triangle,
}
#import akari_math::special::TINY

@group(0) @binding(0) var<uniform> settings: InterreflectionView;
@group(0) @binding(1) var<storage, read> triangles: array<Triangle>;
@group(0) @binding(2) var<storage, read> patch_light: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> clusters: array<Cluster>;
// Where each level begins, one more than there are; then the clusters of all levels.
@group(0) @binding(4) var<storage, read> order: array<u32>;
@group(0) @binding(5) var<storage, read_write> cluster_lights: array<ClusterLight>;

fn largest(v: vec3<f32>) -> f32 {
    return max(max(v.x, v.y), v.z);
}

// Of a point, in halves of the rectangle.
fn place(cluster: Cluster, point: vec3<f32>) -> vec2<f32> {
    let offset = point - cluster.center;
    return vec2(
        dot(offset, cluster.axis_u) / max(dot(cluster.axis_u, cluster.axis_u), TINY),
        dot(offset, cluster.axis_v) / max(dot(cluster.axis_v, cluster.axis_v), TINY),
    );
}

fn at(light: ClusterLight, where_: vec2<f32>) -> vec3<f32> {
    return light.mean + where_.x * light.slope_u + where_.y * light.slope_v;
}

fn area_of(triangle: Triangle) -> f32 {
    return 0.5 * length(cross(triangle.b - triangle.a, triangle.c - triangle.a));
}

fn of_triangles(cluster: Cluster) -> ClusterLight {
    var light: ClusterLight;
    var area = 0.0;
    for (var i = cluster.first; i < cluster.first + cluster.count; i++) {
        let own = area_of(triangles[i]);
        for (var k = 0u; k < 3u; k++) {
            let corner = patch_light[3u * i + k].rgb;
            light.mean += own * corner / 3.0;
            light.brightest = max(light.brightest, largest(corner));
        }
        area += own;
    }
    light.mean /= max(area, TINY);
    // The integral of a product of linear functions over a triangle is a twelfth of its area times the sum over pairs of
    // corners, equal ones twice. That of the square of a coordinate is a third of the rectangle's.
    for (var i = cluster.first; i < cluster.first + cluster.count; i++) {
        let triangle = triangles[i];
        let a = place(cluster, triangle.a);
        let b = place(cluster, triangle.b);
        let c = place(cluster, triangle.c);
        let light_a = patch_light[3u * i].rgb - light.mean;
        let light_b = patch_light[3u * i + 1u].rgb - light.mean;
        let light_c = patch_light[3u * i + 2u].rgb - light.mean;
        let share = area_of(triangle) / (4.0 * max(area, TINY));
        let places = a + b + c;
        light.slope_u += share * (light_a * (a.x + places.x) + light_b * (b.x + places.x) + light_c * (c.x + places.x));
        light.slope_v += share * (light_a * (a.y + places.y) + light_b * (b.y + places.y) + light_c * (c.y + places.y));
    }
    for (var i = cluster.first; i < cluster.first + cluster.count; i++) {
        let triangle = triangles[i];
        let off = max(
            max(
                abs(at(light, place(cluster, triangle.a)) - patch_light[3u * i].rgb),
                abs(at(light, place(cluster, triangle.b)) - patch_light[3u * i + 1u].rgb),
            ),
            abs(at(light, place(cluster, triangle.c)) - patch_light[3u * i + 2u].rgb),
        );
        light.residual = max(light.residual, largest(off));
    }
    return light;
}

// How far the planes of a cluster and of one below it are apart within the latter, and its own residual.
fn residual_of(cluster: Cluster, light: ClusterLight, below: Cluster, light_below: ClusterLight) -> f32 {
    // The rectangle was shrunk to the area of the triangles; they are in the larger one.
    let grown = sqrt(1.0 + 0.5 * min(below.mismatch, 8.0));
    var most = 0.0;
    for (var k = 0u; k < 4u; k++) {
        let s = select(-grown, grown, (k & 1u) != 0u);
        let t = select(-grown, grown, (k & 2u) != 0u);
        let point = below.center + s * below.axis_u + t * below.axis_v;
        most = max(most, largest(abs(at(light, place(cluster, point)) - at(light_below, vec2(s, t)))));
    }
    return most + light_below.residual;
}

fn of_halves(cluster: Cluster, first: u32) -> ClusterLight {
    let one = clusters[first];
    let second = one.skip;
    let two = clusters[second];
    let light_one = cluster_lights[first];
    let light_two = cluster_lights[second];
    var light: ClusterLight;
    let area = max(one.area + two.area, TINY);
    light.mean = (one.area * light_one.mean + two.area * light_two.mean) / area;
    light.brightest = max(light_one.brightest, light_two.brightest);
    for (var k = 0u; k < 2u; k++) {
        var below = one;
        var of_below = light_one;
        if k == 1u {
            below = two;
            of_below = light_two;
        }
        let middle = place(cluster, below.center);
        let along_u = place(cluster, below.center + below.axis_u) - middle;
        let along_v = place(cluster, below.center + below.axis_v) - middle;
        let share = 3.0 * below.area / area;
        let off = of_below.mean - light.mean;
        light.slope_u += share * (off * middle.x + (of_below.slope_u * along_u.x + of_below.slope_v * along_v.x) / 3.0);
        light.slope_v += share * (off * middle.y + (of_below.slope_u * along_u.y + of_below.slope_v * along_v.y) / 3.0);
    }
    light.residual = max(residual_of(cluster, light, one, light_one), residual_of(cluster, light, two, light_two));
    return light;
}

@compute @workgroup_size(AGGREGATE_WORKGROUP)
fn aggregate(@builtin(local_invocation_index) lane: u32) {
    for (var level = 0u; level < settings.levels; level++) {
        let end = order[level + 1u];
        for (var i = order[level] + lane; i < end; i += AGGREGATE_WORKGROUP) {
            let index = order[settings.levels + 1u + i];
            let cluster = clusters[index];
            if cluster.count > 0u {
                cluster_lights[index] = of_triangles(cluster);
            } else {
                cluster_lights[index] = of_halves(cluster, index + 1u);
            }
        }
        storageBarrier();
    }
}
