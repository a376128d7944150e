//! Materials that remember: what each element of a body under the law `inelastic` is made of.

use std::ops::ControlFlow;

use nalgebra::Matrix6;
use yawara_corot::{Flow, Inelastic, InelasticMaterial};
use yawara_embed::{Elasticities, EmbedError, Embedding, FineMaterial, Material, Materials};
use yawara_mesh::NodeRef;

use crate::error::SimError;
use crate::scene::{MaterialLaw, Scene};

/// The laws of a scene's materials, by position.
pub(crate) struct Memory {
    laws: Vec<MaterialLaw>,
    /// All relaxation times, ascending, s.
    times_s: Vec<f64>,
    step_s: f64,
}

/// Which exponentials of a relaxation are over.
#[derive(Clone, Copy)]
enum Moment {
    /// What a step of the scene takes away from each.
    Step,
    /// Those of the first so many times, all of them; of the others nothing.
    After(usize),
}

impl Memory {
    /// None where no material remembers anything.
    /// # Errors
    /// [`SimError::Corot`] for numbers of no law.
    pub fn of(scene: &Scene) -> Result<Option<Self>, SimError> {
        let entries = scene.materials.iter();
        let laws = entries.map(|entry| {
            entry.law.as_ref().map_or_else(|| Ok(MaterialLaw::default()), |law| law.law())
        });
        let laws: Vec<MaterialLaw> = laws.collect::<Result<_, _>>()?;
        if laws.iter().all(|law| law.prony.terms().is_empty() && law.flow == Flow::None) {
            return Ok(None);
        }
        let terms = laws.iter().flat_map(|law| law.prony.terms());
        let mut times_s: Vec<f64> = terms.map(|term| term.time_s).collect();
        times_s.sort_by(f64::total_cmp);
        times_s.dedup();
        Ok(Some(Self { laws, times_s, step_s: scene.time.step_s }))
    }

    pub fn law(&self) -> Inelastic {
        let flows = self.laws.iter().any(|law| law.flow != Flow::None);
        Inelastic::new(self.times_s.clone(), flows)
    }

    /// D of a material by its position, if it has one, Pa.
    fn elasticity(
        &self,
        position: Option<usize>,
        material: &Material,
        moment: Moment,
    ) -> Matrix6<f64> {
        let whole = material.elasticity();
        let Some(position) = position else { return whole };
        let prony = &self.laws[position].prony;
        let factor = match moment {
            Moment::Step => prony.at_step(self.step_s),
            Moment::After(over) => {
                let lasts = |time_s: f64| self.times_s[over..].contains(&time_s);
                let lasting = prony.terms().iter().filter(|term| lasts(term.time_s));
                prony.rest() + lasting.map(|term| term.fraction).sum::<f64>()
            }
        };
        if prony.terms().is_empty() { whole } else { prony.scaled(&whole, factor) }
    }

    /// What a material with nothing beside it is made of, and its elasticity in a step, Pa.
    pub fn alone(&self, position: usize, material: &Material) -> (Matrix6<f64>, Vec<f64>) {
        let at = |moment| self.elasticity(Some(position), material, moment);
        let stages: Vec<_> = (0..=self.times_s.len()).map(|over| at(Moment::After(over))).collect();
        (at(Moment::Step), made_of(&stages, self.laws[position].flow))
    }

    /// Materials of a step of the scene, by dense label; `positions` are those of labels, none of void.
    pub fn in_a_step(
        &self,
        materials: &[Material],
        positions: &[Option<usize>],
    ) -> Result<Materials, EmbedError> {
        self.materials(materials, positions, Moment::Step)
    }

    fn materials(
        &self,
        materials: &[Material],
        positions: &[Option<usize>],
        moment: Moment,
    ) -> Result<Materials, EmbedError> {
        let both = materials.iter().zip(positions);
        let fine = both.map(|(material, &position)| {
            FineMaterial::new(self.elasticity(position, material, moment), material.density_kg_m3())
        });
        Ok(Materials::new(fine.collect::<Result<Vec<_>, _>>()?))
    }

    /// The same for all contents of an embedding.
    pub fn embedded(
        &self,
        materials: &[Material],
        positions: &[Option<usize>],
        embedding: &Embedding,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<EmbeddedMemory, EmbedError> {
        let stages = (0..=self.times_s.len()).map(|over| {
            let materials = self.materials(materials, positions, Moment::After(over))?;
            embedding.of_others(&materials.with_void(embedding.materials().void()), progress)
        });
        let flow = |position: &Option<usize>| position.map_or(Flow::None, |at| self.laws[at].flow);
        Ok(EmbeddedMemory {
            stages: stages.collect::<Result<_, _>>()?,
            flows: positions.iter().map(flow).collect(),
        })
    }
}

/// What every tetrahedron of a label tree is made of.
///
/// With the relaxation times in ascending order, D_i is by how much the homogenised elasticity falls when, after those
/// of shorter times, the exponentials of τ_i are over in all materials: their sum and D_∞ is the elasticity at once, and
/// none of them is negative where the homogenisation gives more for stiffer materials. Exact for one material,
/// and for several where times are far apart. Strain stays as in the label of most of the volume.
pub(crate) struct EmbeddedMemory {
    /// Elasticities after 0, 1, … times.
    stages: Vec<Elasticities>,
    /// By dense label.
    flows: Vec<Flow>,
}

impl EmbeddedMemory {
    /// What a content is made of; `majority` is the dense label of most of its volume.
    pub fn made_of(&self, content: NodeRef, majority: u16) -> Vec<f64> {
        let stages: Vec<_> = self.stages.iter().map(|stage| stage.of(content)).collect();
        made_of(&stages, self.flows[usize::from(majority)])
    }
}

fn made_of(stages: &[Matrix6<f64>], flow: Flow) -> Vec<f64> {
    let relaxed = stages.last().copied().unwrap_or_else(Matrix6::zeros);
    let terms = stages.windows(2).map(|pair| pair[0] - pair[1]).collect();
    InelasticMaterial { relaxed, terms, flow }.numbers()
}
