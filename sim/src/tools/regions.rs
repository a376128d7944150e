//! What holds a vertex that comes in: where the body is fixed, and where tools have taken hold.

use nalgebra::Vector3;

use super::Hold;
use crate::scene::{Region, Scene, Tool};
use crate::setup::OrganBox;

/// The regions of a scene in which vertices are held.
pub(crate) struct Regions {
    organ: OrganBox,
    fixed: Vec<Region>,
    /// By the number of the tool.
    grabbed: Vec<(usize, Region)>,
}

impl Regions {
    pub fn of(scene: &Scene, organ: OrganBox) -> Self {
        let grabbed = scene.tools.iter().enumerate().filter_map(|(number, tool)| match tool {
            Tool::Grab { region, .. } => Some((number, region.clone())),
            Tool::Probe { .. } | Tool::Pressure { .. } => None,
        });
        Self { organ, fixed: scene.fixed.clone(), grabbed: grabbed.collect() }
    }

    /// What holds the new vertex at `rest` on an edge between two vertices that are held by `ends`,
    /// in a ring whose vertices are held by `ring`.
    ///
    /// A tool that holds one of the ring takes it if it lies in the tool's region, as a start vertex
    /// would be: refined everywhere, the mesh is held as a mesh is that starts so fine. A tool also
    /// takes it if it holds both ends. It is fixed only between two that are, and in the region:
    /// between two regions that face each other the body is free.
    pub fn hold(
        &self,
        rest: &Vector3<f64>,
        ends: [Hold; 2],
        mut ring: impl Iterator<Item = Hold>,
    ) -> Hold {
        let contains = |region: &Region| region.contains(&self.organ, rest);
        match ends {
            [Hold::Fixed, Hold::Fixed] if self.fixed.iter().any(contains) => return Hold::Fixed,
            [Hold::Grabbed(a), Hold::Grabbed(b)] if a == b => return ends[0],
            _ => {}
        }
        ring.find(|hold| {
            let is_in = |(number, region): &(usize, Region)| {
                *hold == Hold::Grabbed(*number) && contains(region)
            };
            self.grabbed.iter().any(is_in)
        })
        .unwrap_or(Hold::Free)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREE: Hold = Hold::Free;
    const FIXED: Hold = Hold::Fixed;

    /// Two fixed slabs at the ends of a cube of 1 m, a ball of 0.1 m in its middle that tool 3
    /// holds, and a larger one that tool 5 does.
    fn regions() -> Regions {
        let slab =
            |low: f64, high: f64| Region::Box { min: [low, 0.0, 0.0], max: [high, 1.0, 1.0] };
        let ball = |radius_m: f64| Region::Sphere { centre: [0.5; 3], radius_m };
        Regions {
            organ: OrganBox { low: Vector3::zeros(), high: Vector3::repeat(1.0) },
            fixed: vec![slab(0.0, 0.2), slab(0.8, 1.0)],
            grabbed: vec![(3, ball(0.1)), (5, ball(0.3))],
        }
    }

    fn hold(x: f64, ends: [Hold; 2], ring: &[Hold]) -> Hold {
        regions().hold(&Vector3::new(x, 0.5, 0.5), ends, ring.iter().copied())
    }

    #[test]
    fn fixed_between_fixed_ends_in_a_region_only() {
        assert_eq!(hold(0.1, [FIXED, FIXED], &[]), FIXED);
        assert_eq!(hold(0.5, [FIXED, FIXED], &[FIXED]), FREE, "between the slabs");
        assert_eq!(hold(0.1, [FIXED, FREE], &[FIXED]), FREE);
    }

    #[test]
    fn a_tool_takes_what_comes_into_its_region() {
        let (small, large) = (Hold::Grabbed(3), Hold::Grabbed(5));
        assert_eq!(hold(0.45, [FREE, FREE], &[FREE, small]), small);
        assert_eq!(hold(0.35, [small, FREE], &[small, FREE]), FREE, "outside of its ball");
        assert_eq!(hold(0.35, [small, large], &[small, large]), large);
        assert_eq!(hold(0.9, [small, small], &[]), small, "carried by both ends");
        assert_eq!(hold(0.45, [FREE, FIXED], &[FREE, FIXED]), FREE, "a tool that is gone");
    }
}
