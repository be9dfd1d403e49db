//! Which shading pipelines a view needs, and which of them draw it meanwhile.

use crate::pipeline::InterreflectionPipelines;
use crate::receivers::ReceiverKinds;
use crate::settings::Interreflection;
use crate::types::{RECEIVERS_GLOSSY, RECEIVERS_MATTE};
use bevy::prelude::*;
use bevy::render::render_resource::*;
use bevy::shader::ShaderDefVal;

/// Label of the pass that marks the pixels that receive light, and of its time span.
pub const CLASSIFY_LABEL: &str = "akari_interreflection_classify";
/// Format of the marks: small whole numbers over 255, which it holds exactly.
pub const CLASS_FORMAT: TextureFormat = TextureFormat::Depth16Unorm;
/// Bytes of a pixel's mark.
pub const CLASS_BYTES: u64 = 2;

/// What the reflectors of a scene call for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct ReflectorKinds {
    /// Whether there are diffuse patches.
    pub patches: bool,
    /// Whether there are glossy triangles.
    pub mirrors: bool,
    /// Whether any of those, or of their clusters, has normals that turn.
    pub bends: bool,
    /// Whether there are clusters.
    pub clusters: bool,
}

/// How lobes of mirrors are integrated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Integral {
    /// By so many cosine lobes.
    CosineLobes(u32),
    /// By so many nodes an edge.
    Nodes(u32),
}

impl Integral {
    /// That of the settings.
    pub fn of(settings: &Interreflection) -> Self {
        match (settings.cosine_lobes(), settings.nodes()) {
            (Some(lobes), _) => Self::CosineLobes(lobes),
            (None, nodes) => Self::Nodes(nodes.unwrap_or(1)),
        }
    }
}

/// What makes one shading pipeline differ from another: it holds the code for what is there and nothing else.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ShadeKey {
    /// Format of the view target.
    pub target_format: TextureFormat,
    /// How lobes are integrated, if there are mirrors.
    pub integral: Option<Integral>,
    /// Whether rays look what reflectors hold back.
    pub shadow_rays: bool,
    /// Whether mirrors show the sky.
    pub sky: bool,
    /// What there is to reflect.
    pub reflectors: ReflectorKinds,
    /// Whether the receivers have specular lobes.
    pub glossy_receivers: bool,
}

impl ShadeKey {
    /// The definitions beside those of bind groups.
    pub fn definitions(&self) -> Vec<ShaderDefVal> {
        let kinds = self.reflectors;
        let mut definitions: Vec<ShaderDefVal> = [
            (kinds.patches, "PATCHES"),
            (kinds.mirrors, "MIRRORS"),
            (kinds.bends, "BENDS"),
            (kinds.clusters, "CLUSTERS"),
            (self.glossy_receivers, "GLOSSY_RECEIVERS"),
        ]
        .into_iter()
        .filter(|(wanted, _)| *wanted)
        .map(|(_, name)| name.into())
        .collect();
        match self.integral {
            Some(Integral::CosineLobes(lobes)) => {
                definitions.push("COSINE_LOBES".into());
                definitions.push(ShaderDefVal::UInt("TERMS".into(), lobes));
            }
            Some(Integral::Nodes(nodes)) => {
                definitions.push(ShaderDefVal::UInt("TERMS".into(), nodes));
            }
            None => {}
        }
        definitions
    }

    /// Whether its pipeline can draw what `wanted` is there for, with other settings perhaps: nothing is left out, and what it
    /// reads is bound.
    pub fn can_draw(&self, wanted: &Self) -> bool {
        let (have, need) = (self.reflectors, wanted.reflectors);
        self.target_format == wanted.target_format
            && (wanted.shadow_rays || !self.shadow_rays)
            // Its bind group comes after that of rays.
            && self.sky == wanted.sky
            && (!self.sky || self.shadow_rays == wanted.shadow_rays)
            && (have.patches || !need.patches)
            && (have.mirrors || !need.mirrors)
            && (have.bends || !need.bends)
            && (have.clusters || !need.clusters)
    }
}

/// The pipelines that draw a view: the latest that were all ready.
#[derive(Debug, Clone, Default)]
pub struct Shading(Vec<(ShadeKey, CachedRenderPipelineId)>);

impl Shading {
    /// Asks for the pipelines of all kinds of receivers. While one of them is compiled, what drew before goes on if it can.
    pub fn want(
        &mut self,
        key: ShadeKey,
        receivers: ReceiverKinds,
        specialized: &mut SpecializedRenderPipelines<InterreflectionPipelines>,
        pipelines: &InterreflectionPipelines,
        cache: &PipelineCache,
    ) {
        let wanted: Vec<_> = [(receivers.matte, false), (receivers.glossy, true)]
            .into_iter()
            .filter(|(there, _)| *there)
            .map(|(_, glossy_receivers)| {
                let key = ShadeKey {
                    glossy_receivers,
                    ..key
                };
                (key, specialized.specialize(cache, pipelines, key))
            })
            .collect();
        let ready = |id| cache.get_render_pipeline(id).is_some();
        self.replace(wanted, ready);
    }

    fn replace(
        &mut self,
        wanted: Vec<(ShadeKey, CachedRenderPipelineId)>,
        ready: impl Fn(CachedRenderPipelineId) -> bool,
    ) {
        if wanted.iter().all(|(_, id)| ready(*id)) {
            self.0 = wanted;
        } else if !(self.0.iter()).all(|(old, _)| wanted.iter().all(|(new, _)| old.can_draw(new))) {
            self.0.clear();
        }
    }

    /// The pipelines, one for each kind of receivers.
    pub fn pipelines(&self) -> impl Iterator<Item = CachedRenderPipelineId> {
        self.0.iter().map(|(_, id)| *id)
    }

    /// Combination of `RECEIVERS_…`.
    pub fn receivers(&self) -> u32 {
        let kind = |key: &ShadeKey| {
            if key.glossy_receivers {
                RECEIVERS_GLOSSY
            } else {
                RECEIVERS_MATTE
            }
        };
        self.0.iter().fold(0, |kinds, (key, _)| kinds | kind(key))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key() -> ShadeKey {
        ShadeKey {
            target_format: TextureFormat::Rgba16Float,
            integral: Some(Integral::Nodes(3)),
            shadow_rays: false,
            sky: false,
            reflectors: ReflectorKinds {
                mirrors: true,
                ..ReflectorKinds::default()
            },
            glossy_receivers: false,
        }
    }

    #[test]
    fn what_drew_before_goes_on_while_it_leaves_nothing_out() {
        let id = |i| CachedRenderPipelineId::new(i);
        let mut shading = Shading::default();
        let drawn = |shading: &Shading| shading.pipelines().collect::<Vec<_>>();
        shading.replace(vec![(key(), id(0))], |_| false);
        assert_eq!(drawn(&shading), [], "nothing is ready");
        shading.replace(vec![(key(), id(0))], |_| true);
        assert_eq!(drawn(&shading), [id(0)]);
        let coarse = ShadeKey {
            integral: Some(Integral::CosineLobes(1)),
            ..key()
        };
        shading.replace(vec![(coarse, id(1))], |i| i == id(0));
        assert_eq!(drawn(&shading), [id(0)], "another tier is compiled");
        assert_eq!(shading.receivers(), RECEIVERS_MATTE);
        let glossy = ShadeKey {
            glossy_receivers: true,
            ..key()
        };
        let both = vec![(key(), id(0)), (glossy, id(2))];
        let with_sky = ShadeKey { sky: true, ..key() };
        assert!(!key().can_draw(&with_sky) && !with_sky.can_draw(&key()));
        shading.replace(both.clone(), |i| i == id(0));
        assert_eq!(shading.receivers(), RECEIVERS_MATTE, "one of two is ready");
        shading.replace(both, |_| true);
        assert_eq!(shading.receivers(), RECEIVERS_MATTE | RECEIVERS_GLOSSY);
        let mut more = key();
        more.reflectors.patches = true;
        shading.replace(vec![(more, id(3))], |i| i != id(3));
        assert_eq!(drawn(&shading), [], "patches would be missing");
    }

    #[test]
    fn a_pipeline_holds_what_is_there_and_nothing_else() {
        let names = |key: ShadeKey| {
            let list = key.definitions();
            let name = |definition: &ShaderDefVal| format!("{definition:?}");
            list.iter().map(name).collect::<Vec<_>>().join(" ")
        };
        let plain = names(key());
        assert!(plain.contains("MIRRORS") && plain.contains("UInt(\"TERMS\", 3)"));
        for absent in ["PATCHES", "BENDS", "CLUSTERS", "GLOSSY", "COSINE"] {
            assert!(!plain.contains(absent), "{plain}");
        }
        let none = ShadeKey {
            integral: None,
            reflectors: ReflectorKinds {
                patches: true,
                ..ReflectorKinds::default()
            },
            ..key()
        };
        assert!(!names(none).contains("TERMS"));
    }
}
