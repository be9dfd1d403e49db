#define_import_path akari_visibility::face

// Twin: `face.rs`, where the conventions and the error bounds are. Change both or neither.

const FACES: u32 = 6u;
// Steps per unit of a packed line's coordinate along the border of the face.
const LINE_STEPS_PER_UNIT: u32 = 4096u;
const LINE_STEP_BITS: u32 = 15u;
const LINE_STEP_MASK: u32 = 0x7fffu;
// Steps along one side.
const SIDE_STEPS: u32 = 8192u;
const SIDE_STEP_BITS: u32 = 13u;
const SQRT_HALF: f32 = 0.70710678;

// A point of a face.
struct FacePoint {
    at: vec2<f32>,
    face: u32,
}

// Axes of the cube in the world, times 49.
const CUBE_X: vec3<f32> = vec3<f32>(-15.0, 40.0, 24.0);
const CUBE_Y: vec3<f32> = vec3<f32>(-40.0, -24.0, 15.0);
const CUBE_Z: vec3<f32> = vec3<f32>(24.0, -15.0, 40.0);
const CUBE_SCALE: f32 = 1.0 / 49.0;

// A vector along the axes of the world, along those of the cube.
fn cube_from_world(v: vec3<f32>) -> vec3<f32> {
    return CUBE_SCALE * vec3<f32>(dot(v, CUBE_X), dot(v, CUBE_Y), dot(v, CUBE_Z));
}

// The inverse of `cube_from_world`.
fn world_from_cube(v: vec3<f32>) -> vec3<f32> {
    return CUBE_SCALE * (v.x * CUBE_X + v.y * CUBE_Y + v.z * CUBE_Z);
}

// A vector of the cube from its parts along r, u and the positive axis of the face.
fn face_permute(face: u32, v: vec3<f32>) -> vec3<f32> {
    let axis = face >> 1u;
    if axis == 0u {
        return v.zxy;
    }
    if axis == 1u {
        return v.yzx;
    }
    return v;
}

// 1 for the faces along a positive axis, -1 for the others.
fn face_sign(face: u32) -> f32 {
    return select(1.0, -1.0, (face & 1u) == 1u);
}

// Direction, not normalised, in which the point `at` of a face lies.
fn face_direction(face: u32, at: vec2<f32>) -> vec3<f32> {
    return face_permute(face, vec3<f32>(at, face_sign(face)));
}

// Face in whose frustum `direction` is, and where on the face it points.
fn face_of(direction: vec3<f32>) -> FacePoint {
    let size = abs(direction);
    var axis = 2u;
    if size.y >= size.z {
        axis = 1u;
    }
    if size.x >= size.y && size.x >= size.z {
        axis = 0u;
    }
    // Undoes `face_permute`: the permutation of the other cyclic sense.
    var local = direction;
    if axis == 0u {
        local = direction.yzx;
    } else if axis == 1u {
        local = direction.zxy;
    }
    if local.z == 0.0 {
        return FacePoint(vec2<f32>(0.0), 0u);
    }
    return FacePoint(local.xy / abs(local.z), 2u * axis + select(0u, 1u, local.z < 0.0));
}

// Unit normal, pointing inwards, of the plane through the sample point and a side of a face.
fn face_side(face: u32, side: u32) -> vec3<f32> {
    let outwards = select(-SQRT_HALF, SQRT_HALF, (side & 1u) == 1u);
    let depth = face_sign(face) * SQRT_HALF;
    if side < 2u {
        return face_permute(face, vec3<f32>(outwards, 0.0, depth));
    }
    return face_permute(face, vec3<f32>(0.0, outwards, depth));
}

// A vector that is nearly in the plane of a side, put exactly there.
fn face_onto_side(face: u32, side: u32, v: vec3<f32>) -> vec3<f32> {
    let forward = face_permute(face, vec3<f32>(0.0, 0.0, 1.0));
    let lateral = face_permute(face, select(vec3<f32>(0.0, 1.0, 0.0), vec3<f32>(1.0, 0.0, 0.0), side < 2u));
    let depth = face_sign(face) * dot(v, forward);
    let across = select(depth, -depth, (side & 1u) == 1u);
    if abs(dot(v, lateral) - across) > 0.25 * abs(depth) {
        return select(v, vec3<f32>(0.0), (forward + lateral) > vec3<f32>(0.5));
    }
    return select(v, vec3<f32>(across), lateral > vec3<f32>(0.5));
}

// Point of the border of a face, counter-clockwise from (-1, -1).
fn border_point(steps: u32) -> vec2<f32> {
    let side = (steps >> SIDE_STEP_BITS) & 3u;
    let t = f32(steps & (SIDE_STEPS - 1u)) / f32(LINE_STEPS_PER_UNIT) - 1.0;
    // The third and the fourth side lie opposite of the first and the second.
    let sign = 1.0 - f32(side & 2u);
    return select(vec2<f32>(sign, sign * t), vec2<f32>(sign * t, -sign), (side & 1u) == 0u);
}

// Coefficients (a, b, c) of a packed line, not normalised.
fn unpack_line(bits: u32) -> vec3<f32> {
    let p = border_point(bits & LINE_STEP_MASK);
    let q = border_point((bits >> LINE_STEP_BITS) & LINE_STEP_MASK);
    return vec3<f32>(p.y - q.y, q.x - p.x, p.x * q.y - q.x * p.y);
}

// a x + b y + c at a point of the face: positive on the positive side of a packed line.
fn line_height(bits: u32, at: vec2<f32>) -> f32 {
    let line = unpack_line(bits);
    return line.x * at.x + line.y * at.y + line.z;
}

// Normal of the plane through the sample point and a packed line of a face, towards the line's positive side.
fn line_normal(face: u32, bits: u32) -> vec3<f32> {
    let line = unpack_line(bits);
    return face_permute(face, vec3<f32>(line.xy, face_sign(face) * line.z));
}
