// Filters the image of a light, one step a dispatch:
//   RESAMPLE    the part of the image that the light shows -> level 0 of the coverage-weighted image
//   DOWNSAMPLE  one level of it -> the next, by 2x2 means
//   CONVOLVE    a level of it -> a level of the layer that the shading pass reads
// The coverage-weighted image holds colour times coverage in rgb and the coverage of the light's polygon in alpha, so
// that nothing from outside of the light leaks in, and a filter over the rim is a mean over the inside.

struct Params {
    // The part of the image that the layer shows, margin included: smallest image coordinates, and size.
    region_low: vec2<f32>,
    region_size: vec2<f32>,
    // Corners of the light's polygon.
    corner_count: u32,
    // RESAMPLE: samples a texel and axis. CONVOLVE: reach of the kernel in texels of the source.
    samples: i32,
    // CONVOLVE: width of the kernel in texels of the source; 0 copies.
    width: f32,
    pad: f32,
}

@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var source_sampler: sampler;
@group(0) @binding(2) var<uniform> params: Params;
// Corners in layer coordinates, xy.
@group(0) @binding(3) var<storage, read> corners: array<vec4<f32>>;
@group(0) @binding(4) var result: texture_storage_2d<rgba16float, write>;
// CONVOLVE: the level above the one written, filtered already; it fills what no kernel of this level reaches.
@group(0) @binding(5) var coarser: texture_2d<f32>;

// Coverage below which a mean is not worth its rounding.
const SMALLEST_COVERAGE: f32 = 1e-3;

// Even-odd rule.
fn inside_polygon(point: vec2<f32>) -> bool {
    var inside = false;
    var a = corners[params.corner_count - 1u].xy;
    for (var i = 0u; i < params.corner_count; i++) {
        let b = corners[i].xy;
        if (a.y > point.y) != (b.y > point.y) {
            // The two ends differ in y, so the division is safe.
            let crossing = a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x);
            if point.x < crossing {
                inside = !inside;
            }
        }
        a = b;
    }
    return inside;
}

@compute @workgroup_size(8, 8, 1)
fn prefilter(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(result);
    if any(id.xy >= size) {
        return;
    }
    var sum = vec4(0.0);
#ifdef RESAMPLE
    for (var y = 0; y < params.samples; y++) {
        for (var x = 0; x < params.samples; x++) {
            let offset = (vec2(f32(x), f32(y)) + 0.5) / f32(params.samples);
            let point = (vec2<f32>(id.xy) + offset) / vec2<f32>(size);
            if inside_polygon(point) {
                let uv = params.region_low + point * params.region_size;
                sum += vec4(textureSampleLevel(source, source_sampler, uv, 0.0).rgb, 1.0);
            }
        }
    }
    sum /= f32(params.samples * params.samples);
#else ifdef DOWNSAMPLE
    let last = vec2<i32>(textureDimensions(source)) - 1;
    for (var i = 0; i < 4; i++) {
        let texel = min(vec2<i32>(id.xy) * 2 + vec2(i & 1, i >> 1u), last);
        sum += 0.25 * textureLoad(source, texel, 0);
    }
#else
    let last = vec2<i32>(textureDimensions(source)) - 1;
    let center = vec2<i32>(id.xy);
    if params.width == 0.0 {
        sum = textureLoad(source, center, 0);
    } else {
        let low = max(center - params.samples, vec2(0));
        let high = min(center + params.samples, last);
        for (var y = low.y; y <= high.y; y++) {
            for (var x = low.x; x <= high.x; x++) {
                // What a cosine sees of a plane: (1 + (r/width)^2)^-2.
                let r = vec2<f32>(vec2(x, y) - center) / params.width;
                let falloff = 1.0 / (1.0 + dot(r, r));
                sum += falloff * falloff * textureLoad(source, vec2(x, y), 0);
            }
        }
    }
    // The mean over the light. Beyond the reach of the kernel the coarser level goes on.
    if sum.a > SMALLEST_COVERAGE {
        sum = vec4(sum.rgb / sum.a, 1.0);
    } else {
        let above = min(center / 2, vec2<i32>(textureDimensions(coarser)) - 1);
        sum = vec4(textureLoad(coarser, above, 0).rgb, 1.0);
    }
#endif
    textureStore(result, id.xy, sum);
}
