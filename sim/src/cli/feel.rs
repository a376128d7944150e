//! `yawara feel`: how stiff the skin feels, and where a nodule is felt.

use crate::feel::{Options, Skin, feel};
use crate::output::write_json;
use crate::{SimError, scene_file};

use super::arguments::FeelArguments;
use super::input::{check_file, material};
use super::preview::write_png;
use super::printer::Printer;

const COMMAND: &str = "yawara feel";

pub fn run(arguments: &FeelArguments, out: &mut Printer) -> Result<(), SimError> {
    let FeelArguments { scene, out: file, json, nodule, like, set, .. } = arguments;
    check_file(COMMAND, "--out", file, "png")?;
    if let Some(json) = json {
        check_file(COMMAND, "--json", json, "json")?;
    }
    let (scene, _) = scene_file::load(scene, set)?;
    let nodule = match nodule {
        None => None,
        Some(nodule) => {
            let like =
                like.as_ref().map_or(Ok(0), |like| material(COMMAND, "--like", &scene, like))?;
            Some([material(COMMAND, "--nodule", &scene, nodule)?, like])
        }
    };
    let options = Options {
        points: arguments.points,
        radius_mm: arguments.radius_mm,
        depth_mm: arguments.depth_mm,
        threshold_n: arguments.threshold_n,
        nodule,
    };
    let skin = feel(&scene, None, &options)?;
    write_png(file, &skin.picture(&options))?;
    if let Some(json) = json {
        write_json(json, &skin)?;
    }
    out.print(&summary(&skin, &options))?;
    for file in std::iter::once(file).chain(json) {
        out.print(&format!("written to {}\n", file.display()))?;
    }
    Ok(())
}

fn summary(skin: &Skin, options: &Options) -> String {
    let mut text = format!(
        "skin      {} points on {} vertices, a fingertip of {} mm; {:.0} ms for the solves\n",
        skin.points.len(),
        skin.vertices,
        options.radius_mm,
        skin.solves_ms
    );
    let range = |name: &str, unit: &str, mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        let at = |part: f64| values[(part * (values.len() - 1) as f64).round() as usize];
        match values.is_empty() {
            true => format!("{name:<9} none\n"),
            false => format!(
                "{name:<9} {:.4} to {:.4} {unit}, half of the skin above {:.4}\n",
                at(0.0),
                at(1.0),
                at(0.5)
            ),
        }
    };
    let stiffnesses = skin.points.iter().map(|point| point.stiffness_n_m).collect();
    text += &range("stiffness", "N/m", stiffnesses);
    if let Some(share) = skin.felt_share {
        let differences = skin.points.iter().filter_map(|point| point.difference_n(options));
        text += &range("nodule", "N", differences.collect());
        text += &format!(
            "felt      on {:.1} % of the skin: {} N or more at {} mm\n",
            1e2 * share,
            options.threshold_n,
            options.depth_mm
        );
    }
    text
}
