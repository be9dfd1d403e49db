//! Every shader composes with Bevy's own modules and is valid for every set of shader definitions, and agrees with Rust on
//! constants and layouts. Needs no GPU.

use akari_gpu_test::{layout_fault, u32_constants, workgroup_size};
use akari_interreflection::types::{
    AGGREGATE_WORKGROUP, BLOCKER_COUNT_BITS, FLAG_TWO_SIDED, GpuBlockerNode, GpuCluster,
    GpuClusterLight, GpuInterreflectionView, GpuReflectedSky, GpuReflectorMaterial, GpuTriangle,
    IRRADIANCE_WORKGROUP, MIXED_MATERIAL, RECEIVERS_GLOSSY, RECEIVERS_MATTE,
};
use bevy::math::Vec3;
use bevy::render::render_resource::ShaderType;
use std::path::Path;

#[path = "../../akari_render/tests/shader_composer/mod.rs"]
mod shader_composer;

use shader_composer::{Composer, Entry, choices, list_faults};

const TYPES: &str = include_str!("../src/types.wgsl");
const LIBRARIES: &[(&str, &str)] = &[
    ("types.wgsl", TYPES),
    ("lights.wgsl", include_str!("../src/lights.wgsl")),
    ("clusters.wgsl", include_str!("../src/clusters.wgsl")),
    ("bindings.wgsl", include_str!("../src/bindings.wgsl")),
    ("occlusion.wgsl", include_str!("../src/occlusion.wgsl")),
    ("receiver.wgsl", include_str!("../src/receiver.wgsl")),
    ("diffuse.wgsl", include_str!("../src/diffuse.wgsl")),
    ("mirror.wgsl", MIRROR),
    ("open.wgsl", include_str!("../src/open.wgsl")),
    ("sky.wgsl", include_str!("../src/sky.wgsl")),
    ("sky_mirror.wgsl", include_str!("../src/sky_mirror.wgsl")),
    ("walk.wgsl", include_str!("../src/walk.wgsl")),
];
/// After the bind group of rays.
const SKY: &[&str] = &["SKY", "SKY_GROUP=2"];
const LTC_LAYER: &str = include_str!("../../akari_render/src/ltc_layer.wgsl");
const SCENE_LIGHTS: &str = include_str!("../../akari_render/src/scene_lights.wgsl");
const RENDER_SKY: &str = include_str!("../../akari_render/src/sky.wgsl");
const MIRROR: &str = include_str!("../src/mirror.wgsl");

fn irradiance() -> Entry {
    Entry {
        file: "irradiance.wgsl",
        source: include_str!("../src/irradiance.wgsl"),
        entry_point: "irradiance",
        definitions: choices(&[&[&[], &["SHADOW_RAYS"]], &[&[], SKY]]),
    }
}

fn aggregate() -> Entry {
    Entry {
        file: "aggregate.wgsl",
        source: include_str!("../src/aggregate.wgsl"),
        entry_point: "aggregate",
        definitions: choices(&[]),
    }
}

fn shade() -> Entry {
    Entry {
        file: "shade.wgsl",
        source: include_str!("../src/shade.wgsl"),
        entry_point: "fragment",
        definitions: choices(&[
            &[
                &["PATCHES"],
                &["MIRRORS", "TERMS=3"],
                &["MIRRORS", "BENDS", "TERMS=3"],
                &["MIRRORS", "COSINE_LOBES", "TERMS=1"],
                &["PATCHES", "MIRRORS", "BENDS", "COSINE_LOBES", "TERMS=2"],
            ],
            &[&[], &["CLUSTERS"]],
            &[&[], &["GLOSSY_RECEIVERS"]],
            &[&[], &["SHADOW_RAYS"]],
            &[&[], SKY],
        ]),
    }
}

fn classify() -> Entry {
    Entry {
        file: "classify.wgsl",
        source: include_str!("../src/classify.wgsl"),
        entry_point: "fragment",
        definitions: choices(&[]),
    }
}

fn composer(mirror: &'static str) -> Composer {
    let gbuffer = include_str!("../../akari_render/src/gbuffer.wgsl");
    let mut libraries = [
        LIBRARIES,
        &[
            ("gbuffer.wgsl", gbuffer),
            ("ltc_layer.wgsl", LTC_LAYER),
            ("scene_lights.wgsl", SCENE_LIGHTS),
            ("render/sky.wgsl", RENDER_SKY),
        ],
    ]
    .concat();
    for (file, source) in &mut libraries {
        if *file == "mirror.wgsl" {
            *source = mirror;
        }
    }
    Composer::new(
        &libraries,
        &[&irradiance(), &aggregate(), &classify(), &shade()],
    )
}

#[test]
fn every_shader_is_valid_for_every_set_of_definitions() {
    let mut valid = composer(MIRROR);
    for entry in [irradiance(), aggregate(), classify(), shade()] {
        if let Err(error) = valid.compose_all(&entry) {
            panic!("{error}");
        }
    }
    let from = "mix(polygon.integral, mixed, share)";
    assert!(MIRROR.contains(from));
    let wrong = MIRROR.replacen(from, "mix(polygon, mixed, share)", 1);
    let mut invalid = composer(String::leak(wrong));
    let source = || shade().source.to_owned();
    let by_nodes = ["MIRRORS", "TERMS=3"];
    assert!(invalid.compose("a.wgsl", source(), &by_nodes).is_ok());
    let by_lobes = ["MIRRORS", "TERMS=3", "COSINE_LOBES"];
    assert!(invalid.compose("a.wgsl", source(), &by_lobes).is_err());
}

#[test]
fn every_shader_and_definition_is_tried() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let entries = [&irradiance(), &aggregate(), &classify(), &shade()];
    let faults = list_faults(&source, &entries, LIBRARIES);
    assert_eq!(faults, [""; 0]);
    assert!(!list_faults(&source, &[&shade()], LIBRARIES).is_empty());
}

fn types_module() -> naga::Module {
    let source: String = TYPES
        .lines()
        .filter(|line| !line.starts_with('#'))
        .flat_map(|line| [line, "\n"])
        .collect();
    naga::front::wgsl::parse_str(&source).expect("types.wgsl")
}

#[test]
fn constants_and_workgroups_agree() {
    let module = types_module();
    let mut found = u32_constants(&module);
    assert_eq!(found.len(), module.constants.len());
    for (name, value) in [
        ("IRRADIANCE_WORKGROUP", IRRADIANCE_WORKGROUP),
        ("AGGREGATE_WORKGROUP", AGGREGATE_WORKGROUP),
        ("MIXED_MATERIAL", MIXED_MATERIAL),
        ("FLAG_TWO_SIDED", FLAG_TWO_SIDED),
        ("BLOCKER_COUNT_BITS", BLOCKER_COUNT_BITS),
        ("RECEIVERS_MATTE", RECEIVERS_MATTE),
        ("RECEIVERS_GLOSSY", RECEIVERS_GLOSSY),
    ] {
        assert_eq!(found.remove(name), Some(value), "{name}");
    }
    assert!(found.is_empty(), "{found:?}");
    for (entry, size) in [
        (irradiance(), IRRADIANCE_WORKGROUP),
        (aggregate(), AGGREGATE_WORKGROUP),
    ] {
        let module = composer(MIRROR)
            .compose(entry.file, entry.source.to_owned(), &[])
            .expect(entry.file);
        let found = workgroup_size(&module, entry.entry_point);
        assert_eq!(found, Some([size, 1, 1]), "{}", entry.file);
    }
}

/// [`layout_fault`] of a value of a struct in `types.wgsl`.
fn fault<T: ShaderType + encase::internal::WriteInto>(
    name: &str,
    value: &T,
    fields: &[(&str, u32)],
) -> Option<String> {
    let mut buffer = encase::StorageBuffer::new(Vec::<u8>::new());
    buffer.write(value).expect("a write to memory");
    layout_fault(
        &types_module(),
        name,
        T::min_size().get(),
        buffer.as_ref(),
        fields,
    )
}

#[test]
fn layouts_agree() {
    let at = |value: f32| Vec3::new(value, 0.0, 0.0);
    let triangle = GpuTriangle {
        a: at(1.0),
        material: 2,
        b: at(3.0),
        flags: 4,
        c: at(5.0),
        pad: 6,
        normal_a: at(7.0),
        normal_b: at(8.0),
        normal_c: at(9.0),
    };
    let float = f32::to_bits;
    let fields = [
        ("a", float(1.0)),
        ("material", 2),
        ("b", float(3.0)),
        ("flags", 4),
        ("c", float(5.0)),
        ("pad", 6),
        ("normal_a", float(7.0)),
        ("normal_b", float(8.0)),
        ("normal_c", float(9.0)),
    ];
    assert_eq!(fault("Triangle", &triangle, &fields), None);
    let mut wrong = fields;
    wrong[3].1 = 5;
    assert!(fault("Triangle", &triangle, &wrong).is_some());
    let material = GpuReflectorMaterial {
        diffuse_color: at(1.0),
        perceptual_roughness: 2.0,
        normal_reflectance: at(3.0),
        grazing_reflectance: 4.0,
        dielectric_normal_reflectance: 5.0,
        dielectric_grazing_reflectance: 6.0,
    };
    let fields = [
        ("diffuse_color", float(1.0)),
        ("perceptual_roughness", float(2.0)),
        ("normal_reflectance", float(3.0)),
        ("grazing_reflectance", float(4.0)),
        ("dielectric_normal_reflectance", float(5.0)),
        ("dielectric_grazing_reflectance", float(6.0)),
    ];
    assert_eq!(fault("ReflectorMaterial", &material, &fields), None);
    let cluster = GpuCluster {
        center: at(1.0),
        skip: 2,
        axis_u: at(3.0),
        first: 4,
        axis_v: at(5.0),
        count: 6,
        normal: at(7.0),
        material: 8,
        radius: 9.0,
        turn: 10.0,
        deviation: 11.0,
        mismatch: 12.0,
        rim: 13.0,
        area: 14.0,
        flags: 15,
        stray: 16.0,
        bend_u: at(17.0),
        bend_v: at(18.0),
    };
    let fields = [
        ("center", float(1.0)),
        ("skip", 2),
        ("axis_u", float(3.0)),
        ("first", 4),
        ("axis_v", float(5.0)),
        ("count", 6),
        ("normal", float(7.0)),
        ("material", 8),
        ("radius", float(9.0)),
        ("turn", float(10.0)),
        ("deviation", float(11.0)),
        ("mismatch", float(12.0)),
        ("rim", float(13.0)),
        ("area", float(14.0)),
        ("flags", 15),
        ("stray", float(16.0)),
        ("bend_u", float(17.0)),
        ("bend_v", float(18.0)),
    ];
    assert_eq!(fault("Cluster", &cluster, &fields), None);
    let light = GpuClusterLight {
        mean: at(1.0),
        brightest: 2.0,
        slope_u: at(3.0),
        residual: 4.0,
        slope_v: at(5.0),
        pad: 6.0,
    };
    let fields = [
        ("mean", float(1.0)),
        ("brightest", float(2.0)),
        ("slope_u", float(3.0)),
        ("residual", float(4.0)),
        ("slope_v", float(5.0)),
        ("pad", float(6.0)),
    ];
    assert_eq!(fault("ClusterLight", &light, &fields), None);
    let view = GpuInterreflectionView {
        patches: 1,
        glossy: 2,
        lights: 3,
        lighting_pass_id: 6,
        patch_clusters: 7,
        clusters: 8,
        levels: 9,
        cut: 10.0,
        shadow_rays: 11,
        receivers: 12,
        low: at(13.0),
        high: at(14.0),
    };
    let fields = [
        ("patches", 1),
        ("glossy", 2),
        ("lights", 3),
        ("lighting_pass_id", 6),
        ("patch_clusters", 7),
        ("clusters", 8),
        ("levels", 9),
        ("cut", float(10.0)),
        ("shadow_rays", 11),
        ("receivers", 12),
        ("low", float(13.0)),
        ("high", float(14.0)),
    ];
    assert_eq!(fault("InterreflectionView", &view, &fields), None);
    let node = GpuBlockerNode {
        low: at(1.0),
        skip: 2,
        high: at(3.0),
        leaf: 4,
    };
    let fields = [
        ("low", float(1.0)),
        ("skip", 2),
        ("high", float(3.0)),
        ("leaf", 4),
    ];
    assert_eq!(fault("BlockerNode", &node, &fields), None);
    let sky = GpuReflectedSky {
        to_map: at(1.0).extend(0.0),
        intensity: 2.0,
        last_level: 3.0,
    };
    let mut fields = [
        ("to_map", float(1.0)),
        ("intensity", float(2.0)),
        ("last_level", float(3.0)),
    ];
    assert_eq!(fault("ReflectedSky", &sky, &fields), None);
    fields[1].1 = float(3.0);
    assert!(fault("ReflectedSky", &sky, &fields).is_some());
}
