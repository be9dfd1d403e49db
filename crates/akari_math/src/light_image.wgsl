#define_import_path akari_math::light_image

// Twin: `light_image.rs`. Change both or neither.

#import akari_math::special::{TINY, safe_normalize}
#import akari_math::frame::orthonormal_basis

// Width of a level's kernel in its own texels.
const KERNEL_TEXELS: f32 = 2.0;
// Interpolation between texels and levels widens a kernel: so much narrower ones are looked up.
const SHARPEN: f32 = 0.85;
// Cell size of a light that is not cut into cells.
const WHOLE_LIGHT: f32 = 1e9;
// Widest filter of a look-up, as a share of the cell that it stands for.
const CELL_FILTER: f32 = 0.35;
// Cosine between the axis of the lobe and the plane's normal, in cosine space, from which on the foot of the
// perpendicular counts, and from which on it alone.
const FOOT_FROM: f32 = 0.5;
const FOOT_TO: f32 = 0.9;
// Ratio of the axes of a footprint up to which one look-up stands for it.
const ROUND: f32 = 1.2;
// Half-axes beyond this many layers are cut, so that their fourth powers are finite. No layer has a level as wide.
const WIDEST: f32 = 1e8;
// A plane that a ray meets only after this many times its length is not met: it runs along the plane.
const FARTHEST: f32 = 1e20;

// Where a light's image is looked up, all in layer coordinates.
struct ImageFootprint {
    // Middle.
    center: vec2<f32>,
    // Half-axis of the line along which the look-ups lie; 0 for a single one.
    line: vec2<f32>,
    // Width of the filter of each look-up.
    width: f32,
    // 1 if the look-ups spread along `line`.
    spread: u32,
}

fn light_image_footprint(
    axis: vec3<f32>,
    m: mat3x3<f32>,
    m_inv: mat3x3<f32>,
    center: vec3<f32>,
    normal: vec3<f32>,
    texture_u: vec4<f32>,
    texture_v: vec4<f32>,
    cell_size: f32,
) -> ImageFootprint {
    let middle = vec2<f32>(texture_u.w, texture_v.w);
    let height = dot(normal, center);
    // Cofactors take area vectors to the cosine space.
    let lobe_normal = safe_normalize(
        normal.x * cross(m_inv[1], m_inv[2])
            + normal.y * cross(m_inv[2], m_inv[0])
            + normal.z * cross(m_inv[0], m_inv[1]),
        vec3<f32>(0.0, 0.0, 1.0),
    );
    let mean = plane_point(m * axis, center, normal, height);
    // The perpendicular from the origin, as far as the plane: with its sign, since it may point away from the plane.
    let perpendicular = m * lobe_normal;
    let slope = dot(normal, perpendicular);
    let meets = abs(height) < abs(slope) * FARTHEST;
    let scale = select(0.0, height / select(1.0, slope, meets), meets);
    let foot = select(center, perpendicular * scale, meets);
    // What a cosine sees of a plane across its axis is centred on the foot of the perpendicular.
    // A cell sees its own part of that kernel only, whose middle is where the mean direction points.
    let by_foot = select(0.0, smoothstep(FOOT_FROM, FOOT_TO, abs(lobe_normal.z)), cell_size == WHOLE_LIGHT);
    let point = mix(mean, foot, by_foot);
    let offset = point - center;
    let at = middle + vec2<f32>(dot(texture_u.xyz, offset), dot(texture_v.xyz, offset));

    // The map from the plane in cosine space to the layer is affine: its image of a circle is the footprint.
    // The circle lies as far from the origin as the plane does, so its radius needs no look at m_inv.
    let basis = orthonormal_basis(lobe_normal);
    let p = m * basis[0] * scale;
    let q = m * basis[1] * scale;
    let widest = vec2<f32>(WIDEST);
    let a = clamp(vec2<f32>(dot(texture_u.xyz, p), dot(texture_v.xyz, p)), -widest, widest);
    let b = clamp(vec2<f32>(dot(texture_u.xyz, q), dot(texture_v.xyz, q)), -widest, widest);
    // Eigenvalues of a aT + b bT: the squared half-axes.
    let xx = a.x * a.x + b.x * b.x;
    let yy = a.y * a.y + b.y * b.y;
    let xy = a.x * a.y + b.x * b.y;
    let mid = 0.5 * (xx + yy);
    let radius = sqrt(0.25 * (xx - yy) * (xx - yy) + xy * xy);
    let major_squared = mid + radius;
    let minor_squared = max(mid - radius, 0.0);
    let limit = CELL_FILTER * cell_size;
    var footprint: ImageFootprint;
    footprint.center = clamp(at, vec2<f32>(0.0), vec2<f32>(1.0));
    footprint.line = vec2<f32>(0.0);
    footprint.spread = 0u;
    if major_squared <= ROUND * ROUND * minor_squared || major_squared >= limit * limit {
        footprint.width = min(sqrt(sqrt(major_squared * minor_squared)), limit);
        return footprint;
    }
    var direction = vec2<f32>(major_squared - yy, xy);
    if xx < yy {
        direction = vec2<f32>(xy, major_squared - xx);
    }
    footprint.line = direction * (sqrt(2.0 * radius) / max(length(direction), TINY));
    footprint.width = sqrt(minor_squared);
    footprint.spread = 1u;
    return footprint;
}

// Where a ray from the origin meets the light's plane; its centre if it does not.
fn plane_point(ray: vec3<f32>, center: vec3<f32>, normal: vec3<f32>, height: f32) -> vec3<f32> {
    let slope = dot(normal, ray);
    if abs(height) < abs(slope) * FARTHEST && slope * height > 0.0 {
        return ray * (height / slope);
    }
    return center;
}

// Position of look-up `index` of `count` along the line of a footprint, in half-axes.
fn footprint_position(index: f32, count: f32) -> f32 {
    let y = (2.0 * index + 1.0) / count - 1.0;
    return y / sqrt(max(1.0 - y * y, TINY));
}

// Mip level for a filter of `width`: level l is filtered with KERNEL_TEXELS of its texels, level 0 not at all.
fn light_image_lod(width: f32, texels: f32) -> f32 {
    let filter_texels = SHARPEN * width * texels / KERNEL_TEXELS;
    return select(log2(max(filter_texels, 2.0)), 0.5 * filter_texels, filter_texels < 2.0);
}
