//! Settings of the interreflection of a view.

use akari_render::prelude::*;
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// Nodes an edge of the tiers above [`LAST_COSINE_TIER`], in order.
pub const NODES: [u32; 6] = [1, 2, 3, 4, 6, 8];
/// Tiers up to this one use as many cosine lobes as their number.
pub const LAST_COSINE_TIER: u32 = 3;

/// Most rays of a contribution.
pub const MOST_SHADOW_RAYS: u32 = 16;

/// How light between reflectors and what a camera sees is computed. On a camera, for that camera; every other
/// [`AkariCamera`] takes [`DefaultInterreflection`].
#[derive(Component, Debug, Clone, Copy, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Debug, Clone, PartialEq, Serialize, Deserialize)]
#[require(AkariCamera)]
#[serde(default, deny_unknown_fields)]
pub struct Interreflection {
    /// How a spherical Gaussian is integrated over a triangle: 1 to 3 cosine lobes (Okada and Iwasaki 2017), or, from 4 to 9,
    /// 1, 2, 3, 4, 6 or 8 nodes on each edge (`akari_math::sg::polygon`).
    pub tier: u32,
    /// Longest edge of a patch of a diffuse reflector, as a share of its distance from the nearest light. 0.05 to 4.
    ///
    /// Radiance is exact at the corners of patches and interpolated between them. Where rays are sent, patches are also no
    /// longer than 0.4 of this share of a body that may throw its shadow on them, and near it than 0.8 of this share of its
    /// parts, of which the smallest are an eighth of it.
    pub patch: f32,
    /// Most patches of all reflectors together. 64 to 65,536: where they would be more, all become larger alike.
    pub most_patches: u32,
    /// Largest error of a cluster of triangles behind one rectangle, relative to the cluster's own light under the
    /// receiver's largest weight in it (`akari_math::cluster`); where that light is little, a fiftieth of this share of white
    /// in proportion to the cluster's solid angle. 0 to 1: 0 visits every triangle.
    pub cut: f32,
    /// Rays, for each light that a triangle or cluster sends to a pixel, that look whether an opaque mesh holds it back, and as
    /// many from where it is mirrored to the light. 0 to 16: 0 lets all light through. Where some of a cluster's rays are held
    /// back, its parts are looked at. Where shadows may fall on diffuse reflectors, patches are finer.
    pub shadow_rays: u32,
}

/// Settings of every camera that has an [`AkariCamera`] but no [`Interreflection`].
#[derive(Resource, Debug, Default, Clone, Copy, PartialEq, Reflect)]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
pub struct DefaultInterreflection(pub Interreflection);

impl Default for Interreflection {
    fn default() -> Self {
        Self::preset(Quality::default())
    }
}

impl Interreflection {
    /// Cosine lobes of the tier, if it is one of those.
    pub fn cosine_lobes(&self) -> Option<u32> {
        (self.tier <= LAST_COSINE_TIER).then(|| self.tier.max(1))
    }

    /// Nodes an edge of the tier, if it has any.
    pub fn nodes(&self) -> Option<u32> {
        let index = self.tier.checked_sub(LAST_COSINE_TIER + 1)?;
        Some(NODES[(index as usize).min(NODES.len() - 1)])
    }
}

impl Knobs for Interreflection {
    const KNOBS: &'static [Knob] = &[
        Knob {
            name: "tier",
            what: "integral of a lobe over a triangle: 1 to 3 cosine lobes; 4 to 9: 1, 2, 3, 4, 6, 8 nodes an edge",
            min: 1.0,
            max: 9.0,
            integer: true,
            presets: [4.0, 5.0, 6.0, 9.0],
            cost: "8 nodes cost 1.8 times what 1 node does",
        },
        Knob {
            name: "patch",
            what: "longest edge of a diffuse patch over its distance from the nearest light",
            min: 0.05,
            max: 4.0,
            integer: false,
            presets: [1.0, 0.5, 0.25, 0.125],
            cost: "half the edge makes four times the patches",
        },
        Knob {
            name: "most_patches",
            what: "diffuse patches of all reflectors together",
            min: 64.0,
            max: 65536.0,
            integer: true,
            presets: [512.0, 2048.0, 8192.0, 65536.0],
            cost: "without clusters, time of a pixel grows with the patches",
        },
        Knob {
            name: "cut",
            what: "largest error of a cluster of triangles over its light; 0 visits every triangle",
            min: 0.0,
            max: 1.0,
            integer: false,
            presets: [0.6, 0.3, 0.15, 0.08],
            cost: "half the error makes about twice the clusters",
        },
        Knob {
            name: "shadow_rays",
            what: "rays that look whether opaque meshes hold light back, for each light of a triangle or cluster; 0 is none",
            min: 0.0,
            max: MOST_SHADOW_RAYS as f32,
            integer: true,
            presets: [0.0, 1.0, 3.0, 7.0],
            cost: "each is a walk through a tree of boxes, two of what is mirrored; little beside the integrals of metal",
        },
    ];

    akari_render::knob_fields!(tier, patch, most_patches, cut, shadow_rays);
}

#[cfg(test)]
mod tests {
    use super::*;
    use akari_render::quality::knob_faults;

    #[test]
    fn fields_are_knobs() {
        let fields = ["tier", "patch", "most_patches", "cut", "shadow_rays"];
        assert_eq!(knob_faults::<Interreflection>(&fields), [""; 0]);
    }

    #[test]
    fn each_tier_is_lobes_or_nodes() {
        let of = |tier| {
            let settings = Interreflection {
                tier,
                ..Interreflection::default()
            };
            (settings.cosine_lobes(), settings.nodes())
        };
        assert_eq!(of(3), (Some(3), None));
        assert_eq!(of(4), (None, Some(1)));
        assert_eq!(of(9), (None, Some(8)));
        assert_eq!(of(99), (None, Some(8)));
    }
}
