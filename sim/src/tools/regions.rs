//! What holds a vertex that comes in: a fixed region, or a tool that holds one beside it.

use std::sync::Arc;

use nalgebra::Vector3;
use yawara_mesh::volume::LabelVolume;

use super::tool::Tool;
use crate::body::{Hold, OrganBox, Zone, touches_solid};

/// Where vertices that come in are held.
pub(crate) struct Regions {
    organ: OrganBox,
    fixed: Vec<Zone>,
    /// The image, if any tool holds vertices.
    volume: Option<Arc<LabelVolume>>,
}

impl Regions {
    /// Those of a scene whose start mesh is held by `holds`.
    pub fn new(fixed: &[Zone], organ: OrganBox, volume: Arc<LabelVolume>, holds: &[Hold]) -> Self {
        let grabs = holds.iter().any(|hold| matches!(hold, Hold::Grabbed(_)));
        Self { organ, fixed: fixed.to_vec(), volume: grabs.then_some(volume) }
    }

    /// The image has other labels now.
    pub fn relabel(&mut self, volume: &Arc<LabelVolume>) {
        if let Some(own) = &mut self.volume {
            *own = Arc::clone(volume);
        }
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
        if self.fixed.iter().any(|zone| zone.contains(&self.organ, rest)) {
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
        let slab = |low: f64, high: f64| Zone::Box { min: [low, 0.0, 0.0], max: [high, 1.0, 1.0] };
        let grid = Grid::centred([10; 3], 100.0);
        let labels = (0..1000u16).map(|i| u16::from(i / 10 % 10 >= 4)).collect();
        Regions {
            organ: OrganBox { low: Vector3::zeros(), high: Vector3::repeat(1.0) },
            fixed: vec![slab(0.0, 0.2), slab(0.8, 1.0)],
            volume: Some(Arc::new(LabelVolume::new(grid, labels, vec![0, 1]).unwrap())),
        }
    }

    #[test]
    fn fixed_regions_hold_first_then_the_tools_beside() {
        // In the middle.
        let tools: [Box<dyn Tool>; 2] = [Box::new(Ball(0.1)), Box::new(Ball(0.3))];
        let (small, large) = (Hold::Grabbed(0), Hold::Grabbed(1));
        let cases: [(f64, f64, &[Hold], Hold, &str); 9] = [
            (0.1, 0.5, &[FREE], FIXED, "in a fixed region"),
            (0.1, 0.5, &[FREE, large], FIXED, "in a fixed region beside a tool"),
            (0.5, 0.5, &[FIXED, FIXED], FREE, "between the slabs"),
            (0.45, 0.5, &[FREE, small], small, "in a tool's ball"),
            (0.35, 0.5, &[small, small], FREE, "outside of its ball"),
            (0.35, 0.5, &[small, large], large, "in one ball of two"),
            (0.45, 0.5, &[FREE, FIXED], FREE, "a tool that is gone"),
            (0.5, 0.41, &[large], large, "above the void"),
            (0.5, 0.39, &[large], FREE, "in void"),
        ];
        for (x, y, ring, want, place) in cases {
            let rest = Vector3::new(x, y, 0.5);
            assert_eq!(regions().hold(&rest, ring.iter().copied(), &tools), want, "{place}");
        }
    }
}
