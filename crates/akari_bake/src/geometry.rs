//! What is baked: the triangles that receive shadows and those that cast them.

use akari_scene::{AreaLightShape, Material, Primitive, Scene, light_polygons};
use akari_visibility::face::cube_from_world_f64;
use akari_visibility::identity::{EnclosureSettings, Hash};
use akari_visibility::sites::Topology;
use glam::{DAffine3, DVec3, Vec2, Vec3};

use crate::Error;
use crate::adjacency::Adjacency;
use crate::bvh::{Accept, Bvh, Caster};
use crate::enclosure::Enclosure;
use crate::layout::{Roles, SceneLayout, sources};
use crate::weld::weld;

/// Most triangles: their indices have flags in the top bits.
const MAX_TRIANGLES: usize = (1 << 30) - 1;

/// A triangle whose doubled area is below this share of its longest edge squared has no normal.
const SLIVER: f64 = 1e-12;

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
    /// Leaving the enclosure out is exact for all lights within it; lights beyond it shine through. The scene includes
    /// its area lights where they are during the bake: what one of them is behind of is no enclosure.
    pub enclosure_casts: bool,
}

/// Where the alpha of a triangle that is cut out comes from.
#[derive(Clone, Copy, Debug)]
struct CutTriangle {
    part: u32,
    corners: [u32; 3],
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct CutPart<'a> {
    pub(crate) primitive: &'a Primitive,
    pub(crate) material: &'a Material,
    /// Smallest alpha that casts.
    pub(crate) cutoff: f32,
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
    /// World position of the frame in which everything else is: the middle of the scene, where `f32` serves best. Its
    /// axes are those of the samples' cubes.
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
    enclosure: EnclosureSettings,
    notes: Vec<String>,
}

/// A mesh in the world.
pub(crate) struct Source<'m, 'a> {
    pub(crate) name: String,
    pub(crate) transform: DAffine3,
    /// Local.
    pub(crate) positions: &'m [Vec3],
    pub(crate) triangles: &'m [[u32; 3]],
    pub(crate) roles: Roles,
    pub(crate) two_sided: bool,
    /// Where alpha has to be looked at.
    pub(crate) cut: Option<CutPart<'a>>,
}

impl Source<'_, '_> {
    /// Position of a vertex in the world; none if there is no such vertex.
    fn position(&self, vertex: u32) -> Option<DVec3> {
        let local = self.positions.get(vertex as usize)?;
        Some(self.transform.transform_point3(local.as_dvec3()))
    }
}

/// A position of the world in the frame of the bake.
fn to_frame(position: DVec3, origin: DVec3) -> Vec3 {
    cube_from_world_f64(position - origin).as_vec3()
}

impl<'a> Geometry<'a> {
    /// All instances of a scene. `roles` tells what primitive `k` of instance `i` takes part in, given the default.
    /// Order, defaults and identity: [`crate::layout`].
    pub fn from_scene(
        scene: &'a Scene,
        options: GeometryOptions,
        roles: impl FnMut(usize, usize, Roles) -> Roles,
    ) -> Result<Self, Error> {
        let sources = sources(scene, roles);
        Self::new(&sources, &light_corners(scene), Some(scene), options)
    }

    /// Meshes without a scene. Surfaces are opaque.
    pub fn from_meshes(
        meshes: &[MeshInput<'_>],
        options: GeometryOptions,
    ) -> Result<Geometry<'static>, Error> {
        let sources: Vec<_> = meshes
            .iter()
            .enumerate()
            .map(|(index, mesh)| {
                let source = Source {
                    name: mesh.name.to_owned(),
                    transform: mesh.world_from_mesh,
                    positions: mesh.positions,
                    triangles: mesh.triangles,
                    roles: mesh.roles,
                    two_sided: mesh.two_sided,
                    cut: None,
                };
                ((index, 0), source)
            })
            .collect();
        Geometry::new(&sources, &[], None, options)
    }

    fn new(
        sources: &[((usize, usize), Source<'_, 'a>)],
        light_corners: &[DVec3],
        scene: Option<&'a Scene>,
        options: GeometryOptions,
    ) -> Result<Self, Error> {
        let (origin, diagonal) = check(sources.iter().map(|(_, source)| source))?;
        let layout = SceneLayout::of_sources(sources, scene);
        let mut receivers = Vec::new();
        let mut normals = Vec::new();
        let mut two_sided = Vec::new();
        let mut casters: Vec<Caster> = Vec::new();
        let mut cuts = Cuts {
            scene,
            ..Cuts::default()
        };
        let mut notes = Vec::new();
        for (_, source) in sources {
            if source.roles == Roles::NONE {
                continue;
            }
            // A mirror turns the winding, but not which side is the front.
            let flip = source.transform.matrix3.determinant() < 0.0;
            let mut degenerate = 0_usize;
            let cut_part = source.cut.map(|cut| {
                cuts.parts.push(cut);
                cuts.parts.len() as u32 - 1
            });
            for corners in source.triangles {
                // `check` has found every vertex.
                let vertices =
                    corners.map(|i| to_frame(source.position(i).unwrap_or_default(), origin));
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
        let mut enclosure = EnclosureSettings::default();
        if !options.enclosure_casts {
            let points = light_corners
                .iter()
                .map(|&p| to_frame(p, origin))
                .chain(receivers.iter().flatten().copied());
            enclosure = Enclosure::new(&casters, points, diagonal).remove(&mut casters);
            if enclosure.triangles > 0 {
                notes.push(format!(
                    "{} triangles have the whole scene in front of them: they enclose it and cast no shadow into it",
                    enclosure.triangles
                ));
            }
        }
        let triangles = weld(&receivers, &normals, &two_sided);
        let adjacency = Adjacency::new(&triangles);
        Ok(Self {
            origin,
            diagonal,
            adjacency,
            receivers,
            normals,
            two_sided,
            topology: Topology {
                instances: layout.instances,
                triangles,
            },
            bvh: Bvh::build(&casters),
            cuts,
            source: layout.source,
            enclosure,
            notes,
        })
    }

    /// Hash of all that takes part; with [`Geometry::enclosure`] and the options, all that the bake depends on.
    #[must_use]
    pub fn source(&self) -> Hash {
        self.source
    }

    /// Which casters were left out as the scene's enclosure.
    #[must_use]
    pub fn enclosure(&self) -> EnclosureSettings {
        self.enclosure
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

/// Corners of all area lights, in the world.
fn light_corners(scene: &Scene) -> Vec<DVec3> {
    let mut corners = Vec::new();
    for candidate in light_polygons(scene) {
        if let Ok(polygon) = &candidate.result {
            corners.extend(polygon.vertices.iter().map(|v| v.as_dvec3()));
        }
    }
    for light in &scene.area_lights {
        let (x, y) = match light.shape {
            AreaLightShape::Rect { width, height } => (0.5 * width, 0.5 * height),
            AreaLightShape::Disk { diameter } => (0.5 * diameter, 0.5 * diameter),
        };
        for (x, y) in [(-x, -y), (x, -y), (-x, y), (x, y)] {
            let corner = DVec3::new(x.into(), y.into(), 0.0);
            corners.push(light.world_from_local.transform_point3(corner));
        }
    }
    corners
}

/// Middle and diagonal of the bounds of what takes part, if all of it can be baked. Lights do not count: where they are
/// must not change a bit of the bake.
fn check<'s>(sources: impl Iterator<Item = &'s Source<'s, 's>>) -> Result<(DVec3, f64), Error> {
    let mut min = DVec3::INFINITY;
    let mut max = DVec3::NEG_INFINITY;
    let mut count = 0_usize;
    for source in sources.filter(|source| source.roles != Roles::NONE) {
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
                let Some(p) = source.position(i) else {
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
                min = min.min(p);
                max = max.max(p);
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
