//! Whatever the bytes are: a clear error or a scene, never a panic.

mod common;

use akari_scene::{Scene, SceneError};
use common::{Glb, load, load_err};
use serde_json::json;

#[test]
fn the_valid_scene_loads() {
    let scene = load(&Glb::quad().bytes());
    assert_eq!(scene.instances.len(), 1);
    assert_eq!(scene.meshes[0].primitives[0].indices.len(), 6);
    assert_eq!(scene.images.len(), 1);
    assert_eq!(scene.cameras.len(), 1);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn missing_file() {
    let error = Scene::load("/nowhere/at/all.glb".as_ref()).unwrap_err();
    assert!(matches!(error, SceneError::Io { .. }));
    assert!(error.to_string().contains("/nowhere/at/all.glb"));
}

#[test]
fn truncated_at_every_fiftieth() {
    let bytes = Glb::quad().bytes();
    for i in 0..50 {
        let cut = bytes.len() * i / 50;
        let message = load_err(&bytes[..cut]);
        assert!(message.contains("test.glb"), "cut at {cut}: {message}");
    }
}

#[test]
fn every_byte_flipped() {
    let bytes = Glb::quad().bytes();
    for i in 0..bytes.len() {
        for mask in [0x01, 0x80, 0xff] {
            let mut damaged = bytes.clone();
            damaged[i] ^= mask;
            if let Ok(scene) = Scene::from_bytes("test.glb".as_ref(), &damaged) {
                // What loads must be usable: follow every index.
                for instance in &scene.instances {
                    for primitive in &scene.meshes[instance.mesh].primitives {
                        assert!(primitive.material < scene.materials.len());
                        assert_eq!(primitive.normals.len(), primitive.positions.len());
                        for &k in &primitive.indices {
                            assert!(primitive.positions[k as usize].is_finite());
                        }
                    }
                }
                let _ = akari_scene::light_polygons(&scene);
                assert!(scene.frame_camera().world_from_local.is_finite());
            }
        }
    }
}

#[test]
fn damaged_json_structure() {
    // Every number of the JSON replaced by values that no index or count should have.
    let glb = Glb::quad();
    let text = glb.json.to_string();
    let starts: Vec<usize> = (1..text.len())
        .filter(|&i| {
            text.as_bytes()[i].is_ascii_digit()
                && matches!(text.as_bytes()[i - 1], b':' | b'[' | b',')
        })
        .collect();
    for start in starts {
        let end = start
            + text[start..]
                .find(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | 'e' | '-' | '+')))
                .unwrap();
        for value in ["-1", "4294967295", "18446744073709551615", "1e38", "3", "0"] {
            let changed = format!("{}{value}{}", &text[..start], &text[end..]);
            let _ = Scene::from_bytes("test.glb".as_ref(), &common::glb(&changed, &glb.bin));
        }
    }
}

#[test]
fn garbage() {
    assert!(load_err(b"{ this is no JSON").contains("line 1"));
    assert!(load_err(b"").contains("test.glb"));
    assert!(load_err(&[0xff; 100]).contains("test.glb"));
}

#[test]
fn nan_vertex_is_named() {
    let mut glb = Glb::quad();
    glb.set_position(2, [0.0, f32::NAN, 0.0]);
    let message = load_err(&glb.bytes());
    assert!(
        message.contains("mesh 'Wall' primitive 0: POSITION[2] is NaN"),
        "{message}"
    );
    glb.set_position(2, [0.0, f32::INFINITY, 0.0]);
    assert!(load_err(&glb.bytes()).contains("POSITION[2] is infinite"));
}

#[test]
fn accessor_out_of_range() {
    let mut glb = Glb::quad();
    glb.json["accessors"][0]["count"] = json!(400);
    let message = load_err(&glb.bytes());
    assert!(
        message.contains("mesh 'Wall'") && message.contains("400 elements"),
        "{message}"
    );
}

#[test]
fn huge_index() {
    let mut glb = Glb::quad();
    glb.set_index(4, 60000);
    let message = load_err(&glb.bytes());
    assert!(
        message.contains("index[4] = 60000 is out of range (4 vertices)"),
        "{message}"
    );
}

#[test]
fn missing_texture_names_texture_and_file() {
    let mut glb = Glb::quad();
    glb.json["images"][0] = json!({"uri": "gone.png", "name": "Photo"});
    let message = load_err(&glb.bytes());
    for part in ["test.glb", "baseColorTexture", "gone.png", "Photo"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn undecodable_and_zero_sized_images() {
    let mut glb = Glb::quad();
    glb.json["images"][0] = json!({"uri": "data:image/png;base64,AAAA"});
    assert!(load_err(&glb.bytes()).contains("neither PNG nor JPEG"));
    let mut png = common::png();
    // IHDR's width: bytes 16 to 19.
    png[16..20].fill(0);
    use base64::Engine as _;
    let text = base64::engine::general_purpose::STANDARD.encode(&png);
    glb.json["images"][0] = json!({"uri": format!("data:image/png;base64,{text}")});
    let message = load_err(&glb.bytes());
    assert!(message.contains("baseColorTexture"), "{message}");
}

#[test]
fn negative_emission() {
    let mut glb = Glb::quad();
    glb.json["materials"][0]["emissiveFactor"] = json!([0.5, -0.5, 0.5]);
    let message = load_err(&glb.bytes());
    assert!(message.contains("material 'Paint'"), "{message}");
}

#[test]
fn camera_without_parameters() {
    let mut glb = Glb::quad();
    glb.json["cameras"][0]["type"] = json!("orthographic");
    assert!(load_err(&glb.bytes()).contains("camera"));
}

#[test]
fn node_cycle() {
    let mut glb = Glb::quad();
    glb.json["nodes"][0]["children"] = json!([0]);
    assert!(load_err(&glb.bytes()).contains("reached twice"));
}

#[test]
fn unsupported_compression_is_named() {
    let mut glb = Glb::quad();
    glb.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    glb.json["extensionsUsed"] = json!(["KHR_draco_mesh_compression"]);
    assert!(load_err(&glb.bytes()).contains("KHR_draco_mesh_compression"));
}

#[test]
fn degenerate_triangles_are_dropped_with_a_count() {
    let mut glb = Glb::quad();
    glb.set_index(5, 2); // second triangle becomes (0, 2, 2)
    let scene = load(&glb.bytes());
    let primitive = &scene.meshes[0].primitives[0];
    assert_eq!(primitive.indices.len(), 3);
    assert_eq!(primitive.degenerate_triangles, 1);
    assert!(
        scene.warnings[0].contains("1 of 2 triangles"),
        "{:?}",
        scene.warnings
    );
}
