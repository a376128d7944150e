//! What a page may say: JSON, one request a message, checked before anything is done.

use serde::Deserialize;

use crate::scene::file;

/// The longest message, bytes.
pub(super) const LONGEST_MESSAGE: usize = 16 << 10;

/// Hands of one page.
const HANDS: u8 = 10;

/// The longest way that a hand moves, mm.
const FARTHEST_MM: f64 = 1e4;

/// Lengths of the edge of a blade, mm.
const EDGES_MM: std::ops::RangeInclusive<f64> = 1.0..=500.0;

/// Radii of what a hand holds or presses with, mm.
const RADII_MM: std::ops::RangeInclusive<f64> = 0.5..=200.0;

/// Keys that a page may change, or what they begin with.
const KEYS: [&str; 11] = [
    "stages.",
    "refinement.split_above",
    "refinement.target",
    "refinement.merge_fraction",
    "refinement.max_splits_per_step",
    "refinement.every_steps",
    "refinement.ease_s",
    "solver.residual",
    "mesh.max_vertices",
    "gravity_m_s2",
    "materials.",
];

/// Of a material only these.
const OF_MATERIALS: [&str; 3] = [".young_modulus_pa", ".poisson_ratio", ".density_kg_m3"];

/// The most changes at a time, and the longest of them, bytes.
const CHANGES: (usize, usize) = (32, 200);

/// A request of a page.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Request {
    /// Takes hold of the material around a place at rest, scanner RAS, mm.
    Grab { hand: u8, rest_mm: [f64; 3], radius_mm: f64 },
    /// Puts a ball there, which presses from then on.
    Press { hand: u8, centre_mm: [f64; 3], radius_mm: f64 },
    /// Puts a blade there by its tip, scanner RAS, mm, with the other end of its edge `edge_mm` from there, scanner axes,
    /// mm: what it sweeps over from then on is cut.
    Cut { hand: u8, tip_mm: [f64; 3], edge_mm: [f64; 3] },
    /// Puts a ball there, scanner RAS, mm, that joins the cut faces in it.
    Sew { hand: u8, centre_mm: [f64; 3], radius_mm: f64 },
    /// Where a hand is from where it took hold, scanner axes, mm; `stamp` comes back in the picture that
    /// shows it.
    Move { hand: u8, move_mm: [f64; 3], stamp: u32 },
    /// Lets go.
    Release { hand: u8 },
    /// So many pictures have been drawn; a page has at most two that it has not.
    Drawn { count: u32 },
    /// Stops the clock, or lets it go on.
    Pause { on: bool },
    /// One step while the clock stands.
    Step {},
    /// Begins anew, at rest.
    Reset {},
    /// Begins anew with keys of the scene changed, `KEY=VALUE`.
    Set { changes: Vec<String> },
    /// Keeps what the hands did, and runs it again into a run directory.
    Save {},
    /// Shows a frame of a run that is over, by its number.
    Seek { frame: usize },
}

impl Request {
    /// Reads a message.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub fn read(text: &str) -> Result<Self, String> {
        if text.len() > LONGEST_MESSAGE {
            return Err(format!(
                "a message of {} bytes, want at most {LONGEST_MESSAGE}",
                text.len()
            ));
        }
        let request: Self = serde_json::from_str(text).map_err(|error| error.to_string())?;
        request.check()?;
        Ok(request)
    }

    fn check(&self) -> Result<(), String> {
        match self {
            Self::Grab { hand, rest_mm: at, radius_mm }
            | Self::Press { hand, centre_mm: at, radius_mm }
            | Self::Sew { hand, centre_mm: at, radius_mm } => {
                check_hand(*hand)?;
                check_place("the place", at)?;
                match RADII_MM.contains(radius_mm) {
                    true => Ok(()),
                    false => Err(format!(
                        "radius_mm is {radius_mm}, want {} to {}",
                        RADII_MM.start(),
                        RADII_MM.end()
                    )),
                }
            }
            Self::Cut { hand, tip_mm, edge_mm } => {
                check_hand(*hand)?;
                check_place("tip_mm", tip_mm)?;
                check_place("edge_mm", edge_mm)?;
                let length = edge_mm.iter().map(|x| x * x).sum::<f64>().sqrt();
                match EDGES_MM.contains(&length) {
                    true => Ok(()),
                    false => {
                        let (least, most) = (EDGES_MM.start(), EDGES_MM.end());
                        Err(format!("edge_mm is {length} mm long, want {least} to {most}"))
                    }
                }
            }
            Self::Move { hand, move_mm, .. } => {
                check_hand(*hand)?;
                check_place("move_mm", move_mm)
            }
            Self::Release { hand } => check_hand(*hand),
            Self::Set { changes } => check_changes(changes),
            Self::Drawn { .. }
            | Self::Pause { .. }
            | Self::Step {}
            | Self::Reset {}
            | Self::Save {}
            | Self::Seek { .. } => Ok(()),
        }
    }
}

fn check_hand(hand: u8) -> Result<(), String> {
    match hand < HANDS {
        true => Ok(()),
        false => Err(format!("hand is {hand}, want at most {}", HANDS - 1)),
    }
}

fn check_place(what: &str, at: &[f64; 3]) -> Result<(), String> {
    match at.iter().find(|x| !(x.abs() <= FARTHEST_MM)) {
        None => Ok(()),
        Some(x) => Err(format!("{what} has {x} mm, want at most {FARTHEST_MM} either way")),
    }
}

fn check_changes(changes: &[String]) -> Result<(), String> {
    let (most, longest) = CHANGES;
    if changes.is_empty() || changes.len() > most {
        return Err(format!("{} changes, want 1 to {most}", changes.len()));
    }
    for change in changes {
        if change.len() > longest {
            return Err(format!("a change of {} bytes, want at most {longest}", change.len()));
        }
        let key = change.split('=').next().unwrap_or_default().trim();
        let is_number = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
        let of_material =
            |key: &str| OF_MATERIALS.iter().any(|end| key.strip_suffix(end).is_some_and(is_number));
        let may = KEYS.iter().any(|known| match *known {
            "materials." => key.strip_prefix(known).is_some_and(of_material),
            "stages." => key.starts_with(known),
            known => key == known,
        });
        if !may {
            return Err(format!("{key:?} can't be changed from a page"));
        }
    }
    Ok(())
}

/// The scene of a name or file with `changes`; relative paths start from the current directory.
///
/// # Errors
/// As [`file::load`], in words.
pub(super) fn scene_with(
    name: &str,
    changes: &[String],
) -> Result<crate::scene::Scene, crate::SimError> {
    Ok(file::load(name, changes)?.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_page_says_is_read() {
        let text = r#"{"do":"grab","hand":0,"rest_mm":[1,2.5,-3],"radius_mm":12}"#;
        let want = Request::Grab { hand: 0, rest_mm: [1.0, 2.5, -3.0], radius_mm: 12.0 };
        assert_eq!(Request::read(text).unwrap(), want);
        assert_eq!(Request::read(r#"{"do":"reset"}"#).unwrap(), Request::Reset {});
        let set = r#"{"do":"set","changes":["stages.corotation=paper","materials.0.young_modulus_pa=1e4"]}"#;
        assert!(Request::read(set).is_ok());
    }

    #[test]
    fn what_it_may_not_say_is_refused() {
        let long = format!(r#"{{"do":"set","changes":["stages.x={}"]}}"#, "y".repeat(300));
        let longer = format!(r#"{{"do":"{}"}}"#, "y".repeat(LONGEST_MESSAGE));
        for (text, want) in [
            ("", "EOF"),
            ("[]", "missing field `do`"),
            (r#"{"do":"fly"}"#, "unknown variant `fly`"),
            (r#"{"do":"reset","really":1}"#, "unknown field `really`"),
            (r#"{"do":"grab","hand":0,"rest_mm":[1,2],"radius_mm":1}"#, "invalid length 2"),
            (r#"{"do":"grab","hand":0,"rest_mm":[1,2,1e9],"radius_mm":1}"#, "1000000000 mm, want"),
            (r#"{"do":"grab","hand":0,"rest_mm":[1,2,1e999],"radius_mm":1}"#, "out of range"),
            (r#"{"do":"grab","hand":99,"rest_mm":[1,2,3],"radius_mm":1}"#, "hand is 99"),
            (r#"{"do":"press","hand":1,"centre_mm":[1,2,3],"radius_mm":0}"#, "radius_mm is 0"),
            (r#"{"do":"sew","hand":1,"centre_mm":[1,2,3],"radius_mm":-4}"#, "radius_mm is -4"),
            (r#"{"do":"cut","hand":1,"tip_mm":[1,2,3],"edge_mm":[0,0,0]}"#, "edge_mm is 0 mm long"),
            (r#"{"do":"cut","hand":1,"tip_mm":[1,2,3],"edge_mm":[0,0,900]}"#, "edge_mm is 900 mm"),
            (r#"{"do":"cut","hand":11,"tip_mm":[1,2,3],"edge_mm":[0,0,9]}"#, "hand is 11"),
            (r#"{"do":"move","hand":1,"move_mm":[1,2,-1e5],"stamp":1}"#, "-100000 mm"),
            (r#"{"do":"move","hand":1,"move_mm":[1,2,1],"stamp":-1}"#, "`-1`, expected u32"),
            (r#"{"do":"seek","frame":-1}"#, "`-1`, expected usize"),
            (r#"{"do":"set","changes":[]}"#, "0 changes"),
            (r#"{"do":"set","changes":["image.path=/etc/passwd"]}"#, "can't be changed"),
            (r#"{"do":"set","changes":["output.void=true"]}"#, "can't be changed"),
            (r#"{"do":"set","changes":["tools.0.path_csv=x"]}"#, "can't be changed"),
            (r#"{"do":"set","changes":["materials.0.name=x"]}"#, "can't be changed"),
            (r#"{"do":"set","changes":["materials.x.young_modulus_pa=1"]}"#, "can't be changed"),
            (&long, "bytes, want at most 200"),
            (&longer, "bytes, want at most 16384"),
        ] {
            let message = Request::read(text).unwrap_err();
            assert!(message.contains(want), "{text}: {message}");
        }
    }
}
