//! One family's mesh and the updates that all methods of that family get.

use super::lane::{Burst, three_slots};
use super::{BURST, Family};
use crate::error::BenchError;
use crate::history::History;
use crate::random::SplitMix64;
use crate::reference::Reference;

/// One family's mesh and what is derived from it.
pub(super) struct Course {
    pub family: Family,
    pub history: History,
    pub ranks: Vec<f64>,
    /// Of the present mesh, made when it is asked for.
    pub reference: Option<Reference>,
}

impl Course {
    /// Pairs that leave the size as it is, alternately a split with its merge and a merge with its
    /// split.
    pub fn burst(&mut self, mut random: SplitMix64) -> Result<Burst, BenchError> {
        let mut pairs = Vec::with_capacity(BURST + 1);
        for at in 0..=BURST {
            let pair = if at % 2 == 1 && self.history.can_merge() {
                let merge = self.history.merge()?;
                let split = self.history.split_at(merge.point)?;
                [merge, split]
            } else {
                let split = self.history.split()?;
                let merge = self.history.merge_at(split.point)?;
                [split, merge]
            };
            if at > 0 {
                self.ranks.push(pair[0].rank() as f64);
            }
            pairs.push(pair);
        }
        let vertices = self.history.slots().len();
        let load = (0..3 * vertices).map(|_| random.symmetric()).collect();
        let tool = three_slots(&mut random, vertices);
        Ok(Burst { pairs, load, tool })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::direct::Direct;
    use crate::organ::{Organ, Size};
    use crate::studies::race::{FAMILIES, Lane};

    fn course(family: Family) -> Course {
        let organ = Organ::new(Size::Quick).unwrap();
        let history = History::refined(&organ, family.homogenisation, 180, 0, 1).unwrap();
        Course { family, history, ranks: Vec::new(), reference: None }
    }

    #[test]
    fn a_burst_keeps_the_size_and_is_the_same_in_all_families() {
        let mut courses = FAMILIES.map(course);
        let bursts = courses.each_mut().map(|course| course.burst(SplitMix64(5)).unwrap());
        for (burst, course) in bursts.iter().zip(&courses) {
            assert_eq!(course.history.slots().len(), 180);
            assert_eq!((burst.pairs.len(), course.ranks.len()), (BURST + 1, BURST));
            assert_eq!((burst.load.len(), burst.tool.len()), (540, 3));
        }
        let places = bursts.each_ref().map(|burst| {
            burst.pairs.iter().map(|[a, b]| (a.point, b.point, a.slot)).collect::<Vec<_>>()
        });
        assert_eq!(places[0], places[1]);
        assert!(places[0].iter().all(|(a, b, _)| a == b));
        assert_eq!(bursts[0].load, bursts[1].load);
    }

    #[test]
    fn a_lane_sorts_its_times_and_sees_a_wrong_stiffness() {
        let mut course = course(FAMILIES[0]);
        let stiffness = course.history.stiffness().unwrap();
        let mut kept = Lane::maintainer("woodbury", 0, stiffness.clone()).unwrap();
        let mut direct = Lane::direct(Direct::Cholesky, 0, 1);
        let burst = course.burst(SplitMix64(5)).unwrap();
        for lane in [&mut kept, &mut direct] {
            assert!(lane.runs(0, 4));
            lane.burst(0, &burst, || course.history.stiffness()).unwrap();
        }
        // Pairs 2 and 4 of 0..=5 begin with a split, 1, 3 and 5 with a merge; 0 is apart.
        let counts = |lane: &Lane| {
            [&lane.split, &lane.merge, &lane.old_merge, &lane.cold_split, &lane.solve]
                .map(|samples| samples.all().len())
        };
        assert_eq!(counts(&kept), [5, 2, 3, 1, 5]);
        assert_eq!(counts(&direct), [1, 0, 0, 0, 5]);
        let right = Reference::new(course.history.stiffness().unwrap()).unwrap();
        direct.judge(&right, 1).unwrap();
        assert!(direct.errors.unwrap().solve < 1e-11);
        assert!(!direct.runs(0, 4) && direct.last_burst(4).is_none());
        // Another vertex moved: hardly anything is right any more.
        course.burst(SplitMix64(6)).unwrap();
        let other = Reference::new(course.history.stiffness().unwrap()).unwrap();
        kept.judge(&other, 1).unwrap();
        let errors = kept.errors.unwrap();
        assert!(errors.solve > 1e-3 && errors.columns > 1e-3, "{errors:?}");
    }
}
