//! What holds a vertex that comes in: a fixed region, or a tool that holds one beside it.

use std::sync::Arc;

use nalgebra::Vector3;
use yawara_mesh::volume::LabelVolume;

use super::tool::Tool;
use crate::body::{Hold, OrganBox, touches_solid};
use crate::scene::Region;

/// Where vertices that come in are held.
pub(crate) struct Regions {
    organ: OrganBox,
    fixed: Vec<Region>,
    /// The image, if any tool holds vertices.
    volume: Option<Arc<LabelVolume>>,
}

impl Regions {
    /// Those of a scene whose start mesh is held by `holds`.
    pub fn new(
        fixed: &[Region],
        organ: OrganBox,
        volume: Arc<LabelVolume>,
        holds: &[Hold],
    ) -> Self {
        let grabs = holds.iter().any(|hold| matches!(hold, Hold::Grabbed(_)));
        Self { organ, fixed: fixed.to_vec(), volume: grabs.then_some(volume) }
    }

    /// What holds the new vertex at `rest` in a ring whose vertices are held by `ring`: what would
    /// hold it in a start mesh that has it. A mesh refined everywhere is then held as one that
    /// starts as fine.
    ///
    /// A tool holds the body and not the void around it, and it does not take hold again after it
    /// has let go: it takes a new vertex only beside one that it holds.
    pub fn hold(
        &self,
        rest: &Vector3<f64>,
        mut ring: impl Iterator<Item = Hold>,
        tools: &[Box<dyn Tool>],
    ) -> Hold {
        if self.fixed.iter().any(|region| region.contains(&self.organ, rest)) {
            return Hold::Fixed;
        }
        let takes = |hold: &Hold| matches!(hold, Hold::Grabbed(tool) if tools[*tool].takes(rest));
        let by = ring.find(takes);
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

    /// Holds what rests in a ball of this radius, m, around the middle of the cube.
    struct Ball(f64);

    impl Tool for Ball {
        fn kind(&self) -> &'static str {
            "ball"
        }

        fn reference(&self, _: f64) -> Vector3<f64> {
            Vector3::repeat(0.5)
        }

        fn takes(&self, rest: &Vector3<f64>) -> bool {
            (rest - self.reference(0.0)).norm() <= self.0
        }
    }

    /// Two fixed slabs at the ends of a cube of 1 m, which is void where y < 0.4.
    fn regions() -> Regions {
        let slab =
            |low: f64, high: f64| Region::Box { min: [low, 0.0, 0.0], max: [high, 1.0, 1.0] };
        let grid = Grid::centred([10; 3], 100.0);
        let labels = (0..1000u16).map(|i| u16::from(i / 10 % 10 >= 4)).collect();
        Regions {
            organ: OrganBox { low: Vector3::zeros(), high: Vector3::repeat(1.0) },
            fixed: vec![slab(0.0, 0.2), slab(0.8, 1.0)],
            volume: Some(Arc::new(LabelVolume::new(grid, labels, vec![0, 1]).unwrap())),
        }
    }

    /// Tool 0 holds a ball of 0.1 m in the middle, tool 1 one of 0.3 m.
    fn hold_at(rest: Vector3<f64>, ring: &[Hold]) -> Hold {
        let tools: [Box<dyn Tool>; 2] = [Box::new(Ball(0.1)), Box::new(Ball(0.3))];
        regions().hold(&rest, ring.iter().copied(), &tools)
    }

    fn hold(x: f64, ring: &[Hold]) -> Hold {
        hold_at(Vector3::new(x, 0.5, 0.5), ring)
    }

    #[test]
    fn what_comes_into_a_fixed_region_is_fixed() {
        assert_eq!(hold(0.1, &[FREE]), FIXED);
        assert_eq!(hold(0.1, &[FREE, Hold::Grabbed(1)]), FIXED);
        assert_eq!(hold(0.5, &[FIXED, FIXED]), FREE, "between the slabs");
    }

    #[test]
    fn a_tool_takes_what_comes_into_its_region() {
        let (small, large) = (Hold::Grabbed(0), Hold::Grabbed(1));
        assert_eq!(hold(0.45, &[FREE, small]), small);
        assert_eq!(hold(0.35, &[small, small]), FREE, "outside of its ball");
        assert_eq!(hold(0.35, &[small, large]), large);
        assert_eq!(hold(0.45, &[FREE, FIXED]), FREE, "a tool that is gone");
        let below = |y: f64| hold_at(Vector3::new(0.5, y, 0.5), &[large]);
        assert_eq!(below(0.41), large);
        assert_eq!(below(0.39), FREE, "in void");
    }
}
