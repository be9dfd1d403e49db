#define_import_path akari_render::sky

// Where in an environment's cube map a direction of the world is. `to_map` is the quaternion that turns directions of the
// world into those of the map.
fn sky_place(to_map: vec4<f32>, direction: vec3<f32>) -> vec3<f32> {
    let half_turn = 2.0 * cross(to_map.xyz, direction);
    let turned = direction + to_map.w * half_turn + cross(to_map.xyz, half_turn);
    // Cube maps are left-handed.
    return vec3(turned.xy, -turned.z);
}
