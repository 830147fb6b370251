//! Steps into a command encoder that somebody else made. Nothing is submitted here, and nothing is waited for.

use super::GpuError;
use super::cache::Pipeline;
use super::execute::Executor;
use super::memory::Place;
use crate::plan::{BufferId, How, Life, Run, Step, Vertices, Work};

impl Executor {
    /// The steps that run once, uploads included, but for those whose results were there before.
    pub fn encode_setup(&self, encoder: &mut wgpu::CommandEncoder) -> Result<(), GpuError> {
        self.encode_steps(encoder, &self.steps_to_set_up())
    }

    /// The steps of the frame that was begun, taps included.
    pub fn encode_frame(&mut self, encoder: &mut wgpu::CommandEncoder) -> Result<(), GpuError> {
        if self.take_reset() {
            self.encode_reset(encoder);
        }
        self.encode_steps(encoder, &self.steps_of_frame(true))
    }

    /// Some steps of the plan, in order.
    pub(super) fn encode_steps(&self, encoder: &mut wgpu::CommandEncoder, steps: &[usize]) -> Result<(), GpuError> {
        // beginning a pass costs as much as a small kernel: with no stamps to write, steps share one
        let is_compute = |at: usize| {
            self.prepared[at].as_ref().is_some_and(|prepared| matches!(prepared.pipeline, Pipeline::Compute(_)))
        };
        let shares = |a: &usize, b: &usize| self.stamps.is_none() && is_compute(*a) && is_compute(*b);
        for steps in steps.chunk_by(shares) {
            self.encode_pass(encoder, steps)?;
        }
        if let Some(stamps) = &self.stamps {
            stamps.resolve(encoder);
        }
        Ok(())
    }

    /// Forgets what earlier frames have left, before anything of this one runs.
    pub(super) fn encode_reset(&self, encoder: &mut wgpu::CommandEncoder) {
        for (at, buffer) in self.plan.buffers.iter().enumerate() {
            let place = self.memory.places[at]
                .as_ref()
                .filter(|_| matches!(buffer.life, Life::Kept | Life::Next | Life::LastOf(_)));
            if let Some(array) = place.and_then(Place::array) {
                encoder.clear_buffer(array, 0, None);
            }
        }
    }

    /// One pass: any number of compute steps, or one draw; or one copy.
    fn encode_pass(&self, encoder: &mut wgpu::CommandEncoder, steps: &[usize]) -> Result<(), GpuError> {
        let Some(&at) = steps.first() else { return Ok(()) };
        let step = &self.plan.steps[at];
        match &step.work {
            Work::Upload(id) => self.upload(*id),
            Work::Copy { from, to } => {
                let bytes = self.plan.buffer(*from).bytes();
                let (from, to) = (self.array(step, *from)?, self.array(step, *to)?);
                encoder.copy_buffer_to_buffer(from, 0, to, 0, bytes);
                Ok(())
            }
            Work::Run(run) => match &run.how {
                How::Draw { vertices, target, .. } => self.encode_draw(encoder, at, *vertices, *target),
                _ => {
                    let timestamp_writes = self.stamps.as_ref().map(|stamps| stamps.of_compute(at));
                    let descriptor = wgpu::ComputePassDescriptor { label: Some(&step.label), timestamp_writes };
                    let mut pass = encoder.begin_compute_pass(&descriptor);
                    steps.iter().try_for_each(|&at| self.dispatch(&mut pass, at))
                }
            },
        }
    }

    fn dispatch(&self, pass: &mut wgpu::ComputePass, at: usize) -> Result<(), GpuError> {
        let step = &self.plan.steps[at];
        let (Some(prepared), Some(Run { how, .. })) = (&self.prepared[at], step.run()) else {
            return Err(lacks(step, "pipeline"));
        };
        let Pipeline::Compute(pipeline) = &prepared.pipeline else { return Err(lacks(step, "pipeline")) };
        pass.set_pipeline(pipeline);
        for (group, bound) in prepared.groups(self.half()).iter().enumerate() {
            let offset = self.offset(at).filter(|_| group == 0);
            pass.set_bind_group(group as u32, bound, offset.as_slice());
        }
        match how {
            How::Groups([x, y, z]) => pass.dispatch_workgroups(*x, *y, *z),
            How::Indirect(id) => pass.dispatch_workgroups_indirect(self.array(step, *id)?, 0),
            How::Draw { .. } => return Err(lacks(step, "render pass")),
        }
        Ok(())
    }

    fn encode_draw(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        at: usize,
        vertices: Vertices,
        target: BufferId,
    ) -> Result<(), GpuError> {
        let step = &self.plan.steps[at];
        let Some(Place::Target { view, depth, .. }) = &self.memory.places[target.0] else {
            return Err(lacks(step, "render target"));
        };
        let Some(prepared) = &self.prepared[at] else { return Err(lacks(step, "pipeline")) };
        let Pipeline::Render(pipeline) = &prepared.pipeline else { return Err(lacks(step, "pipeline")) };
        let clear = |value| wgpu::Operations { load: wgpu::LoadOp::Clear(value), store: wgpu::StoreOp::Store };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(&step.label),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: None,
                ops: clear(wgpu::Color::TRANSPARENT),
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Discard }),
                stencil_ops: None,
            }),
            timestamp_writes: self.stamps.as_ref().map(|stamps| stamps.of_render(at)),
            ..Default::default()
        });
        pass.set_pipeline(pipeline);
        for (group, bound) in prepared.groups(self.half()).iter().enumerate() {
            let offset = self.offset(at).filter(|_| group == 0);
            pass.set_bind_group(group as u32, bound, offset.as_slice());
        }
        match vertices {
            Vertices::Strip { vertices, .. } => pass.draw(0..vertices, 0..1),
            Vertices::List(id) => pass.draw_indirect(self.array(step, id)?, 0),
        }
        Ok(())
    }

    fn array(&self, step: &Step, id: BufferId) -> Result<&wgpu::Buffer, GpuError> {
        let place = self.memory.place(&self.plan, id, self.half());
        place.and_then(Place::array).ok_or_else(|| lacks(step, &format!("memory for `{}`", self.plan.buffer(id).name)))
    }
}

/// A step lacks something that every plan gives it.
fn lacks(step: &Step, what: &str) -> GpuError {
    GpuError::Plan(format!("the step `{}` has no {what}", step.label))
}
