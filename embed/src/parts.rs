//! What the material in a part of a tetrahedron makes of the whole of it.

use std::sync::Arc;

use nalgebra::Matrix6;
use yawara_mesh::kuhn::{Point, bisect, bisected_corner, midpoint};
use yawara_mesh::{Content, LabelTree, NodeRef, Part};

use crate::embedding::{Embedding, put, solid_fraction};
use crate::error::EmbedError;
use crate::fine::lattice_tet;
use crate::homogenisation::{ChildPair, combine_solids};
use crate::material::{Packed6, VoidRule};

/// The share of a tetrahedron that is in a part, by its volume: what is absent counts as nothing.
#[derive(Clone, Copy)]
struct Share {
    elasticity: Matrix6<f64>,
    density: f64,
    /// Of the volume, what is there.
    present: f64,
    /// Of the volume, what is there and not void.
    solid: f64,
}

impl Embedding {
    /// Takes the contents of sheets into its materials: `parts` are those that a cut has made, `tree` has them.
    ///
    /// What two halves both have is homogenised, what one has beyond the other counts by its volume: a cut takes away
    /// as much stiffness from a sheet as volume, where a lamination with nothing would leave none at all.
    ///
    /// Cost: at most one [`Homogenisation::combine`](crate::Homogenisation::combine) per finest tetrahedron.
    ///
    /// # Errors
    /// [`EmbedError::Edit`] under a global homogenisation. Then nothing has changed.
    pub fn adopt(&mut self, tree: Arc<LabelTree>, parts: &[Part]) -> Result<(), EmbedError> {
        if self.homogenisation.global().is_some() {
            return Err(EmbedError::Edit { name: self.homogenisation.name().to_owned() });
        }
        for part in parts {
            let Content::Node(index) = part.node.open() else { continue };
            let share = self.share(part.whole, &part.corners, part.level, &part.holds);
            let nodes = tree.node_count();
            let elasticity = [Packed6::new(&share.elasticity)];
            put(&mut self.elasticity_of_node, (nodes, Packed6::ZERO), index, &elasticity);
            put(&mut self.density_of_node, (nodes, 0.0), index, &[share.density]);
        }
        self.tree = tree;
        Ok(())
    }

    fn share(&self, of: NodeRef, corners: &[Point; 4], level: u8, holds: &[bool]) -> Share {
        let present = holds.iter().filter(|holds| **holds).count() as f64 / holds.len() as f64;
        let is_uniform = matches!(of.open(), Content::Label(_));
        if present == 0.0 || present == 1.0 || is_uniform {
            let solid = match of.open() {
                Content::Label(label) => solid_fraction(label),
                Content::Node(i) => self.solid_of_node.get(i).copied().unwrap_or(1.0),
            };
            let (elasticity, density) = (present * self.elasticity(of), present * self.density(of));
            return Share { elasticity, density, present, solid: present * solid };
        }
        let halved = bisect(corners, level, midpoint(corners, level));
        let (first, second) = holds.split_at(holds.len() / 2);
        let nodes = self.tree.children(of);
        let halves = [
            self.share(nodes[0], &halved[0], level + 1, first),
            self.share(nodes[1], &halved[1], level + 1, second),
        ];
        let mean = |of: fn(&Share) -> f64| 0.5 * halves.iter().map(of).sum::<f64>();
        let common = halves[0].present.min(halves[1].present);
        let mut elasticity = 0.5 * (halves[0].elasticity + halves[1].elasticity);
        if common > 0.0 {
            let own = halves.map(|half| half.elasticity / half.present);
            let pair = ChildPair::new(&lattice_tet(corners), 0, bisected_corner(level), own);
            let rule = self.homogenisation.as_ref();
            let both = match self.materials.void() {
                VoidRule::Material => rule.combine(&pair),
                VoidRule::Volume => {
                    let void = self.materials.by_label()[0].elasticity();
                    combine_solids(rule, &pair, halves.map(|half| half.solid / half.present), void)
                }
            };
            elasticity -= common * (pair.mean_elasticity() - both.elasticity);
        }
        Share {
            elasticity,
            density: mean(|half| half.density),
            present,
            solid: mean(|half| half.solid),
        }
    }
}
