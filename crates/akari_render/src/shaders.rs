//! The WGSL modules that passes of several effects import, made known to Bevy's shader composer.

use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::shader::{Shader, load_shader_library};

/// Keeps the library modules alive: a module whose handle is dropped can no longer be imported.
#[derive(Resource)]
pub struct MathShaders {
    /// One handle for each entry of `akari_math::WGSL_MODULES`.
    pub handles: Vec<Handle<Shader>>,
}

/// Adds every WGSL module of `akari_math` to the shader assets. Text only: nothing is compiled by that.
pub fn register_math_shaders(app: &mut App) {
    let Some(mut shaders) = app.world_mut().get_resource_mut::<Assets<Shader>>() else {
        // No renderer in this app (a server, a test of the ECS part): nothing to import into.
        return;
    };
    let handles = akari_math::WGSL_MODULES
        .iter()
        .map(|(import_path, source)| {
            shaders.add(Shader::from_wgsl(*source, format!("{import_path}.wgsl")))
        })
        .collect();
    app.insert_resource(MathShaders { handles });
}

/// Adds the WGSL modules of this crate.
pub(crate) fn register_shared_shaders(app: &mut App) {
    if app.get_sub_app(RenderApp).is_none() {
        return;
    }
    load_shader_library!(app, "gbuffer.wgsl");
    load_shader_library!(app, "ltc_layer.wgsl");
    load_shader_library!(app, "scene_lights.wgsl");
    load_shader_library!(app, "sky.wgsl");
}
