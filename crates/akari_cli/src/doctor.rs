//! `akari doctor`: adapters, and what of the project works on them.

use crate::args::Common;
use crate::console::print_result;
use crate::error::CliError;
use bevy_akari::headless::{AdapterDescription, HeadlessError, adapters};
use wgpu::Features;

/// Runs the command.
///
/// # Errors
/// If there is no adapter, or none of the wanted name.
pub fn run(common: &Common) -> Result<(), CliError> {
    let all = adapters();
    if all.is_empty() {
        return Err(HeadlessError::NoAdapter.into());
    }
    let wanted = common.adapter.as_deref().unwrap_or("").to_lowercase();
    let shown: Vec<&AdapterDescription> = all
        .iter()
        .filter(|adapter| adapter.name.to_lowercase().contains(&wanted))
        .collect();
    if shown.is_empty() {
        let names: Vec<_> = all.iter().map(|adapter| adapter.name.as_str()).collect();
        return Err(HeadlessError::NoSuchAdapter {
            wanted,
            available: names.join(", "),
        }
        .into());
    }
    let descriptions: Vec<String> = shown.into_iter().map(describe_adapter).collect();
    print_result(&descriptions.join("\n"))
}

fn describe_adapter(adapter: &AdapterDescription) -> String {
    let mut lines = Vec::new();
    lines.push(format!(
        "{} ({}, {})",
        adapter.name, adapter.kind, adapter.backend
    ));
    lines.push(format!("  driver           {}", adapter.driver));
    let limits = &adapter.limits;
    lines.push(format!(
        "  textures         up to {0} x {0}, 3D {1}",
        limits.max_texture_dimension_2d, limits.max_texture_dimension_3d
    ));
    lines.push(format!(
        "  storage buffers  {} a stage, up to {} MiB",
        limits.max_storage_buffers_per_shader_stage,
        limits.max_storage_buffer_binding_size >> 20
    ));
    lines.push(format!(
        "  workgroups       {} invocations, {} KiB shared",
        limits.max_compute_invocations_per_workgroup,
        limits.max_compute_workgroup_storage_size >> 10
    ));
    let has = |feature| {
        if adapter.features.contains(feature) {
            "yes"
        } else {
            "no"
        }
    };
    lines.push(format!(
        "  time stamps      {} (times in --stats)",
        has(Features::TIMESTAMP_QUERY)
    ));
    lines.push(format!(
        "  area lights      {}",
        area_light_support(adapter)
    ));
    lines.join("\n")
}

/// Whether area lights work, and what is missing if not.
fn area_light_support(adapter: &AdapterDescription) -> String {
    /// Lights, corners, masks.
    const STORAGE_BUFFERS: u32 = 3;
    /// Bevy's G-buffer: four 32-bit targets' worth of attachments.
    const ATTACHMENT_BYTES: u32 = 32;
    let limits = &adapter.limits;
    let mut missing = Vec::new();
    if limits.max_storage_buffers_per_shader_stage < STORAGE_BUFFERS {
        missing.push("storage buffers in fragment shaders");
    }
    if limits.max_color_attachment_bytes_per_sample < ATTACHMENT_BYTES {
        missing.push("a deferred G-buffer");
    }
    if limits.max_compute_invocations_per_workgroup == 0 {
        missing.push("compute shaders");
    }
    if missing.is_empty() {
        "yes".to_owned()
    } else {
        format!("no: it lacks {}", missing.join(", "))
    }
}
