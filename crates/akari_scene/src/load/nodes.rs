//! The node tree: instances, cameras, lights.

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Vec3};
use gltf::json::Value;
use gltf::khr_lights_punctual::Kind;

use super::{Loader, label, name_or};
use crate::error::SceneError;
use crate::types::{
    AreaLight, AreaLightShape, Camera, Instance, Projection, PunctualKind, PunctualLight, Scene,
};

/// Coordinates beyond this, in metres, are a mistake of units or damage; within it, squared distances stay far
/// inside of `f32`.
const FARTHEST: f64 = 1e12;

/// Name of the draft area light extension.
const AREA_LIGHTS: &str = "EXT_lights_area";

pub(super) fn load(loader: &mut Loader, scene: &mut Scene) -> Result<(), SceneError> {
    let document = loader.document;
    let gltf_scene = document
        .default_scene()
        .or_else(|| document.scenes().next());
    let stem = loader
        .path
        .file_stem()
        .map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    scene.name = gltf_scene
        .as_ref()
        .and_then(|s| s.name())
        .filter(|n| !n.is_empty())
        .map_or(stem, str::to_owned);
    let roots: Vec<gltf::Node> = match gltf_scene {
        Some(s) => s.nodes().collect(),
        None => {
            loader
                .warnings
                .push("the file has no scene: all root nodes are shown".to_owned());
            let mut is_child = vec![false; document.nodes().len()];
            for child in document.nodes().flat_map(|n| n.children()) {
                is_child[child.index()] = true;
            }
            document.nodes().filter(|n| !is_child[n.index()]).collect()
        }
    };
    // An explicit stack: a file may nest deeper than the thread's stack. Reversed, so that the order is the file's.
    let mut visited = vec![false; document.nodes().len()];
    let mut stack: Vec<(gltf::Node, DAffine3)> = roots
        .into_iter()
        .rev()
        .map(|n| (n, DAffine3::IDENTITY))
        .collect();
    while let Some((node, parent)) = stack.pop() {
        let place = format!("node {}", label(node.name(), node.index()));
        if std::mem::replace(&mut visited[node.index()], true) {
            return Err(loader.invalid(
                place,
                "is reached twice: it has two parents or is its own ancestor",
                "nodes must form a tree: export the file again",
            ));
        }
        let world = parent * local_transform(loader, &node, &place)?;
        if !world.is_finite() || world.translation.abs().max_element() > FARTHEST {
            return Err(loader.invalid(
                place,
                "its transform is not finite or leads beyond 1e12 m",
                "correct its matrix, scale or units",
            ));
        }
        node_content(loader, scene, &node, world, &place)?;
        let children: Vec<gltf::Node> = node.children().collect();
        stack.extend(children.into_iter().rev().map(|c| (c, world)));
    }
    if scene.instances.is_empty() {
        loader.warnings.push("the scene shows no mesh".to_owned());
    }
    Ok(())
}

fn local_transform(
    loader: &Loader,
    node: &gltf::Node,
    place: &str,
) -> Result<DAffine3, SceneError> {
    match node.transform() {
        gltf::scene::Transform::Matrix { matrix } => {
            let m = DMat4::from_cols_array_2d(&matrix.map(|c| c.map(f64::from)));
            Ok(DAffine3::from_mat4(m))
        }
        gltf::scene::Transform::Decomposed {
            translation,
            rotation,
            scale,
        } => {
            let q = DQuat::from_array(rotation.map(f64::from));
            let length = q.length();
            if !(length > 1e-6 && length.is_finite()) {
                return Err(loader.invalid(
                    place,
                    format!("its rotation {rotation:?} is no rotation"),
                    "use a unit quaternion",
                ));
            }
            Ok(DAffine3::from_scale_rotation_translation(
                DVec3::from_array(scale.map(f64::from)),
                q.normalize(),
                DVec3::from_array(translation.map(f64::from)),
            ))
        }
    }
}

/// Rotation and translation of a transform; none where its axes do not span space.
fn rigid(world: DAffine3) -> Option<DAffine3> {
    let m = world.matrix3;
    let z = m.z_axis.try_normalize()?;
    let x = m.y_axis.cross(z).try_normalize()?;
    let y = z.cross(x);
    // A mirroring node: keep the view direction and up, as glTF viewers do.
    Some(DAffine3::from_mat3_translation(
        DMat3::from_cols(x, y, z),
        world.translation,
    ))
}

fn node_content(
    loader: &mut Loader,
    scene: &mut Scene,
    node: &gltf::Node,
    world: DAffine3,
    place: &str,
) -> Result<(), SceneError> {
    if let Some(mesh) = node.mesh() {
        add_instance(loader, scene, node, mesh.index(), world, place)?;
    }
    let area_light = node
        .extension_value(AREA_LIGHTS)
        .and_then(|v| v.get("light"));
    if node.camera().is_none() && node.light().is_none() && area_light.is_none() {
        return Ok(());
    }
    let Some(world_from_local) = rigid(world) else {
        loader.warnings.push(format!(
            "{place}: its scale is 0 along an axis, its camera or light is left out"
        ));
        return Ok(());
    };
    if let Some(camera) = node.camera() {
        let projection = projection(loader, &camera, place)?;
        let name = node
            .name()
            .or(camera.name())
            .map_or_else(|| format!("camera {}", scene.cameras.len()), str::to_owned);
        scene.cameras.push(Camera {
            name,
            world_from_local,
            projection,
        });
    }
    if let Some(light) = node.light() {
        let converted = punctual(loader, node, &light, world_from_local, place)?;
        scene.punctual_lights.push(converted);
    }
    if let Some(index) = area_light {
        let converted = area(loader, node, index, world, world_from_local, place)?;
        scene.area_lights.push(converted);
    }
    Ok(())
}

fn add_instance(
    loader: &mut Loader,
    scene: &mut Scene,
    node: &gltf::Node,
    mesh: usize,
    world: DAffine3,
    place: &str,
) -> Result<(), SceneError> {
    // Compared with the product of the axes' lengths, so that a model in micrometres is no singular one.
    let m = world.matrix3;
    let volume = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
    if !(m.determinant().abs() > 1e-12 * volume) {
        loader.warnings.push(format!(
            "{place}: its transform flattens the mesh, which is left out"
        ));
        return Ok(());
    }
    for (j, primitive) in scene.meshes[mesh].primitives.iter().enumerate() {
        let far = primitive.positions.iter().position(|p| {
            let q = world.transform_point3(p.as_dvec3());
            // Written so that NaN is found, too.
            !(q.abs().max_element() <= FARTHEST)
        });
        if let Some(i) = far {
            return Err(loader.invalid(
                format!("{place}, mesh '{}' primitive {j}", scene.meshes[mesh].name),
                format!("POSITION[{i}] lies beyond 1e12 m from the origin"),
                "correct the units or repair the mesh",
            ));
        }
    }
    scene.instances.push(Instance {
        name: name_or(node.name(), "node", node.index()),
        mesh,
        world_from_local: world,
    });
    Ok(())
}

fn projection(
    loader: &Loader,
    camera: &gltf::Camera,
    place: &str,
) -> Result<Projection, SceneError> {
    let place = format!("{place}, camera {}", label(camera.name(), camera.index()));
    match camera.projection() {
        gltf::camera::Projection::Perspective(p) => {
            if !(p.yfov() > 0.0 && p.yfov() < std::f32::consts::PI) {
                return Err(loader.invalid(
                    place,
                    format!("its vertical field of view is {} rad", p.yfov()),
                    "it must lie between 0 and pi",
                ));
            }
            Ok(Projection::Perspective {
                yfov: p.yfov(),
                aspect: p.aspect_ratio().filter(|a| *a > 0.0 && a.is_finite()),
                znear: if p.znear().is_finite() {
                    p.znear().max(0.0)
                } else {
                    0.0
                },
                zfar: p.zfar().filter(|z| *z > 0.0 && z.is_finite()),
            })
        }
        gltf::camera::Projection::Orthographic(o) => {
            // A negative magnitude mirrors the image; nobody means it.
            let (xmag, ymag) = (o.xmag().abs(), o.ymag().abs());
            if !(xmag > 0.0 && ymag > 0.0 && xmag.is_finite() && ymag.is_finite()) {
                return Err(loader.invalid(
                    place,
                    format!("its magnification is {} x {}", o.xmag(), o.ymag()),
                    "xmag and ymag must not be 0",
                ));
            }
            Ok(Projection::Orthographic {
                xmag,
                ymag,
                znear: o.znear(),
                zfar: o.zfar(),
            })
        }
    }
}

/// Colour × intensity, checked.
fn intensity(
    loader: &Loader,
    color: Vec3,
    intensity: f32,
    place: &str,
) -> Result<Vec3, SceneError> {
    let value = color * intensity;
    if value.is_finite() && color.min_element() >= 0.0 && intensity >= 0.0 {
        Ok(value)
    } else {
        Err(loader.invalid(
            place,
            format!(
                "its intensity {intensity} with colour {:?}",
                color.to_array()
            ),
            "both must be finite and not negative",
        ))
    }
}

fn punctual(
    loader: &mut Loader,
    node: &gltf::Node,
    light: &gltf::khr_lights_punctual::Light,
    world_from_local: DAffine3,
    place: &str,
) -> Result<PunctualLight, SceneError> {
    let place = format!("{place}, light {}", label(light.name(), light.index()));
    let kind = match light.kind() {
        Kind::Directional => PunctualKind::Directional,
        Kind::Point => PunctualKind::Point,
        Kind::Spot {
            inner_cone_angle,
            outer_cone_angle,
        } => {
            let outer = outer_cone_angle.clamp(1e-4, std::f32::consts::FRAC_PI_2);
            let inner = inner_cone_angle.clamp(0.0, outer - 1e-5);
            // An inner angle equal to the outer one is a hard edge, which the clamp keeps: not worth a warning.
            if outer != outer_cone_angle || (inner - inner_cone_angle).abs() > 1e-4 {
                loader.warnings.push(format!(
                    "{place}: cone angles {inner_cone_angle} and {outer_cone_angle} become {inner} and {outer}"
                ));
            }
            PunctualKind::Spot {
                inner_cone_angle: inner,
                outer_cone_angle: outer,
            }
        }
    };
    Ok(PunctualLight {
        name: node
            .name()
            .or(light.name())
            .map_or_else(|| format!("light {}", light.index()), str::to_owned),
        kind,
        intensity: intensity(loader, Vec3::from(light.color()), light.intensity(), &place)?,
        range: light.range().filter(|r| *r > 0.0 && r.is_finite()),
        world_from_local,
    })
}

/// A light of the draft `EXT_lights_area` (KhronosGroup/glTF pull request 2525).
fn area(
    loader: &mut Loader,
    node: &gltf::Node,
    index: &Value,
    world: DAffine3,
    world_from_local: DAffine3,
    place: &str,
) -> Result<AreaLight, SceneError> {
    let correct = "correct the extension (it is a draft)";
    let place = format!("{place}, {AREA_LIGHTS} light {index}");
    let light = loader
        .document
        .extension_value(AREA_LIGHTS)
        .and_then(|v| v.get("lights"))
        .zip(index.as_u64())
        .and_then(|(list, i)| list.get(usize::try_from(i).ok()?));
    let Some(light) = light else {
        return Err(loader.invalid(place, "there is no such light", correct));
    };
    let number = |value: Option<&Value>, default: f64| value.map_or(Some(default), Value::as_f64);
    let color: Option<Vec<f32>> = match light.get("color") {
        None => Some(vec![1.0; 3]),
        Some(v) => v
            .as_array()
            .and_then(|a| a.iter().map(|c| c.as_f64().map(|c| c as f32)).collect()),
    };
    let nits = number(light.get("intensity"), 1000.0);
    let size = number(light.get("size"), 1.0);
    let aspect = number(light.get("rect").and_then(|r| r.get("aspect")), 1.0);
    let (Some(color), Some(nits), Some(size), Some(aspect)) = (color, nits, size, aspect) else {
        return Err(loader.invalid(place, "a value has the wrong type", correct));
    };
    if color.len() != 3 || !(size > 0.0 && aspect > 0.0) {
        return Err(loader.invalid(
            place,
            "colour needs 3 components, size and aspect must be positive",
            correct,
        ));
    }
    // The draft: one uniform scale, the largest of the three.
    let m = world.matrix3;
    let scale = m
        .x_axis
        .length()
        .max(m.y_axis.length())
        .max(m.z_axis.length());
    let height = (scale * size) as f32;
    let shape = match light.get("type").and_then(Value::as_str) {
        Some("rect") => AreaLightShape::Rect {
            width: (scale * size * aspect) as f32,
            height,
        },
        Some("disk") => AreaLightShape::Disk { diameter: height },
        other => {
            return Err(loader.invalid(
                place,
                format!("its type is {other:?}, not \"rect\" or \"disk\""),
                correct,
            ));
        }
    };
    let radiance = intensity(
        loader,
        Vec3::new(color[0], color[1], color[2]),
        nits as f32,
        &place,
    )?;
    Ok(AreaLight {
        name: node
            .name()
            .or_else(|| light.get("name").and_then(Value::as_str))
            .map_or_else(|| format!("area light {index}"), str::to_owned),
        shape,
        radiance,
        world_from_local,
    })
}
