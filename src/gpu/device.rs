//! Adapters and the device a run uses.

use std::sync::{Arc, Mutex, OnceLock};

use serde::{Deserialize, Serialize};

use super::cache::Cache;
use super::watch::Watch;
use super::{GpuError, limits, timing, turns};
use crate::plan::Plan;

/// What a record says about the machine it was made on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AdapterSummary {
    pub name: String,
    pub backend: String,
    pub kind: String,
    pub driver: String,
    pub subgroup_min_size: u32,
    pub subgroup_max_size: u32,
    pub storage_binding_bytes: u64,
    /// The adapter has timestamps, and they agree with the clock.
    pub timestamps: bool,
    /// How often the loops of a thread turn in all before the adapter ends them; `None` if it has gone on as long as it was asked to.
    #[serde(default)]
    pub loop_turns: Option<u32>,
    /// Bounds and loop checks of built-in kernels; a user's kernel always has them.
    pub runtime_checks: String,
}

impl AdapterSummary {
    /// What decides results and times: adapter, backend, driver.
    pub fn identity(&self) -> String {
        format!("{} {} {}", self.name, self.backend, self.driver)
    }

    /// The processor is the adapter.
    pub fn is_software(&self) -> bool {
        self.kind == format!("{:?}", wgpu::DeviceType::Cpu)
    }
}

/// An open device. Errors that wgpu reports later end up in `failure`.
pub struct Gpu {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub summary: AdapterSummary,
    pub limits: wgpu::Limits,
    /// What a submission with nothing in it takes on the clock.
    pub submission_ms: f64,
    pub(super) cache: Cache,
    pub(super) watch: Arc<Watch>,
    adapter: wgpu::Adapter,
    failure: Arc<Mutex<Option<String>>>,
}

fn instance() -> &'static wgpu::Instance {
    static INSTANCE: OnceLock<wgpu::Instance> = OnceLock::new();
    INSTANCE.get_or_init(|| {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        // it would add a dispatch to every indirect one; the kernels' own numbers are limited, and a user's are where they are used
        descriptor.flags.remove(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
        wgpu::Instance::new(descriptor)
    })
}

fn adapters() -> Vec<wgpu::Adapter> {
    let mut adapters = pollster::block_on(instance().enumerate_adapters(wgpu::Backends::PRIMARY));
    let rank = |adapter: &wgpu::Adapter| {
        let info = adapter.get_info();
        let kind = match info.device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Other => 3,
            wgpu::DeviceType::Cpu => 4,
        };
        (kind, info.name)
    };
    adapters.sort_by_key(rank);
    adapters
}

fn summarize(adapter: &wgpu::Adapter) -> AdapterSummary {
    let info = adapter.get_info();
    AdapterSummary {
        backend: info.backend.to_string(),
        kind: format!("{:?}", info.device_type),
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_string(),
        name: info.name,
        subgroup_min_size: info.subgroup_min_size,
        subgroup_max_size: info.subgroup_max_size,
        storage_binding_bytes: adapter.limits().max_storage_buffer_binding_size,
        // a software adapter works on the clock's own processor, and its stamps have been seen to be wrong
        timestamps: adapter.features().contains(wgpu::Features::TIMESTAMP_QUERY)
            && info.device_type != wgpu::DeviceType::Cpu,
        loop_turns: None,
        runtime_checks: "off for built-in kernels".into(),
    }
}

/// Every adapter there is, the one a run would take first.
pub fn list() -> Vec<AdapterSummary> {
    adapters().iter().map(summarize).collect()
}

impl Gpu {
    /// Opens an adapter by its place in [`list`]: several can have the same name.
    pub fn open_nth(at: usize) -> Result<Arc<Self>, GpuError> {
        adapters().get(at).map_or(Err(GpuError::NoAdapter), Self::open_adapter)
    }

    /// Opens the first adapter whose name contains `wanted`, or the first one.
    pub fn open(wanted: Option<&str>) -> Result<Arc<Self>, GpuError> {
        let adapters = adapters();
        let known: Vec<String> = adapters.iter().map(|adapter| adapter.get_info().name).collect();
        let fits = |name: &String| wanted.is_none_or(|wanted| name.to_lowercase().contains(&wanted.to_lowercase()));
        let adapter = match (known.iter().position(fits), wanted) {
            (Some(at), _) => &adapters[at],
            (None, Some(wanted)) if !known.is_empty() => {
                return Err(GpuError::UnknownAdapter { wanted: wanted.into(), known });
            }
            _ => return Err(GpuError::NoAdapter),
        };
        Self::open_adapter(adapter)
    }

    fn open_adapter(adapter: &wgpu::Adapter) -> Result<Arc<Self>, GpuError> {
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("lodlab"),
            required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| GpuError::Open { adapter: adapter.get_info().name, why: error.to_string() })?;
        Self::adopt(adapter, device, queue)
    }

    /// Takes on a device that somebody else made, a window for instance. Its error handlers are lodlab's from now on.
    pub fn adopt(adapter: &wgpu::Adapter, device: wgpu::Device, queue: wgpu::Queue) -> Result<Arc<Self>, GpuError> {
        let failure = Arc::new(Mutex::new(None));
        let note = |failure: &Arc<Mutex<Option<String>>>| {
            let failure = failure.clone();
            move |what: String| {
                if let Ok(mut failure) = failure.lock() {
                    failure.get_or_insert(what);
                }
            }
        };
        let (on_error, on_loss) = (note(&failure), note(&failure));
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| on_error(error.to_string())));
        device.set_device_lost_callback(move |reason, message| {
            // dropping the device at the end is no failure
            if reason != wgpu::DeviceLostReason::Destroyed {
                on_loss(message);
            }
        });
        // a device can have less than its adapter
        let (limits, has_stamps) = (device.limits(), device.features().contains(wgpu::Features::TIMESTAMP_QUERY));
        let mut gpu = Self {
            device,
            queue,
            summary: summarize(adapter),
            limits,
            submission_ms: 0.0,
            cache: Cache::default(),
            watch: Arc::default(),
            adapter: adapter.clone(),
            failure,
        };
        gpu.submission_ms = timing::empty_submission_ms(&gpu)?;
        gpu.summary.timestamps = gpu.summary.timestamps && has_stamps && timing::stamps_agree_with_clock(&gpu)?;
        gpu.summary.loop_turns = turns::most_turns(&gpu)?;
        Ok(Arc::new(gpu))
    }

    /// What a window is opened on.
    pub fn instance_and_adapter(&self) -> (wgpu::Instance, wgpu::Adapter) {
        (instance().clone(), self.adapter.clone())
    }

    /// Waits until everything submitted is done.
    pub fn wait(&self) -> Result<(), GpuError> {
        self.wait_for(&self.queue.submit([]))
    }

    /// Waits for a submission, and for those before it.
    pub fn wait_for(&self, submission: &wgpu::SubmissionIndex) -> Result<(), GpuError> {
        // (with a timeout it can panic: wgpu-core 30 asserts that no other thread has emptied the queue since)
        let waits = wgpu::PollType::Wait { submission_index: Some(submission.clone()), timeout: None };
        let waited = self.device.poll(waits);
        // of a submission that was refused there is nothing to wait for, and the reason has been told already
        self.check()?;
        waited.map(|_| ()).map_err(|error| GpuError::Lost(error.to_string()))
    }

    /// The first error that came in outside of any scope.
    pub fn check(&self) -> Result<(), GpuError> {
        match self.failure.lock() {
            Ok(mut failure) => failure.take().map_or(Ok(()), |what| Err(GpuError::Lost(what))),
            Err(_) => Err(GpuError::Lost("its error handler failed".into())),
        }
    }

    /// Whether it still does what it is told, after an error.
    pub fn is_alive(&self) -> bool {
        timing::empty_submission_ms(self).is_ok()
    }

    /// Runs `make` and turns what the device says about it into an error that names `what`.
    pub fn scoped<T>(&self, what: &str, make: impl FnOnce() -> T) -> Result<T, GpuError> {
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let internal = self.device.push_error_scope(wgpu::ErrorFilter::Internal);
        let made = make();
        let internal = pollster::block_on(internal.pop());
        let validation = pollster::block_on(validation.pop());
        let memory = pollster::block_on(memory.pop());
        match (memory, validation.or(internal)) {
            (Some(_), _) => Err(GpuError::OutOfMemory(what.into())),
            (None, Some(error)) => Err(GpuError::Refused { what: what.into(), why: error.to_string() }),
            (None, None) => Ok(made),
        }
    }

    /// Compares the plan with the adapter's limits, before anything is allocated.
    pub fn check_plan(&self, plan: &Plan) -> Result<(), GpuError> {
        limits::check(plan, &self.limits, &self.summary.name)
    }
}
