//! Stiffness matrices that splits and merges can be tried on, kept as a list of parts.

use faer::Mat;
use nalgebra::DMatrix;
use yawara_inverse_update::{RingChange, StiffnessChange};

/// One part of K that can be refined: K_p = A Aᵀ − R Rᵀ on some vertices.
pub(crate) struct Patch {
    pub(crate) vertices: Vec<usize>,
    added: DMatrix<f64>,
    removed: DMatrix<f64>,
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
    negative: DMatrix<f64>,
}

/// A column at most 0.9 long.
fn shrinking(column: &DMatrix<f64>, unit: f64) -> DMatrix<f64> {
    column * (0.9 / column.norm().max(unit))
}

/// An independent model of K: it knows parts and names, and is assembled anew when asked.
///
/// No matrix is ever updated in it, so it has no drift.
///
/// With negative rows the matrix is [A, Bᵀ; B, −P] in displacements and pressures: quasi-definite
/// whatever B is, as long as the parts add up to positive definite A and P.
pub struct Model {
    pub(crate) block: usize,
    pub(crate) negative: usize,
    base: DMatrix<f64>,
    base_vertices: usize,
    /// The name in each slot, moved about by swap-removal as the contract says.
    pub(crate) names: Vec<usize>,
    pub(crate) patches: Vec<Patch>,
    /// Vertices whose rows are not in K now.
    pub(crate) fixed: Vec<usize>,
    next: usize,
}

pub(crate) fn to_faer(matrix: &DMatrix<f64>) -> Mat<f64> {
    Mat::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[(i, j)])
}

impl Model {
    /// A chain of `vertices` springs that is held at its first vertex; the last `negative` rows of
    /// a vertex are a chain of their own, subtracted, and coupled to its first row.
    #[must_use]
    pub fn chain(vertices: usize, block: usize, negative: usize) -> Self {
        let mut base = DMatrix::zeros(block * vertices, block * vertices);
        for i in 0..vertices * block {
            // Sideways stiffnesses differ, so that rows can't be mixed up unseen.
            let sideways = 1.0 + (i % block) as f64;
            let is_pressure = i % block + negative >= block;
            let spring = if is_pressure { -sideways } else { sideways };
            if is_pressure {
                base[(i, i - i % block)] += 0.5;
                base[(i - i % block, i)] += 0.5;
            }
            base[(i, i)] += spring;
            if i >= block {
                base[(i - block, i - block)] += spring;
                base[(i - block, i)] -= spring;
                base[(i, i - block)] -= spring;
            }
        }
        let names = (0..vertices).collect();
        let (patches, fixed, next) = (vec![], vec![], vertices);
        Self { block, negative, base, base_vertices: vertices, names, patches, fixed, next }
    }

    /// K in slot order, assembled from the parts.
    #[must_use]
    pub fn assemble(&self) -> DMatrix<f64> {
        self.assemble_on(&self.names)
    }

    /// K on the rows of some vertices: the others are held.
    fn assemble_on(&self, names: &[usize]) -> DMatrix<f64> {
        let n = self.block * names.len();
        let mut k = DMatrix::zeros(n, n);
        let base: Vec<usize> = (0..self.base_vertices).collect();
        self.scatter(&mut k, names, &base, &self.base);
        for patch in &self.patches {
            match patch.vertex {
                None => self.scatter(&mut k, names, &patch.vertices, &patch.refined.k_p),
                Some(vertex) => {
                    let mut vertices = patch.vertices.clone();
                    vertices.push(vertex);
                    self.scatter(&mut k, names, &vertices, &patch.refined.ring());
                }
            }
        }
        k
    }

    fn scatter(
        &self,
        k: &mut DMatrix<f64>,
        names: &[usize],
        vertices: &[usize],
        part: &DMatrix<f64>,
    ) {
        let slots: Vec<Option<usize>> =
            vertices.iter().map(|v| names.iter().position(|name| name == v)).collect();
        let row = |i: usize| slots[i / self.block].map(|slot| self.block * slot + i % self.block);
        for i in 0..part.nrows() {
            for j in 0..part.ncols() {
                if let (Some(row), Some(column)) = (row(i), row(j)) {
                    k[(row, column)] += part[(i, j)];
                }
            }
        }
    }

    /// The slots of the vertices that are not fixed, and the rows of `vertices` that are theirs.
    fn live(&self, vertices: &[usize]) -> (Vec<usize>, Vec<usize>) {
        let (mut slots, mut rows) = (vec![], vec![]);
        for (at, vertex) in vertices.iter().enumerate() {
            if let Some(slot) = self.names.iter().position(|name| name == vertex) {
                slots.push(slot);
                rows.extend(self.block * at..self.block * (at + 1));
            }
        }
        (slots, rows)
    }

    /// Fixes the vertex in a slot.
    pub(crate) fn fix(&mut self, slot: usize) {
        self.fixed.push(self.names.swap_remove(slot));
    }

    /// Frees a vertex, which takes the last slot; the hand-over is that of K assembled with it.
    pub(crate) fn release(&mut self, at: usize) -> RingChange {
        let vertex = self.fixed.remove(at);
        let old = self.names.len();
        self.names.push(vertex);
        let k = self.assemble();
        let m = self.block;
        let block = |slot: usize| k.view((m * slot, m * old), (m, m)).into_owned();
        let slots: Vec<usize> = (0..old).filter(|&slot| block(slot).amax() > 0.0).collect();
        let a12 = Mat::from_fn(m * slots.len(), m, |i, j| block(slots[i / m])[(i % m, j)]);
        RingChange::freed(slots, a12, to_faer(&block(old)), 0).expect("the model's own change")
    }

    /// Adds a patch of stiffness `scale` on `vertices` and says how K changes.
    ///
    /// In the basis (u_old, d), d = u_M − H u_old, its refinement is
    /// [K_p + F Fᵀ − N Nᵀ, b; bᵀ, A22] with K_p = W Wᵀ + E Eᵀ, b A22⁻¹ bᵀ = θ² W Wᵀ and
    /// N Nᵀ ≤ E Eᵀ, hence positive semidefinite; in nodal values a12 = b − Hᵀ A22 and
    /// K_c = K_p + F Fᵀ − N Nᵀ − b H − Hᵀ bᵀ + Hᵀ A22 H.
    pub(crate) fn add_patch(
        &mut self,
        vertices: Vec<usize>,
        scale: f64,
        rank: usize,
        mut number: impl FnMut() -> f64,
    ) -> StiffnessChange {
        if self.negative > 0 {
            return self.add_mixed_patch(vertices, scale, rank, number);
        }
        let (m, r) = (self.block, self.block * vertices.len());
        let unit = scale.sqrt();
        let mut random = |rows, cols| DMatrix::from_fn(rows, cols, |_, _| unit * number());
        let (w, extra) = (random(r, m), random(r, 2));
        let positive = random(r, rank);
        let negative = &extra * shrinking(&random(2, 1), unit);
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
        let excess = &positive * positive.transpose() - &negative * negative.transpose();
        let k_c =
            &k_p + excess - &b * &h - h.transpose() * b.transpose() + h.transpose() * &a22 * &h;
        let added =
            DMatrix::from_fn(r, m + 2, |i, j| if j < m { w[(i, j)] } else { extra[(i, j - m)] });
        let removed = DMatrix::zeros(r, 0);
        let refined = Refinement { k_p, k_c, a12, a22, b, positive, negative };
        let change = self.change(&vertices, &added, &removed);
        self.patches.push(Patch { vertices, added, removed, refined, vertex: None });
        change
    }

    /// The same for displacements u and pressures q: A and P are refined as above, each by itself;
    /// what couples u to q is arbitrary.
    ///
    /// In the basis (u_old, d) the parts of A are [W Wᵀ + E Eᵀ + F_u F_uᵀ − N_u N_uᵀ, b_uu; ·,
    /// A22_uu] with b_uu A22_uu⁻¹ b_uuᵀ = θ² W Wᵀ and N_u N_uᵀ ≤ E Eᵀ, and those of P are [4 V Vᵀ −
    /// F_q F_qᵀ + N_q N_qᵀ, −b_qq; ·, p] with F_q F_qᵀ ≤ V Vᵀ, b_qq p⁻¹ b_qqᵀ = θ² V Vᵀ: all
    /// positive semidefinite.
    fn add_mixed_patch(
        &mut self,
        vertices: Vec<usize>,
        scale: f64,
        rank: usize,
        mut number: impl FnMut() -> f64,
    ) -> StiffnessChange {
        let (m, r) = (self.block, self.block * vertices.len());
        let solid = m - self.negative;
        assert_eq!(self.negative, 1, "one pressure per vertex");
        let unit = scale.sqrt();
        let is_pressure = |i: usize| i % m >= solid;
        let mut random = |rows, cols| DMatrix::from_fn(rows, cols, |_, _| unit * number());
        let on = |wanted: bool, x: DMatrix<f64>| {
            DMatrix::from_fn(x.nrows(), x.ncols(), |i, j| {
                if is_pressure(i) == wanted { x[(i, j)] } else { 0.0 }
            })
        };
        let (w, extra) = (on(false, random(r, solid)), on(false, random(r, 2)));
        let v = on(true, random(r, 1));
        let coupling = [on(false, random(r, 1)), on(true, random(r, 1))];
        let spread = random(solid, solid);
        let (in_solid, own, gap) = (on(false, random(r, rank)), random(1, rank), random(m, 1));
        let softer = &extra * shrinking(&random(2, 1), unit) + on(true, random(r, 1));
        let mixed = random(r, m);
        let theta = number().abs();

        let solid22 = &spread * spread.transpose() + DMatrix::identity(solid, solid) * scale;
        let p22 = scale * (1.0 + theta);
        let mut a22 = DMatrix::zeros(m, m);
        a22.view_mut((0, 0), (solid, solid)).copy_from(&solid22);
        a22[(solid, solid)] = -p22;
        for i in 0..solid {
            a22[(i, solid)] = unit * gap[(i, 0)];
            a22[(solid, i)] = unit * gap[(i, 0)];
        }
        let lower = solid22.cholesky().expect("positive definite by construction").l();
        let in_b = &w * lower.transpose() * theta;
        let b = DMatrix::from_fn(r, m, |i, j| match (is_pressure(i), j >= solid) {
            (false, false) => in_b[(i, j)],
            (true, true) => theta * p22.sqrt() * v[(i, 0)],
            _ => unit * mixed[(i, j)],
        });
        let share = own.norm().max(unit);
        let positive = in_solid + &v * own / share;
        let negative = softer;
        let halves = [&coupling[0] + &coupling[1], &coupling[0] - &coupling[1]];
        let half = 0.5_f64.sqrt();
        let added = DMatrix::from_fn(r, solid + 3, |i, j| match j {
            j if j < solid => w[(i, j)],
            j if j < solid + 2 => extra[(i, j - solid)],
            _ => half * halves[0][(i, 0)],
        });
        let removed = DMatrix::from_fn(r, 2, |i, j| [2.0 * v[(i, 0)], half * halves[1][(i, 0)]][j]);
        let mut h = DMatrix::zeros(m, r);
        for i in 0..r.min(2 * m) {
            h[(i % m, i)] = 0.5;
        }
        let k_p = &added * added.transpose() - &removed * removed.transpose();
        let a12 = &b - h.transpose() * &a22;
        let excess = &positive * positive.transpose() - &negative * negative.transpose();
        let k_c =
            &k_p + excess - &b * &h - h.transpose() * b.transpose() + h.transpose() * &a22 * &h;
        let refined = Refinement { k_p, k_c, a12, a22, b, positive, negative };
        let change = self.change(&vertices, &added, &removed);
        self.patches.push(Patch { vertices, added, removed, refined, vertex: None });
        change
    }

    /// Takes an unsplit patch away and says how K changes.
    pub(crate) fn remove_patch(&mut self, patch: usize) -> StiffnessChange {
        let patch = self.patches.remove(patch);
        self.change(&patch.vertices, &patch.removed, &patch.added)
    }

    fn change(
        &self,
        vertices: &[usize],
        added: &DMatrix<f64>,
        removed: &DMatrix<f64>,
    ) -> StiffnessChange {
        let (slots, rows) = self.live(vertices);
        let [added, removed] = [added, removed].map(|part| to_faer(&part.select_rows(&rows)));
        StiffnessChange { slots, added, removed }
    }

    /// The change that a split, or now a merge, of this patch hands over.
    pub(crate) fn ring(&self, patch: usize) -> RingChange {
        let patch = &self.patches[patch];
        let refined = &patch.refined;
        let (slots, rows) = self.live(&patch.vertices);
        let square = |m: &DMatrix<f64>| to_faer(&m.select_rows(&rows).select_columns(&rows));
        let on_rows = |m: &DMatrix<f64>| to_faer(&m.select_rows(&rows));
        RingChange {
            slots,
            k_p: square(&refined.k_p),
            k_c: square(&refined.k_c),
            a12: on_rows(&refined.a12),
            a22: to_faer(&refined.a22),
            b: on_rows(&refined.b),
            positive: on_rows(&refined.positive),
            negative: on_rows(&refined.negative),
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
        let slot = self.names.iter().position(|&name| name == vertex).expect("a free vertex");
        self.names.swap_remove(slot);
        slot
    }

    /// Patches that nothing younger stands on, split or not as asked; a fixed vertex stays.
    pub(crate) fn free(&self, split: bool) -> Vec<usize> {
        let used = |v: usize| self.patches.iter().any(|patch| patch.vertices.contains(&v));
        let stays = |v: usize| used(v) || self.fixed.contains(&v);
        let free =
            |patch: &Patch| patch.vertex.is_some() == split && !patch.vertex.is_some_and(stays);
        (0..self.patches.len()).filter(|&at| free(&self.patches[at])).collect()
    }
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
