//! What is baked: the triangles that receive shadows and those that cast them.

use akari_scene::{AlphaMode, Material, Primitive, Scene, light_polygons};
use akari_visibility::identity::{Hash, SourceHasher, mesh_hash};
use akari_visibility::sites::{Instance, Topology};
use glam::{DAffine3, DVec3, Vec2, Vec3};

use crate::Error;
use crate::adjacency::Adjacency;
use crate::bvh::{Accept, Bvh, Caster};
use crate::enclosure::Enclosure;
use crate::weld::weld;

/// Coverage (`alphaMode` BLEND) from which on a surface casts: bits cannot be half.
const BLEND_CUTOFF: f32 = 0.5;

/// Most triangles: their indices have flags in the top bits.
const MAX_TRIANGLES: usize = (1 << 30) - 1;

/// A triangle whose doubled area is below this share of its longest edge squared has no normal.
const SLIVER: f64 = 1e-12;

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

/// A mesh without a scene, for [`Geometry::from_meshes`].
#[derive(Clone, Debug)]
pub struct MeshInput<'a> {
    /// Name of the receiver in the file, and in messages.
    pub name: &'a str,
    /// Positions in the space of the mesh.
    pub positions: &'a [Vec3],
    /// Vertices of each triangle, counter-clockwise from the front.
    pub triangles: &'a [[u32; 3]],
    /// World from mesh.
    pub world_from_mesh: DAffine3,
    /// What it takes part in.
    pub roles: Roles,
    /// Receives on its back too.
    pub two_sided: bool,
}

/// How geometry is taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GeometryOptions {
    /// Let the enclosure cast too.
    ///
    /// The enclosure is what has the whole scene in front of it: walls and floor of a room, seen from inside, or the
    /// ground. Visibility is told by direction alone, so a wall behind a light would count as if it were before it.
    /// Leaving the enclosure out is exact for all lights within it; lights beyond it shine through.
    pub enclosure_casts: bool,
}

/// Where the alpha of a triangle that is cut out comes from.
#[derive(Clone, Copy, Debug)]
struct CutTriangle {
    part: u32,
    corners: [u32; 3],
}

#[derive(Debug)]
struct CutPart<'a> {
    primitive: &'a Primitive,
    material: &'a Material,
    cutoff: f32,
}

/// Alpha of the triangles that need a look.
#[derive(Debug, Default)]
pub(crate) struct Cuts<'a> {
    scene: Option<&'a Scene>,
    parts: Vec<CutPart<'a>>,
    triangles: Vec<CutTriangle>,
}

impl Accept for Cuts<'_> {
    fn accept(&self, cut: u32, u: f64, v: f64) -> bool {
        let CutTriangle { part, corners } = self.triangles[cut as usize];
        let part = &self.parts[part as usize];
        let (u, v) = (u as f32, v as f32);
        let w = 1.0 - u - v;
        let [a, b, c] = corners.map(|i| i as usize);
        let mut alpha = part.material.base_color.w;
        let colors = &part.primitive.colors;
        if !colors.is_empty() {
            alpha *= colors[a].w * w + colors[b].w * u + colors[c].w * v;
        }
        if let (Some(scene), Some(texture)) = (self.scene, &part.material.base_color_texture) {
            let uvs = &part.primitive.uvs[texture.tex_coord];
            let uv = if uvs.is_empty() {
                Vec2::ZERO
            } else {
                uvs[a] * w + uvs[b] * u + uvs[c] * v
            };
            alpha *= texture.sample(&scene.images, uv).w;
        }
        alpha >= part.cutoff
    }
}

/// The triangles of a static scene, ready to be baked. Borrows the scene for the alpha of its materials.
#[derive(Debug)]
pub struct Geometry<'a> {
    /// World position of the frame in which everything else is: the middle of the scene, where `f32` serves best.
    pub(crate) origin: DVec3,
    /// Length of the diagonal of the scene's bounds, metres.
    pub(crate) diagonal: f64,
    /// Vertices of the receiving triangles.
    pub(crate) receivers: Vec<[Vec3; 3]>,
    /// Geometric normals of the receiving triangles; none if they have no area.
    pub(crate) normals: Vec<Option<DVec3>>,
    /// Which of them receive on both sides.
    pub(crate) two_sided: Vec<bool>,
    pub(crate) topology: Topology,
    pub(crate) adjacency: Adjacency,
    pub(crate) bvh: Bvh,
    pub(crate) cuts: Cuts<'a>,
    source: Hash,
    notes: Vec<String>,
}

/// A mesh in the world.
struct Source<'a> {
    name: String,
    mesh: Hash,
    transform: DAffine3,
    positions: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    roles: Roles,
    two_sided: bool,
    /// Where alpha has to be looked at.
    cut: Option<CutPart<'a>>,
}

impl<'a> Geometry<'a> {
    /// All instances of a scene. `roles` tells what primitive `k` of instance `i` takes part in, given the default:
    /// everything casts and receives but area lights (neither) and unlit surfaces (which only cast).
    ///
    /// Surfaces cast with both sides, as in the path tracer. Double-sided ones receive on both. Alpha MASK is looked up
    /// for every ray; BLEND casts where its coverage is at least ½.
    pub fn from_scene(
        scene: &'a Scene,
        options: GeometryOptions,
        mut roles: impl FnMut(usize, usize, Roles) -> Roles,
    ) -> Result<Self, Error> {
        let mut is_light = std::collections::HashSet::new();
        let mut light_points = Vec::new();
        for candidate in light_polygons(scene) {
            if let Ok(polygon) = &candidate.result {
                is_light.insert((candidate.instance, candidate.primitive));
                light_points.extend(polygon.vertices.iter().map(|v| v.as_dvec3()));
            }
        }
        for light in &scene.area_lights {
            let (x, y) = match light.shape {
                akari_scene::AreaLightShape::Rect { width, height } => (0.5 * width, 0.5 * height),
                akari_scene::AreaLightShape::Disk { diameter } => (0.5 * diameter, 0.5 * diameter),
            };
            for (x, y) in [(-x, -y), (x, -y), (-x, y), (x, y)] {
                let corner = DVec3::new(x.into(), y.into(), 0.0);
                light_points.push(light.world_from_local.transform_point3(corner));
            }
        }
        let mut sources = Vec::new();
        for (i, instance) in scene.instances.iter().enumerate() {
            let mesh = &scene.meshes[instance.mesh];
            for (k, primitive) in mesh.primitives.iter().enumerate() {
                let material = &scene.materials[primitive.material];
                let default = if is_light.contains(&(i, k)) {
                    Roles::NONE
                } else if material.unlit {
                    Roles {
                        casts: true,
                        receives: false,
                    }
                } else {
                    Roles::BOTH
                };
                let positions: Vec<[f32; 3]> =
                    primitive.positions.iter().map(|p| p.to_array()).collect();
                let triangles: Vec<[u32; 3]> = primitive
                    .indices
                    .chunks_exact(3)
                    .map(|t| [t[0], t[1], t[2]])
                    .collect();
                let cutoff = match material.alpha_mode {
                    AlphaMode::Opaque => None,
                    AlphaMode::Mask { cutoff } => Some(cutoff),
                    AlphaMode::Blend => Some(BLEND_CUTOFF),
                };
                sources.push(Source {
                    name: format!("{} / {} / {k}", instance.name, mesh.name),
                    mesh: mesh_hash(&positions, &triangles),
                    transform: instance.world_from_local,
                    positions: primitive
                        .positions
                        .iter()
                        .map(|p| instance.world_from_local.transform_point3(p.as_dvec3()))
                        .collect(),
                    triangles,
                    roles: roles(i, k, default),
                    two_sided: material.double_sided,
                    cut: cutoff.map(|cutoff| CutPart {
                        primitive,
                        material,
                        cutoff,
                    }),
                });
            }
        }
        Self::new(sources, &light_points, Some(scene), options)
    }

    /// Meshes without a scene. Surfaces are opaque.
    pub fn from_meshes(
        meshes: &[MeshInput<'_>],
        options: GeometryOptions,
    ) -> Result<Geometry<'static>, Error> {
        let sources = meshes
            .iter()
            .map(|mesh| {
                let positions: Vec<[f32; 3]> =
                    mesh.positions.iter().map(|p| p.to_array()).collect();
                Source {
                    name: mesh.name.to_owned(),
                    mesh: mesh_hash(&positions, mesh.triangles),
                    transform: mesh.world_from_mesh,
                    positions: mesh
                        .positions
                        .iter()
                        .map(|p| mesh.world_from_mesh.transform_point3(p.as_dvec3()))
                        .collect(),
                    triangles: mesh.triangles.to_vec(),
                    roles: mesh.roles,
                    two_sided: mesh.two_sided,
                    cut: None,
                }
            })
            .collect();
        Geometry::new(sources, &[], None, options)
    }

    fn new(
        sources: Vec<Source<'a>>,
        light_points: &[DVec3],
        scene: Option<&'a Scene>,
        options: GeometryOptions,
    ) -> Result<Self, Error> {
        let (origin, diagonal) = check(&sources, light_points)?;
        let local = |p: DVec3| (p - origin).as_vec3();
        let mut topology = Topology::default();
        let mut receivers = Vec::new();
        let mut normals = Vec::new();
        let mut two_sided = Vec::new();
        let mut casters: Vec<Caster> = Vec::new();
        let mut cuts = Cuts {
            scene,
            ..Cuts::default()
        };
        let mut notes = Vec::new();
        let mut hasher = SourceHasher::new();
        for component in origin.to_array() {
            hasher.field(&component.to_le_bytes());
        }
        for source in sources {
            // A mirror turns the winding, but not which side is the front.
            let flip = source.transform.matrix3.determinant() < 0.0;
            let mut degenerate = 0_usize;
            hash_source(&mut hasher, &source, scene);
            if source.roles.receives && !source.triangles.is_empty() {
                topology.instances.push(Instance {
                    name: source.name.clone(),
                    mesh: source.mesh,
                    transform: rows(&source.transform),
                    first_triangle: receivers.len() as u32,
                    triangle_count: source.triangles.len() as u32,
                });
            }
            let cut_part = source.cut.map(|cut| {
                cuts.parts.push(cut);
                cuts.parts.len() as u32 - 1
            });
            for corners in &source.triangles {
                let vertices = corners.map(|i| local(source.positions[i as usize]));
                let normal = unit_normal(&vertices).map(|n| if flip { -n } else { n });
                degenerate += usize::from(normal.is_none());
                if source.roles.receives {
                    receivers.push(vertices);
                    normals.push(normal);
                    two_sided.push(source.two_sided);
                }
                if let (true, Some(normal)) = (source.roles.casts, normal) {
                    let cut = cut_part.map(|part| {
                        cuts.triangles.push(CutTriangle {
                            part,
                            corners: *corners,
                        });
                        cuts.triangles.len() as u32 - 1
                    });
                    casters.push(Caster {
                        vertices,
                        front: (!source.two_sided).then_some(normal),
                        cut,
                    });
                }
            }
            if degenerate > 0 {
                notes.push(format!(
                    "{}: {degenerate} triangles have no area and neither cast nor receive",
                    source.name
                ));
            }
        }
        if receivers.is_empty() {
            return Err(Error::Geometry {
                place: "scene".into(),
                problem: "no mesh receives shadows".into(),
                advice: "nothing would be baked; check which meshes are static and receive",
            });
        }
        if !options.enclosure_casts {
            let all = casters.len();
            let points = light_points
                .iter()
                .map(|&p| local(p))
                .chain(receivers.iter().flatten().copied());
            Enclosure::new(&casters, points, diagonal).remove(&mut casters);
            if casters.len() < all {
                notes.push(format!(
                    "{} triangles have the whole scene in front of them: they enclose it and cast no shadow into it",
                    all - casters.len()
                ));
            }
        }
        hasher.field(&(casters.len() as u64).to_le_bytes());
        hasher.field(&[u8::from(options.enclosure_casts)]);
        topology.triangles = weld(&receivers, &normals, &two_sided);
        let adjacency = Adjacency::new(&topology.triangles);
        Ok(Self {
            origin,
            diagonal,
            adjacency,
            receivers,
            normals,
            two_sided,
            topology,
            bvh: Bvh::build(&casters),
            cuts,
            source: hasher.finish(),
            notes,
        })
    }

    /// Hash of all that the bake depends on besides its options.
    #[must_use]
    pub fn source(&self) -> Hash {
        self.source
    }

    /// The receiving triangles.
    #[must_use]
    pub fn topology(&self) -> &Topology {
        &self.topology
    }

    /// How many triangles cast.
    #[must_use]
    pub fn caster_count(&self) -> usize {
        self.bvh.triangles.len()
    }

    /// What was left out, in words, one line each.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }
}

/// Middle and diagonal of the bounds of everything, if all of it can be baked.
fn check(sources: &[Source<'_>], light_points: &[DVec3]) -> Result<(DVec3, f64), Error> {
    let mut min = DVec3::INFINITY;
    let mut max = DVec3::NEG_INFINITY;
    let mut count = 0_usize;
    for source in sources {
        let refuse = |problem: String, advice| {
            Err(Error::Geometry {
                place: source.name.clone(),
                problem,
                advice,
            })
        };
        count += source.triangles.len();
        for (k, corners) in source.triangles.iter().enumerate() {
            for &i in corners {
                let Some(p) = source.positions.get(i as usize) else {
                    return refuse(
                        format!(
                            "triangle {k} names vertex {i} of {}",
                            source.positions.len()
                        ),
                        "export the mesh again",
                    );
                };
                // Far from the origin, squares overflow in f32.
                if !(p.abs().max_element() < 1e15) {
                    return refuse(
                        format!("vertex {i} of triangle {k} is at {p}"),
                        "positions are finite numbers below 1e15 metres: repair the mesh or its transform",
                    );
                }
                min = min.min(*p);
                max = max.max(*p);
            }
        }
    }
    if count > MAX_TRIANGLES {
        return Err(Error::Geometry {
            place: "scene".into(),
            problem: format!("{count} triangles, more than {MAX_TRIANGLES}"),
            advice: "bake it in pieces",
        });
    }
    for &p in light_points.iter().filter(|p| p.is_finite()) {
        min = min.min(p);
        max = max.max(p);
    }
    if count == 0 {
        return Ok((DVec3::ZERO, 0.0));
    }
    Ok((0.5 * (min + max), (max - min).length()))
}

/// Unit normal by the winding; none if the triangle has no area.
fn unit_normal(&[a, b, c]: &[Vec3; 3]) -> Option<DVec3> {
    let (ab, ac) = ((b - a).as_dvec3(), (c - a).as_dvec3());
    let normal = ab.cross(ac);
    let longest = ab
        .length_squared()
        .max(ac.length_squared())
        .max((ab - ac).length_squared());
    (normal.length() > SLIVER * longest)
        .then(|| normal.try_normalize())
        .flatten()
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

fn hash_source(hasher: &mut SourceHasher, source: &Source<'_>, scene: Option<&Scene>) {
    hasher.field(source.name.as_bytes());
    hasher.field(&source.mesh.0);
    let mut transform = Vec::with_capacity(12 * size_of::<f64>());
    for x in source.transform.to_cols_array() {
        transform.extend(x.to_le_bytes());
    }
    hasher.field(&transform);
    hasher.field(&[
        u8::from(source.roles.casts),
        u8::from(source.roles.receives),
        u8::from(source.two_sided),
        u8::from(source.cut.is_some()),
    ]);
    let Some(cut) = &source.cut else { return };
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
        akari_scene::Pixels::U8(p) => p.iter().map(|p| p[3]).collect(),
        akari_scene::Pixels::U16(p) => p.iter().flat_map(|p| p[3].to_le_bytes()).collect(),
    };
    hasher.field(&alpha);
}
