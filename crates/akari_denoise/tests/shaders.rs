//! Every shader composes with Bevy's own modules and is valid for every set of shader definitions, and agrees with Rust on
//! constants and layouts. Needs no GPU.

use akari_denoise::targets::LIST_HEADER;
use akari_denoise::types::{DIFFUSE_BIT, GpuDenoiseStage, GpuDenoiseView, SPECULAR_BIT, WORKGROUP};
use akari_gpu_test::{layout_fault, struct_layout, u32_constants, workgroup_size};
use akari_render::signals::RESAMPLE_WORKGROUP;
use bevy::math::{IVec2, Mat4, UVec2, Vec2, Vec3, Vec4};
use bevy::render::render_resource::ShaderType;
use naga::Module;
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

#[path = "../../akari_render/tests/shader_composer/mod.rs"]
mod shader_composer;

use shader_composer::{Composer, Entry, choices, list_faults};

const TYPES: &str = include_str!("../src/types.wgsl");

/// Modules of this crate that the entry shaders import.
const LIBRARIES: &[(&str, &str)] = &[
    ("types.wgsl", TYPES),
    ("signal.wgsl", include_str!("../src/signal.wgsl")),
    ("likeness.wgsl", include_str!("../src/likeness.wgsl")),
    ("weights.wgsl", include_str!("../src/weights.wgsl")),
    ("upsample.wgsl", include_str!("../src/upsample.wgsl")),
];

/// Modules of other crates that they import.
const BORROWED: &[(&str, &str)] = &[
    (
        "guides.wgsl",
        include_str!("../../akari_lobes/src/guides.wgsl"),
    ),
    (
        "tiles.wgsl",
        include_str!("../../akari_lobes/src/tiles.wgsl"),
    ),
    (
        "gbuffer.wgsl",
        include_str!("../../akari_render/src/gbuffer.wgsl"),
    ),
];

type Sets = &'static [&'static [&'static str]];

/// What decides how guides are declared: part of every pass but two.
const SOURCE: Sets = &[&[], &["EXTERNAL_GUIDES"]];
const LOBES: Sets = &[&[], &["STORED_LOBES"]];
const MODEL: Sets = &[&[], &["WANG_LOBES"]];
/// Specular, diffuse; and the same of a producer whose specular signal is that of glossy surfaces.
const SIGNAL: Sets = &[
    &[],
    &["DIFFUSE_SIGNAL"],
    &["GLOSSY_ONLY", "GLOSSY_SIGNAL"],
    &["DIFFUSE_SIGNAL", "GLOSSY_ONLY"],
];
/// Method of the filter.
const METHOD: Sets = &[
    &["METHOD_GUIDED", "LOBE_WEIGHT"],
    &["LOBE_WEIGHT"],
    &["METHOD_NORMAL"],
    &["METHOD_AXIS_ALIGNED"],
    &["METHOD_DISTRIBUTION"],
];
const SHAPE: Sets = &[&[], &["ANISOTROPIC"]];
const MARKS: Sets = &[&[], &["MARK_RESAMPLED"]];
/// Of the filter: the first stage, a later one.
const STAGE: Sets = &[&[], &["CHANGED"]];

fn entry(
    file: &'static str,
    source: &'static str,
    entry_point: &'static str,
    parts: &[Sets],
) -> Entry {
    Entry {
        file,
        source,
        entry_point,
        definitions: choices(&[&[SOURCE, LOBES, MODEL], parts].concat()),
    }
}

/// Without the sets that no pipeline asks for.
fn without(mut entry: Entry, never_together: [&str; 2]) -> Entry {
    entry
        .definitions
        .retain(|set| !never_together.iter().all(|name| set.contains(name)));
    entry
}

fn accumulate() -> Entry {
    // Full resolution, upsampled, upsampled with a list of pixels to be shaded again.
    let scale: Sets = &[&[], &["UPSAMPLE"], &["UPSAMPLE", "RESAMPLE"]];
    let likeness: Sets = &[&[], &["METHOD_NORMAL"], &["METHOD_GUIDED"]];
    let history: Sets = &[
        &[],
        &["HISTORY"],
        &["HISTORY", "MOTION_VECTORS"],
        &["HISTORY", "HIT_DISTANCE"],
        &["HISTORY", "MOTION_VECTORS", "HIT_DISTANCE"],
    ];
    let all = entry(
        "accumulate.wgsl",
        include_str!("../src/accumulate.wgsl"),
        "accumulate",
        &[SIGNAL, scale, likeness, history],
    );
    let mut all = without(all, ["DIFFUSE_SIGNAL", "HIT_DISTANCE"]);
    // One function looks at the method, whatever the history: only the default method is tried with every kind of it.
    all.definitions
        .retain(|set| set.contains(&"METHOD_GUIDED") || !set.contains(&"HISTORY"));
    all
}

fn arguments() -> Entry {
    Entry {
        file: "arguments.wgsl",
        source: include_str!("../src/arguments.wgsl"),
        entry_point: "resample_arguments",
        definitions: choices(&[]),
    }
}

fn merge() -> Entry {
    let source = include_str!("../src/merge.wgsl");
    entry("merge.wgsl", source, "merge", &[SIGNAL, MARKS])
}

fn remember() -> Entry {
    let source = include_str!("../src/remember.wgsl");
    let glossy: Sets = &[&[], &["GLOSSY_ONLY"]];
    entry("remember.wgsl", source, "remember", &[glossy])
}

fn residual() -> Entry {
    let source = include_str!("../src/residual.wgsl");
    entry("residual.wgsl", source, "residual", &[SIGNAL])
}

fn noise() -> Entry {
    let source = include_str!("../src/noise.wgsl");
    let pool: Sets = &[&[], &["NARROW"]];
    entry("noise.wgsl", source, "noise_variance", &[SIGNAL, pool])
}

fn guide() -> Entry {
    let method: Sets = &[&["METHOD_GUIDED", "LOBE_WEIGHT"], &["METHOD_DISTRIBUTION"]];
    let source = include_str!("../src/guide.wgsl");
    let all = entry("guide.wgsl", source, "prefilter", &[SIGNAL, method, SHAPE]);
    without(all, ["DIFFUSE_SIGNAL", "ANISOTROPIC"])
}

const FILTER: &str = include_str!("../src/filter.wgsl");

fn stage() -> Entry {
    let all = entry(
        "filter.wgsl",
        FILTER,
        "filter_stage",
        &[SIGNAL, METHOD, SHAPE, STAGE],
    );
    without(all, ["DIFFUSE_SIGNAL", "ANISOTROPIC"])
}

fn last_stage() -> Entry {
    let last: Sets = &[&["LAST_STAGE"], &["LAST_STAGE", "EXACT_SIGNAL"]];
    let all = entry(
        "filter.wgsl",
        FILTER,
        "filter_last",
        &[SIGNAL, METHOD, SHAPE, STAGE, last],
    );
    without(all, ["DIFFUSE_SIGNAL", "ANISOTROPIC"])
}

fn debug() -> Entry {
    let view: Sets = &[
        &["VIEW_LOBE_AXIS"],
        &["VIEW_LOBE_WIDTH"],
        &["VIEW_WEIGHTS"],
        &["VIEW_HISTORY"],
        &["VIEW_RESAMPLED"],
        &["VIEW_RESAMPLED", "MARK_RESAMPLED"],
    ];
    let history: Sets = &[&[], &["HISTORY"]];
    let mut all = entry(
        "debug.wgsl",
        include_str!("../src/debug.wgsl"),
        "debug",
        &[SIGNAL, METHOD, SHAPE, view, history],
    );
    // Only one view looks at the method: the others are tried under two of them.
    all.definitions.retain(|set| {
        set.contains(&"VIEW_WEIGHTS")
            || set.contains(&"METHOD_GUIDED")
            || set.contains(&"METHOD_NORMAL") && !set.contains(&"ANISOTROPIC")
    });
    all
}

fn split() -> Entry {
    Entry {
        file: "split.wgsl",
        source: include_str!("../src/split.wgsl"),
        entry_point: "split",
        definitions: choices(&[]),
    }
}

fn entries() -> [Entry; 11] {
    [
        accumulate(),
        arguments(),
        merge(),
        remember(),
        residual(),
        noise(),
        guide(),
        stage(),
        last_stage(),
        debug(),
        split(),
    ]
}

fn composer() -> Composer {
    Composer::new(
        &[LIBRARIES, BORROWED].concat(),
        &entries().each_ref().map(|entry| entry),
    )
}

/// An entry under the first of its sets of definitions that holds all of `names`.
fn composed(composer: &mut Composer, entry: &Entry, names: &[&str]) -> Arc<Module> {
    let set = entry
        .definitions
        .iter()
        .find(|set| names.iter().all(|name| set.contains(name)))
        .expect("such a set");
    composer
        .compose(entry.file, entry.source.to_owned(), set)
        .unwrap_or_else(|error| panic!("{} {set:?}: {error}", entry.file))
}

fn assert_valid(entries: &[Entry]) {
    let mut composer = composer();
    let mut sets = 0;
    for entry in entries {
        match composer.compose_all(entry) {
            Ok(modules) => sets += modules.len(),
            Err(error) => panic!("{error}"),
        }
    }
    println!("{sets} shaders are valid");
}

/// Most of the sets are of this shader: it has a test of its own, beside the others.
#[test]
fn the_accumulation_is_valid_for_every_set_of_definitions() {
    assert_valid(&[accumulate()]);
}

#[test]
fn every_other_shader_is_valid_for_every_set_of_definitions() {
    let [_, others @ ..] = entries();
    assert_valid(&others);
}

/// What is wrong under one set of definitions only, is found under that one.
#[test]
fn wrong_shaders_are_noticed() {
    let mut composer = composer();
    let accumulate = accumulate();
    let changed = |from: &str, to: &str| {
        assert!(
            accumulate.source.contains(from),
            "nothing to change: {from}"
        );
        accumulate.source.replacen(from, to, 1)
    };
    let history = ["UPSAMPLE", "HISTORY", "MOTION_VECTORS"];
    let mut outcome = |source: &str, definitions: &[&str]| {
        composer
            .compose("a.wgsl", source.to_owned(), definitions)
            .is_ok()
    };
    assert!(outcome(accumulate.source, &history));
    let wrong = changed(
        "frames = max(gathered.own, LEAST",
        "frames = max(gathered.owned, LEAST",
    );
    assert!(!outcome(&wrong, &["UPSAMPLE"]));
    let wrong = changed(
        "let motion = textureLoad(motion_vectors, pixel, 0).xy;",
        "let motion = textureLoad(motion_vectors, pixel).xy;",
    );
    assert!(outcome(&wrong, &["UPSAMPLE", "HISTORY"]));
    assert!(!outcome(&wrong, &history));
    let wrong = changed("akari_lobes::guides::", "akari_lobes::no_guides::");
    assert!(!outcome(&wrong, &[]));
}

#[test]
fn every_shader_and_definition_is_tried() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let all = entries();
    let all: Vec<&Entry> = all.iter().collect();
    assert_eq!(list_faults(&source, &all, LIBRARIES), [""; 0]);
    // Without the debug views their definitions and their file are missed.
    let fewer: Vec<&Entry> = all
        .iter()
        .copied()
        .filter(|entry| entry.file != "debug.wgsl")
        .collect();
    assert!(!list_faults(&source, &fewer, LIBRARIES).is_empty());
}

/// Names that a source file of the host quotes as shader definitions are written.
fn quoted(source: &str) -> BTreeSet<&str> {
    source
        .split('"')
        .skip(1)
        .step_by(2)
        .filter(|text| {
            let is_name = |c: char| c.is_ascii_uppercase() || c == '_';
            !text.is_empty() && text.chars().all(is_name)
        })
        .collect()
}

/// The sets above are written down by hand: whatever the host gives has to be among them, and nothing else.
#[test]
fn the_host_gives_these_definitions() {
    let mut given = quoted(include_str!("../src/plan.rs"));
    given.extend(quoted(include_str!("../src/debug.rs")));
    given.extend(quoted(include_str!("../../akari_lobes/src/pipeline.rs")));
    let all = entries();
    let tried: BTreeSet<&str> = all
        .iter()
        .flat_map(|entry| entry.definitions.iter().flatten().copied())
        .collect();
    assert_eq!(given, tried);
    assert_eq!(
        quoted(r#"defs.push("A_B"); info("Text"); c("D");"#),
        BTreeSet::from(["A_B", "D"])
    );
}

#[test]
fn workgroups_agree() {
    let mut composer = composer();
    let pixels = Some([WORKGROUP, WORKGROUP, 1]);
    for entry in [
        accumulate(),
        remember(),
        residual(),
        noise(),
        guide(),
        stage(),
    ] {
        let module = composed(&mut composer, &entry, &[]);
        let size = workgroup_size(&module, entry.entry_point);
        assert_eq!(size, pixels, "{}", entry.file);
    }
    let module = composed(&mut composer, &merge(), &[]);
    assert_eq!(
        workgroup_size(&module, "merge"),
        Some([RESAMPLE_WORKGROUP, 1, 1])
    );
    let module = composed(&mut composer, &arguments(), &[]);
    assert_eq!(
        workgroup_size(&module, "resample_arguments"),
        Some([1, 1, 1]),
        "a single invocation divides the list"
    );
    assert_eq!(
        u32_constants(&module).get("RESAMPLE_WORKGROUP"),
        Some(&RESAMPLE_WORKGROUP)
    );
}

/// The facade's producer of single pixels: it reads the list, and stands in a crate that has no test tools.
const PRODUCER: &str = include_str!("../../bevy_akari/src/resample.wgsl");

#[test]
fn lists_agree() {
    let mut composer = composer();
    let producer = composer
        .compose("resample.wgsl", PRODUCER.to_owned(), &[])
        .expect("a valid shader");
    let size = workgroup_size(&producer, "resample");
    assert_eq!(size, Some([RESAMPLE_WORKGROUP, 1, 1]));
    for module in [producer, composed(&mut composer, &merge(), &[])] {
        assert_eq!(u32_constants(&module).get("HEADER"), Some(&LIST_HEADER));
    }
    let module = composed(&mut composer, &accumulate(), &["RESAMPLE"]);
    let (members, _) = struct_layout(&module, "Listed").expect("the list");
    let places: Vec<_> = members
        .iter()
        .map(|member| (member.name.as_deref().unwrap_or_default(), member.offset))
        .collect();
    // The host writes a count of 0 and the capacity; the pixels follow the header.
    assert_eq!(
        places,
        [
            ("count", 0),
            ("capacity", 4),
            ("padding", 8),
            ("pixels", 4 * LIST_HEADER)
        ]
    );
}

/// A workgroup of the noise pass loads all that its pixels pool.
#[test]
fn tiles_hold_what_is_pooled() {
    for names in [&[] as &[&str], &["NARROW"]] {
        assert_tile(names);
    }
}

fn assert_tile(names: &[&str]) {
    let mut composer = composer();
    let module = composed(&mut composer, &noise(), names);
    let constants: std::collections::BTreeMap<_, _> = module
        .constants
        .iter()
        .filter_map(|(_, constant)| {
            let naga::Expression::Literal(literal) = module.global_expressions[constant.init]
            else {
                return None;
            };
            let value = match literal {
                naga::Literal::I32(value) => i64::from(value),
                naga::Literal::U32(value) => i64::from(value),
                _ => return None,
            };
            Some((
                akari_gpu_test::undecorated(constant.name.as_deref()?),
                value,
            ))
        })
        .collect();
    let constant = |name: &str| {
        constants
            .get(name)
            .copied()
            .expect("a constant of that name")
    };
    assert_eq!(constant("GROUP"), i64::from(WORKGROUP));
    assert_eq!(constant("TILE"), constant("GROUP") + 2 * constant("RADIUS"));
    assert_eq!(constant("TILE_PIXELS"), constant("TILE") * constant("TILE"));
    assert_eq!(
        constant("INVOCATIONS"),
        constant("GROUP") * constant("GROUP")
    );
}

/// The signals' bits as the shaders look at them.
#[test]
fn the_first_bit_is_the_specular_signal() {
    assert!(
        include_str!("../src/remember.wgsl").contains(&format!(
            "vec2((denoise.signals & {SPECULAR_BIT}u) != 0u, (denoise.signals & {DIFFUSE_BIT}u) != 0u)"
        )),
        "what is remembered asks which signals there are"
    );
    assert_eq!(SPECULAR_BIT & DIFFUSE_BIT, 0);
}

/// [`layout_fault`] of the value of a uniform.
fn fault<T: ShaderType + encase::internal::WriteInto>(
    module: &Module,
    name: &str,
    value: &T,
    fields: &[(&str, u32)],
) -> Option<String> {
    let mut buffer = encase::UniformBuffer::new(Vec::<u8>::new());
    buffer.write(value).expect("a write to memory");
    layout_fault(module, name, T::min_size().get(), buffer.as_ref(), fields)
}

/// A value whose fields all differ, and the first word of each.
fn marked_view() -> (GpuDenoiseView, Vec<(&'static str, u32)>) {
    let view = GpuDenoiseView {
        previous_clip_from_relative: Mat4::from_cols_array(&[1.0; 16]),
        previous_relative_from_clip: Mat4::from_cols_array(&[2.0; 16]),
        previous_depth_from_relative: Vec4::new(3.0, 0.0, 0.0, 0.0),
        previous_camera_rel: Vec3::new(4.0, 0.0, 0.0),
        previous_orthographic: 5,
        size: UVec2::new(6, 0),
        signal_size: UVec2::new(7, 0),
        sample_offset: UVec2::new(8, 0),
        scale: 9,
        frame: 10,
        max_history: 11.0,
        has_history: 12,
        beta: 13.0,
        inverse_kappa: 14.0,
        sigma_n_squared: 15.0,
        resample_below: 16.0,
        signals: 17,
        least_deviation: Vec2::new(18.0, 0.0),
    };
    let fields = vec![
        ("previous_clip_from_relative", 1.0_f32.to_bits()),
        ("previous_relative_from_clip", 2.0_f32.to_bits()),
        ("previous_depth_from_relative", 3.0_f32.to_bits()),
        ("previous_camera_rel", 4.0_f32.to_bits()),
        ("previous_orthographic", 5),
        ("size", 6),
        ("signal_size", 7),
        ("sample_offset", 8),
        ("scale", 9),
        ("frame", 10),
        ("max_history", 11.0_f32.to_bits()),
        ("has_history", 12),
        ("beta", 13.0_f32.to_bits()),
        ("inverse_kappa", 14.0_f32.to_bits()),
        ("sigma_n_squared", 15.0_f32.to_bits()),
        ("resample_below", 16.0_f32.to_bits()),
        ("signals", 17),
        ("least_deviation", 18.0_f32.to_bits()),
    ];
    (view, fields)
}

#[test]
fn structs_have_one_layout() {
    let mut composer = composer();
    let module = composed(&mut composer, &stage(), &[]);
    let (view, fields) = marked_view();
    assert_eq!(fault(&module, "DenoiseView", &view, &fields), None);
    let value = GpuDenoiseStage {
        radius: IVec2::new(1, 0),
        stride: 2,
        inverse_two_sigma_squared: 3.0,
        sigma: 4.0,
        cursor: Vec2::new(6.0, 0.0),
    };
    let stage_fields = [
        ("radius", 1),
        ("stride", 2),
        ("inverse_two_sigma_squared", 3.0_f32.to_bits()),
        ("sigma", 4.0_f32.to_bits()),
        ("cursor", 6.0_f32.to_bits()),
    ];
    assert_eq!(fault(&module, "DenoiseStage", &value, &stage_fields), None);
}

#[test]
fn another_layout_is_noticed() {
    let (view, fields) = marked_view();
    let swapped = TYPES.replacen(
        "size: vec2<u32>,\n    signal_size: vec2<u32>,",
        "signal_size: vec2<u32>,\n    size: vec2<u32>,",
        1,
    );
    let wider = TYPES.replacen("scale: u32,", "scale: vec2<u32>,", 1);
    for source in [swapped, wider] {
        assert_ne!(source, TYPES);
        let libraries = [
            &[("types.wgsl", &*source.leak())],
            &LIBRARIES[1..],
            BORROWED,
        ]
        .concat();
        let mut composer = Composer::new(&libraries, &[]);
        let probe = "#import akari_denoise::types::DenoiseView
            @group(0) @binding(0) var<uniform> denoise: DenoiseView;
            @compute @workgroup_size(1) fn probe() { _ = denoise.frame; }";
        let module = composer
            .compose("probe.wgsl", probe.to_owned(), &[])
            .expect("a valid shader");
        assert!(fault(&module, "DenoiseView", &view, &fields).is_some());
    }
}
