use serde_json::Value;

use super::vec3::{self, Vec3};
use super::*;
use crate::workspace;

mod denoiser;

/// A file read back, with its own reader.
struct Glb {
    json: Value,
    bin: Vec<u8>,
}

fn read(bytes: &[u8]) -> Result<Glb> {
    let word = |at: usize| {
        bytes
            .get(at..at + 4)
            .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize)
    };
    let wrong = |what: &str| crate::failure::Failure::new(what);
    if bytes.get(..4) != Some(b"glTF") || word(4) != Some(2) {
        return Err(wrong("not glTF 2"));
    }
    if word(8) != Some(bytes.len()) {
        return Err(wrong("length in the header"));
    }
    let json_length = word(12).ok_or_else(|| wrong("truncated"))?;
    let bin_start = 20 + json_length;
    let bin_length = word(bin_start).ok_or_else(|| wrong("truncated"))?;
    if bytes.get(16..20) != Some(b"JSON")
        || bytes.get(bin_start + 4..bin_start + 8) != Some(b"BIN\0")
    {
        return Err(wrong("chunk types"));
    }
    if json_length % 4 != 0 || bin_length % 4 != 0 || bin_start + 8 + bin_length != bytes.len() {
        return Err(wrong("chunk lengths"));
    }
    let json = serde_json::from_slice(&bytes[20..bin_start]).context(|| "JSON".into())?;
    Ok(Glb {
        json,
        bin: bytes[bin_start + 8..].to_vec(),
    })
}

impl Glb {
    fn accessor_bytes(&self, index: u64, element_size: usize) -> &[u8] {
        let accessor = &self.json["accessors"][index as usize];
        let view = &self.json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let start = view["byteOffset"].as_u64().unwrap() as usize;
        let length = accessor["count"].as_u64().unwrap() as usize * element_size;
        assert!(start.is_multiple_of(4) && length as u64 == view["byteLength"].as_u64().unwrap());
        &self.bin[start..start + length]
    }

    fn vectors(&self, index: &Value) -> Vec<Vec3> {
        let component = |b: &[u8]| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        self.accessor_bytes(index.as_u64().unwrap(), 12)
            .chunks_exact(12)
            .map(|v| [component(v), component(&v[4..]), component(&v[8..])])
            .collect()
    }

    fn indices(&self, index: &Value) -> Vec<usize> {
        self.accessor_bytes(index.as_u64().unwrap(), 2)
            .chunks_exact(2)
            .map(|b| usize::from(u16::from_le_bytes([b[0], b[1]])))
            .collect()
    }

    fn list(&self, name: &str) -> &[Value] {
        self.json[name].as_array().map_or(&[], Vec::as_slice)
    }

    /// Nodes with a mesh: node, material, world positions, local normals, indices. Rotations are about +Y only.
    fn objects(&self) -> Vec<Object> {
        self.list("nodes")
            .iter()
            .filter(|node| node["mesh"].is_u64())
            .map(|node| {
                let primitive =
                    &self.list("meshes")[node["mesh"].as_u64().unwrap() as usize]["primitives"][0];
                let numbers = |name: &str, default: f64| -> Vec3 {
                    std::array::from_fn(|i| node[name][i].as_f64().unwrap_or(default))
                };
                let (translation, scale) = (numbers("translation", 0.0), numbers("scale", 1.0));
                let (qy, qw) = (
                    node["rotation"][1].as_f64().unwrap_or(0.0),
                    node["rotation"][3].as_f64().unwrap_or(1.0),
                );
                let (sin, cos) = (2.0 * qy * qw, 1.0 - 2.0 * qy * qy);
                let place = |p: &Vec3| {
                    let [x, y, z]: Vec3 = std::array::from_fn(|i| p[i] * scale[i]);
                    vec3::add(translation, [cos * x + sin * z, y, cos * z - sin * x])
                };
                let positions = self.vectors(&primitive["attributes"]["POSITION"]);
                Object {
                    name: node["name"].as_str().unwrap().into(),
                    material: self.list("materials")
                        [primitive["material"].as_u64().unwrap() as usize]
                        .clone(),
                    world: positions.iter().map(place).collect(),
                    normals: self.vectors(&primitive["attributes"]["NORMAL"]),
                    indices: self.indices(&primitive["indices"]),
                    positions,
                }
            })
            .collect()
    }
}

struct Object {
    name: String,
    material: Value,
    positions: Vec<Vec3>,
    world: Vec<Vec3>,
    normals: Vec<Vec3>,
    indices: Vec<usize>,
}

impl Object {
    fn emits(&self) -> bool {
        self.material["emissiveFactor"].is_array()
    }

    fn centroid(&self) -> Vec3 {
        let sum = self
            .world
            .iter()
            .fold([0.0; 3], |sum, p| vec3::add(sum, *p));
        vec3::scale(sum, 1.0 / self.world.len() as f64)
    }

    fn bottom(&self) -> f64 {
        self.world
            .iter()
            .map(|p| p[1])
            .fold(f64::INFINITY, f64::min)
    }

    /// Twice the vector area of the first triangle, in world space.
    fn facing(&self) -> Vec3 {
        let [a, b, c] = [0, 1, 2].map(|i| self.world[self.indices[i]]);
        vec3::cross(vec3::sub(b, a), vec3::sub(c, a))
    }
}

fn scene(name: &str) -> Glb {
    let (_, bytes) = all()
        .into_iter()
        .find(|(file, _)| *file == name)
        .expect("a scene of this name");
    read(&bytes).expect("a readable file")
}

#[test]
fn files_of_the_repository_are_up_to_date() {
    let outdated = outdated(&workspace::root().join("assets/scenes"));
    assert!(
        outdated.is_empty(),
        "run `cargo xtask gen-assets`: {outdated:?}"
    );
}

#[test]
fn a_changed_or_missing_file_is_found() {
    let folder = tempfile::tempdir().unwrap();
    generate(folder.path()).unwrap();
    assert_eq!(outdated(folder.path()), Vec::<String>::new());
    let changed = folder.path().join("cornell.glb");
    let mut bytes = std::fs::read(&changed).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    std::fs::write(&changed, bytes).unwrap();
    std::fs::remove_file(folder.path().join("gallery.glb")).unwrap();
    let found = outdated(folder.path());
    assert_eq!(found.len(), 2, "{found:?}");
}

#[test]
fn a_broken_file_is_refused_by_the_reader_of_these_tests() {
    let (_, bytes) = all().swap_remove(0);
    assert!(read(&bytes).is_ok());
    assert!(read(&bytes[..bytes.len() - 4]).is_err());
}

#[test]
fn meshes_are_sound() {
    for (name, bytes) in all() {
        let glb = read(&bytes).unwrap();
        for object in glb.objects() {
            let at = format!("{name}: {}", object.name);
            assert_eq!(object.positions.len(), object.normals.len(), "{at}");
            for normal in &object.normals {
                assert!(
                    (vec3::dot(*normal, *normal) - 1.0).abs() < 1e-6,
                    "{at}: normal {normal:?}"
                );
            }
            for t in object.indices.chunks_exact(3) {
                let [a, b, c] = [0, 1, 2].map(|i| object.positions[t[i]]);
                let geometric = vec3::cross(vec3::sub(b, a), vec3::sub(c, a));
                for &i in t {
                    assert!(
                        vec3::dot(geometric, object.normals[i]) > 0.0,
                        "{at}: triangle {t:?} against its normals"
                    );
                }
            }
        }
    }
}

#[test]
fn every_scene_has_a_named_camera_and_stays_small() {
    for (name, bytes) in all() {
        let glb = read(&bytes).unwrap();
        assert!(
            glb.list("cameras")
                .iter()
                .any(|camera| camera["name"] == "camera"),
            "{name}"
        );
        assert!(bytes.len() < 400_000, "{name}: {} bytes", bytes.len());
    }
}

#[test]
fn lights_are_black_one_sided_and_face_the_objects() {
    for (name, bytes) in all() {
        let glb = read(&bytes).unwrap();
        for light in glb.objects().iter().filter(|object| object.emits()) {
            let at = format!("{name}: {}", light.name);
            let material = &light.material;
            assert!(material["doubleSided"].is_null(), "{at}");
            assert_eq!(
                material["pbrMetallicRoughness"]["baseColorFactor"],
                serde_json::json!([0.0, 0.0, 0.0, 1.0]),
                "{at}"
            );
            let strength =
                &material["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"];
            assert!(
                (1.0..=100.0).contains(&strength.as_f64().unwrap()),
                "{at}: {strength}"
            );
            // Not upwards, and towards the middle of the scene unless it is one of many.
            let facing = light.facing();
            assert!(vec3::dot(facing, [0.0, -1.0, 0.0]) >= 0.0, "{at} faces up");
            if name != "many_lights.glb" {
                assert!(
                    vec3::dot(facing, vec3::sub([0.0, 0.4, 0.0], light.centroid())) > 0.0,
                    "{at} faces away"
                );
            }
        }
    }
}

#[test]
fn scenes_hold_what_their_names_say() {
    let lights = |name: &str| {
        scene(name)
            .objects()
            .iter()
            .filter(|object| object.emits())
            .count()
    };
    assert_eq!(lights("empty.glb"), 0);
    assert_eq!(lights("many_lights.glb"), 1024);
    assert_eq!(lights("gallery.glb"), 4);
    for (name, corners) in [
        ("quad", 4),
        ("triangle", 3),
        ("hexagon", 6),
        ("textured", 4),
    ] {
        let glb = scene(&format!("spheres_{name}.glb"));
        let objects = glb.objects();
        let light = objects.iter().find(|object| object.emits()).unwrap();
        assert_eq!(light.positions.len(), corners, "{name}");
        assert_eq!(
            light.material["emissiveTexture"].is_object(),
            name == "textured"
        );
        let area: f64 = light
            .indices
            .chunks_exact(3)
            .map(|t| {
                let [a, b, c] = [0, 1, 2].map(|i| light.world[t[i]]);
                let normal = vec3::cross(vec3::sub(b, a), vec3::sub(c, a));
                0.5 * vec3::dot(normal, normal).sqrt()
            })
            .sum();
        assert!((area - 2.4).abs() < 1e-5, "{name}: {area} m²");
        let spheres: Vec<_> = objects
            .iter()
            .filter(|object| object.name.starts_with("sphere"))
            .collect();
        assert_eq!(spheres.len(), 7);
        let floor = objects
            .iter()
            .find(|object| object.name == "floor")
            .unwrap();
        assert_eq!(
            floor.material["extensions"]["KHR_materials_specular"]["specularFactor"],
            0.0
        );
        for sphere in spheres {
            assert_eq!(
                sphere.material["pbrMetallicRoughness"]["metallicFactor"],
                1.0
            );
            assert!(
                sphere.bottom() > 0.04,
                "{name}: {} meets the floor",
                sphere.name
            );
        }
    }
}

#[test]
fn spheres_do_not_meet() {
    let centers = spheres::centers();
    for (i, a) in centers.iter().enumerate() {
        for b in &centers[..i] {
            let between = vec3::sub(*a, *b);
            assert!(
                vec3::dot(between, between).sqrt() > 2.0 * spheres::RADIUS + 0.05,
                "{a:?} and {b:?}"
            );
        }
    }
}
