//! Stiffness matrices that splits and merges can be tried on, kept as a list of parts.

use faer::{Mat, MatRef, Scale, Side};
use yawara_inverse_update::{RingChange, StiffnessChange};

/// One part of K that can be refined; its changes have names of vertices for slots.
pub(crate) struct Patch {
    /// K_p = A Aᵀ − R Rᵀ as it came.
    content: StiffnessChange,
    refinement: RingChange,
    /// The new vertex, if it is refined.
    vertex: Option<usize>,
}

/// An independent model of K: it knows parts and names, and is assembled anew when asked.
///
/// No matrix is ever updated in it, so it has no drift.
///
/// With negative rows the matrix is [A, Bᵀ; B, −P] in displacements and pressures: quasi-definite
/// whatever B is, as long as the parts add up to positive definite A and P.
pub(crate) struct Model {
    pub(crate) block: usize,
    pub(crate) negative: usize,
    base: Mat<f64>,
    /// The name in each slot, moved about by swap-removal as the contract says.
    pub(crate) names: Vec<usize>,
    pub(crate) patches: Vec<Patch>,
    /// Vertices whose rows are not in K now.
    pub(crate) fixed: Vec<usize>,
    next: usize,
}

impl Model {
    /// A chain of `vertices` springs that is held at its first vertex; the last `negative` rows of
    /// a vertex are a chain of their own, subtracted, and coupled to its first row.
    pub(crate) fn chain(vertices: usize, block: usize, negative: usize) -> Self {
        let mut base = Mat::zeros(block * vertices, block * vertices);
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
        Self { block, negative, base, names, patches, fixed, next }
    }

    /// K in slot order, assembled from the parts.
    pub(crate) fn assemble(&self) -> Mat<f64> {
        let n = self.block * self.names.len();
        let mut k = Mat::zeros(n, n);
        let base: Vec<usize> = (0..self.base.nrows() / self.block).collect();
        self.scatter(&mut k, &base, &base, self.base.as_ref());
        for Patch { refinement, vertex, .. } in &self.patches {
            let RingChange { slots: old, k_p, k_c, a12, a22, .. } = refinement;
            if vertex.is_none() {
                self.scatter(&mut k, old, old, k_p.as_ref());
            } else {
                let new = vertex.as_slice();
                self.scatter(&mut k, old, old, k_c.as_ref());
                self.scatter(&mut k, old, new, a12.as_ref());
                self.scatter(&mut k, new, old, a12.transpose());
                self.scatter(&mut k, new, new, a22.as_ref());
            }
        }
        k
    }

    /// Adds a part on the rows of some vertices and the columns of others, fixed ones left out.
    fn scatter(&self, k: &mut Mat<f64>, rows: &[usize], columns: &[usize], part: MatRef<'_, f64>) {
        let m = self.block;
        let [(row_slots, rows), (column_slots, columns)] = [rows, columns].map(|v| self.live(v));
        for (i, &row) in rows.iter().enumerate() {
            for (j, &column) in columns.iter().enumerate() {
                let place = (m * row_slots[i / m] + i % m, m * column_slots[j / m] + j % m);
                k[place] += part[(row, column)];
            }
        }
    }

    fn slot(&self, name: usize) -> Option<usize> {
        self.names.iter().position(|&other| other == name)
    }

    /// The slots of the vertices that are not fixed, and the rows of `vertices` that are theirs.
    fn live(&self, vertices: &[usize]) -> (Vec<usize>, Vec<usize>) {
        let (mut slots, mut rows) = (vec![], vec![]);
        for (at, &vertex) in vertices.iter().enumerate() {
            if let Some(slot) = self.slot(vertex) {
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
        let (m, old) = (self.block, self.names.len());
        self.names.push(self.fixed.remove(at));
        let k = self.assemble();
        let block = |slot: usize| k.submatrix(m * slot, m * old, m, m);
        let slots: Vec<usize> = (0..old).filter(|&slot| block(slot).norm_max() > 0.0).collect();
        let a12 = Mat::from_fn(m * slots.len(), m, |i, j| block(slots[i / m])[(i % m, j)]);
        RingChange::freed(slots, a12, block(old).to_owned(), 0).expect("the model's own change")
    }

    /// Adds a patch of stiffness `scale` on `vertices` and says how K changes.
    ///
    /// Displacements u and pressures q are refined each by themselves; what couples them is
    /// arbitrary. In the basis (u_old, d), d = u_M − H u_old, the refinement is
    /// [K_p + F Fᵀ − N Nᵀ, b; bᵀ, A22]. Of displacements it is [W Wᵀ + E Eᵀ + F_u F_uᵀ − N_u N_uᵀ,
    /// b_uu; ·, A22_uu] with b_uu A22_uu⁻¹ b_uuᵀ = θ² W Wᵀ and N_u N_uᵀ ≤ E Eᵀ; of pressures it is
    /// the negative of [4 V Vᵀ − F_q F_qᵀ + N_q N_qᵀ, −b_qq; ·, p] with F_q F_qᵀ ≤ V Vᵀ and
    /// b_qq p⁻¹ b_qqᵀ = θ² V Vᵀ: all positive semidefinite. In nodal values a12 = b − Hᵀ A22 and
    /// K_c = K_p + F Fᵀ − N Nᵀ − b H − Hᵀ bᵀ + Hᵀ A22 H.
    pub(crate) fn add_patch(
        &mut self,
        vertices: Vec<usize>,
        scale: f64,
        rank: usize,
        mut number: impl FnMut() -> f64,
    ) -> StiffnessChange {
        let (m, q, r) = (self.block, self.negative, self.block * vertices.len());
        assert!(q <= 1, "at most one pressure per vertex");
        let (solid, unit) = (m - q, scale.sqrt());
        let is_pressure = |i: usize| i % m >= solid;
        let mut random = |rows, cols| Mat::from_fn(rows, cols, |_, _| unit * number());
        let on = |wanted: bool, x: Mat<f64>| {
            let entry = |i, j| if is_pressure(i) == wanted { x[(i, j)] } else { 0.0 };
            Mat::from_fn(x.nrows(), x.ncols(), entry)
        };
        let (w, extra) = (on(false, random(r, solid)), on(false, random(r, 2)));
        let v = on(true, random(r, q));
        let coupling = [on(false, random(r, q)), on(true, random(r, q))];
        let spread = random(solid, solid);
        let (in_solid, own, gap) = (on(false, random(r, rank)), random(q, rank), random(m, q));
        let share = random(2, 1);
        // At most 0.9 long: N_u N_uᵀ ≤ E Eᵀ.
        let share = &share * Scale(0.9 / share.norm_l2().max(unit));
        let negative = &extra * share + on(true, random(r, 1));
        let mixed = random(r, m);
        let theta = number().abs();

        let solid22 =
            &spread * spread.transpose() + Mat::<f64>::identity(solid, solid) * Scale(scale);
        let p22 = scale * (1.0 + theta);
        let a22 = Mat::from_fn(m, m, |i, j| match (is_pressure(i), is_pressure(j)) {
            (false, false) => solid22[(i, j)],
            (true, true) => -p22,
            _ => unit * gap[(i.min(j), 0)],
        });
        let cholesky = solid22.llt(Side::Lower).expect("positive definite by construction");
        let in_b = &w * cholesky.L().transpose() * Scale(theta);
        let b = Mat::from_fn(r, m, |i, j| match (is_pressure(i), is_pressure(j)) {
            (false, false) => in_b[(i, j)],
            (true, true) => theta * p22.sqrt() * v[(i, 0)],
            _ => unit * mixed[(i, j)],
        });
        let positive = in_solid + &v * &own * Scale(1.0 / own.norm_l2().max(unit));
        let half = Scale(0.5_f64.sqrt());
        let added = faer::concat![[w, extra, (&coupling[0] + &coupling[1]) * half]];
        let removed = faer::concat![[&v * Scale(2.0), (&coupling[0] - &coupling[1]) * half]];
        let h = Mat::from_fn(m, r, |i, j| if j % m == i && j < 2 * m { 0.5 } else { 0.0 });
        let k_p = &added * added.transpose() - &removed * removed.transpose();
        let a12 = &b - h.transpose() * &a22;
        let excess = &positive * positive.transpose() - &negative * negative.transpose();
        let k_c =
            &k_p + excess - &b * &h - h.transpose() * b.transpose() + h.transpose() * &a22 * &h;
        let slots = vertices.clone();
        let refinement =
            RingChange { slots, k_p, k_c, a12, a22, b, positive, negative, order_key: 0 };
        let content = StiffnessChange { slots: vertices, added, removed };
        let change = self.in_slots(&content);
        self.patches.push(Patch { content, refinement, vertex: None });
        change
    }

    /// Takes an unsplit patch away and says how K changes.
    pub(crate) fn remove_patch(&mut self, patch: usize) -> StiffnessChange {
        let StiffnessChange { slots, added, removed } = self.patches.remove(patch).content;
        self.in_slots(&StiffnessChange { slots, added: removed, removed: added })
    }

    fn in_slots(&self, change: &StiffnessChange) -> StiffnessChange {
        let (slots, rows) = self.live(&change.slots);
        let [added, removed] = [&change.added, &change.removed].map(|part| on_rows(part, &rows));
        StiffnessChange { slots, added, removed }
    }

    /// The change that a split, or now a merge, of this patch hands over.
    pub(crate) fn ring(&self, patch: usize) -> RingChange {
        let ring = &self.patches[patch].refinement;
        let (slots, rows) = self.live(&ring.slots);
        let on_rows = |part: &Mat<f64>| on_rows(part, &rows);
        let square =
            |part: &Mat<f64>| Mat::from_fn(rows.len(), rows.len(), |i, j| part[(rows[i], rows[j])]);
        RingChange {
            slots,
            k_p: square(&ring.k_p),
            k_c: square(&ring.k_c),
            a12: on_rows(&ring.a12),
            a22: ring.a22.clone(),
            b: on_rows(&ring.b),
            positive: on_rows(&ring.positive),
            negative: on_rows(&ring.negative),
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
        let slot = self.slot(vertex).expect("a free vertex");
        self.names.swap_remove(slot);
        slot
    }

    /// Patches that nothing younger stands on, split or not as asked; a fixed vertex stays.
    pub(crate) fn free(&self, split: bool) -> Vec<usize> {
        let used = |v| self.patches.iter().any(|patch| patch.content.slots.contains(&v));
        let stays = |v: usize| used(v) || self.fixed.contains(&v);
        let free =
            |patch: &Patch| patch.vertex.is_some() == split && !patch.vertex.is_some_and(stays);
        (0..self.patches.len()).filter(|&at| free(&self.patches[at])).collect()
    }
}

fn on_rows(part: &Mat<f64>, rows: &[usize]) -> Mat<f64> {
    Mat::from_fn(rows.len(), part.ncols(), |i, j| part[(rows[i], j)])
}
