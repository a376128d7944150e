//! Stiffness matrices that splits and merges can be tried on, kept as a list of parts.

use faer::Mat;
use nalgebra::DMatrix;
use yawara_inverse_update::{RingChange, StiffnessChange};

/// One part of K that can be refined: K_p = W Wᵀ + E Eᵀ on some vertices.
pub(crate) struct Patch {
    pub(crate) vertices: Vec<usize>,
    factor: DMatrix<f64>,
    refined: Refinement,
    pub(crate) vertex: Option<usize>,
}

/// The parts of a ring change, by vertex names that never move.
struct Refinement {
    k_p: DMatrix<f64>,
    k_c: DMatrix<f64>,
    a12: DMatrix<f64>,
    a22: DMatrix<f64>,
    b: DMatrix<f64>,
    positive: DMatrix<f64>,
}

/// An independent model of K: it knows parts and names, and is assembled anew when asked.
///
/// No matrix is ever updated in it, so it has no drift.
///
/// The quasi-definite model is the definite one with the sign of all blocks between last rows
/// turned: [A, Bᵀ; B, P] becomes [A, Bᵀ; B, −P]. That is linear, so sums stay sums.
pub struct Model {
    pub(crate) block: usize,
    /// Rows at the end of a block that have negative pivots.
    pub(crate) negative: usize,
    base: DMatrix<f64>,
    base_vertices: usize,
    /// The name in each slot, moved about by swap-removal as the contract says.
    pub(crate) names: Vec<usize>,
    pub(crate) patches: Vec<Patch>,
    next: usize,
}

pub(crate) fn to_faer(matrix: &DMatrix<f64>) -> Mat<f64> {
    Mat::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[(i, j)])
}

impl Model {
    /// A chain of `vertices` springs that is held at its first vertex.
    #[must_use]
    pub fn chain(vertices: usize, block: usize, negative: usize) -> Self {
        let mut base = DMatrix::zeros(block * vertices, block * vertices);
        for i in 0..vertices * block {
            // Sideways stiffnesses differ, so that rows can't be mixed up unseen.
            let spring = 1.0 + (i % block) as f64;
            base[(i, i)] += spring;
            if i >= block {
                base[(i - block, i - block)] += spring;
                base[(i - block, i)] -= spring;
                base[(i, i - block)] -= spring;
            }
        }
        let names = (0..vertices).collect();
        Self {
            block,
            negative,
            base,
            base_vertices: vertices,
            names,
            patches: vec![],
            next: vertices,
        }
    }

    fn is_negative(&self, row: usize) -> bool {
        row % self.block + self.negative >= self.block
    }

    /// Turns the sign of entries between two last rows.
    fn turned(&self, matrix: &DMatrix<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
            if self.is_negative(i) && self.is_negative(j) {
                -matrix[(i, j)]
            } else {
                matrix[(i, j)]
            }
        })
    }

    /// K in slot order, assembled from the parts.
    #[must_use]
    pub fn assemble(&self) -> DMatrix<f64> {
        let n = self.block * self.names.len();
        let mut k = DMatrix::zeros(n, n);
        let base: Vec<usize> = (0..self.base_vertices).collect();
        self.scatter(&mut k, &base, &self.base);
        for patch in &self.patches {
            match patch.vertex {
                None => self.scatter(&mut k, &patch.vertices, &patch.refined.k_p),
                Some(vertex) => {
                    let mut vertices = patch.vertices.clone();
                    vertices.push(vertex);
                    self.scatter(&mut k, &vertices, &patch.refined.ring());
                }
            }
        }
        k
    }

    fn scatter(&self, k: &mut DMatrix<f64>, vertices: &[usize], part: &DMatrix<f64>) {
        let slots = self.slots(vertices);
        let row = |i: usize| self.block * slots[i / self.block] + i % self.block;
        for i in 0..part.nrows() {
            for j in 0..part.ncols() {
                let turns = self.is_negative(i) && self.is_negative(j);
                k[(row(i), row(j))] += if turns { -part[(i, j)] } else { part[(i, j)] };
            }
        }
    }

    pub(crate) fn slots(&self, vertices: &[usize]) -> Vec<usize> {
        let slot = |v: &usize| self.names.iter().position(|name| name == v).expect("a live name");
        vertices.iter().map(slot).collect()
    }

    /// Adds a patch of stiffness `scale` on `vertices` and says how K changes.
    ///
    /// In the basis (u_old, d), d = u_M − H u_old, its refinement is
    /// [K_p + F Fᵀ, b; bᵀ, A22] with b A22⁻¹ bᵀ = θ² W Wᵀ ≤ K_p, hence positive
    /// semidefinite; in nodal values a12 = b − Hᵀ A22 and
    /// K_c = K_p + F Fᵀ − b H − Hᵀ bᵀ + Hᵀ A22 H.
    pub(crate) fn add_patch(
        &mut self,
        vertices: Vec<usize>,
        scale: f64,
        rank: usize,
        mut number: impl FnMut() -> f64,
    ) -> StiffnessChange {
        let (m, r) = (self.block, self.block * vertices.len());
        let unit = scale.sqrt();
        let mut random = |rows, cols| DMatrix::from_fn(rows, cols, |_, _| unit * number());
        let (w, extra) = (random(r, m), random(r, 2));
        let mut positive = random(r, rank);
        // Nothing is turned in F Fᵀ without last rows.
        (0..r).filter(|&i| self.is_negative(i)).for_each(|i| positive.row_mut(i).fill(0.0));
        let spread = random(m, m);
        let a22 = &spread * spread.transpose() + DMatrix::identity(m, m) * scale;
        let theta = number().abs();
        let lower = a22.clone().cholesky().expect("positive definite by construction").l();
        let b = &w * lower.transpose() * theta;
        let mut h = DMatrix::zeros(m, r);
        for i in 0..r.min(2 * m) {
            h[(i % m, i)] = 0.5;
        }
        let k_p = &w * w.transpose() + &extra * extra.transpose();
        let a12 = &b - h.transpose() * &a22;
        let k_c = &k_p + &positive * positive.transpose() - &b * &h - h.transpose() * b.transpose()
            + h.transpose() * &a22 * &h;
        let factor =
            DMatrix::from_fn(r, m + 2, |i, j| if j < m { w[(i, j)] } else { extra[(i, j - m)] });
        let refined = Refinement { k_p, k_c, a12, a22, b, positive };
        let change = self.change(&vertices, Some(&factor), None);
        self.patches.push(Patch { vertices, factor, refined, vertex: None });
        change
    }

    /// Takes an unsplit patch away and says how K changes.
    pub(crate) fn remove_patch(&mut self, patch: usize) -> StiffnessChange {
        let patch = self.patches.remove(patch);
        self.change(&patch.vertices, None, Some(&patch.factor))
    }

    fn change(
        &self,
        vertices: &[usize],
        added: Option<&DMatrix<f64>>,
        removed: Option<&DMatrix<f64>>,
    ) -> StiffnessChange {
        let none = || DMatrix::zeros(self.block * vertices.len(), 0);
        let [plus, minus] = added.map_or_else(|| [none(), none()], |factor| self.signed(factor));
        let [less, more] = removed.map_or_else(|| [none(), none()], |factor| self.signed(factor));
        StiffnessChange {
            slots: self.slots(vertices),
            added: to_faer(&side_by_side(&plus, &more)),
            removed: to_faer(&side_by_side(&minus, &less)),
        }
    }

    /// A and B with A Aᵀ − B Bᵀ = W Wᵀ turned. A column of W, in its parts u of first and p of last
    /// rows, makes [u; p] [1, 1; 1, −1] [u; p]ᵀ, whose eigenvalues are ±√2.
    fn signed(&self, factor: &DMatrix<f64>) -> [DMatrix<f64>; 2] {
        if self.negative == 0 {
            return [factor.clone(), DMatrix::zeros(factor.nrows(), 0)];
        }
        let (sine, cosine) = (std::f64::consts::PI / 8.0).sin_cos();
        [(cosine, sine), (-sine, cosine)].map(|(first, last)| {
            let size = 2_f64.powf(0.25);
            DMatrix::from_fn(factor.nrows(), factor.ncols(), |i, j| {
                size * factor[(i, j)] * if self.is_negative(i) { last } else { first }
            })
        })
    }

    /// The change that a split, or now a merge, of this patch hands over.
    pub(crate) fn ring(&self, patch: usize) -> RingChange {
        let patch = &self.patches[patch];
        let refined = &patch.refined;
        RingChange {
            slots: self.slots(&patch.vertices),
            k_p: to_faer(&self.turned(&refined.k_p)),
            k_c: to_faer(&self.turned(&refined.k_c)),
            a12: to_faer(&self.turned(&refined.a12)),
            a22: to_faer(&self.turned(&refined.a22)),
            b: to_faer(&self.turned(&refined.b)),
            positive: to_faer(&refined.positive),
            order_key: 0,
        }
    }

    pub(crate) fn split(&mut self, patch: usize) {
        self.patches[patch].vertex = Some(self.next);
        self.names.push(self.next);
        self.next += 1;
    }

    pub(crate) fn merge(&mut self, patch: usize) -> usize {
        let vertex = self.patches[patch].vertex.take().expect("a split patch");
        let slot = self.slots(&[vertex])[0];
        self.names.swap_remove(slot);
        slot
    }

    /// Patches that nothing younger stands on, split or not as asked.
    pub(crate) fn free(&self, split: bool) -> Vec<usize> {
        let used = |v: usize| self.patches.iter().any(|patch| patch.vertices.contains(&v));
        let free =
            |patch: &Patch| patch.vertex.is_some() == split && !patch.vertex.is_some_and(used);
        (0..self.patches.len()).filter(|&at| free(&self.patches[at])).collect()
    }
}

fn side_by_side(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let count = a.ncols();
    DMatrix::from_fn(a.nrows(), count + b.ncols(), |i, j| {
        if j < count { a[(i, j)] } else { b[(i, j - count)] }
    })
}

impl Refinement {
    /// [K_c, a12; a12ᵀ, A22].
    fn ring(&self) -> DMatrix<f64> {
        let (r, m) = (self.k_c.nrows(), self.a22.nrows());
        let mut ring = DMatrix::zeros(r + m, r + m);
        ring.view_mut((0, 0), (r, r)).copy_from(&self.k_c);
        ring.view_mut((0, r), (r, m)).copy_from(&self.a12);
        ring.view_mut((r, 0), (m, r)).copy_from(&self.a12.transpose());
        ring.view_mut((r, r), (m, m)).copy_from(&self.a22);
        ring
    }
}
