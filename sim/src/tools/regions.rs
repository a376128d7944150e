//! What holds a vertex that comes in: where the body is fixed, and where tools have taken hold.

use std::sync::Arc;

use nalgebra::Vector3;
use yawara_mesh::volume::LabelVolume;

use crate::body::{Hold, OrganBox, touches_solid};
use crate::scene::{Region, Scene, ToolEntry};

/// The regions of a scene in which vertices are held.
pub(crate) struct Regions {
    organ: OrganBox,
    fixed: Vec<Region>,
    /// By the number of the tool.
    grabbed: Vec<(usize, Region)>,
    /// The image, where a tool may ask for it.
    volume: Option<Arc<LabelVolume>>,
}

impl Regions {
    pub fn of(scene: &Scene, organ: OrganBox, volume: Arc<LabelVolume>) -> Self {
        let grab = |(number, tool): (usize, &ToolEntry)| match tool {
            ToolEntry::Grab { region, .. } => Some((number, region.clone())),
            ToolEntry::Probe { .. } | ToolEntry::Pressure { .. } => None,
        };
        let grabbed: Vec<(usize, Region)> =
            scene.tools.iter().enumerate().filter_map(grab).collect();
        let volume = (!grabbed.is_empty()).then_some(volume);
        Self { organ, fixed: scene.fixed.clone(), grabbed, volume }
    }

    /// What holds the new vertex at `rest` in a ring whose vertices are held by `ring`: what would
    /// hold it in a start mesh that has it, so that a mesh refined everywhere is held as one that
    /// starts so fine.
    ///
    /// A tool takes hold of the body, not of what surrounds it, and must not have let go: it takes
    /// what it holds one of the ring's vertices next to.
    pub fn hold(&self, rest: &Vector3<f64>, mut ring: impl Iterator<Item = Hold>) -> Hold {
        let contains = |region: &Region| region.contains(&self.organ, rest);
        if self.fixed.iter().any(contains) {
            return Hold::Fixed;
        }
        let takes = |number: usize| {
            self.grabbed.iter().any(|(tool, region)| *tool == number && contains(region))
        };
        let by = ring.find(|hold| matches!(hold, Hold::Grabbed(number) if takes(*number)));
        let is_body = |volume: &Arc<LabelVolume>| touches_solid(volume, rest);
        by.filter(|_| self.volume.as_ref().is_some_and(is_body)).unwrap_or(Hold::Free)
    }
}

#[cfg(test)]
mod tests {
    use yawara_mesh::volume::Grid;

    use super::*;

    const FREE: Hold = Hold::Free;
    const FIXED: Hold = Hold::Fixed;

    /// Two fixed slabs at the ends of a cube of 1 m, a ball of 0.1 m in its middle that tool 3
    /// holds, and a larger one that tool 5 does. The cube is void where y < 0.4.
    fn regions() -> Regions {
        let slab =
            |low: f64, high: f64| Region::Box { min: [low, 0.0, 0.0], max: [high, 1.0, 1.0] };
        let ball = |radius_m: f64| Region::Sphere { centre: [0.5; 3], radius_m };
        let grid = Grid::centred([10; 3], 100.0);
        let labels = (0..1000u16).map(|i| u16::from(i / 10 % 10 >= 4)).collect();
        Regions {
            organ: OrganBox { low: Vector3::zeros(), high: Vector3::repeat(1.0) },
            fixed: vec![slab(0.0, 0.2), slab(0.8, 1.0)],
            grabbed: vec![(3, ball(0.1)), (5, ball(0.3))],
            volume: Some(Arc::new(LabelVolume::new(grid, labels, vec![0, 1]).unwrap())),
        }
    }

    fn hold(x: f64, ring: &[Hold]) -> Hold {
        regions().hold(&Vector3::new(x, 0.5, 0.5), ring.iter().copied())
    }

    #[test]
    fn what_comes_into_a_fixed_region_is_fixed() {
        assert_eq!(hold(0.1, &[FREE]), FIXED);
        assert_eq!(hold(0.1, &[FREE, Hold::Grabbed(5)]), FIXED);
        assert_eq!(hold(0.5, &[FIXED, FIXED]), FREE, "between the slabs");
    }

    #[test]
    fn a_tool_takes_what_comes_into_its_region() {
        let (small, large) = (Hold::Grabbed(3), Hold::Grabbed(5));
        assert_eq!(hold(0.45, &[FREE, small]), small);
        assert_eq!(hold(0.35, &[small, small]), FREE, "outside of its ball");
        assert_eq!(hold(0.35, &[small, large]), large);
        assert_eq!(hold(0.45, &[FREE, FIXED]), FREE, "a tool that is gone");
        let below = |y: f64| regions().hold(&Vector3::new(0.5, y, 0.5), [large].into_iter());
        assert_eq!(below(0.41), large);
        assert_eq!(below(0.39), FREE, "in void");
    }
}
