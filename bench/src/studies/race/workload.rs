//! One family's mesh, and the updates and loads that all methods of that family get.

use super::settings::BURST;
use crate::error::Result;
use crate::workloads::{History, SplitMix64, Update};

/// Two updates, of which the second undoes the first.
pub(crate) type Pair = [Update; 2];

/// What everyone is to do before the next one's turn.
pub(crate) struct Burst {
    pub pairs: Vec<Pair>,
    pub load: Vec<f64>,
    pub tool: Vec<usize>,
}

/// One family's mesh and what is derived from it.
pub(crate) struct Workload {
    pub history: History,
    pub ranks: Vec<f64>,
}

impl Workload {
    pub fn new(history: History) -> Self {
        Self { history, ranks: Vec::new() }
    }

    /// Pairs that leave the size as it is, alternately a split with its merge and a merge with its
    /// split.
    pub fn burst(&mut self, mut random: SplitMix64) -> Result<Burst> {
        let mut pairs = Vec::with_capacity(BURST + 1);
        for at in 0..=BURST {
            let pair = if at % 2 == 1 && self.history.can_merge() {
                let merge = self.history.merge()?;
                let split = self.history.split_at(merge.point)?;
                [merge, split]
            } else {
                self.history.split_and_merge()?
            };
            if at > 0 {
                self.ranks.push(pair[0].rank() as f64);
            }
            pairs.push(pair);
        }
        let vertices = self.history.slots().len();
        let load = (0..3 * vertices).map(|_| random.symmetric()).collect();
        Ok(Burst { pairs, load, tool: random.three_below(vertices) })
    }
}

#[cfg(test)]
mod tests {
    use super::super::competitor::Competitor;
    use super::super::settings::{FAMILIES, Family};
    use super::*;
    use crate::bodies::organ::{Organ, Size};
    use crate::solvers::{Direct, Reference};

    fn workload(family: Family) -> Workload {
        let organ = Organ::new(Size::Quick).unwrap();
        let history = History::refined(&organ, family.homogenisation, 180, 0, 1).unwrap();
        Workload::new(history)
    }

    #[test]
    fn a_burst_keeps_the_size_and_is_the_same_in_all_families() {
        let mut workloads = FAMILIES.map(workload);
        let bursts = workloads.each_mut().map(|workload| workload.burst(SplitMix64(5)).unwrap());
        for (burst, workload) in bursts.iter().zip(&workloads) {
            assert_eq!(workload.history.slots().len(), 180);
            assert_eq!((burst.pairs.len(), workload.ranks.len()), (BURST + 1, BURST));
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
    fn a_competitor_sorts_its_times_and_sees_a_wrong_stiffness() {
        let mut workload = workload(FAMILIES[0]);
        let stiffness = workload.history.stiffness().unwrap();
        let mut kept = Competitor::maintainer("woodbury", 0, stiffness.clone()).unwrap();
        let mut direct = Competitor::direct(Direct::Cholesky, 0, 1);
        let burst = workload.burst(SplitMix64(5)).unwrap();
        for competitor in [&mut kept, &mut direct] {
            assert!(competitor.runs(0, 4));
            competitor.burst(0, &burst, || workload.history.stiffness()).unwrap();
        }
        // Pairs 2 and 4 of 0..=5 begin with a split, 1, 3 and 5 with a merge; 0 is apart.
        let counts = |one: &Competitor| {
            [&one.split, &one.merge, &one.old_merge, &one.cold_split, &one.solve]
                .map(|samples| samples.all().len())
        };
        assert_eq!(counts(&kept), [5, 2, 3, 1, 5]);
        assert_eq!(counts(&direct), [1, 0, 0, 0, 5]);
        let right = Reference::new(workload.history.stiffness().unwrap()).unwrap();
        direct.judge(&right, 1).unwrap();
        assert!(direct.errors.unwrap().solve < 1e-11);
        assert!(!direct.runs(0, 4) && direct.last_burst(4).is_none());
        // Another vertex moved: hardly anything is right any more.
        workload.burst(SplitMix64(6)).unwrap();
        let other = Reference::new(workload.history.stiffness().unwrap()).unwrap();
        kept.judge(&other, 1).unwrap();
        let errors = kept.errors.unwrap();
        assert!(errors.solve > 1e-3 && errors.columns > 1e-3, "{errors:?}");
    }
}
