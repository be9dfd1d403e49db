//! Meshes: attributes, indices, normals, tangents.

use glam::{Vec2, Vec3, Vec4};
use gltf::accessor::Dimensions;
use gltf::mesh::{Mode, Semantic};

use super::{Loader, label, name_or};
use crate::error::SceneError;
use crate::types::{Material, Mesh, Primitive, Scene};

/// A triangle whose height is below this share of its longest edge has no area that `f32` could tell from 0.
const SLIVER: f64 = 1e-10;

/// Converts all meshes; appends the default material if one is needed.
pub(super) fn load(loader: &mut Loader, scene: &mut Scene) -> Result<(), SceneError> {
    let document = loader.document;
    let default_material = scene.materials.len();
    let mut needs_default = false;
    for mesh in document.meshes() {
        let mut primitives = Vec::new();
        for primitive in mesh.primitives() {
            let place = format!(
                "mesh {} primitive {}",
                label(mesh.name(), mesh.index()),
                primitive.index()
            );
            let material = primitive.material().index();
            needs_default |= material.is_none();
            let mut converted = convert(loader, &primitive, &place)?;
            converted.material = material.unwrap_or(default_material);
            if let Some(texture) = material.and_then(|m| scene.materials[m].normal_texture.as_ref())
            {
                make_tangents(&mut converted, texture.tex_coord);
            }
            primitives.push(converted);
        }
        scene.meshes.push(Mesh {
            name: name_or(mesh.name(), "mesh", mesh.index()),
            primitives,
        });
    }
    if needs_default {
        scene.materials.push(Material {
            name: "default".into(),
            ..Material::default()
        });
    }
    Ok(())
}

fn convert(
    loader: &mut Loader,
    primitive: &gltf::Primitive,
    place: &str,
) -> Result<Primitive, SceneError> {
    let mode = primitive.mode();
    if !matches!(
        mode,
        Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
    ) {
        loader.warnings.push(format!(
            "{place}: {mode:?} are not drawn, only triangles are"
        ));
        return Ok(Primitive::default());
    }
    if primitive.morph_targets().len() > 0 {
        loader
            .warnings
            .push(format!("{place}: morph targets are not applied"));
    }
    let Some(accessor) = primitive.get(&Semantic::Positions) else {
        loader
            .warnings
            .push(format!("{place}: it has no POSITION and is not drawn"));
        return Ok(Primitive::default());
    };
    let positions: Vec<Vec3> = loader
        .vectors::<3>(&accessor, place, "POSITION", &[Dimensions::Vec3], 0.0)?
        .into_iter()
        .map(Vec3::from)
        .collect();
    let count = positions.len();
    if u32::try_from(count).is_err() {
        return Err(loader.invalid(place, format!("{count} vertices"), "split the mesh"));
    }
    let same_length = |length: usize, attribute: &str| {
        if length == count {
            Ok(())
        } else {
            Err(loader.invalid(
                place,
                format!("{attribute} has {length} elements for {count} vertices"),
                "export the file again",
            ))
        }
    };
    let mut out = Primitive {
        positions,
        ..Primitive::default()
    };
    if let Some(accessor) = primitive.get(&Semantic::Normals) {
        let values = loader.vectors::<3>(&accessor, place, "NORMAL", &[Dimensions::Vec3], 0.0)?;
        same_length(values.len(), "NORMAL")?;
        out.normals = values.into_iter().map(Vec3::from).collect();
    }
    if let Some(accessor) = primitive.get(&Semantic::Tangents) {
        let values = loader.vectors::<4>(&accessor, place, "TANGENT", &[Dimensions::Vec4], 1.0)?;
        same_length(values.len(), "TANGENT")?;
        out.tangents = values.into_iter().map(Vec4::from).collect();
    }
    for set in 0..2_u32 {
        if let Some(accessor) = primitive.get(&Semantic::TexCoords(set)) {
            let name = format!("TEXCOORD_{set}");
            let values = loader.vectors::<2>(&accessor, place, &name, &[Dimensions::Vec2], 0.0)?;
            same_length(values.len(), &name)?;
            out.uvs[set as usize] = values.into_iter().map(Vec2::from).collect();
        }
    }
    if let Some(accessor) = primitive.get(&Semantic::Colors(0)) {
        let allowed = [Dimensions::Vec3, Dimensions::Vec4];
        let values = loader.vectors::<4>(&accessor, place, "COLOR_0", &allowed, 1.0)?;
        same_length(values.len(), "COLOR_0")?;
        out.colors = values
            .into_iter()
            .map(|c| Vec4::from(c).clamp(Vec4::ZERO, Vec4::ONE))
            .collect();
    }
    let listed: Vec<u32> = match primitive.indices() {
        Some(accessor) => loader.indices(&accessor, count, place)?,
        None => (0..count as u32).collect(),
    };
    if mode == Mode::Triangles && !listed.len().is_multiple_of(3) {
        loader.warnings.push(format!(
            "{place}: {} indices are no multiple of 3, the rest is dropped",
            listed.len()
        ));
    }
    let triangles = triangles_of(&listed, mode);
    let all = triangles.len();
    let kept: Vec<[u32; 3]> = triangles
        .into_iter()
        .filter(|t| has_area(&out.positions, *t))
        .collect();
    out.degenerate_triangles = all - kept.len();
    if out.degenerate_triangles > 0 {
        loader.warnings.push(format!(
            "{place}: {} of {all} triangles have no area and are dropped",
            out.degenerate_triangles
        ));
    }
    out.indices = kept.into_iter().flatten().collect();
    repair_normals(loader, &mut out, place);
    Ok(out)
}

/// Triangle list of any triangle mode, all with the winding that glTF defines.
fn triangles_of(indices: &[u32], mode: Mode) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => indices
            .windows(3)
            .enumerate()
            .map(|(i, t)| {
                if i % 2 == 0 {
                    [t[0], t[1], t[2]]
                } else {
                    [t[0], t[2], t[1]]
                }
            })
            .collect(),
        Mode::TriangleFan => match indices.split_first() {
            Some((&hub, rim)) => rim.windows(2).map(|t| [t[0], t[1], hub]).collect(),
            None => Vec::new(),
        },
        _ => indices
            .chunks_exact(3)
            .map(|t| [t[0], t[1], t[2]])
            .collect(),
    }
}

fn has_area(positions: &[Vec3], triangle: [u32; 3]) -> bool {
    let [a, b, c] = triangle.map(|i| positions[i as usize].as_dvec3());
    let longest = (b - a)
        .length_squared()
        .max((c - b).length_squared())
        .max((a - c).length_squared());
    longest > 0.0 && (b - a).cross(c - a).length() > SLIVER * longest
}

/// Flat normals where the file has none; unit length everywhere.
fn repair_normals(loader: &mut Loader, primitive: &mut Primitive, place: &str) {
    let face = |positions: &[Vec3], t: &[u32]| {
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| positions[i as usize].as_dvec3());
        (b - a).cross(c - a).normalize_or_zero().as_vec3()
    };
    if primitive.normals.is_empty() {
        // A flat triangle shares no vertex with its neighbours.
        let order: Vec<usize> = primitive.indices.iter().map(|&i| i as usize).collect();
        fn gather<T: Copy>(values: &mut Vec<T>, order: &[usize]) {
            if !values.is_empty() {
                *values = order.iter().map(|&i| values[i]).collect();
            }
        }
        gather(&mut primitive.positions, &order);
        gather(&mut primitive.colors, &order);
        gather(&mut primitive.uvs[0], &order);
        gather(&mut primitive.uvs[1], &order);
        // glTF: without normals, tangents must be ignored.
        primitive.tangents.clear();
        primitive.indices = (0..order.len() as u32).collect();
        primitive.normals = primitive
            .indices
            .chunks_exact(3)
            .flat_map(|t| [face(&primitive.positions, t); 3])
            .collect();
        return;
    }
    let mut zero = 0;
    for n in &mut primitive.normals {
        let unit = n.as_dvec3().normalize_or_zero().as_vec3();
        zero += usize::from(unit == Vec3::ZERO);
        *n = unit;
    }
    if zero > 0 {
        loader.warnings.push(format!(
            "{place}: {zero} normals have no direction and are replaced by that of a triangle"
        ));
        for t in primitive.indices.chunks_exact(3) {
            let normal = face(&primitive.positions, t);
            for &i in t {
                let n = &mut primitive.normals[i as usize];
                if *n == Vec3::ZERO {
                    *n = normal;
                }
            }
        }
        // Vertices that no triangle uses.
        for n in &mut primitive.normals {
            if *n == Vec3::ZERO {
                *n = Vec3::Y;
            }
        }
    }
    for t in &mut primitive.tangents {
        let unit = t.truncate().normalize_or(Vec3::X);
        *t = unit.extend(if t.w < 0.0 { -1.0 } else { 1.0 });
    }
}

/// Tangents from texture coordinates, where the file has none: per triangle the direction in which u grows,
/// summed over the triangles around a vertex weighted by angle, made orthogonal to the normal.
///
/// glTF asks for `MikkTSpace`, which also splits vertices where the handedness changes; this does not, so a mirrored
/// seam through shared vertices is shaded differently.
fn make_tangents(primitive: &mut Primitive, tex_coord: usize) {
    let uvs = &primitive.uvs[tex_coord];
    if !primitive.tangents.is_empty() || uvs.len() != primitive.positions.len() {
        return;
    }
    let n = primitive.positions.len();
    let mut tangents = vec![Vec3::ZERO; n];
    let mut bitangents = vec![Vec3::ZERO; n];
    for t in primitive.indices.chunks_exact(3) {
        let t = [t[0], t[1], t[2]].map(|i| i as usize);
        let p = t.map(|i| primitive.positions[i]);
        let uv = t.map(|i| uvs[i]);
        let (e1, e2) = (p[1] - p[0], p[2] - p[0]);
        let (d1, d2) = (uv[1] - uv[0], uv[2] - uv[0]);
        let determinant = d1.perp_dot(d2);
        if determinant == 0.0 {
            continue;
        }
        let tangent = ((e1 * d2.y - e2 * d1.y) * determinant.signum()).normalize_or_zero();
        let bitangent = ((e2 * d1.x - e1 * d2.x) * determinant.signum()).normalize_or_zero();
        for k in 0..3 {
            let to = |j: usize| (p[j] - p[k]).normalize_or_zero();
            let angle = to((k + 1) % 3).dot(to((k + 2) % 3)).clamp(-1.0, 1.0).acos();
            tangents[t[k]] += angle * tangent;
            bitangents[t[k]] += angle * bitangent;
        }
    }
    primitive.tangents = (0..n)
        .map(|i| {
            let normal = primitive.normals[i];
            let tangent = tangents[i] - normal * normal.dot(tangents[i]);
            let tangent = tangent
                .try_normalize()
                .unwrap_or_else(|| normal.any_orthonormal_vector());
            // v runs down the image, and the green of a glTF normal map points up in it: the bitangent is against
            // the direction in which v grows.
            let side = normal.cross(tangent).dot(bitangents[i]);
            tangent.extend(if side < 0.0 { 1.0 } else { -1.0 })
        })
        .collect();
}
