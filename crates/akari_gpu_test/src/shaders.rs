//! What tests look for in shaders and composed modules: definitions, constants, workgroups, layouts.

use naga::{Expression, Literal, Module, StructMember, TypeInner};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// What composing puts between the name of an imported item and that of its module.
const DECORATION: &str = "X_naga_oil_mod_";

/// The name of an item of a composed module as it stands in its source.
#[must_use]
pub fn undecorated(name: &str) -> &str {
    name.split(DECORATION).next().unwrap_or(name)
}

/// Names of the definitions that the preprocessor looks at.
#[must_use]
pub fn definitions_in(source: &str) -> BTreeSet<&str> {
    source
        .lines()
        .filter_map(|line| {
            let directive = line.trim().strip_prefix('#')?;
            let directive = directive.strip_prefix("else ").unwrap_or(directive);
            let condition = ["ifdef ", "ifndef ", "if "]
                .iter()
                .find_map(|word| directive.strip_prefix(word))?;
            condition.split_whitespace().next()
        })
        .collect()
}

/// The WGSL files in a folder and in those below it.
///
/// # Errors
///
/// Where a folder cannot be read.
pub fn wgsl_files(folder: &Path) -> std::io::Result<BTreeSet<PathBuf>> {
    let mut found = BTreeSet::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            found.extend(wgsl_files(&path)?);
        } else if path
            .extension()
            .is_some_and(|extension| extension == "wgsl")
        {
            found.insert(path);
        }
    }
    Ok(found)
}

/// Constants of type `u32`, by the names of their sources.
#[must_use]
pub fn u32_constants(module: &Module) -> BTreeMap<&str, u32> {
    module
        .constants
        .iter()
        .filter_map(|(_, constant)| {
            let Expression::Literal(Literal::U32(value)) = module.global_expressions[constant.init]
            else {
                return None;
            };
            Some((undecorated(constant.name.as_deref()?), value))
        })
        .collect()
}

/// Size of the workgroups of an entry point, if there is one of that name.
#[must_use]
pub fn workgroup_size(module: &Module, entry_point: &str) -> Option<[u32; 3]> {
    let mut points = module.entry_points.iter();
    let point = points.find(|point| point.name == entry_point)?;
    Some(point.workgroup_size)
}

/// Members and size in bytes of the struct that its source calls `name`.
#[must_use]
pub fn struct_layout<'a>(module: &'a Module, name: &str) -> Option<(&'a [StructMember], u32)> {
    module.types.iter().find_map(|(_, found)| {
        let TypeInner::Struct { members, span } = &found.inner else {
            return None;
        };
        (undecorated(found.name.as_deref()?) == name).then_some((members.as_slice(), *span))
    })
}

/// Where the struct `name` differs from what the host hands over: its size, the names and order of its fields, or the
/// place of one.
///
/// `host_size` is the size that the host's type has, `bytes` a value of it as it is uploaded, and `fields` lists the
/// names of all fields with the first word that each has in that value, no two of them alike.
#[must_use]
pub fn layout_fault(
    module: &Module,
    name: &str,
    host_size: u64,
    bytes: &[u8],
    fields: &[(&str, u32)],
) -> Option<String> {
    let Some((members, span)) = struct_layout(module, name) else {
        return Some(format!("no struct {name}"));
    };
    if u64::from(span) != host_size {
        return Some(format!(
            "{name} has {span} bytes in WGSL, {host_size} in Rust"
        ));
    }
    let names: Vec<&str> = members
        .iter()
        .map(|member| member.name.as_deref().unwrap_or_default())
        .collect();
    let expected: Vec<&str> = fields.iter().map(|(field, _)| *field).collect();
    if names != expected {
        return Some(format!(
            "{name} has the fields {names:?} in WGSL, {expected:?} in Rust"
        ));
    }
    let marks: BTreeSet<u32> = fields.iter().map(|(_, mark)| *mark).collect();
    if marks.len() != fields.len() {
        return Some(format!("two fields of {name} bear the same mark"));
    }
    for (member, (field, mark)) in members.iter().zip(fields) {
        let at = member.offset as usize;
        let word = bytes
            .get(at..at + 4)
            .and_then(|word| word.try_into().ok())
            .map(u32::from_le_bytes);
        if word != Some(*mark) {
            return Some(format!("{name}.{field} is not at byte {at} in Rust"));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn definitions_are_those_of_conditions() {
        let source =
            "#ifdef A\n #else ifdef B\n#ifndef C\n#if D == 1\n#endif\nlet a = b;\n#import E";
        assert_eq!(definitions_in(source), BTreeSet::from(["A", "B", "C", "D"]));
    }

    #[test]
    fn composed_items_go_by_the_names_of_their_sources() {
        let modules = [(
            "a::types",
            "#define_import_path a::types\nconst SIZE: u32 = 8u;\nstruct Pair { first: u32, second: vec3<f32> }",
        )];
        let source = "#import a::types::{Pair, SIZE}
            @group(0) @binding(0) var<uniform> pair: Pair;
            @compute @workgroup_size(SIZE, 2) fn run() { _ = pair.first; }";
        let module = crate::compose(&modules, source).unwrap();
        assert_eq!(u32_constants(&module).get("SIZE"), Some(&8));
        let (members, span) = struct_layout(&module, "Pair").unwrap();
        assert_eq!((members.len(), span), (2, 32));
        assert_eq!(workgroup_size(&module, "walk"), None);
    }

    #[test]
    fn other_layouts_are_faults() {
        let module = |fields: &str| {
            naga::front::wgsl::parse_str(&format!("struct S {{ {fields} }}")).unwrap()
        };
        let good = module("a: u32, b: u32, c: vec2<u32>");
        let bytes = [1_u32, 2, 3, 0].map(u32::to_le_bytes);
        let bytes = bytes.as_flattened();
        let fields = [("a", 1), ("b", 2), ("c", 3)];
        assert_eq!(layout_fault(&good, "S", 16, bytes, &fields), None);
        let faults = [
            layout_fault(&good, "T", 16, bytes, &fields),
            layout_fault(&good, "S", 12, bytes, &fields),
            layout_fault(&good, "S", 16, &bytes[..8], &fields),
            layout_fault(&good, "S", 16, bytes, &[("a", 1), ("b", 1), ("c", 3)]),
            layout_fault(&good, "S", 16, bytes, &[("a", 1), ("b", 3), ("c", 2)]),
            layout_fault(
                &module("b: u32, a: u32, c: vec2<u32>"),
                "S",
                16,
                bytes,
                &fields,
            ),
            layout_fault(
                &module("a: u32, b: u32, c: vec4<u32>"),
                "S",
                16,
                bytes,
                &fields,
            ),
        ];
        assert!(faults.iter().all(Option::is_some), "{faults:?}");
    }
}
