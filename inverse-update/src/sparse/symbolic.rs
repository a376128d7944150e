//! The nonzero pattern of the factor: the elimination tree, and panels of columns that share rows.

use super::pattern::Pattern;

/// The share of a panel's blocks that may be zero, so that panels become wider.
const ZEROS: f64 = 0.05;

/// Panels of at most this many columns are worth twice as many zeros.
const NARROW: usize = 8;

/// The columns `first..first + width` of the elimination order and the rows below them.
#[derive(Debug, Clone)]
pub(crate) struct PanelShape {
    pub first: usize,
    pub width: usize,
    /// Ascending in the elimination order.
    pub rows: Vec<u32>,
}

/// An elimination order with the panels of its factor, leaves first.
pub(crate) struct Symbolic {
    /// The vertex that is eliminated at each step.
    pub order: Vec<usize>,
    pub panels: Vec<PanelShape>,
}

const NONE: usize = usize::MAX;

impl Symbolic {
    /// Analyses an order. Cost: O(blocks of the factor).
    /// # Source
    /// Liu, The role of elimination trees in sparse factorization, SIAM J. Matrix Anal. Appl.
    /// 11(1), 1990; Ashcraft, Grimes, The influence of relaxed supernode partitions, 1989.
    pub(crate) fn new(pattern: &Pattern, order: Vec<usize>) -> Self {
        let parent = elimination_tree(pattern, &order);
        let sorted = postorder(&parent);
        // The same tree.
        let step = steps(&sorted);
        let above = |&at: &usize| step.get(parent[at]).copied().unwrap_or(NONE);
        let parent: Vec<usize> = sorted.iter().map(above).collect();
        let order: Vec<usize> = sorted.into_iter().map(|at| order[at]).collect();
        let panels = panels(pattern, &order, &parent);
        Self { order, panels }
    }

    /// The multiplications that make such a factor: half the square of each column.
    pub(crate) fn operations(&self, block: usize) -> f64 {
        let column = |panel: &PanelShape, at: usize| (panel.width - at + panel.rows.len()) as f64;
        let panel =
            |p: &PanelShape| (0..p.width).map(|at| 0.5 * column(p, at).powi(2)).sum::<f64>();
        (block as f64).powi(3) * self.panels.iter().map(panel).sum::<f64>()
    }
}

fn steps(order: &[usize]) -> Vec<usize> {
    let mut step = vec![0; order.len()];
    for (at, &v) in order.iter().enumerate() {
        step[v] = at;
    }
    step
}

/// The first later column that each column changes.
fn elimination_tree(pattern: &Pattern, order: &[usize]) -> Vec<usize> {
    let step = steps(order);
    let n = order.len();
    let (mut parent, mut ancestor) = (vec![NONE; n], vec![NONE; n]);
    for at in 0..n {
        for &other in pattern.neighbours(order[at]) {
            let mut below = step[other as usize];
            while below < at {
                let next = ancestor[below];
                ancestor[below] = at;
                if next == NONE {
                    parent[below] = at;
                    break;
                }
                below = next;
            }
        }
    }
    parent
}

/// An order of the steps in which every subtree is contiguous, the largest subtree right before its
/// root, so that it can share a panel with it.
fn postorder(parent: &[usize]) -> Vec<usize> {
    let n = parent.len();
    let mut size = vec![1; n];
    let mut children = vec![Vec::new(); n];
    for at in 0..n {
        if parent[at] != NONE {
            size[parent[at]] += size[at];
            children[parent[at]].push(at);
        }
    }
    let mut result = Vec::with_capacity(n);
    // From the roots down, largest child first; the reverse of that is the order.
    let mut stack: Vec<usize> = (0..n).filter(|&at| parent[at] == NONE).collect();
    while let Some(at) = stack.pop() {
        result.push(at);
        children[at].sort_by_key(|&child| size[child]);
        stack.append(&mut children[at]);
    }
    result.reverse();
    result
}

/// Panels of columns with equal or nearly equal rows. A panel absorbs the child right before it as
/// long as that adds few zeros.
fn panels(pattern: &Pattern, order: &[usize], parent: &[usize]) -> Vec<PanelShape> {
    let step = steps(order);
    let n = order.len();
    let mut rows_of: Vec<Vec<u32>> = vec![Vec::new(); n];
    let mut mark = vec![NONE; n];
    for at in 0..n {
        // The children have put their rows here.
        let mut rows = std::mem::take(&mut rows_of[at]);
        mark[at] = at;
        rows.retain(|&row| std::mem::replace(&mut mark[row as usize], at) != at);
        for &other in pattern.neighbours(order[at]) {
            let row = step[other as usize];
            if row > at && mark[row] != at {
                mark[row] = at;
                rows.push(row as u32);
            }
        }
        rows.sort_unstable();
        if parent[at] != NONE {
            rows_of[parent[at]].extend_from_slice(&rows[1..]);
        }
        rows_of[at] = rows;
    }
    let mut panels: Vec<PanelShape> = Vec::new();
    let mut kept: Vec<usize> = Vec::new();
    for at in 0..n {
        let rows = std::mem::take(&mut rows_of[at]);
        let mut next = PanelShape { first: at, width: 1, rows };
        let mut real = 1 + next.rows.len();
        while let Some(child) = panels.last() {
            if child.rows.first().is_none_or(|&row| row as usize != next.first) {
                break;
            }
            let below = kept.last().copied().unwrap_or(0);
            let width = child.width + next.width;
            let total = blocks(width, next.rows.len());
            let zeros = (total - real - below) as f64;
            let allowed = if width <= NARROW { 2.0 * ZEROS } else { ZEROS };
            if zeros > allowed * total as f64 {
                break;
            }
            real += below;
            next = PanelShape { first: child.first, width, rows: next.rows };
            panels.pop();
            kept.pop();
        }
        panels.push(next);
        kept.push(real);
    }
    panels
}

/// Blocks of a panel on and below its diagonal.
pub(crate) fn blocks(width: usize, rows: usize) -> usize {
    width * (width + 1) / 2 + width * rows
}
