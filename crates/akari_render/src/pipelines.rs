//! Pipelines that are queued once, however often an effect comes and goes.
//!
//! Bevy's [`PipelineCache`] keeps every pipeline for good, and an effect lets go of all that it made when nothing needs it any
//! more. Without what is here, an effect that comes back would have its shaders compiled anew, and the cache would grow by
//! a set of pipelines each time.

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::render::render_resource::{
    CachedComputePipelineId, CachedRenderPipelineId, ComputePipelineDescriptor, PipelineCache,
    RenderPipelineDescriptor,
};
use std::ops::Deref;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What was queued, in the render world.
#[derive(Resource, Default)]
pub(crate) struct QueuedPipelines {
    compute: Mutex<Vec<(ComputePipelineDescriptor, CachedComputePipelineId)>>,
    render: Mutex<Vec<(RenderPipelineDescriptor, CachedRenderPipelineId)>>,
}

/// Bevy's [`PipelineCache`], for systems that queue pipelines of an effect: of equal descriptions only the first is queued.
#[derive(SystemParam)]
pub struct Pipelines<'w> {
    cache: Res<'w, PipelineCache>,
    queued: Res<'w, QueuedPipelines>,
}

impl Pipelines<'_> {
    /// The compute pipeline of that description, which compiles in the background if it is the first.
    pub fn queue_compute_pipeline(
        &self,
        descriptor: ComputePipelineDescriptor,
    ) -> CachedComputePipelineId {
        once(&self.queued.compute, descriptor, |descriptor| {
            self.cache.queue_compute_pipeline(descriptor)
        })
    }

    /// The render pipeline of that description, which compiles in the background if it is the first.
    pub fn queue_render_pipeline(
        &self,
        descriptor: RenderPipelineDescriptor,
    ) -> CachedRenderPipelineId {
        once(&self.queued.render, descriptor, |descriptor| {
            self.cache.queue_render_pipeline(descriptor)
        })
    }
}

impl Deref for Pipelines<'_> {
    type Target = PipelineCache;

    fn deref(&self) -> &PipelineCache {
        &self.cache
    }
}

/// The id of an equal descriptor, else the one that `queue` gives. There are tens of them, and only an effect that comes asks.
fn once<Descriptor: Clone + PartialEq, Id: Copy>(
    queued: &Mutex<Vec<(Descriptor, Id)>>,
    descriptor: Descriptor,
    queue: impl FnOnce(Descriptor) -> Id,
) -> Id {
    let mut queued: MutexGuard<_> = queued.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(&(_, id)) = queued.iter().find(|(known, _)| *known == descriptor) {
        return id;
    }
    let id = queue(descriptor.clone());
    queued.push((descriptor, id));
    id
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_equal_descriptors_only_the_first_is_queued() {
        let queued = Mutex::default();
        let mut next = 0;
        let mut queue = |label: &'static str| {
            let descriptor = ComputePipelineDescriptor {
                label: Some(label.into()),
                ..default()
            };
            once(&queued, descriptor, |_| {
                next += 1;
                next
            })
        };
        assert_eq!(
            [queue("a"), queue("b"), queue("a"), queue("b")],
            [1, 2, 1, 2]
        );
    }
}
