//! The kernels, translated once per device and precision, and their arguments.

use wgpu::{BindGroupLayout, ComputePass, ComputePipeline};

/// Bytes of [`Work`].
pub(crate) const WORK_BYTES: u32 = 48;

/// The storage buffers that every kernel may touch, in the order of their bindings.
pub(crate) const BINDINGS: usize = 6;

const HEAD: &str = include_str!("head.wgsl");

/// A kernel by its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kernel {
    Gather,
    Correct,
    Pick,
    Times,
    Diagonal,
    CorrectDiagonal,
    Update,
    Symv,
    Inner,
    Reduce,
    Put,
    MoveRows,
}

/// In the order of [`Kernel`].
const SOURCES: [(&str, &str); 12] = [
    ("gather", include_str!("gather.wgsl")),
    ("correct", include_str!("correct.wgsl")),
    ("pick", include_str!("pick.wgsl")),
    ("times", include_str!("times.wgsl")),
    ("diagonal", include_str!("diagonal.wgsl")),
    ("correct_diagonal", include_str!("correct_diagonal.wgsl")),
    ("update", include_str!("update.wgsl")),
    ("symv", include_str!("symv.wgsl")),
    ("inner", include_str!("inner.wgsl")),
    ("reduce", include_str!("reduce.wgsl")),
    ("put", include_str!("put.wgsl")),
    ("move_rows", include_str!("move_rows.wgsl")),
];

/// `Work` of head.wgsl: see there.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Work {
    pub(crate) first_tile: usize,
    pub(crate) tiles: usize,
    pub(crate) rows: usize,
    pub(crate) tile_rows: usize,
    pub(crate) stride: usize,
    pub(crate) source: usize,
    pub(crate) sources: usize,
    pub(crate) target: usize,
    pub(crate) targets: usize,
    pub(crate) terms: usize,
    pub(crate) at: usize,
    pub(crate) other: usize,
}

impl Work {
    fn bytes(&self) -> Vec<u8> {
        let words = [
            self.first_tile,
            self.tiles,
            self.rows,
            self.tile_rows,
            self.stride,
            self.source,
            self.sources,
            self.target,
            self.targets,
            self.terms,
            self.at,
            self.other,
        ];
        // Sizes are checked against limits far below 2³² when buffers are made.
        words.iter().flat_map(|&word| (word as u32).to_le_bytes()).collect()
    }
}

/// All kernels in one precision, translated: nothing that can be used outside of this crate.
#[derive(Debug)]
pub struct Kernels {
    pub(crate) layout: BindGroupLayout,
    pipelines: Vec<ComputePipeline>,
}

impl Kernels {
    /// Translates all kernels for numbers of the WGSL type `scalar`. Cost: 0.1–1 s.
    pub(crate) fn new(device: &wgpu::Device, scalar: &str) -> Self {
        let entry = |binding: usize| wgpu::BindGroupLayoutEntry {
            binding: binding as u32,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                // `small` and `index` are only read.
                ty: wgpu::BufferBindingType::Storage { read_only: matches!(binding, 2 | 3) },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let entries: Vec<_> = (0..BINDINGS).map(entry).collect();
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: None,
            entries: &entries,
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: WORK_BYTES,
        });
        let pipeline = |&(name, source): &(&str, &str)| {
            let source = format!("alias T = {scalar};\n{HEAD}\n{source}");
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            });
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some("main"),
                compilation_options: Default::default(),
                cache: None,
            })
        };
        let pipelines = SOURCES.iter().map(pipeline).collect();
        Self { layout, pipelines }
    }

    /// Encodes one dispatch; none without workgroups.
    pub(crate) fn dispatch(
        &self,
        pass: &mut ComputePass<'_>,
        kernel: Kernel,
        group: &wgpu::BindGroup,
        work: &Work,
        (x, y): (usize, usize),
    ) {
        if x == 0 || y == 0 {
            return;
        }
        pass.set_pipeline(&self.pipelines[kernel as usize]);
        pass.set_bind_group(0, group, &[]);
        pass.set_immediates(0, &work.bytes());
        pass.dispatch_workgroups(x as u32, y as u32, 1);
    }
}
