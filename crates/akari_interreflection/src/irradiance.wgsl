// Lights the corners of diffuse patches.

#import akari_math::frame::orthonormal_basis
#import akari_math::ltc::polygon::{lambert_polygon_add_edge, lambert_polygon_close, lambert_polygon_new}
#import akari_interreflection::lights::{INV_PI, polygon_radiance, punctual_light, unpack_light}
#import akari_interreflection::types::{
    InterreflectionView, IRRADIANCE_WORKGROUP, KIND_POLYGON, LIGHT_STRIDE, Triangle,
}

@group(0) @binding(0) var<uniform> settings: InterreflectionView;
@group(0) @binding(1) var<storage, read> triangles: array<Triangle>;
@group(0) @binding(2) var<storage, read> lights: array<vec4<f32>>;
// Irradiance over pi at the three corners of each patch.
@group(0) @binding(3) var<storage, read_write> patch_light: array<vec4<f32>>;

@compute @workgroup_size(IRRADIANCE_WORKGROUP)
fn irradiance(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= 3u * settings.patches {
        return;
    }
    let triangle = triangles[id.x / 3u];
    var point = triangle.a;
    var normal = triangle.normal_a;
    if id.x % 3u == 1u {
        point = triangle.b;
        normal = triangle.normal_b;
    } else if id.x % 3u == 2u {
        point = triangle.c;
        normal = triangle.normal_c;
    }
    let frame = orthonormal_basis(normal);
    var sum = vec3(0.0);
    for (var k = 0u; k < settings.lights; k++) {
        let at = k * LIGHT_STRIDE;
        let light = unpack_light(lights[at], lights[at + 1u], lights[at + 2u], lights[at + 3u]);
        if light.kind == KIND_POLYGON {
            let radiance = polygon_radiance(light, point);
            if radiance.w == 0.0 {
                continue;
            }
            var polygon = lambert_polygon_new();
            var a = (lights[light.first + light.count - 1u].xyz - point) * frame;
            for (var i = 0u; i < light.count; i++) {
                let b = (lights[light.first + i].xyz - point) * frame;
                lambert_polygon_add_edge(&polygon, a, b);
                a = b;
            }
            lambert_polygon_close(&polygon);
            sum += radiance.rgb * max(polygon.diffuse.z * radiance.w, 0.0);
        } else {
            let incident = punctual_light(light, point);
            sum += incident.illuminance * (INV_PI * max(dot(normal, incident.to_light), 0.0));
        }
    }
    patch_light[id.x] = vec4(sum, 0.0);
}
