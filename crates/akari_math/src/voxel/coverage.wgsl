#define_import_path akari_math::voxel::coverage

// Twin: `voxel/coverage.rs`. Change both or neither.

// A triangle has 3 vertices; each of the six planes adds at most one.
const MOST_CLIPPED: u32 = 9u;

// What of a triangle lies in the unit cube.
struct CoveredArea {
    // Its area times its unit normal.
    area: vec3<f32>,
    // Its centroid; undefined, but finite, where the area is 0.
    centroid: vec3<f32>,
}

// By how much `p` is inside of a plane: planes 0, 2, 4 are x, y, z = 0, planes 1, 3, 5 are x, y, z = 1.
fn inside_of_plane(p: vec3<f32>, plane: u32) -> f32 {
    let coordinate = p[plane >> 1u];
    return select(coordinate, 1.0 - coordinate, (plane & 1u) == 1u);
}

// Half-open: a point on the upper plane is outside, so that of two neighbours one owns it.
fn is_inside_of_plane(distance: f32, plane: u32) -> bool {
    return select(distance >= 0.0, distance > 0.0, (plane & 1u) == 1u);
}

// The part of triangle abc in the cube from 0 to 1.
fn triangle_in_cube(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> CoveredArea {
    var vertices: array<vec3<f32>, 9>;
    var clipped: array<vec3<f32>, 9>;
    vertices[0] = a;
    vertices[1] = b;
    vertices[2] = c;
    var count = 3u;
    for (var plane = 0u; plane < 6u; plane += 1u) {
        var kept = 0u;
        var previous = vertices[count - 1u];
        var previous_distance = inside_of_plane(previous, plane);
        var previous_inside = is_inside_of_plane(previous_distance, plane);
        for (var i = 0u; i < count; i += 1u) {
            let vertex = vertices[i];
            let distance = inside_of_plane(vertex, plane);
            let inside = is_inside_of_plane(distance, plane);
            if inside != previous_inside && kept < MOST_CLIPPED {
                // One is inside and the other is not: the two differ, and the difference is not 0.
                let t = previous_distance / (previous_distance - distance);
                clipped[kept] = previous + (vertex - previous) * t;
                kept += 1u;
            }
            if inside && kept < MOST_CLIPPED {
                clipped[kept] = vertex;
                kept += 1u;
            }
            previous = vertex;
            previous_distance = distance;
            previous_inside = inside;
        }
        if kept < 3u {
            return CoveredArea(vec3<f32>(0.0), vec3<f32>(0.5));
        }
        count = kept;
        vertices = clipped;
    }
    let first = vertices[0];
    var doubled = vec3<f32>(0.0);
    var weight = 0.0;
    var moment = vec3<f32>(0.0);
    for (var i = 2u; i < count; i += 1u) {
        let u = vertices[i - 1u] - first;
        let v = vertices[i] - first;
        let part = cross(u, v);
        let part_weight = sqrt(dot(part, part));
        doubled += part;
        weight += part_weight;
        moment += (u + v) * part_weight;
    }
    var centroid = first;
    if weight > 0.0 {
        centroid = first + moment * (1.0 / 3.0) / weight;
    }
    return CoveredArea(doubled * 0.5, centroid);
}
