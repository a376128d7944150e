//! Which implementation of each stage a scene names, and which graphics adapter.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The name that leaves the choice to the plan.
pub(crate) const AUTO: &str = "auto";

/// The inverses that live on a device, and need the feature `gpu`.
pub(crate) const ON_DEVICE: &[&str] = &["gpu", "gpu_f32"];

/// Implementation names of the swappable stages.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StageNames {
    /// What a tetrahedron's vertices carry; `auto` picks by Poisson's ratios.
    pub element: String,
    /// How fine material acts in coarse tetrahedra.
    pub homogenisation: String,
    /// How forces follow from positions.
    pub corotation: String,
    /// How stress follows from strain; `auto` takes the damping of `[dynamics]` in.
    #[serde(skip_serializing_if = "is_auto")]
    pub law: String,
    /// How a step in time is made; `auto` is `implicit_euler` with `[dynamics]`.
    #[serde(skip_serializing_if = "is_auto")]
    pub integrator: String,
    /// How equilibrium is found.
    pub equilibrium: String,
    /// What asks for refinement.
    pub indicator: String,
    /// How the inverse is kept; `auto` picks by size.
    pub inverse: String,
    /// The device of an inverse that lives on one; the first of `yawara devices` if absent.
    pub gpu_adapter: Option<Adapter>,
}

fn is_auto(name: &str) -> bool {
    name == AUTO
}

impl Default for StageNames {
    fn default() -> Self {
        Self {
            element: AUTO.into(),
            homogenisation: "laminate".into(),
            corotation: "element".into(),
            law: AUTO.into(),
            integrator: AUTO.into(),
            equilibrium: "fallback".into(),
            indicator: "residual".into(),
            inverse: AUTO.into(),
            gpu_adapter: None,
        }
    }
}

/// What [`Adapter`] wants, in words.
pub(super) const ADAPTER: &str = "an adapter's number in `yawara devices` or a part of its name";

/// A graphics adapter by its number in `yawara devices` or by a part of its name.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Adapter {
    /// A part of its name, in upper or lower case, that no other adapter's name has.
    Name(String),
    /// Its number.
    #[schemars(extend("format" = "adapter"))]
    Index(usize),
}

/// Prints the number, or the name in quotation marks.
impl fmt::Display for Adapter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Index(index) => write!(f, "{index}"),
            Self::Name(name) => write!(f, "{name:?}"),
        }
    }
}
