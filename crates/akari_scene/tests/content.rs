//! Values of a file arrive as the specification says.

mod common;

use akari_scene::{
    AlphaMode, AreaLightShape, ColorSpace, Filter, Projection, PunctualKind, Wrap, light_polygons,
};
use common::{Glb, load};
use glam::{DVec3, Vec2, Vec3};
use serde_json::json;

#[test]
fn flat_normals_are_generated() {
    let scene = load(&Glb::quad().bytes());
    let primitive = &scene.meshes[0].primitives[0];
    assert_eq!(primitive.positions.len(), 6);
    assert!(primitive.normals.iter().all(|n| *n == Vec3::Z));
    assert_eq!(scene.name, "Test");
    assert_eq!(
        scene.instances[0].world_from_local.translation,
        DVec3::new(0.0, 1.0, 0.0)
    );
}

#[test]
fn material_and_extensions() {
    let mut glb = Glb::quad();
    glb.json["extensionsUsed"] = json!([
        "KHR_materials_emissive_strength",
        "KHR_materials_specular",
        "KHR_materials_ior",
        "KHR_texture_transform"
    ]);
    glb.json["materials"][0] = json!({
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.25, "roughnessFactor": 0.75,
            "metallicRoughnessTexture": {"index": 0}
        },
        "normalTexture": {"index": 0, "scale": 0.5, "extensions": {"KHR_texture_transform": {"scale": [2, 3]}}},
        "emissiveFactor": [1.0, 0.5, 0.25],
        "emissiveTexture": {"index": 0, "extensions": {"KHR_texture_transform":
            {"offset": [0.5, 0.25], "rotation": std::f32::consts::FRAC_PI_2, "scale": [2, 3]}}},
        "alphaMode": "MASK", "alphaCutoff": 0.3, "doubleSided": true,
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 12},
            "KHR_materials_specular": {"specularFactor": 0.0, "specularColorFactor": [1, 2, 3]},
            "KHR_materials_ior": {"ior": 1.33}
        }
    });
    glb.json["samplers"] = json!([{"magFilter": 9728, "wrapS": 33071, "wrapT": 33648}]);
    glb.json["textures"][0]["sampler"] = json!(0);
    let scene = load(&glb.bytes());
    let m = &scene.materials[0];
    assert_eq!(m.name, "material 0");
    assert_eq!(m.emission, Vec3::new(12.0, 6.0, 3.0));
    assert_eq!((m.specular, m.ior), (0.0, 1.33));
    assert_eq!(m.specular_color, Vec3::new(1.0, 2.0, 3.0));
    assert_eq!((m.metallic, m.roughness, m.normal_scale), (0.25, 0.75, 0.5));
    assert_eq!(m.alpha_mode, AlphaMode::Mask { cutoff: 0.3 });
    assert!(m.double_sided && m.is_emissive());
    let emissive = m.emissive_texture.as_ref().unwrap();
    assert_eq!(emissive.color_space, ColorSpace::Srgb);
    assert_eq!(emissive.filter, Filter::Nearest);
    assert_eq!(
        (emissive.wrap_u, emissive.wrap_v),
        (Wrap::Clamp, Wrap::Mirror)
    );
    // offset + R·S·uv with R(90°) = [[0, 1], [−1, 0]]: (1, 1) → (0.5 + 3, 0.25 − 2).
    let uv = emissive.transform.transform_point2(Vec2::ONE);
    assert!((uv - Vec2::new(3.5, -1.75)).length() < 1e-6, "{uv}");
    let metallic_roughness = m.metallic_roughness_texture.as_ref().unwrap();
    assert_eq!(metallic_roughness.color_space, ColorSpace::Linear);
    let normal = m.normal_texture.as_ref().unwrap();
    assert_eq!(
        normal.transform.transform_point2(Vec2::ONE),
        Vec2::new(2.0, 3.0)
    );
    // One image, decoded once, for three uses.
    assert_eq!(scene.images.len(), 1);
    let red = scene.images[0].texel(1, 0, ColorSpace::Srgb);
    assert_eq!(red.truncate(), Vec3::X);
}

#[test]
fn tangents_follow_the_texture() {
    let mut glb = Glb::quad();
    glb.json["materials"][0]["normalTexture"] = json!({"index": 0});
    let scene = load(&glb.bytes());
    // u grows along +X, v along −Y: tangent +X, and n × t = +Y is already "up in the image".
    for t in &scene.meshes[0].primitives[0].tangents {
        assert!((t.truncate() - Vec3::X).length() < 1e-6);
        assert_eq!(t.w, 1.0);
    }
}

#[test]
fn cameras_and_lights() {
    let mut glb = Glb::quad();
    glb.json["extensionsUsed"] = json!(["KHR_lights_punctual", "EXT_lights_area"]);
    // A draft extension that a file requires must not stop the loader that reads it.
    glb.json["extensionsRequired"] = json!(["EXT_lights_area"]);
    glb.json["extensions"] = json!({
        "KHR_lights_punctual": {"lights": [
            {"type": "spot", "color": [1, 0.5, 0], "intensity": 10, "range": 3,
             "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.5}}]},
        "EXT_lights_area": {"lights": [
            {"type": "rect", "intensity": 200, "size": 0.5, "rect": {"aspect": 2}},
            {"type": "disk", "color": [1, 0, 0]}]}
    });
    glb.json["scenes"][0]["nodes"] = json!([0, 1, 2, 3, 4]);
    glb.json["nodes"].as_array_mut().unwrap().extend([
        json!({"name": "Lamp", "rotation": [1, 0, 0, 0], "scale": [1, -2, 3],
               "extensions": {"KHR_lights_punctual": {"light": 0}}}),
        json!({"name": "Panel", "scale": [1, 3, 2], "extensions": {"EXT_lights_area": {"light": 0}}}),
        json!({"extensions": {"EXT_lights_area": {"light": 1}}}),
    ]);
    let scene = load(&glb.bytes());
    assert!(matches!(
        scene.cameras[0].projection,
        Projection::Perspective { yfov, aspect: None, .. } if yfov == 0.8
    ));
    let spot = &scene.punctual_lights[0];
    assert_eq!(spot.intensity, Vec3::new(10.0, 5.0, 0.0));
    assert_eq!(spot.range, Some(3.0));
    assert_eq!(
        spot.kind,
        PunctualKind::Spot {
            inner_cone_angle: 0.1,
            outer_cone_angle: 0.5
        }
    );
    let m = spot.world_from_local.matrix3;
    assert!((m.determinant() - 1.0).abs() < 1e-9, "rigid");
    let AreaLightShape::Rect { width, height } = scene.area_lights[0].shape else {
        panic!("rect")
    };
    assert_eq!((width, height), (3.0, 1.5));
    assert_eq!(scene.area_lights[0].radiance, Vec3::splat(200.0));
    assert_eq!(scene.area_lights[1].radiance, Vec3::new(1000.0, 0.0, 0.0));
    assert_eq!(
        scene.area_lights[1].shape,
        AreaLightShape::Disk { diameter: 1.0 }
    );
    // A light that does not exist.
    glb.json["nodes"][4]["extensions"]["EXT_lights_area"]["light"] = json!(7);
    assert!(common::load_err(&glb.bytes()).contains("there is no such light"));
}

#[test]
fn an_emissive_quad_is_a_light_polygon() {
    let mut glb = Glb::quad();
    glb.json["materials"][0]["emissiveFactor"] = json!([1, 1, 1]);
    let scene = load(&glb.bytes());
    let found = light_polygons(&scene);
    assert_eq!(found[0].result.as_ref().unwrap().vertices.len(), 4);
    glb.set_position(2, [1.0, 1.0, 0.5]);
    let scene = load(&glb.bytes());
    let reason = light_polygons(&scene)[0]
        .result
        .clone()
        .unwrap_err()
        .to_string();
    assert!(reason.contains("not planar"), "{reason}");
}

#[test]
fn external_files_are_relative_to_the_gltf() {
    let glb = Glb::quad();
    let folder = tempfile::tempdir().unwrap();
    let mut json = glb.json.clone();
    json["buffers"][0]["uri"] = json!("data%20dir/b.bin");
    json["images"][0] = json!({"uri": "i.png"});
    std::fs::create_dir(folder.path().join("data dir")).unwrap();
    std::fs::write(folder.path().join("data dir/b.bin"), &glb.bin).unwrap();
    std::fs::write(folder.path().join("i.png"), common::png()).unwrap();
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, json.to_string()).unwrap();
    let scene = akari_scene::Scene::load(&path).unwrap();
    assert_eq!(scene.images[0].width, 2);
    std::fs::write(folder.path().join("data dir/b.bin"), &glb.bin[..50]).unwrap();
    let message = akari_scene::Scene::load(&path).unwrap_err().to_string();
    assert!(message.contains("50 bytes where"), "{message}");
}
