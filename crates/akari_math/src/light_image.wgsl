#define_import_path akari_math::light_image

// Twin: `light_image.rs`. Change both or neither.

#import akari_math::special::TINY

// Widest filter of a look-up, as a share of the cell that it stands for.
const CELL_FILTER: f32 = 0.35;

// Where a light's image is looked up, and how wide: (u, v, width), all in layer coordinates.
fn light_image_lookup(
    axis: vec3<f32>,
    m: mat3x3<f32>,
    m_inv: mat3x3<f32>,
    center: vec3<f32>,
    normal: vec3<f32>,
    texture_u: vec4<f32>,
    texture_v: vec4<f32>,
    layer_area: f32,
) -> vec3<f32> {
    let ray = m * axis;
    let height = dot(normal, center);
    let slope = dot(normal, ray);
    // The ray meets the plane in front of it only if both have one sign; else the centre stands for the light.
    var point = center;
    if slope * height > 0.0 && abs(height) < abs(slope) / TINY {
        point = ray * (height / slope);
    }
    let offset = point - center;
    let u = clamp(dot(texture_u.xyz, offset) + texture_u.w, 0.0, 1.0);
    let v = clamp(dot(texture_v.xyz, offset) + texture_v.w, 0.0, 1.0);
    // Cofactors take area vectors to the cosine space.
    let scaled_normal = normal.x * cross(m_inv[1], m_inv[2])
        + normal.y * cross(m_inv[2], m_inv[0])
        + normal.z * cross(m_inv[0], m_inv[1]);
    let area_scale = length(scaled_normal);
    let distance = abs(dot(scaled_normal, m_inv * point)) / max(area_scale, TINY);
    let width = distance / sqrt(max(layer_area * area_scale, TINY));
    return vec3<f32>(u, v, width);
}

// Mip level of a layer whose level l is filtered with a width of 2^l texels of level 0, and level 0 not at all.
fn light_image_lod(width: f32, cell_size: f32, texels: f32) -> f32 {
    let filter_texels = min(width, CELL_FILTER * cell_size) * texels;
    return select(log2(max(filter_texels, 2.0)), 0.5 * filter_texels, filter_texels < 2.0);
}
