//! Structs that cross from the CPU to the GPU have one layout.

use akari_gpu_test::compose_module;
use akari_math::WGSL_MODULES;
use akari_math::light_image::ImageFootprint;
use akari_math::sg::lobe::{SgLobe, SgProduct};
use encase::ShaderType;

/// Size and offsets of a struct by naga.
fn naga_layout(module: &str, name: &str) -> (u64, Vec<(String, u64)>) {
    let module = compose_module(WGSL_MODULES, module).unwrap_or_else(|error| panic!("{error}"));
    for (_, r#type) in module.types.iter() {
        if let naga::TypeInner::Struct { members, span } = &r#type.inner
            && r#type.name.as_deref() == Some(name)
        {
            let offsets = members
                .iter()
                .map(|m| (m.name.clone().unwrap_or_default(), u64::from(m.offset)))
                .collect();
            return (u64::from(*span), offsets);
        }
    }
    panic!("no struct {name}");
}

fn check<T: ShaderType + encase::internal::WriteInto>(
    module: &str,
    name: &str,
    fields: &[&str],
    value: &T,
    marks: &[f32],
) {
    let (span, offsets) = naga_layout(module, name);
    assert_eq!(span, T::min_size().get(), "size of {name}");
    assert_eq!(
        offsets
            .iter()
            .map(|(field, _)| field.as_str())
            .collect::<Vec<_>>(),
        fields,
        "fields of {name}"
    );
    let mut buffer = encase::StorageBuffer::new(Vec::<u8>::new());
    buffer.write(value).expect("write");
    let bytes = buffer.into_inner();
    for ((field, offset), mark) in offsets.iter().zip(marks) {
        let at = *offset as usize;
        let found = f32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"));
        assert_eq!(found, *mark, "{name}.{field}");
    }
}

#[test]
fn structs_have_one_layout() {
    let axis = glam::Vec3::new(1.0, 2.0, 3.0);
    let lobe = SgLobe {
        axis,
        sharpness: 4.0,
        amplitude: glam::Vec3::new(5.0, 6.0, 7.0),
    };
    check(
        "akari_math::sg::lobe",
        "SgLobe",
        &["axis", "sharpness", "amplitude"],
        &lobe,
        &[1.0, 4.0, 5.0],
    );
    let product = SgProduct {
        axis,
        sharpness: 4.0,
        log_amplitude: 5.0,
    };
    check(
        "akari_math::sg::lobe",
        "SgProduct",
        &["axis", "sharpness", "log_amplitude"],
        &product,
        &[1.0, 4.0, 5.0],
    );
}

#[test]
fn footprints_have_one_layout() {
    let footprint = ImageFootprint {
        center: glam::Vec2::new(1.0, 2.0),
        line: glam::Vec2::new(3.0, 4.0),
        width: 5.0,
        spread: 6.0_f32.to_bits(),
    };
    check(
        "akari_math::light_image",
        "ImageFootprint",
        &["center", "line", "width", "spread"],
        &footprint,
        &[1.0, 3.0, 5.0, 6.0],
    );
}

#[test]
#[should_panic(expected = "SgLobe.sharpness")]
fn another_layout_is_noticed() {
    let lobe = SgLobe {
        axis: glam::Vec3::ONE,
        sharpness: 4.0,
        amplitude: glam::Vec3::ONE,
    };
    check(
        "akari_math::sg::lobe",
        "SgLobe",
        &["axis", "sharpness", "amplitude"],
        &lobe,
        &[1.0, 3.0, 1.0],
    );
}

/// Every module is valid on its own, with no entry points, bindings or workgroup memory.
#[test]
fn modules_are_pure() {
    for (path, _) in WGSL_MODULES {
        let module =
            compose_module(WGSL_MODULES, path).unwrap_or_else(|error| panic!("{path}: {error}"));
        assert!(
            module.global_variables.is_empty() && module.entry_points.is_empty(),
            "{path} is not pure"
        );
    }
}
