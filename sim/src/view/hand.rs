//! A pointer and the tool that it leads, coupled as a haptic device is.

use nalgebra::Vector3;

use crate::SimError;
use crate::haptic::{CoupledDevice, ForceModel, HapticOptions, VirtualCoupling, force_model};
use crate::report::StepReport;
use crate::scene::{AblationEntry, GrabEntry, ProbeEntry, Region, ToolEntry};
use crate::step::Simulation;
use crate::tools::Pose;

/// Between hand and tool: the tool lags a millimetre at 2 N.
const COUPLING: VirtualCoupling = VirtualCoupling { stiffness_n_m: 2000.0, damping_n_s_m: 0.5 };

/// The fastest that a tool follows, m/s.
const FASTEST_M_S: f64 = 0.25;

/// What a page draws of the tool in a hand.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Drawn {
    /// Radius of what it holds or presses with, mm.
    pub radius_mm: Option<f64>,
    /// From the tip of a blade to the other end of its edge, scanner axes, mm.
    pub edge_mm: Option<[f64; 3]>,
}

impl Drawn {
    fn of(entry: &ToolEntry) -> Self {
        let mut drawn = Self::default();
        match entry {
            ToolEntry::Grab(GrabEntry { region: Region::Sphere { radius_m, .. }, .. })
            | ToolEntry::Probe(ProbeEntry { radius_m, .. })
            | ToolEntry::Suture(AblationEntry { radius_m, .. }) => {
                drawn.radius_mm = Some(1e3 * radius_m);
            }
            ToolEntry::Scalpel(blade) => drawn.edge_mm = Some(blade.edge_m.map(|x| 1e3 * x)),
            _ => {}
        }
        drawn
    }
}

/// A hand of a page.
pub(super) struct Hand {
    pub tool: usize,
    pub drawn: Drawn,
    /// Where it wants to be from where it took hold, scanner axes, m.
    pub target: Vector3<f64>,
    /// Of the last move, for the page.
    pub stamp: u32,
    /// Where its tool's path was when it took hold.
    start: Pose,
    /// Where the tool is from there, m.
    at: Vector3<f64>,
    device: CoupledDevice,
    pub model: ForceModel,
    step_s: f64,
}

impl Hand {
    /// A hand on a tool that has just come.
    ///
    /// # Errors
    /// As [`Simulation::tool_pose`].
    pub fn new(
        simulation: &mut Simulation,
        tool: usize,
        time_s: f64,
        step_s: f64,
    ) -> Result<Self, SimError> {
        let options = HapticOptions {
            tool,
            period_s: step_s,
            coupling: COUPLING,
            passivity: false,
            ..HapticOptions::default()
        };
        let none = ForceModel {
            position: Vector3::zeros(),
            force: Vector3::zeros(),
            stiffness: nalgebra::Matrix3::zeros(),
            is_unilateral: false,
        };
        Ok(Self {
            tool,
            drawn: Drawn::of(&simulation.scene().tools[tool]),
            target: Vector3::zeros(),
            stamp: 0,
            start: simulation.tool_pose(tool, time_s)?,
            at: Vector3::zeros(),
            device: CoupledDevice::new(&options, Vector3::zeros()),
            model: none,
            step_s,
        })
    }

    /// Where the coupling has the tool at the end of the next step, from where it took hold, m.
    pub fn next(&mut self) -> Vector3<f64> {
        let (wanted, _) = self.device.tick(self.target, &self.model);
        let step = wanted - self.at;
        let most = FASTEST_M_S * self.step_s;
        self.at + if step.norm() > most { step * (most / step.norm()) } else { step }
    }

    /// Leads the tool to be `at` such a place at the end of the next step.
    ///
    /// # Errors
    /// As [`Simulation::extend_tool_path`].
    pub fn lead(&mut self, simulation: &mut Simulation, at: Vector3<f64>) -> Result<(), SimError> {
        self.at = at;
        let move_m = (Vector3::from(self.start.move_m) + at).into();
        simulation.extend_tool_path(self.tool, Pose { move_m, ..self.start })
    }

    /// Feels what the step of `report` has brought.
    ///
    /// # Errors
    /// As [`Simulation::tool_stiffness`].
    pub fn feel(&mut self, simulation: &Simulation, report: &StepReport) -> Result<(), SimError> {
        // What did not converge is no force to feel.
        if report.converged {
            self.model = force_model(simulation, report, self.tool, self.at)?;
        }
        Ok(())
    }
}
