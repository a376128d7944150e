//! An open device: its memory budget, its errors and its loss, submitting and reading back.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError, mpsc};
use std::time::{Duration, Instant};

use wgpu::{BufferUsages, ErrorFilter, Features, Limits};

use super::adapters::found;
use super::choice::{AdapterChoice, chosen};
use super::report::AdapterReport;
use crate::GpuError;
use crate::kernels::{Kernels, TILE_AREA, WORK_BYTES};

/// The longest wait for the device.
const PATIENCE: Duration = Duration::from_secs(300);

/// The wait of a second attempt.
const GRACE: Duration = Duration::from_secs(5);

/// Bytes of C in one buffer, unless the options or the device say less.
const CHUNK_BYTES: u64 = 32 << 20;

/// Which device to open, and how much of it to use.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct DeviceOptions {
    /// Which adapter of the list of [`adapters`](crate::adapters); the first if `None`.
    pub adapter: Option<AdapterChoice>,
    /// Bytes that buffers may take in all; as many as the device gives if `None`.
    pub most_bytes: Option<u64>,
    /// Tiles of C per buffer, for tests that want many small ones; 32 MiB if `None`.
    pub chunk_tiles: Option<usize>,
}

/// An open device, shared by all inverses on it.
///
/// It never panics on a driver's error: the error is kept and returned by the next call.
#[derive(Debug)]
pub struct Device {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    report: AdapterReport,
    options: DeviceOptions,
    largest_buffer: u64,
    used: Arc<AtomicU64>,
    submits: AtomicU64,
    answers: AtomicU64,
    fault: Arc<Mutex<Option<GpuError>>>,
    /// In f32 and in f64.
    pub(crate) kernels: [OnceLock<Kernels>; 2],
}

/// A buffer that gives its bytes back to the device's budget.
#[derive(Debug)]
pub(crate) struct Memory {
    pub(crate) buffer: wgpu::Buffer,
    used: Arc<AtomicU64>,
}

impl Drop for Memory {
    fn drop(&mut self) {
        self.used.fetch_sub(self.buffer.size(), Ordering::Relaxed);
    }
}

impl Device {
    /// Opens a device with the adapter's own limits, 64-bit floating point if it has it.
    ///
    /// Cost: as [`adapters`](crate::adapters) and 10–100 ms; kernels are translated when first
    /// used.
    /// # Errors
    /// [`GpuError::NoAdapter`], [`GpuError::NoVulkan`], [`GpuError::NoSuchAdapter`],
    /// [`GpuError::SeveralAdapters`];
    /// [`GpuError::Limit`] if a limit is too low; [`GpuError::NotOpened`] if the driver refuses.
    pub fn open(options: DeviceOptions) -> Result<Arc<Self>, GpuError> {
        let mut found = found()?;
        let reports: Vec<&AdapterReport> = found.iter().map(|(_, report)| report).collect();
        let index = chosen(options.adapter.as_ref(), &reports)?;
        let (adapter, report) = found.swap_remove(index);
        let name = || report.name.clone();
        let limits = adapter.limits();
        check_limits(&report.name, &limits)?;
        if options.chunk_tiles == Some(0) {
            let limit = "tiles per chunk";
            return Err(GpuError::Limit { adapter: name(), limit, got: 0, want: 1 });
        }
        let wanted = Features::SHADER_F64 | Features::IMMEDIATES;
        let request = wgpu::DeviceDescriptor {
            required_features: adapter.features() & wanted,
            required_limits: limits.clone(),
            ..Default::default()
        };
        let opened = pollster::block_on(adapter.request_device(&request));
        let (device, queue) = opened.map_err(|error| {
            let (adapter, reason) = (name(), error.to_string());
            GpuError::NotOpened { adapter, reason }
        })?;
        let fault = Arc::new(Mutex::new(None));
        keep_faults(&device, &fault);
        let largest_buffer = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
        Ok(Arc::new(Self {
            device,
            queue,
            report,
            options,
            largest_buffer,
            used: Arc::default(),
            submits: AtomicU64::new(0),
            answers: AtomicU64::new(0),
            fault,
            kernels: Default::default(),
        }))
    }

    /// What the device is and can hold.
    #[must_use]
    pub fn report(&self) -> &AdapterReport {
        &self.report
    }

    /// Bytes that the buffers made so far take.
    #[must_use]
    pub fn used_bytes(&self) -> u64 {
        self.used.load(Ordering::Relaxed)
    }

    /// Submits of commands so far.
    #[must_use]
    pub fn submits(&self) -> u64 {
        self.submits.load(Ordering::Relaxed)
    }

    /// Reads of numbers so far, each of which waits for the device.
    #[must_use]
    pub fn answers(&self) -> u64 {
        self.answers.load(Ordering::Relaxed)
    }

    /// Destroys the device: whatever is on it is lost, and every later call returns that error.
    pub fn destroy(&self) {
        self.device.destroy();
        note(&self.fault, GpuError::Lost("it was destroyed by this program".to_owned()));
    }

    /// The first error since the last check; after a loss always the loss.
    pub(crate) fn check(&self) -> Result<(), GpuError> {
        let mut fault = self.fault.lock().unwrap_or_else(PoisonError::into_inner);
        match &*fault {
            None => Ok(()),
            Some(lost @ GpuError::Lost(_)) => Err(lost.clone()),
            Some(_) => Err(fault.take().unwrap_or(GpuError::NoAdapter)),
        }
    }

    /// Tiles of C in one buffer, for numbers of that many bytes.
    pub(crate) fn chunk_tiles(&self, number_bytes: u64) -> usize {
        let tile = TILE_AREA as u64 * number_bytes;
        let most = CHUNK_BYTES.min(self.largest_buffer) / tile;
        // One dispatch takes a chunk.
        self.options.chunk_tiles.unwrap_or(most as usize).min(65_535)
    }

    /// A new buffer, all 0.
    /// # Errors
    /// [`GpuError::Limit`] above the device's largest buffer; [`GpuError::OutOfMemory`];
    /// [`GpuError::Lost`].
    pub(crate) fn allocate(
        &self,
        what: &'static str,
        bytes: u64,
        usage: BufferUsages,
    ) -> Result<Memory, GpuError> {
        self.check()?;
        // A size of 0 can't be bound; all numbers fill whole words.
        let bytes = bytes.max(256);
        if bytes > self.largest_buffer {
            let (adapter, limit) = (self.report.name.clone(), "the largest buffer in bytes");
            return Err(GpuError::Limit { adapter, limit, got: self.largest_buffer, want: bytes });
        }
        let left = self.options.most_bytes.unwrap_or(u64::MAX).saturating_sub(self.used_bytes());
        if bytes > left {
            return Err(GpuError::OutOfMemory { what, bytes, left });
        }
        let scope = self.device.push_error_scope(ErrorFilter::OutOfMemory);
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size: bytes,
            usage,
            mapped_at_creation: false,
        });
        if pollster::block_on(scope.pop()).is_some() {
            return Err(GpuError::OutOfMemory { what, bytes, left: 0 });
        }
        self.check()?;
        self.used.fetch_add(bytes, Ordering::Relaxed);
        Ok(Memory { buffer, used: Arc::clone(&self.used) })
    }

    /// Submits commands.
    pub(crate) fn submit(&self, encoder: wgpu::CommandEncoder) -> Result<(), GpuError> {
        self.check()?;
        self.queue.submit([encoder.finish()]);
        self.submits.fetch_add(1, Ordering::Relaxed);
        self.check()
    }

    /// Waits until all submitted commands are done.
    pub(crate) fn wait(&self) -> Result<(), GpuError> {
        let wait = |timeout| {
            let timeout = Some(timeout);
            self.device.poll(wgpu::PollType::Wait { submission_index: None, timeout })
        };
        // A program that was suspended meanwhile finds its time over although the device is done:
        // so there is a second attempt.
        let polled = wait(PATIENCE).or_else(|_| wait(GRACE));
        self.check()?;
        polled.map_err(|_| GpuError::Timeout(PATIENCE))?;
        Ok(())
    }

    /// Waits for the answer to a mapping request. Another thread's poll may have received it and
    /// delivers it a moment later.
    fn wait_for(&self, mapped: &mpsc::Receiver<Mapped>) -> Result<(), GpuError> {
        let start = Instant::now();
        loop {
            self.wait()?;
            match mapped.recv_timeout(Duration::from_millis(5)) {
                Ok(Ok(())) => return Ok(()),
                Ok(Err(error)) => return Err(GpuError::Refused(error.to_string())),
                Err(_) if start.elapsed() < PATIENCE => {}
                Err(_) => return Err(GpuError::Timeout(PATIENCE)),
            }
        }
    }

    /// The first bytes of a buffer that can be mapped.
    pub(crate) fn read(&self, memory: &Memory, bytes: u64) -> Result<Vec<u8>, GpuError> {
        self.check()?;
        let (send, mapped) = mpsc::channel();
        memory.buffer.map_async(wgpu::MapMode::Read, ..bytes, move |result| {
            // The receiver is gone only after a timeout.
            _ = send.send(result);
        });
        if let Err(error) = self.wait_for(&mapped) {
            // A mapped buffer could not be used by later commands.
            memory.buffer.unmap();
            return Err(error);
        }
        let refused = |error: wgpu::MapRangeError| GpuError::Refused(error.to_string());
        let data = memory.buffer.get_mapped_range(..bytes).map_err(refused)?.to_vec();
        memory.buffer.unmap();
        self.answers.fetch_add(1, Ordering::Relaxed);
        self.check()?;
        Ok(data)
    }
}

/// The answer to a request for a buffer.
type Mapped = Result<(), wgpu::BufferAsyncError>;

/// Whether a device has what the kernels need of any.
fn check_limits(adapter: &str, has: &Limits) -> Result<(), GpuError> {
    for (limit, got, want) in [
        ("max_compute_invocations_per_workgroup", has.max_compute_invocations_per_workgroup, 256),
        ("max_compute_workgroup_storage_size", has.max_compute_workgroup_storage_size, 12 << 10),
        ("max_storage_buffers_per_shader_stage", has.max_storage_buffers_per_shader_stage, 6),
        ("max_immediate_size", has.max_immediate_size, WORK_BYTES),
        ("max_compute_workgroups_per_dimension", has.max_compute_workgroups_per_dimension, 65_535),
    ] {
        if got < want {
            let (adapter, got, want) = (adapter.to_owned(), got.into(), want.into());
            return Err(GpuError::Limit { adapter, limit, got, want });
        }
    }
    Ok(())
}

/// Keeps the first error; a loss replaces any other.
fn note(fault: &Mutex<Option<GpuError>>, error: GpuError) {
    let mut fault = fault.lock().unwrap_or_else(PoisonError::into_inner);
    let is_lost = matches!(*fault, Some(GpuError::Lost(_)));
    if fault.is_none() || (!is_lost && matches!(error, GpuError::Lost(_))) {
        *fault = Some(error);
    }
}

/// Registers callbacks that keep errors and losses. Without them wgpu panics on an error, and
/// continues after a loss as if nothing had happened.
fn keep_faults(device: &wgpu::Device, fault: &Arc<Mutex<Option<GpuError>>>) {
    let lost = Arc::clone(fault);
    device.set_device_lost_callback(move |reason, message| {
        note(&lost, GpuError::Lost(format!("{reason:?}: {message}")));
    });
    let refused = Arc::clone(fault);
    device.on_uncaptured_error(Arc::new(move |error| {
        let error = match error {
            wgpu::Error::OutOfMemory { .. } => {
                GpuError::OutOfMemory { what: "a command", bytes: 0, left: 0 }
            }
            other => GpuError::Refused(other.to_string()),
        };
        note(&refused, error);
    }));
}
