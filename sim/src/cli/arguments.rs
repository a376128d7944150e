//! The command-line arguments.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};

use crate::scene::LengthUnit;
use crate::scene_file;
use clap::{Args, Parser, Subcommand};
use serde::Deserialize;
use serde::de::IntoDeserializer;

/// Deforms and refines inhomogeneous soft objects from label maps.
///
/// Without a command: runs the scene `liver` into runs/liver.
#[derive(Debug, Parser)]
#[command(name = "yawara", version, max_term_width = 100)]
pub struct Arguments {
    #[command(subcommand)]
    pub command: Option<Command>,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Writes a commented scene for an image, which runs as it is.
    Init(InitArguments),
    /// Runs a scene and writes frames, a table of steps and a summary.
    ///
    /// With --resume goes on with a run that was interrupted, from its last checkpoint.
    ///
    /// Exits 0 if every step converged, 1 if some did not (all is written), 2 if it was refused.
    Run(RunArguments),
    /// Says which stages a scene needs, and why.
    Plan(PlanArguments),
    /// Draws what a scene holds and loads, and where its tools go.
    Preview(PreviewArguments),
    /// Writes the undeformed tetrahedra of a label map.
    Mesh(MeshArguments),
    /// Writes the labels that a scene would use of an image: resampled to cubes, classified.
    Labels(LabelsArguments),
    /// Writes the outlines of a label map's labels, closed and oriented.
    Surface(SurfaceArguments),
    /// Runs a scene in real time with a simulated hand on a tool, which follows the tool's path.
    ///
    /// Prints rates and latencies. What is computed depends on how fast this machine is.
    Haptic(HapticArguments),
    /// Draws how stiff the skin feels under a fingertip, or where and how much a nodule is felt.
    Feel(FeelArguments),
    /// Finds the moduli of a scene's materials from measured moves and forces, with bands.
    ///
    /// Exits 0 if they were found, 1 if the search ended before, 2 if it was refused.
    Identify(IdentifyArguments),
    /// Shows a scene in the browser, with hands on it, or plays a run that is over.
    ///
    /// Prints the address, which has a token in it; ends with Ctrl-C.
    #[cfg(feature = "view")]
    View(ViewArguments),
    /// Writes a run that is over as a page that plays it by itself, or as a scene for other programs.
    #[cfg(feature = "view")]
    Export(ExportArguments),
    /// Removes what interrupted runs have left behind, and says which can be gone on with.
    Clean(CleanArguments),
    /// Lists the built-in scenes.
    Scenes,
    /// Lists materials that scenes may name, with their sources.
    Materials,
    /// Lists the graphics adapters (needs the feature `gpu`).
    Devices,
    /// Prints what a shell may complete, as a script for it.
    Completions(CompletionsArguments),
    /// Prints the manual page, or writes a page for each command.
    Man(ManArguments),
}

#[derive(Debug, Default, Args)]
pub struct RunArguments {
    /// A TOML file, or the name of a built-in scene.
    #[arg(default_value = DEFAULT_SCENE)]
    pub scene: String,
    /// Directory for the results, new or empty [default: runs/<name of the scene>].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Replaces a value of the scene; a TOML value, or else a string. E.g. time.steps=20,
    /// materials.0.young_modulus_pa=5e3, image.path=FILE.nii.gz.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Number of steps, as --set time.steps=N.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub steps: Option<i64>,
    /// Replaces the results of an earlier run in DIR; other files there stay.
    #[arg(long)]
    pub force: bool,
    /// Goes on with the interrupted run of DIR, or of its .NAME.PID.partial folder, from its last checkpoint
    /// (output.checkpoint_steps of its scene).
    #[arg(long, value_name = "DIR", conflicts_with_all = ["scene", "out", "set", "steps", "force"])]
    pub resume: Option<PathBuf>,
}

/// The scene of a command that names none.
pub const DEFAULT_SCENE: &str = "liver";

#[derive(Debug, Args)]
pub struct InitArguments {
    /// A label map or a CT in Hounsfield units (NIfTI, NRRD, MetaImage, VTK or DICOM).
    pub image: PathBuf,
    /// The scene to write.
    #[arg(long, value_name = "FILE.toml", default_value = "scene.toml")]
    pub out: PathBuf,
    /// The unit of the image's spacings (um, mm, cm or m) [default: mm, if a body of that size is likely].
    #[arg(long, value_name = "UNIT", value_parser = unit)]
    pub unit: Option<LengthUnit>,
    /// Replaces a file that is there.
    #[arg(long)]
    pub force: bool,
}

/// A unit of length by the name that scenes have for it.
fn unit(text: &str) -> Result<LengthUnit, serde::de::value::Error> {
    LengthUnit::deserialize(text.into_deserializer())
}

#[derive(Debug, Args)]
pub struct CleanArguments {
    /// The folder of the runs.
    #[arg(default_value = "runs")]
    pub folder: PathBuf,
    /// Those too that can be gone on with (run --resume).
    #[arg(long)]
    pub all: bool,
}

#[derive(Debug, Args)]
pub struct PlanArguments {
    /// A TOML file, or the name of a built-in scene.
    #[arg(default_value = DEFAULT_SCENE)]
    pub scene: String,
    /// Replaces a value of the scene, as for run.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Prints a JSON array instead of a table.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct FeelArguments {
    /// A TOML file, or the name of a built-in scene.
    #[arg(default_value = DEFAULT_SCENE)]
    pub scene: String,
    /// The picture to write.
    #[arg(long, value_name = "FILE.png")]
    pub out: PathBuf,
    /// Writes what is felt at every point as JSON.
    #[arg(long, value_name = "FILE.json")]
    pub json: Option<PathBuf>,
    /// Points of the skin at most.
    #[arg(long, value_name = "N", default_value_t = 10_000)]
    pub points: usize,
    /// Radius of the fingertip, mm.
    #[arg(long, value_name = "MM", default_value_t = 5.0)]
    pub radius_mm: f64,
    /// A material, by name or number from 0, whose part in the force is drawn.
    #[arg(long, value_name = "NAME")]
    pub nodule: Option<String>,
    /// The material that would be in its place [default: the first].
    #[arg(long, value_name = "NAME", requires = "nodule")]
    pub like: Option<String>,
    /// How deep the fingertip presses where forces are compared, mm.
    #[arg(long, value_name = "MM", default_value_t = 2.0)]
    pub depth_mm: f64,
    /// The least difference of force that counts as felt, N.
    #[arg(long, value_name = "N", default_value_t = 0.05)]
    pub threshold_n: f64,
    /// Replaces a value of the scene, as for run.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

#[derive(Debug, Args)]
pub struct IdentifyArguments {
    /// A TOML file, or the name of a built-in scene: the body, what holds it and what its tools did.
    pub scene: String,
    /// A table of what was measured, several times for several: time_s and either x_mm, y_mm, z_mm, ux_mm, uy_mm, uz_mm,
    /// sd_mm (where a point rests, how far it has moved) or tool, fx_n, fy_n, fz_n, sd_n.
    #[arg(long, value_name = "FILE.csv", required = true)]
    pub measured: Vec<PathBuf>,
    /// A material whose modulus is looked for, by name or number from 0, several times for several [default: all].
    #[arg(long, value_name = "NAME")]
    pub material: Vec<String>,
    /// Before anything is measured a modulus is believed to be within this factor of the scene's (one standard deviation).
    #[arg(long, value_name = "FACTOR", default_value_t = 10.0)]
    pub prior_factor: f64,
    /// Writes all that is found as JSON.
    #[arg(long, value_name = "FILE.json")]
    pub json: Option<PathBuf>,
    /// Draws what was measured and what is left.
    #[arg(long, value_name = "FILE.svg")]
    pub picture: Option<PathBuf>,
    /// Replaces a value of the scene, as for run.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

#[derive(Debug, Args)]
pub struct PreviewArguments {
    /// A TOML file, or the name of a built-in scene.
    #[arg(default_value = DEFAULT_SCENE)]
    pub scene: String,
    /// The picture to write.
    #[arg(long, value_name = "FILE.png")]
    pub out: PathBuf,
    /// Replaces a value of the scene, as for run.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Prints what is held as JSON instead of a table.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct HapticArguments {
    /// A TOML file, or the name of a built-in scene.
    #[arg(default_value = "probe")]
    pub scene: String,
    /// For how long; the path starts again when it ends.
    #[arg(long, value_name = "S", default_value_t = 5.0)]
    pub seconds: f64,
    /// Number of the tool in the hand.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub tool: usize,
    /// Stiffness of the coupling between hand and tool, N/m.
    #[arg(long, value_name = "F", default_value_t = 500.0)]
    pub stiffness_n_m: f64,
    /// Damping of the coupling, N s/m.
    #[arg(long, value_name = "F", default_value_t = 0.1)]
    pub damping_n_s_m: f64,
    /// Gives the hand back energy that it has not put in, where the body has it: only observes.
    #[arg(long)]
    pub no_passivity: bool,
    /// Gives the tool to a program that sends poses to this UDP address and gets forces back, in place of
    /// the scene's path; a port alone is one of this machine, 0 any that is free.
    #[arg(long, value_name = "[ADDRESS:]PORT", value_parser = udp_address)]
    pub udp: Option<SocketAddr>,
    /// The largest force that is sent to it, N.
    #[arg(long, value_name = "F", default_value_t = 10.0, requires = "udp")]
    pub most_force_n: f64,
    /// Also writes the printed numbers as JSON.
    #[arg(long, value_name = "FILE.json")]
    pub out: Option<PathBuf>,
    /// Replaces a value of the scene, as for run.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

#[cfg(feature = "view")]
#[derive(Debug, Args)]
pub struct ViewArguments {
    /// A TOML file, the name of a built-in scene, or the directory of a run that is over.
    #[arg(value_name = "SCENE|RUN_DIR", default_value = DEFAULT_SCENE)]
    pub scene: String,
    /// The port; 0 takes any that is free.
    #[arg(long, value_name = "P", default_value_t = 0)]
    pub port: u16,
    /// Where to listen. Beyond 127.0.0.1 whoever reads the address on its way has hands on it too.
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1")]
    pub listen: std::net::IpAddr,
    /// Leaves the scene's own grabs and probes on their paths, and its steps as long as they are.
    #[arg(long)]
    pub play: bool,
    /// Goes on while no page is open.
    #[arg(long)]
    pub keep_going: bool,
    /// Directory for recordings [default: runs/view].
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Replaces a value of the scene, as for run.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Shows a second simulation of the scene beside the first, with a value of its own; the same hand leads both.
    #[arg(long, value_name = "KEY=VALUE")]
    pub beside: Vec<String>,
    /// The scan that a label map was made from, NIfTI and others as for images: its grey values are shown on cuts.
    #[arg(long, value_name = "FILE")]
    pub grey: Option<PathBuf>,
}

#[cfg(feature = "view")]
#[derive(Debug, Args)]
pub struct ExportArguments {
    /// The directory of a run that is over.
    #[arg(value_name = "RUN_DIR")]
    pub run: PathBuf,
    /// A page that plays the run without a server and without a network.
    #[arg(long, value_name = "FILE.html")]
    pub html: Option<PathBuf>,
    /// An animated scene in binary glTF 2.0.
    #[arg(long, value_name = "FILE.glb")]
    pub gltf: Option<PathBuf>,
    /// An animated picture (PNG).
    #[arg(long, value_name = "FILE.png")]
    pub picture: Option<PathBuf>,
    /// How long it lasts until it begins anew; no frame is shorter than .01 s.
    #[arg(
        long,
        value_name = "S",
        default_value_t = 10.0,
        requires = "picture",
        allow_negative_numbers = true
    )]
    pub seconds: f64,
}

/// An address with its port, or a port of this machine.
fn udp_address(text: &str) -> Result<SocketAddr, String> {
    let port = text.parse().map(|port: u16| SocketAddr::from((Ipv4Addr::LOCALHOST, port)));
    let want = "a port, or an address with a port such as 127.0.0.1:5005 or [::1]:5005";
    port.or_else(|_| text.parse()).map_err(|_| format!("want {want}"))
}

#[derive(Debug, Args)]
pub struct MeshArguments {
    /// A label map (NIfTI, NRRD, MetaImage, VTK or DICOM), or the word phantom for the procedural liver.
    pub image: String,
    /// Edge of the base cells in mm, rounded to a power of two times the voxel edge
    /// [default: an eighth of the body's longest side].
    #[arg(long, value_name = "F")]
    pub base_mm: Option<f64>,
    /// Bisections of every base tetrahedron; 3 halve the edges.
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub level: u8,
    /// The file to write: .vtu (VTK) or .msh (Gmsh).
    #[arg(long, value_name = "FILE.vtu")]
    pub out: PathBuf,
}

#[derive(Debug, Args)]
pub struct LabelsArguments {
    /// A label map or, with --range, an image of intensities (NIfTI, NRRD, MetaImage, VTK or DICOM).
    pub image: PathBuf,
    /// The file to write [default: none, the labels are listed only].
    #[arg(long, value_name = "FILE.nii.gz")]
    pub out: Option<PathBuf>,
    /// Edge of the voxels in mm [default: the image's, its smallest where they differ].
    #[arg(long, value_name = "F")]
    pub voxel_mm: Option<f64>,
    /// Standard deviation in mm of a Gaussian that smooths intensities first.
    #[arg(long, value_name = "F")]
    pub blur_mm: Option<f64>,
    /// Gives LABEL to intensities from LOW on and below HIGH (inf and -inf allowed); repeatable.
    /// What is in no range becomes 0.
    #[arg(long, value_name = "LABEL:LOW:HIGH", allow_hyphen_values = true)]
    pub range: Vec<String>,
}

#[derive(Debug, Args)]
pub struct SurfaceArguments {
    /// A label map (NIfTI, NRRD, MetaImage, VTK or DICOM), or the word phantom for the procedural liver.
    pub image: String,
    /// A label to outline; repeatable [default: all].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub label: Vec<i64>,
    /// Width in voxels of the blur that rounds off stairs; tubes of radius below 1.18 of it vanish.
    #[arg(long, value_name = "F", default_value_t = 1.0, allow_hyphen_values = true)]
    pub sigma_voxels: f64,
    /// The file to write: .ply or .vtp, scanner RAS in mm.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
}

#[derive(Debug, Args)]
pub struct CompletionsArguments {
    /// The shell.
    pub shell: clap_complete::Shell,
}

#[derive(Debug, Args)]
pub struct ManArguments {
    /// The folder for the pages of all commands [default: none, the first page is printed].
    #[arg(value_name = "DIR")]
    pub folder: Option<PathBuf>,
}

/// What was probably meant by words that are no command, or by options of `run` alone.
pub fn meant(words: &[String]) -> Option<String> {
    let first = words.first()?;
    let rest = words.join(" ");
    let is_scene =
        first.ends_with(".toml") || scene_file::built_in().iter().any(|(name, _)| name == first);
    if is_scene
        || ["--out", "--set", "--steps", "--force", "--resume"]
            .iter()
            .any(|one| first.starts_with(one))
    {
        return Some(format!("did you mean `yawara run {rest}`?"));
    }
    let is_file = Path::new(first).exists();
    is_file.then(|| format!("did you mean `yawara init {first}`, then `yawara run scene.toml`?"))
}

/// The message of a usage error as one paragraph, without the usage lines.
pub fn paragraph(error: &clap::Error) -> String {
    let text = error.to_string();
    let text = text.strip_prefix("error: ").unwrap_or(&text);
    let end =
        ["\nUsage:", "\nFor more information"].iter().filter_map(|mark| text.find(mark)).min();
    format!("{} (see yawara --help)", text[..end.unwrap_or(text.len())].trim_end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_is_consistent() {
        use clap::CommandFactory;
        Arguments::command().debug_assert();
    }

    #[test]
    fn usage_errors_are_one_paragraph_with_the_tip() {
        let error = Arguments::try_parse_from(["yawara", "run", "--stesp", "3"]).unwrap_err();
        let text = paragraph(&error);
        assert!(text.contains("'--stesp'") && text.contains("'--steps'"), "{text}");
        assert!(!text.contains("Usage") && !text.starts_with("error"), "{text}");
    }
}
