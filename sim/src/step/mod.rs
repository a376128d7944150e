//! One step of the simulation, and the loop over all of them.
//!
//! `simulation` is the file to open first: it owns the parts, which do not know it, and runs them in
//! order; `builder` makes them from a scene. `equilibrium` brings the body to rest under its loads, those of
//! tools from `tool_loads`, starting from what `predictor` expects, with inertia by `dynamics`, vertices `held` by tools and
//! probes by `contact`, in parts as long as `pace` allows; `missed` says where it fails. `refinement`
//! splits and merges the mesh of `content` where the [`indicator`] and `marking` ask for it, and estimates how far
//! `figures` are from those of a finer one, as far as `measuring` asks and what was found has not `stood`; `tool_forces` measures what tools feel, and `ledger` whose work became which
//! energy, with what `slips` from under tools when the mesh changes. `hands` has tools come, go where they are led and
//! let go while the simulation runs, `editing` changes the labels that they change; `holding` puts what they hold into the body. `keeping` takes all of the state out as
//! a `checkpoint` and makes it again from its `beginning`.

mod beginning;
mod builder;
mod checkpoint;
mod contact;
mod content;
mod cutting;
mod dynamics;
mod easing;
mod editing;
mod equilibrium;
mod figures;
mod grips;
mod hands;
mod held;
mod holding;
pub mod indicator;
mod keeping;
mod ledger;
mod marking;
mod measuring;
mod missed;
mod pace;
mod predictor;
mod proximity;
mod refinement;
mod sensitivity;
mod settling;
mod simulation;
mod slips;
mod softness;
mod span;
mod stood;
mod tool_forces;
mod tool_loads;

pub use builder::SimulationBuilder;
pub use checkpoint::Checkpoint;
pub(crate) use sensitivity::{Reading, Variations};
pub use simulation::Simulation;
