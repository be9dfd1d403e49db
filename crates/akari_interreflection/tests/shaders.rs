//! Every shader composes with Bevy's own modules and is valid for every set of shader definitions, and agrees with Rust on
//! constants and layouts. Needs no GPU.

use akari_gpu_test::{layout_fault, u32_constants, workgroup_size};
use akari_interreflection::types::{
    FLAG_TWO_SIDED, GpuInterreflectionView, GpuReflectorMaterial, GpuTriangle,
    IRRADIANCE_WORKGROUP, KIND_DIRECTIONAL, KIND_POINT, KIND_POLYGON, LIGHT_STRIDE,
};
use bevy::math::{UVec2, Vec3};
use bevy::render::render_resource::ShaderType;
use std::path::Path;

#[path = "../../akari_render/tests/shader_composer/mod.rs"]
mod shader_composer;

use shader_composer::{Composer, Entry, choices, list_faults};

const TYPES: &str = include_str!("../src/types.wgsl");
const LIBRARIES: &[(&str, &str)] = &[
    ("types.wgsl", TYPES),
    ("lights.wgsl", include_str!("../src/lights.wgsl")),
];

fn irradiance() -> Entry {
    Entry {
        file: "irradiance.wgsl",
        source: include_str!("../src/irradiance.wgsl"),
        entry_point: "irradiance",
        definitions: choices(&[]),
    }
}

fn shade() -> Entry {
    Entry {
        file: "shade.wgsl",
        source: include_str!("../src/shade.wgsl"),
        entry_point: "fragment",
        definitions: choices(&[&[&[], &["COSINE_LOBES"]]]),
    }
}

fn composer() -> Composer {
    let gbuffer = include_str!("../../akari_render/src/gbuffer.wgsl");
    let libraries = [LIBRARIES, &[("gbuffer.wgsl", gbuffer)]].concat();
    Composer::new(&libraries, &[&irradiance(), &shade()])
}

#[test]
fn every_shader_is_valid_for_every_set_of_definitions() {
    let mut composer = composer();
    for entry in [irradiance(), shade()] {
        if let Err(error) = composer.compose_all(&entry) {
            panic!("{error}");
        }
    }
    let shade = shade();
    let from = "mix(polygon.integral, mixed, share)";
    assert!(shade.source.contains(from));
    let wrong = shade.source.replacen(from, "mix(polygon, mixed, share)", 1);
    assert!(composer.compose("a.wgsl", wrong.clone(), &[]).is_ok());
    assert!(
        composer
            .compose("a.wgsl", wrong, &["COSINE_LOBES"])
            .is_err()
    );
}

#[test]
fn every_shader_and_definition_is_tried() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let faults = list_faults(&source, &[&irradiance(), &shade()], LIBRARIES);
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
        ("FLAG_TWO_SIDED", FLAG_TWO_SIDED),
        ("LIGHT_STRIDE", LIGHT_STRIDE),
        ("KIND_DIRECTIONAL", KIND_DIRECTIONAL),
        ("KIND_POINT", KIND_POINT),
        ("KIND_POLYGON", KIND_POLYGON),
    ] {
        assert_eq!(found.remove(name), Some(value), "{name}");
    }
    assert!(found.is_empty(), "{found:?}");
    let entry = irradiance();
    let module = composer()
        .compose(entry.file, entry.source.to_owned(), &[])
        .expect("irradiance.wgsl");
    assert_eq!(
        workgroup_size(&module, entry.entry_point),
        Some([IRRADIANCE_WORKGROUP, 1, 1])
    );
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
    let view = GpuInterreflectionView {
        patches: 1,
        glossy: 2,
        lights: 3,
        nodes: 4,
        lobes: 5,
        lighting_pass_id: 6,
        pad: UVec2::new(7, 0),
    };
    let fields = [
        ("patches", 1),
        ("glossy", 2),
        ("lights", 3),
        ("nodes", 4),
        ("lobes", 5),
        ("lighting_pass_id", 6),
        ("pad", 7),
    ];
    assert_eq!(fault("InterreflectionView", &view, &fields), None);
}
