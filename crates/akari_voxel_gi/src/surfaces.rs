//! What the triangles of a mesh reflect and emit: one value, or a table with an entry for each triangle.
//!
//! Textures are averaged over each triangle, on the CPU, once for each pair of mesh and material; detail within a triangle
//! that is larger than voxels is lost (a floor of two triangles has two colours). Images that are on the GPU only count as
//! white.

use crate::geometry::MeshGeometry;
use akari_math::voxel::packing::{MAX_VOXEL_ALBEDO, unorm_pack, voxel_radiance_pack};
use bevy::image::Image;
use bevy::math::{Vec2, Vec3};
use bevy::mesh::{Mesh, UvChannel, VertexAttributeValues};
use bevy::pbr::StandardMaterial;
use bevy::prelude::{Alpha, AlphaMode, AssetId, Assets, ColorToComponents, Handle};

/// Most steps along a triangle's side at which its textures are looked up.
const MOST_STEPS: u32 = 24;

/// Albedo and coverage (unorm8 × 4), and emission (`voxel_radiance_pack`).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PackedSurface {
    /// Albedo, and coverage in the top byte.
    pub albedo: u32,
    /// Radiance.
    pub emission: u32,
}

/// What a material makes of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshSurface {
    /// One entry for all triangles, or one for each.
    pub entries: Vec<PackedSurface>,
    /// Whether both sides reflect.
    pub two_sided: bool,
    /// Whether anything shines.
    pub emissive: bool,
    /// Whether what lamps send to pixels by way of it is accounted for elsewhere: metal that something else mirrors. What it
    /// sends to voxels, and what voxels send to it, still bounces here.
    pub lamps_elsewhere: bool,
    /// Perceptual roughness, if it is metal, which mirrors.
    pub metal: Option<f32>,
    /// Images that it depends on.
    pub images: Vec<AssetId<Image>>,
}

/// A surface before it is packed.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Surface {
    albedo: Vec3,
    emission: Vec3,
    coverage: f32,
}

impl Surface {
    fn pack(self) -> PackedSurface {
        let albedo = self.albedo.clamp(Vec3::ZERO, Vec3::splat(MAX_VOXEL_ALBEDO));
        PackedSurface {
            albedo: unorm_pack(albedo.x)
                | (unorm_pack(albedo.y) << 8)
                | (unorm_pack(albedo.z) << 16)
                | (unorm_pack(self.coverage) << 24),
            // Half a step of dither rounds to the nearest.
            emission: voxel_radiance_pack(self.emission, Vec3::splat(0.5)),
        }
    }
}

/// Whether voxels hold a material at all: not what is see-through, and not what takes no part in lighting.
pub fn is_voxelized(material: &StandardMaterial) -> bool {
    /// Share of the light that goes through above which a body is see-through.
    const SEE_THROUGH: f32 = 0.5;
    let opaque = matches!(
        material.alpha_mode,
        AlphaMode::Opaque | AlphaMode::Mask(_) | AlphaMode::AlphaToCoverage
    );
    opaque && !material.unlit && material.specular_transmission <= SEE_THROUGH
}

/// Whether a material shines.
pub fn is_emissive(material: &StandardMaterial) -> bool {
    let emission = material.emissive.to_vec3();
    emission.is_finite() && emission.max_element() > 0.0
}

/// An image and where a triangle lies on it.
struct Lookup<'a> {
    image: &'a Image,
    uvs: &'a [[f32; 2]],
}

impl Lookup<'_> {
    fn size(&self) -> Vec2 {
        let size = self.image.texture_descriptor.size;
        Vec2::new(size.width as f32, size.height as f32)
    }

    fn uv(&self, material: &StandardMaterial, corner: u32) -> Vec2 {
        let uv = self
            .uvs
            .get(corner as usize)
            .copied()
            .map_or(Vec2::ZERO, Vec2::from);
        let uv = material.uv_transform.transform_point2(uv);
        if uv.is_finite() { uv } else { Vec2::ZERO }
    }

    /// The texel at a place, linear; repeated beyond the image.
    fn color(&self, uv: Vec2) -> Option<[f32; 4]> {
        let size = self.size();
        let texel = (uv - uv.floor()) * size;
        let texel = texel.min(size - 1.0).max(Vec2::ZERO).as_uvec2();
        let color = self.image.get_color_at(texel.x, texel.y).ok()?;
        Some(color.to_linear().to_f32_array())
    }
}

/// Metallic factor above which a surface reflects more in its lobe than diffusely.
const MOSTLY_METAL: f32 = 0.5;

/// Light of a mesh that something else accounts for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Elsewhere {
    /// What it emits: an area light stands for it.
    pub emission: bool,
    /// What its specular lobe sends on of the light of lamps.
    pub mirrored: bool,
}

/// What a material makes of a mesh, but for what is accounted for elsewhere.
pub fn mesh_surface(
    mesh: Option<&Mesh>,
    geometry: &MeshGeometry,
    material: &StandardMaterial,
    images: &Assets<Image>,
    elsewhere: Elsewhere,
) -> MeshSurface {
    let two_sided = material.double_sided || material.cull_mode.is_none();
    let emissive = is_emissive(material) && !elsewhere.emission;
    let emissive_texture = material.emissive_texture.as_ref().filter(|_| emissive);
    let uvs = |channel: &UvChannel| {
        let attribute = match channel {
            UvChannel::Uv0 => Mesh::ATTRIBUTE_UV_0,
            UvChannel::Uv1 => Mesh::ATTRIBUTE_UV_1,
        };
        match mesh?.try_attribute_option(attribute) {
            Ok(Some(VertexAttributeValues::Float32x2(uvs))) => Some(uvs.as_slice()),
            _ => None,
        }
    };
    let lookup = |handle: Option<&Handle<Image>>, channel: &UvChannel| {
        let image = images.get(handle?)?;
        image.data.as_ref()?;
        Some(Lookup {
            image,
            uvs: uvs(channel)?,
        })
    };
    // Metal has no diffuse reflection; its base colour is what it reflects in all directions together, up to the loss
    // between microfacets. It stands for a diffuse albedo where what metal mirrors is not followed, so that metal hands
    // light on, too: so does a mixture of both.
    let base = lookup(
        material.base_color_texture.as_ref(),
        &material.base_color_channel,
    );
    let emission = lookup(emissive_texture, &material.emissive_channel);
    let colors = match mesh.map(|mesh| mesh.try_attribute_option(Mesh::ATTRIBUTE_COLOR)) {
        Some(Ok(Some(VertexAttributeValues::Float32x4(colors)))) => Some(colors.as_slice()),
        _ => None,
    };
    let used = [
        material.base_color_texture.as_ref(),
        emissive_texture,
        material.metallic_roughness_texture.as_ref(),
    ];
    let metal = metal_roughness(material, images);
    let images = used.into_iter().flatten().map(Handle::id).collect();
    let uniform = Surface {
        albedo: finite(material.base_color.to_linear().to_vec3()),
        emission: if emissive {
            finite(material.emissive.to_vec3())
        } else {
            Vec3::ZERO
        },
        coverage: 1.0 - material.specular_transmission.clamp(0.0, 1.0),
    };
    let entries = if base.is_none() && emission.is_none() && colors.is_none() {
        let coverage = uniform.coverage * alpha_coverage(material, material.base_color.alpha());
        vec![
            Surface {
                coverage,
                ..uniform
            }
            .pack(),
        ]
    } else {
        geometry
            .triangles
            .iter()
            .map(|corners| {
                average(
                    corners,
                    material,
                    base.as_ref(),
                    emission.as_ref(),
                    colors,
                    uniform,
                )
                .pack()
            })
            .collect()
    };
    MeshSurface {
        entries,
        two_sided,
        emissive,
        lamps_elsewhere: elsewhere.mirrored && metal.is_some(),
        metal,
        images,
    }
}

/// Perceptual roughness of a material that is metal, `None` of others. Of textures, the mean over the image counts; one whose
/// data are not in the main world is not known to be metal.
fn metal_roughness(material: &StandardMaterial, images: &Assets<Image>) -> Option<f32> {
    /// Texels that are looked up along each side of the image.
    const SAMPLES: u32 = 16;
    let (mut metallic, mut roughness) = (material.metallic, material.perceptual_roughness);
    if let Some(texture) = &material.metallic_roughness_texture {
        let image = images.get(texture)?;
        let size = image.texture_descriptor.size;
        let (mut green, mut blue) = (0.0, 0.0);
        for index in 0..SAMPLES * SAMPLES {
            let [x, y] = [
                (index % SAMPLES, size.width),
                (index / SAMPLES, size.height),
            ]
            .map(|(step, side)| (2 * step + 1) * side / (2 * SAMPLES));
            let color = image.get_color_at(x, y).ok()?.to_linear();
            green += color.green;
            blue += color.blue;
        }
        let count = (SAMPLES * SAMPLES) as f32;
        roughness *= green / count;
        metallic *= blue / count;
    }
    (metallic > MOSTLY_METAL && roughness.is_finite()).then(|| roughness.clamp(0.0, 1.0))
}

fn finite(color: Vec3) -> Vec3 {
    if color.is_finite() {
        color.max(Vec3::ZERO)
    } else {
        Vec3::ZERO
    }
}

/// How much of what has this opacity is there.
fn alpha_coverage(material: &StandardMaterial, alpha: f32) -> f32 {
    match material.alpha_mode {
        AlphaMode::Mask(cutoff) => f32::from(u8::from(alpha >= cutoff)),
        AlphaMode::AlphaToCoverage => alpha.clamp(0.0, 1.0),
        _ => 1.0,
    }
}

/// The mean over a triangle.
fn average(
    corners: &[u32; 3],
    material: &StandardMaterial,
    base: Option<&Lookup>,
    emission: Option<&Lookup>,
    colors: Option<&[[f32; 4]]>,
    uniform: Surface,
) -> Surface {
    let steps = [base, emission]
        .into_iter()
        .flatten()
        .map(|lookup| {
            let [a, b, c] = corners.map(|corner| lookup.uv(material, corner) * lookup.size());
            // Texels that it covers.
            ((b - a).perp_dot(c - a).abs() * 0.5).sqrt().ceil() as u32
        })
        .max()
        .unwrap_or(2)
        .clamp(2, MOST_STEPS);
    let (mut albedo, mut shine, mut coverage) = (Vec3::ZERO, Vec3::ZERO, 0.0);
    let mut count = 0.0;
    for i in 0..steps {
        for j in 0..steps - i {
            // Middles of the upright ones of steps² equal triangles.
            let u = (i as f32 + 1.0 / 3.0) / steps as f32;
            let v = (j as f32 + 1.0 / 3.0) / steps as f32;
            let weights = [1.0 - u - v, u, v];
            let uv = |lookup: &Lookup| {
                corners
                    .iter()
                    .zip(weights)
                    .map(|(&corner, weight)| lookup.uv(material, corner) * weight)
                    .sum::<Vec2>()
            };
            let mut color = uniform.albedo;
            let mut alpha = material.base_color.alpha();
            if let Some([r, g, b, a]) = base.and_then(|lookup| lookup.color(uv(lookup))) {
                color *= Vec3::new(r, g, b);
                alpha *= a;
            }
            if let Some(colors) = colors {
                for (&corner, weight) in corners.iter().zip(weights) {
                    let [_, _, _, a] = colors.get(corner as usize).copied().unwrap_or([1.0; 4]);
                    alpha *= 1.0 + (a - 1.0) * weight;
                }
                let tint: Vec3 = corners
                    .iter()
                    .zip(weights)
                    .map(|(&corner, weight)| {
                        let [r, g, b, _] = colors.get(corner as usize).copied().unwrap_or([1.0; 4]);
                        Vec3::new(r, g, b) * weight
                    })
                    .sum();
                color *= finite(tint);
            }
            let there = alpha_coverage(material, alpha);
            albedo += color * there;
            coverage += there;
            let mut light = uniform.emission;
            if let Some([r, g, b, _]) = emission.and_then(|lookup| lookup.color(uv(lookup))) {
                light *= Vec3::new(r, g, b);
            }
            shine += light * there;
            count += 1.0;
        }
    }
    // Colours of what is there; where nothing is, they do not matter.
    let there = f32::max(coverage, f32::MIN_POSITIVE);
    Surface {
        albedo: finite(albedo / there),
        emission: finite(shine / there),
        coverage: uniform.coverage * coverage / count,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use akari_math::voxel::packing::{unorm_unpack, voxel_radiance_unpack};
    use bevy::asset::RenderAssetUsages;
    use bevy::color::{Color, LinearRgba};
    use bevy::math::primitives::Rectangle;
    use bevy::mesh::{MeshBuilder, Meshable};
    use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};

    fn albedo(surface: PackedSurface) -> Vec3 {
        let bits = surface.albedo;
        Vec3::new(
            unorm_unpack(bits),
            unorm_unpack(bits >> 8),
            unorm_unpack(bits >> 16),
        )
    }

    fn surface(material: &StandardMaterial, images: &Assets<Image>) -> MeshSurface {
        let mesh = Rectangle::new(1.0, 1.0).mesh().build();
        let geometry = MeshGeometry::new(&mesh).expect("a rectangle");
        mesh_surface(
            Some(&mesh),
            &geometry,
            material,
            images,
            Elsewhere::default(),
        )
    }

    #[test]
    fn a_plain_material_has_one_entry() {
        let images = Assets::default();
        let material = StandardMaterial {
            base_color: Color::linear_rgb(0.5, 0.25, 2.0),
            emissive: LinearRgba::rgb(300.0, 20.0, 1.0),
            metallic: 1.0,
            ..Default::default()
        };
        let plain = surface(&material, &images);
        assert_eq!(plain.entries.len(), 1);
        let expected = Vec3::new(0.5, 0.25, MAX_VOXEL_ALBEDO);
        assert!(
            albedo(plain.entries[0]).abs_diff_eq(expected, 0.003),
            "metal, too"
        );
        let elsewhere = Elsewhere {
            mirrored: true,
            ..Elsewhere::default()
        };
        let mesh = Rectangle::new(1.0, 1.0).mesh().build();
        let geometry = MeshGeometry::new(&mesh).expect("a rectangle");
        let left = mesh_surface(Some(&mesh), &geometry, &material, &images, elsewhere);
        assert!(left.lamps_elsewhere && !plain.lamps_elsewhere);
        assert_eq!(plain.metal, Some(material.perceptual_roughness));
        let wood = StandardMaterial {
            metallic: 0.0,
            ..material.clone()
        };
        assert_eq!(surface(&wood, &images).metal, None);
        assert_eq!(left.entries, plain.entries, "other light still bounces");
        let light = voxel_radiance_unpack(plain.entries[0].emission);
        assert!(
            light.abs_diff_eq(Vec3::new(300.0, 20.0, 1.0), 2.0),
            "{light}"
        );
        assert!(plain.emissive && !plain.two_sided);
    }

    #[test]
    fn a_texture_is_averaged_in_linear_light() {
        let mut images = Assets::<Image>::default();
        // Half white, half black, in sRGB.
        let texels = [[255, 255, 255, 255], [0, 0, 0, 255]].repeat(2).concat();
        let image = Image::new(
            Extent3d {
                width: 2,
                height: 2,
                depth_or_array_layers: 1,
            },
            TextureDimension::D2,
            texels,
            TextureFormat::Rgba8UnormSrgb,
            RenderAssetUsages::default(),
        );
        let material = StandardMaterial {
            base_color_texture: Some(images.add(image)),
            ..Default::default()
        };
        let table = surface(&material, &images);
        assert_eq!(table.entries.len(), 2);
        let mean = (albedo(table.entries[0]) + albedo(table.entries[1])) * 0.5;
        assert!(mean.abs_diff_eq(Vec3::splat(0.5), 0.1), "{mean}");
        assert_eq!(table.images.len(), 1);
    }

    #[test]
    fn what_takes_no_part_in_lighting_is_left_out() {
        assert!(is_voxelized(&StandardMaterial::default()));
        for material in [
            StandardMaterial {
                unlit: true,
                ..Default::default()
            },
            StandardMaterial {
                alpha_mode: AlphaMode::Blend,
                ..Default::default()
            },
            StandardMaterial {
                specular_transmission: 1.0,
                ..Default::default()
            },
        ] {
            assert!(!is_voxelized(&material));
        }
        let masked = StandardMaterial {
            alpha_mode: AlphaMode::Mask(0.5),
            base_color: Color::linear_rgba(1.0, 1.0, 1.0, 0.2),
            ..Default::default()
        };
        let surface = surface(&masked, &Assets::default());
        assert_eq!(
            surface.entries[0].albedo >> 24,
            0,
            "below the cutoff nothing is there"
        );
    }
}
