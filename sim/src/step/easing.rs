//! Forces that splits and merges leave unbalanced, taken away in several steps.

use nalgebra::Vector3;

use crate::scene::Scene;

/// Over how many steps a body comes to feel a change of its mesh; 0 if in the next one: with inertia, or in steps
/// that are long beside `refinement.ease_s`.
pub(super) fn ease_steps(scene: &Scene) -> usize {
    let steps = (scene.refinement.ease_s / scene.time.step_s).round() as usize;
    if scene.dynamics.is_some() || steps < 2 { 0 } else { steps }
}

/// Loads that hold a body in the shape in which a change of its mesh found it, and go away step by step.
///
/// A tetrahedron that has just been bisected is softer, one that two others were merged into is stiffer: with all
/// vertices where they are, internal forces change, and a tool would feel the new ones in the next step.
/// Loads of the same size as that change keep the balance; a step takes an n-th part of them away, n the steps that
/// are left, so that they are gone `over` steps after the last change. After that the body is where it would be
/// without them.
pub(super) struct Easing {
    over: usize,
    left: usize,
    loads: Vec<Vector3<f64>>,
}

impl Easing {
    /// Of changes that are felt over so many steps; at once for 0.
    pub fn new(over: usize) -> Self {
        Self { over, left: 0, loads: Vec::new() }
    }

    /// Whether there is anything to be done.
    pub fn is_wanted(&self) -> bool {
        self.over > 0
    }

    /// Begins with `loads`, N by vertex number, in place of what was left.
    pub fn begin(&mut self, loads: Vec<Vector3<f64>>) {
        self.resume(self.over, loads);
    }

    /// Goes on with `loads`, which are gone after `left` steps.
    pub fn resume(&mut self, left: usize, loads: Vec<Vector3<f64>>) {
        (self.left, self.loads) = (left, loads);
    }

    /// In how many steps all is gone.
    pub fn left(&self) -> usize {
        self.left
    }

    /// A step begins.
    pub fn step(&mut self) {
        self.left = self.left.saturating_sub(1);
        if self.left == 0 {
            self.loads.clear();
        }
        let share = self.left as f64 / (self.left + 1) as f64;
        self.loads.iter_mut().for_each(|load| *load *= share);
    }

    /// Nothing is held any more.
    pub fn clear(&mut self) {
        self.left = 0;
        self.loads.clear();
    }

    /// N by vertex number; those beyond have none.
    pub fn loads(&self) -> &[Vector3<f64>] {
        &self.loads
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_goes_in_each_step_until_all_is_gone() {
        let mut easing = Easing::new(4);
        let left = |easing: &Easing| easing.loads().first().map(|load| load.x);
        easing.begin(vec![Vector3::new(8.0, 0.0, 0.0)]);
        let steps: Vec<_> = (0..5)
            .map(|_| {
                easing.step();
                left(&easing)
            })
            .collect();
        assert_eq!(steps, [Some(6.0), Some(4.0), Some(2.0), None, None]);
        assert!(!Easing::new(0).is_wanted());
    }
}
