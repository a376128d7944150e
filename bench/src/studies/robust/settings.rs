//! The cases: what is replaced in which built-in scene.

use crate::studies::sweep::extremes::block;

/// Edges of half a base cell, and no refinement: what changes is the case alone.
const UNIFORM: &[&str] = &["mesh.start_level=3", "mesh.max_level=3"];

/// A beam of 160 × 20 × 20 mm and 10 kPa without weight, in the scene `beam`.
const SLENDER: &[&str] = &[
    "image.size_mm=[160, 20, 20]",
    "mesh.start_level=3",
    "mesh.max_level=3",
    "gravity_m_s2=[0, 0, 0]",
    "materials.0.young_modulus_pa=1e4",
    "time.steps=24",
    "time.step_s=0.05",
];

/// The load that buckles it as a cantilever, π²EI/(4L²), N.
const EULER_N: f64 = 0.012_85;

/// Its end.
const END: &str = "{shape='box', min=[1, 0, 0], max=[1, 1, 1]}";

/// What a case is compared with at its end.
#[derive(Clone, Copy, Debug)]
pub(super) enum Reference {
    None,
    /// Nothing acts any more, so that the body is where it rests.
    Rest,
    /// Of the tools, N.
    Force(f64),
}

/// A mesh or an image of the study's own making.
pub(super) struct File {
    pub name: String,
    pub bytes: Vec<u8>,
}

/// A scene, whatever its element and equilibrium.
pub(super) struct Setting {
    /// What is varied.
    pub group: &'static str,
    /// Unique within the study.
    pub name: String,
    /// The built-in scene.
    pub scene: &'static str,
    /// What is replaced in it, KEY=VALUE.
    pub keys: Vec<String>,
    pub reference: Reference,
    /// The number of the first step after which nothing does work on a body with inertia.
    pub free_from: Option<usize>,
    pub file: Option<File>,
    /// Whether a quick run has it.
    is_quick: bool,
}

impl Setting {
    /// One that comes to rest: `base` and then `own` in place of a scene's values.
    fn new(
        (group, name): (&'static str, String),
        scene: &'static str,
        base: &[&str],
        own: &[String],
    ) -> Self {
        let keys = base.iter().map(|&one| one.to_owned()).chain(own.iter().cloned()).collect();
        let (reference, free_from, file, is_quick) = (Reference::Rest, None, None, false);
        Self { group, name, scene, keys, reference, free_from, file, is_quick }
    }

    fn quick(self, is_quick: bool) -> Self {
        Self { is_quick, ..self }
    }
}

/// All cases, or those of a quick run.
pub(super) fn settings(quick: bool) -> Vec<Setting> {
    let lists =
        [materials(), displacements(), meshes(), probes(), releases(), loads(), time_steps()];
    lists.into_iter().flatten().filter(|one| one.is_quick || !quick).collect()
}

/// Ratios of Young's moduli, and Poisson's ratios.
fn materials() -> Vec<Setting> {
    let small = &["image.voxel_mm=8", "mesh.max_level=3", "mesh.max_vertices=400"];
    let ratio = |power: i32| {
        let own = [format!("materials.1.young_modulus_pa={:e}", 5e3 * 10f64.powi(power))];
        let name = ("material", format!("modulus ratio 1e{power}"));
        Setting::new(name, "stiff", small, &own).quick(power == 9)
    };
    let poisson = |nu: &f64| {
        let own = [format!("materials.0.poisson_ratio={nu:?}")];
        let name = ("material", format!("Poisson ratio {nu}"));
        let is_quick = *nu == -0.9 || *nu == 0.499;
        Setting::new(name, "near_incompressible", &["mesh.max_level=3"], &own).quick(is_quick)
    };
    let ratios = [-0.9, 0.0, 0.3, 0.45, 0.49, 0.499, 0.4999];
    [0, 3, 6, 9].into_iter().map(ratio).chain(ratios.iter().map(poisson)).collect()
}

/// Pulls, twists and a bar that is turned inside out.
fn displacements() -> Vec<Setting> {
    let pull = |nu: f64, lengths: usize| {
        let path =
            format!("[{{time_s=0}}, {{time_s=1, move_m=[{}, 0, 0]}}]", 0.08 * lengths as f64);
        let name = ("displacement", format!("pull of {lengths} lengths, nu {nu}"));
        let own = [format!("tools.0.path={path}"), format!("materials.0.poisson_ratio={nu:?}")];
        Setting::new(name, "extreme", &[UNIFORM, &["time.steps=12"]].concat(), &own)
    };
    let linear = |mut one: Setting| {
        one.keys.push("stages.law=linear".to_owned());
        one.name += ", law linear";
        one
    };
    // Held by its vertices a bar without a Poisson ratio is stretched evenly: E A u/L, 16 N a length.
    let mut even = pull(0.0, 3);
    let held = ["support.hold=vertices", "tools.0.hold=vertices", "tools.0.release_s=9.0"];
    even.keys.extend(held.map(str::to_owned));
    let even = Setting { reference: Reference::Force(48.0), ..linear(even) }.quick(true);
    let twist = |turns: usize| {
        let path = format!("[{{time_s=0}}, {{time_s=2, turn_deg={}}}]", 360 * turns);
        let own = [format!("tools.0.path={path}")];
        let keys = [UNIFORM, &["tools.0.release_s=2.05", "time.steps=24"]].concat();
        let name = ("displacement", format!("twist of {turns} turns"));
        Setting::new(name, "twist", &keys, &own).quick(turns == 1)
    };
    let inside_out = |nu: &f64| {
        let own = [format!("materials.0.poisson_ratio={nu}")];
        Setting::new(("displacement", format!("inverted start, nu {nu}")), "extreme", UNIFORM, &own)
    };
    let pulls = (1..=3).map(|lengths| pull(0.45, lengths));
    let twists = [1, 2, 4].into_iter().map(twist);
    let turned = [0.3, 0.49].iter().map(inside_out);
    let of_linear = [pull(0.45, 2), pull(0.45, 3), inside_out(&0.49)].map(linear);
    pulls.chain([even]).chain(twists).chain(turned).chain(of_linear).collect()
}

/// Slivers in a mesh from a file, and voxels ten times as high as wide.
fn meshes() -> Vec<Setting> {
    let sliver = |power: i32| {
        let name = ("mesh", format!("slivers of 1e{power}"));
        let one =
            Setting::new(name, "near_incompressible", &["materials.0.poisson_ratio=0.45"], &[]);
        let bytes = slivers(10f64.powi(power)).into_bytes();
        let file = Some(File { name: format!("slivers{power}.msh"), bytes });
        Setting { file, ..one }.quick(power == -2)
    };
    let core = "materials.1={label=2, young_modulus_pa=5e5, poisson_ratio=0.3}";
    let keys =
        &["image.voxel_mm=2.5", "gravity_m_s2=[0, 0, 0]", "mesh.max_level=3", "time.steps=12"];
    let name = ("mesh", "voxels 1 x 1 x 10".to_owned());
    let voxels = Setting::new(name, "beam", keys, &[core.to_owned()]);
    let file = Some(File { name: "voxels.nrrd".into(), bytes: block(10) });
    [-2, -4, -6].into_iter().map(sliver).chain([Setting { file, ..voxels }]).collect()
}

/// A Gmsh mesh of a bar of 80 × 40 × 40 mm in cubes of 10 mm, six tetrahedra each, but for a layer in
/// its middle as flat as `flat`: its tetrahedra have four corners nearly in a plane.
fn slivers(flat: f64) -> String {
    let heights = [0.0, 10.0, 20.0, 20.0 + 10.0 * flat, 30.0, 40.0];
    let (mut nodes, mut tets) = (Vec::new(), Vec::new());
    let node = |[x, y, z]: [usize; 3]| 1 + x + 9 * (y + 5 * z);
    for (z, height) in heights.iter().enumerate() {
        for (x, y) in (0..5).flat_map(|y| (0..9).map(move |x| (x, y))) {
            nodes.push(format!("{} {} {} {height}\n", node([x, y, z]), 10 * x, 10 * y));
            if x == 8 || y == 4 || z == 5 {
                continue;
            }
            // From corner to opposite corner, along the axes in every order.
            for [a, b, c] in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
                let mut corner = [x, y, z];
                let mut corners = vec![node(corner)];
                for axis in [a, b, c] {
                    corner[axis] += 1;
                    corners.push(node(corner));
                }
                if (b + 3 - a) % 3 == 2 {
                    corners.swap(2, 3);
                }
                let [p, q, r, s] = [0, 1, 2, 3].map(|i| corners[i]);
                tets.push(format!("{} 4 2 1 1 {p} {q} {r} {s}\n", tets.len() + 1));
            }
        }
    }
    format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n{}$EndNodes\n$Elements\n{}\n{}$EndElements\n",
        nodes.len(),
        nodes.concat(),
        tets.len(),
        tets.concat()
    )
}

/// A ball that moves by 12 cm a step, half a centimetre deep.
fn probes() -> Vec<Setting> {
    let keys = &[
        "image.voxel_mm=5",
        "mesh.base_mm=40",
        "mesh.start_level=3",
        "mesh.max_level=3",
        "tools.0.spacing_m=0.005",
        "time.steps=8",
    ];
    let probe = |radius: f64| {
        let key = |i: usize| {
            let x = if i.is_multiple_of(2) { -0.06 } else { 0.06 };
            let z = if i == 0 || i > 5 { radius + 0.01 } else { radius - 0.005 };
            format!("{{time_s={}, move_m=[{x}, 0, {z}]}}", 0.1 * i as f64)
        };
        let path = (0..8).map(key).collect::<Vec<_>>().join(", ");
        let own = [format!("tools.0.radius_m={radius}"), format!("tools.0.path=[{path}]")];
        let name = ("contact", format!("probe by {:.0} radii a step", 0.12 / radius));
        Setting::new(name, "indent", keys, &own).quick(radius > 0.03)
    };
    [0.04, 0.02, 0.01].into_iter().map(probe).collect()
}

/// A beam pressed together by a fifth and a little to the side until it buckles, and let go.
fn releases() -> Vec<Setting> {
    let path = "[{time_s=0}, {time_s=1, move_m=[-0.032, 0, 0.004]}]";
    let own = |release: f64| {
        format!("tools=[{{kind='grab', region={END}, path={path}, release_s={release}}}]")
    };
    let name = |how: &str| ("release", format!("buckled, let go {how}"));
    let still = Setting::new(name("at rest"), "beam", SLENDER, &[own(1.05)]).quick(true);
    let moving = [own(1.0), "dynamics={}".into(), "time.steps=60".into()];
    let moving = Setting::new(name("with inertia"), "beam", SLENDER, &moving);
    vec![still, Setting { reference: Reference::None, free_from: Some(21), ..moving }]
}

/// Loads that keep their direction and pressures that follow the surface, past buckling.
fn loads() -> Vec<Setting> {
    // Along the beam and across it, in Euler's loads.
    let load = |along: f64, across: f64| {
        let force = format!("[{}, 0, {}]", along * EULER_N, across * EULER_N);
        format!("{{kind='load', region={END}, load=[{{time_s=0}}, {{time_s=1, force_n={force}}}]}}")
    };
    let dead = |times: f64| (format!("dead load, {times} times Euler's"), load(-times, 0.01));
    let following = |times: f64| {
        let end = times * EULER_N / 4e-4;
        let push = format!("{{time_s=0, pressure_pa=0}}, {{time_s=1, pressure_pa={end}}}");
        // The outline is a little inside of the voxels, and its pieces at the sides push each other out.
        let face = "{shape='box', min=[0.97, -0.1, -0.1], max=[1.1, 1.1, 1.1]}";
        let pressure = format!("{{kind='pressure', region={face}, pressure=[{push}]}}");
        let tools = format!("{pressure}, {}", load(0.0, 0.05));
        (format!("following pressure, {times} times Euler's"), tools)
    };
    let all = [dead(2.0), dead(5.0), dead(20.0), following(2.0), following(20.0)];
    let one = |(name, tools): (String, String)| {
        let is_quick = name.contains(" 5 times");
        let own = [format!("tools=[{tools}]")];
        let one = Setting::new(("load", name), "beam", SLENDER, &own);
        Setting { reference: Reference::None, ..one }.quick(is_quick)
    };
    all.into_iter().map(one).collect()
}

/// A beam that falls from rest, by steps of very different length.
fn time_steps() -> Vec<Setting> {
    let one = |seconds: &f64| {
        let own = [format!("time.step_s={seconds:?}"), "tools=[]".into()];
        let keys = [UNIFORM, &["time.steps=40"]].concat();
        let one =
            Setting::new(("time step", format!("step of {seconds:?} s")), "drop", &keys, &own);
        let one = Setting { reference: Reference::None, free_from: Some(1), ..one };
        one.quick(*seconds == 0.1)
    };
    [1e-5, 1e-3, 0.1, 1.0].iter().map(one).collect()
}
