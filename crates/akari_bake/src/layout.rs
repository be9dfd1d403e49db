//! How a glTF scene becomes the geometry of a bake: what takes part, in which order, and by which hash it is known.
//!
//! # Order
//! Instances in the order of [`Scene::instances`] (depth first through the nodes, children in the order of the file), and
//! of each the primitives of its mesh in the order of the file. Each primitive that receives and has triangles is one
//! [`Instance`] of the bake, named `node / mesh / k`. Its triangles are those of [`Primitive::indices`] in their order:
//! triangle `t` of the primitive is triangle `first_triangle + t` of the bake, and its corners are in the order of its
//! three indices. [`akari_scene`] has left degenerate triangles out by then. Whoever mirrors a mesh into its vertices and
//! swaps two corners to keep the winding has to swap their barycentrics, too.
//!
//! Names are for people: equal ones occur. An instance is known by its place in that order; [`SceneLayout::primitives`]
//! tells which primitive it is.
//!
//! # Roles
//! | surface | casts | receives | why |
//! |---|---|---|---|
//! | opaque | with both sides | on its front | as in the path tracer |
//! | `doubleSided` | with both sides | on both sides | |
//! | `alphaMode` MASK | where alpha ≥ cutoff | as above | looked up for every ray |
//! | `alphaMode` BLEND | where coverage ≥ ½ | as above | a bit cannot be half |
//! | unlit | with both sides | no | it shows its colour, whatever the light |
//! | area light (an emissive planar primitive, [`akari_scene::light_polygons`]) | no | no | it moves without a new bake |
//! | other emissive surface | with both sides | on its front | it stays where it is |
//!
//! Visibility is told by direction alone. A light's own panel would therefore hide the light from everywhere, and where
//! it was when it was baked would stay dark for every other light: panels are left out. What is lost is the shadow that
//! one light's panel casts into the light of another, and shadows upon panels.
//!
//! # Identity
//! [`SceneLayout::source`] is the hash of what takes part: positions and triangles, transforms, roles, sides, and what
//! decides the alpha of MASK and BLEND surfaces. It does not see names, colours, cameras, nor lights: these move, dim and
//! change their pictures freely. A panel whose emission becomes zero is no light any more but a surface, and makes the
//! bake stale.
//!
//! Which triangles are left out as an enclosure may depend on where the lights are during the bake
//! ([`crate::GeometryOptions::enclosure_casts`]); that is stated in the bake's settings, so that parts of unequal
//! enclosures are not merged.

use akari_scene::{AlphaMode, Material, Pixels, Primitive, Scene, light_polygons};
use akari_visibility::identity::{Hash, SourceHasher, mesh_hash};
use akari_visibility::sites::Instance;
use glam::{DAffine3, Vec3};
use std::collections::HashSet;

use crate::geometry::{CutPart, Source};

/// Coverage (`alphaMode` BLEND) from which on a surface casts: bits cannot be half.
const BLEND_CUTOFF: f32 = 0.5;

/// What a mesh takes part in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Roles {
    /// It throws shadows.
    pub casts: bool,
    /// It has samples, and so receives shadows.
    pub receives: bool,
}

impl Roles {
    /// The default of static meshes.
    pub const BOTH: Self = Self {
        casts: true,
        receives: true,
    };
    /// The default of lights.
    pub const NONE: Self = Self {
        casts: false,
        receives: false,
    };
}

/// What a scene is to a bake, without the work of a [`crate::Geometry`]: enough to tell whether a bake is of this scene,
/// and which triangles are which.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneLayout {
    /// Hash of what takes part: [`akari_visibility::identity::Identity::source`] of a bake of this scene.
    pub source: Hash,
    /// What receives, as the bake lists it.
    pub instances: Vec<Instance>,
    /// Of each of `instances`, its place in [`Scene::instances`] and in the mesh's primitives.
    pub primitives: Vec<(usize, usize)>,
}

impl SceneLayout {
    /// Of a scene with the default roles: what `akari bake` bakes.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        Self::with_roles(scene, |_, _, roles| roles)
    }

    /// Of a scene where `roles` tells what primitive `k` of instance `i` takes part in, given the default.
    #[must_use]
    pub fn with_roles(scene: &Scene, roles: impl FnMut(usize, usize, Roles) -> Roles) -> Self {
        Self::of_sources(&sources(scene, roles), Some(scene))
    }

    pub(crate) fn of_sources(
        sources: &[((usize, usize), Source<'_, '_>)],
        scene: Option<&Scene>,
    ) -> Self {
        let mut hasher = SourceHasher::new();
        let mut layout = Self {
            source: Hash::default(),
            instances: Vec::new(),
            primitives: Vec::new(),
        };
        let mut first_triangle = 0;
        for (place, source) in sources {
            if source.roles == Roles::NONE || source.triangles.is_empty() {
                continue;
            }
            let positions: Vec<[f32; 3]> = source.positions.iter().map(Vec3::to_array).collect();
            let mesh = mesh_hash(&positions, source.triangles);
            hash_source(&mut hasher, mesh, source, scene);
            if source.roles.receives {
                let triangle_count = source.triangles.len() as u32;
                layout.instances.push(Instance {
                    name: source.name.clone(),
                    mesh,
                    transform: rows(&source.transform),
                    first_triangle,
                    triangle_count,
                });
                layout.primitives.push(*place);
                first_triangle += triangle_count;
            }
        }
        layout.source = hasher.finish();
        layout
    }
}

/// All primitives of a scene in the order of the bake, each with its place.
pub(crate) fn sources<'a>(
    scene: &'a Scene,
    mut roles: impl FnMut(usize, usize, Roles) -> Roles,
) -> Vec<((usize, usize), Source<'a, 'a>)> {
    let lights: HashSet<(usize, usize)> = light_polygons(scene)
        .iter()
        .filter(|candidate| candidate.result.is_ok())
        .map(|candidate| (candidate.instance, candidate.primitive))
        .collect();
    let mut sources = Vec::new();
    for (i, instance) in scene.instances.iter().enumerate() {
        let mesh = &scene.meshes[instance.mesh];
        for (k, primitive) in mesh.primitives.iter().enumerate() {
            let material = &scene.materials[primitive.material];
            let default = if lights.contains(&(i, k)) {
                Roles::NONE
            } else if material.unlit {
                Roles {
                    casts: true,
                    receives: false,
                }
            } else {
                Roles::BOTH
            };
            let source = Source {
                name: format!("{} / {} / {k}", instance.name, mesh.name),
                transform: instance.world_from_local,
                positions: &primitive.positions,
                triangles: primitive.indices.as_chunks().0,
                roles: roles(i, k, default),
                two_sided: material.double_sided,
                cut: cut(primitive, material),
            };
            sources.push(((i, k), source));
        }
    }
    sources
}

/// Where the alpha of a surface comes from, if it matters.
fn cut<'a>(primitive: &'a Primitive, material: &'a Material) -> Option<CutPart<'a>> {
    let cutoff = match material.alpha_mode {
        AlphaMode::Opaque => return None,
        AlphaMode::Mask { cutoff } => cutoff,
        AlphaMode::Blend => BLEND_CUTOFF,
    };
    Some(CutPart {
        primitive,
        material,
        cutoff,
    })
}

/// Rows of the 3×4 matrix.
fn rows(transform: &DAffine3) -> [f32; 12] {
    let mut rows = [0.0; 12];
    for row in 0..3 {
        for column in 0..3 {
            rows[4 * row + column] = transform.matrix3.col(column)[row] as f32;
        }
        rows[4 * row + 3] = transform.translation[row] as f32;
    }
    rows
}

fn hash_source(
    hasher: &mut SourceHasher,
    mesh: Hash,
    source: &Source<'_, '_>,
    scene: Option<&Scene>,
) {
    hasher.field(&mesh.0);
    let mut transform = Vec::with_capacity(12 * size_of::<f64>());
    for x in source.transform.to_cols_array() {
        transform.extend(x.to_le_bytes());
    }
    hasher.field(&transform);
    // Alpha matters to rays only.
    let cut = source.cut.as_ref().filter(|_| source.roles.casts);
    hasher.field(&[
        u8::from(source.roles.casts),
        u8::from(source.roles.receives),
        u8::from(source.two_sided),
        u8::from(cut.is_some()),
    ]);
    let Some(cut) = cut else { return };
    let mut floats = |values: &mut dyn Iterator<Item = f32>| {
        hasher.field(&values.flat_map(f32::to_le_bytes).collect::<Vec<u8>>());
    };
    floats(&mut [cut.cutoff, cut.material.base_color.w].into_iter());
    floats(&mut cut.primitive.colors.iter().map(|c| c.w));
    let Some((scene, texture)) = scene.zip(cut.material.base_color_texture.as_ref()) else {
        return;
    };
    floats(
        &mut cut.primitive.uvs[texture.tex_coord]
            .iter()
            .flat_map(|uv| uv.to_array()),
    );
    floats(&mut texture.transform.to_cols_array().into_iter());
    hasher.field(
        format!(
            "{:?} {:?} {:?}",
            texture.wrap_u, texture.wrap_v, texture.filter
        )
        .as_bytes(),
    );
    let image = &scene.images[texture.image];
    hasher.field(&image.width.to_le_bytes());
    let alpha: Vec<u8> = match &image.pixels {
        Pixels::U8(p) => p.iter().map(|p| p[3]).collect(),
        Pixels::U16(p) => p.iter().flat_map(|p| p[3].to_le_bytes()).collect(),
    };
    hasher.field(&alpha);
}
