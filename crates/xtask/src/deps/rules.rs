//! The table of `ARCHITECTURE.md` as data: which crate may use which.

/// What of the engine a crate may reach through its normal and build dependencies, directly or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Engine {
    /// Neither Bevy nor a graphics API.
    None,
    /// wgpu and naga, without Bevy.
    Device,
    /// Everything.
    Bevy,
}

impl Engine {
    pub fn in_words(self) -> &'static str {
        match self {
            Self::None => "nothing of the engine",
            Self::Device => "wgpu and naga only",
            Self::Bevy => "all of the engine",
        }
    }
}

/// One row of the table.
#[derive(Debug)]
pub struct Rule {
    /// Package name.
    pub package: &'static str,
    /// Packages of this workspace it may depend on.
    pub may_use: &'static [&'static str],
    /// Packages of this workspace that its tests may use beyond `may_use`.
    pub tests_may_use: &'static [&'static str],
    pub engine: Engine,
    /// Where given, the only packages from outside the workspace it may depend on.
    pub only: Option<&'static [&'static str]>,
}

const EVERY_LIBRARY: &[&str] = &[
    "akari_area_light",
    "akari_bake",
    "akari_denoise",
    "akari_interreflection",
    "akari_lobes",
    "akari_math",
    "akari_reference",
    "akari_render",
    "akari_scene",
    "akari_visibility",
    "akari_voxel_gi",
    "bevy_akari",
];
/// For tests only; nothing that is published may need them.
const TEST_TOOLS: &[&str] = &["akari_gpu_test", "akari_ltc_fit"];

pub const RULES: &[Rule] = &[
    Rule {
        package: "akari_math",
        may_use: &[],
        tests_may_use: &["akari_gpu_test"],
        engine: Engine::None,
        only: Some(&["bytemuck", "encase", "glam", "half", "thiserror"]),
    },
    Rule {
        package: "akari_gpu_test",
        may_use: &[],
        tests_may_use: &[],
        engine: Engine::Device,
        only: None,
    },
    Rule {
        package: "akari_scene",
        may_use: &["akari_math"],
        tests_may_use: &[],
        engine: Engine::None,
        only: None,
    },
    Rule {
        package: "akari_reference",
        may_use: &["akari_math", "akari_scene"],
        tests_may_use: &[],
        engine: Engine::None,
        only: None,
    },
    Rule {
        package: "akari_ltc_fit",
        may_use: &["akari_math"],
        tests_may_use: &[],
        engine: Engine::None,
        only: None,
    },
    Rule {
        package: "akari_render",
        may_use: &["akari_math"],
        tests_may_use: &["akari_gpu_test"],
        engine: Engine::Bevy,
        only: None,
    },
    Rule {
        package: "akari_area_light",
        may_use: &["akari_math", "akari_render", "akari_visibility"],
        tests_may_use: &["akari_gpu_test"],
        engine: Engine::Bevy,
        only: None,
    },
    Rule {
        package: "akari_lobes",
        may_use: &["akari_math", "akari_render"],
        tests_may_use: &["akari_gpu_test"],
        engine: Engine::Bevy,
        only: None,
    },
    Rule {
        package: "akari_voxel_gi",
        may_use: &["akari_math", "akari_render"],
        tests_may_use: &["akari_gpu_test"],
        engine: Engine::Bevy,
        only: None,
    },
    Rule {
        package: "akari_interreflection",
        may_use: &["akari_math", "akari_render"],
        tests_may_use: &["akari_gpu_test"],
        engine: Engine::Bevy,
        only: None,
    },
    Rule {
        package: "akari_denoise",
        may_use: &["akari_math", "akari_render"],
        tests_may_use: &["akari_gpu_test"],
        engine: Engine::Bevy,
        only: None,
    },
    Rule {
        package: "akari_bake",
        may_use: &["akari_scene", "akari_visibility"],
        // The path tracer's rays are what the bits are held against.
        tests_may_use: &["akari_reference"],
        engine: Engine::None,
        only: None,
    },
    Rule {
        package: "akari_visibility",
        may_use: &["akari_math"],
        tests_may_use: &["akari_gpu_test"],
        engine: Engine::None,
        only: None,
    },
    Rule {
        package: "bevy_akari",
        may_use: &[
            "akari_area_light",
            "akari_denoise",
            "akari_interreflection",
            "akari_lobes",
            "akari_math",
            "akari_render",
            "akari_visibility",
            "akari_voxel_gi",
        ],
        tests_may_use: &[],
        engine: Engine::Bevy,
        only: None,
    },
    Rule {
        package: "akari_cli",
        may_use: EVERY_LIBRARY,
        tests_may_use: &[],
        engine: Engine::Bevy,
        only: None,
    },
    Rule {
        package: "xtask",
        may_use: &["akari_ltc_fit"],
        tests_may_use: &[],
        engine: Engine::None,
        only: None,
    },
    Rule {
        package: "bevy_akari_examples",
        // An example may bake its scene, and hold it against rays.
        may_use: &["akari_bake", "akari_reference", "bevy_akari"],
        tests_may_use: &[],
        engine: Engine::Bevy,
        only: None,
    },
    Rule {
        package: "bevy_akari_tests",
        may_use: EVERY_LIBRARY,
        tests_may_use: TEST_TOOLS,
        engine: Engine::Bevy,
        only: None,
    },
    Rule {
        package: "bevy_akari_benches",
        may_use: EVERY_LIBRARY,
        // What the render tests measure, the benches measure more finely.
        tests_may_use: &["akari_gpu_test", "akari_ltc_fit", "bevy_akari_tests"],
        engine: Engine::Bevy,
        only: None,
    },
];

/// Packages of which the workspace holds exactly one version: two of them would be two engines, whose types differ.
pub const SINGLE: &[&str] = &["bevy_app", "bevy_ecs", "glam", "naga", "wgpu"];

/// The smallest [`Engine`] that allows a package from outside the workspace.
pub fn engine_of(package: &str) -> Engine {
    if package == "bevy" || package.starts_with("bevy_") {
        Engine::Bevy
    } else if package == "naga"
        || package == "wgpu"
        || package.starts_with("wgpu-")
        || package == "naga_oil"
    {
        Engine::Device
    } else {
        Engine::None
    }
}
