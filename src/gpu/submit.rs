//! Frames by themselves: encoded, submitted and waited for, with what they took. A program that has a frame of its own encodes into that
//! instead; see [`Executor::encode_frame`].

use std::time::Instant;

use super::GpuError;
use super::execute::Executor;
use crate::plan::{Often, Work};

/// GPU time of one step; `None` if the adapter's stamps are missing or contradict the clock.
#[derive(Clone, Debug, PartialEq)]
pub struct StepTime {
    pub step: usize,
    pub ms: Option<f64>,
}

/// One submission: wall time from the first command to the end of its execution, and its steps.
#[derive(Clone, Debug)]
pub struct SubmissionTime {
    pub wall_ms: f64,
    /// From the first step's beginning to the last step's end.
    pub gpu_ms: Option<f64>,
    pub steps: Vec<StepTime>,
}

impl Executor {
    /// Uploads, and runs the steps that run once.
    pub fn setup(&mut self) -> Result<SubmissionTime, GpuError> {
        let (uploads, steps) = self.uploads_and_steps();
        let mut uploaded = self.uploaded(&uploads)?;
        let SubmissionTime { wall_ms, gpu_ms, steps } = self.submit(&steps)?;
        let wall_ms = wall_ms + uploaded.iter().filter_map(|time| time.ms).sum::<f64>();
        uploaded.extend(steps);
        Ok(SubmissionTime { wall_ms, gpu_ms, steps: uploaded })
    }

    /// The same but for steps whose results were there before, and nobody waits for it.
    pub fn submit_setup(&self) -> Result<(), GpuError> {
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.encode_setup(&mut encoder)?;
        self.gpu.queue.submit([encoder.finish()]);
        Ok(())
    }

    /// The same with each step as a submission of its own.
    pub fn setup_by_steps(&mut self) -> Result<SubmissionTime, GpuError> {
        let (uploads, steps) = self.uploads_and_steps();
        let mut times = self.uploaded(&uploads)?;
        times.extend(self.each(&steps)?);
        Ok(SubmissionTime { wall_ms: times.iter().filter_map(|time| time.ms).sum(), gpu_ms: None, steps: times })
    }

    /// Runs a frame of the path, and copies what is tapped.
    pub fn frame(&mut self, frame: usize) -> Result<SubmissionTime, GpuError> {
        self.begin_path_frame(frame)?;
        self.submit(&self.steps_of_frame(true))
    }

    /// Runs a frame of the path as nobody looks at it.
    pub fn timed_frame(&mut self, frame: usize) -> Result<SubmissionTime, GpuError> {
        self.begin_path_frame(frame)?;
        self.submit(&self.steps_of_frame(false))
    }

    /// The same without what comes after the drawn surface: what the method takes.
    pub fn timed_method(&mut self, frame: usize) -> Result<SubmissionTime, GpuError> {
        self.begin_path_frame(frame)?;
        let mut steps = self.steps_of_frame(false);
        steps.retain(|at| !self.plan.after_surface.contains(at));
        self.submit(&steps)
    }

    /// Runs a frame with each step as a submission of its own, timed by the clock less what an empty submission
    /// takes: what is left to say about kernels where the stamps are not to be believed.
    pub fn frame_by_steps(&mut self, frame: usize) -> Result<SubmissionTime, GpuError> {
        self.begin_path_frame(frame)?;
        let steps = self.each(&self.steps_of_frame(false))?;
        Ok(SubmissionTime { wall_ms: steps.iter().filter_map(|time| time.ms).sum(), gpu_ms: None, steps })
    }

    /// Runs the frame that was begun.
    pub fn submit_frame(&mut self) -> Result<SubmissionTime, GpuError> {
        self.submit(&self.steps_of_frame(true))
    }

    /// Runs the steps of one stage in the frame that was begun, those that run once among them, and copies what is tapped.
    pub fn submit_stage(&mut self, stage_index: usize) -> Result<SubmissionTime, GpuError> {
        let is_own = |at: &usize| self.plan.steps[*at].stage_index == stage_index;
        let steps: Vec<usize> = (0..self.plan.steps.len()).filter(is_own).collect();
        self.submit(&steps)
    }

    /// Copies again what is tapped of one stage.
    pub fn submit_taps(&mut self, stage_index: usize) -> Result<SubmissionTime, GpuError> {
        let is_own = |at: &usize| self.plan.steps[*at].stage_index == stage_index && self.plan.steps[*at].is_tap();
        let steps: Vec<usize> = (0..self.plan.steps.len()).filter(is_own).collect();
        self.submit(&steps)
    }

    /// Runs one step of the frame that was begun.
    pub fn submit_step(&mut self, step: usize) -> Result<SubmissionTime, GpuError> {
        self.submit(&[step])
    }

    fn uploads_and_steps(&self) -> (Vec<usize>, Vec<usize>) {
        let is_upload = |at: &usize| matches!(self.plan.steps[*at].work, Work::Upload(_));
        self.steps_of(Often::Once).into_iter().partition(is_upload)
    }

    /// Each upload by the clock: adapters stamp none.
    fn uploaded(&self, uploads: &[usize]) -> Result<Vec<StepTime>, GpuError> {
        let mut times = Vec::new();
        for &step in uploads {
            let start = Instant::now();
            if let Work::Upload(id) = self.plan.steps[step].work {
                self.upload(id)?;
            }
            self.gpu.wait()?;
            times.push(StepTime { step, ms: Some(start.elapsed().as_secs_f64() * 1e3) });
        }
        Ok(times)
    }

    fn each(&mut self, steps: &[usize]) -> Result<Vec<StepTime>, GpuError> {
        let mut times = Vec::new();
        for &step in steps {
            let ms = self.submit(&[step])?.wall_ms - self.gpu.submission_ms;
            times.push(StepTime { step, ms: Some(ms.max(0.0)) });
        }
        Ok(times)
    }

    fn submit(&mut self, steps: &[usize]) -> Result<SubmissionTime, GpuError> {
        if self.take_reset() {
            let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            self.encode_reset(&mut encoder);
            self.gpu.wait_for(&self.gpu.queue.submit([encoder.finish()]))?;
        }
        let start = Instant::now();
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.encode_steps(&mut encoder, steps)?;
        let submission = self.gpu.watched(
            || self.name_of(steps),
            || {
                let submission = self.gpu.queue.submit([encoder.finish()]);
                self.gpu.wait_for(&submission).map(|()| submission)
            },
        )?;
        let wall_ms = start.elapsed().as_secs_f64() * 1e3;
        self.has_run = true;
        let (gpu_ms, each) = match &self.stamps {
            Some(stamps) => stamps.read(&self.gpu, &submission, steps, wall_ms)?,
            None => (None, vec![None; steps.len()]),
        };
        let steps = steps.iter().zip(each).map(|(&step, ms)| StepTime { step, ms }).collect();
        Ok(SubmissionTime { wall_ms, gpu_ms, steps })
    }

    /// What a submission is, for somebody who waits for it.
    fn name_of(&self, steps: &[usize]) -> String {
        let label = |at: &usize| self.plan.steps[*at].label.as_str();
        let chain = &self.plan.chain;
        match steps {
            [] => format!("chain `{chain}`"),
            [step] => format!("step `{}` of chain `{chain}`", label(step)),
            [first, .., last] => {
                format!("the {} steps `{}` to `{}` of chain `{chain}`", steps.len(), label(first), label(last))
            }
        }
    }
}
