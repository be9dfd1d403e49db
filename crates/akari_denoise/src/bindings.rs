//! A bind group and its layout from one list, so that the two cannot disagree.

use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_2d, texture_storage_2d,
    uniform_buffer_sized,
};
use bevy::render::render_resource::{
    BindGroup, BindGroupEntry, BindGroupLayoutDescriptor, BindGroupLayoutEntry,
    BindGroupLayoutEntryBuilder, BindingResource, Buffer, PipelineCache, ShaderStages,
    StorageTextureAccess, TextureFormat, TextureSampleType, TextureView,
};
use bevy::render::renderer::RenderDevice;

/// Bindings of one pass, in the order in which they are added.
pub struct Bindings<'a> {
    label: &'static str,
    stages: ShaderStages,
    layout: Vec<BindGroupLayoutEntry>,
    entries: Vec<BindGroupEntry<'a>>,
}

impl<'a> Bindings<'a> {
    /// None yet.
    pub fn new(label: &'static str, stages: ShaderStages) -> Self {
        Self {
            label,
            stages,
            layout: Vec::new(),
            entries: Vec::new(),
        }
    }

    fn push(
        mut self,
        binding: u32,
        entry: BindGroupLayoutEntryBuilder,
        resource: BindingResource<'a>,
    ) -> Self {
        self.layout.push(entry.build(binding, self.stages));
        self.entries.push(BindGroupEntry { binding, resource });
        self
    }

    /// A uniform buffer.
    pub fn uniform(self, binding: u32, buffer: &'a Buffer) -> Self {
        let entry = uniform_buffer_sized(false, None);
        self.push(binding, entry, buffer.as_entire_binding())
    }

    /// A storage buffer that is only read.
    pub fn read(self, binding: u32, buffer: &'a Buffer) -> Self {
        let entry = storage_buffer_read_only_sized(false, None);
        self.push(binding, entry, buffer.as_entire_binding())
    }

    /// A storage buffer.
    pub fn read_write(self, binding: u32, buffer: &'a Buffer) -> Self {
        let entry = storage_buffer_sized(false, None);
        self.push(binding, entry, buffer.as_entire_binding())
    }

    /// A texture of unsigned integers.
    pub fn uint(self, binding: u32, view: &'a TextureView) -> Self {
        let entry = texture_2d(TextureSampleType::Uint);
        self.push(binding, entry, BindingResource::TextureView(view))
    }

    /// A texture of numbers that is not filtered.
    pub fn float(self, binding: u32, view: &'a TextureView) -> Self {
        let entry = texture_2d(TextureSampleType::Float { filterable: false });
        self.push(binding, entry, BindingResource::TextureView(view))
    }

    /// A texture that is written.
    pub fn write(self, binding: u32, view: &'a TextureView, format: TextureFormat) -> Self {
        let entry = texture_storage_2d(format, StorageTextureAccess::WriteOnly);
        self.push(binding, entry, BindingResource::TextureView(view))
    }

    /// A texture that is read and written.
    pub fn update(self, binding: u32, view: &'a TextureView, format: TextureFormat) -> Self {
        let entry = texture_storage_2d(format, StorageTextureAccess::ReadWrite);
        self.push(binding, entry, BindingResource::TextureView(view))
    }

    /// The layout.
    pub fn layout(&self) -> BindGroupLayoutDescriptor {
        BindGroupLayoutDescriptor::new(self.label, &self.layout)
    }

    /// The group.
    pub fn group(&self, device: &RenderDevice, cache: &PipelineCache) -> BindGroup {
        device.create_bind_group(
            self.label,
            &cache.get_bind_group_layout(&self.layout()),
            &self.entries,
        )
    }
}
