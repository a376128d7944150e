//! Projected Gauss-Seidel: forces that push where there is contact and vanish where there is not.

/// Finds λ ≥ 0 with s = b + W λ ≥ 0 and λᵀs = 0 by sweeps λ_i ← max(0, λ_i − s_i/W_ii), or with a
/// `set` given s_i = 0 in it and λ_i = 0 outside, whatever the signs; from the λ given, until no
/// sweep changes an s_i by more than `tolerance` through its own λ_i.
///
/// W: k × k, symmetric positive semi-definite, by rows, m/N; b in m; λ in N. Rows without
/// compliance (W_ii = 0) are left at 0. Returns the sweeps made, at most `sweeps`. Cost: O(k²) a
/// sweep.
/// # Source
/// Cottle, Pang, Stone, The Linear Complementarity Problem, 1992, section 5.2.
pub(crate) fn projected_gauss_seidel(
    w: &[f64],
    b: &[f64],
    lambda: &mut [f64],
    set: Option<&[bool]>,
    tolerance: f64,
    sweeps: usize,
) -> usize {
    let k = b.len();
    for sweep in 1..=sweeps {
        let mut largest: f64 = 0.0;
        for i in 0..k {
            let row = &w[k * i..k * (i + 1)];
            if !(row[i] > 0.0) || set.is_some_and(|set| !set[i]) {
                lambda[i] = 0.0;
                continue;
            }
            let slack = b[i] + row.iter().zip(lambda.iter()).map(|(w, l)| w * l).sum::<f64>();
            let renewed = match set {
                None => (lambda[i] - slack / row[i]).max(0.0),
                Some(_) => lambda[i] - slack / row[i],
            };
            largest = largest.max((renewed - lambda[i]).abs() * row[i]);
            lambda[i] = renewed;
        }
        if largest <= tolerance {
            return sweep;
        }
    }
    sweeps
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_ends_at_the_complementary_solution_or_at_that_of_a_given_set(
            entries in proptest::collection::vec(-1.0..1.0f64, 36),
            b in proptest::collection::vec(-1.0..1.0f64, 6),
            set in proptest::collection::vec(proptest::bool::ANY, 6),
        ) {
            let w = contracting(&entries);
            for set in [None, Some(&set[..])] {
                let mut lambda = vec![if set.is_some() { 1.0 } else { 0.0 }; 6];
                let sweeps = projected_gauss_seidel(&w, &b, &mut lambda, set, 1e-14, 10_000);
                prop_assert!(sweeps < 10_000);
                for i in 0..6 {
                    let force = lambda[i];
                    let slack = b[i] + (0..6).map(|j| w[6 * i + j] * lambda[j]).sum::<f64>();
                    match set.map(|set| set[i]) {
                        None => prop_assert!(force >= 0.0 && slack > -1e-10 && force * slack < 1e-9),
                        Some(true) => prop_assert!(slack.abs() < 1e-10, "{}", slack),
                        Some(false) => prop_assert!(force.abs() < 1e-10, "{}", force),
                    }
                }
            }
        }
    }

    /// A Aᵀ + I: eigenvalues from 1 on, so that sweeps contract.
    fn contracting(entries: &[f64]) -> Vec<f64> {
        let entry = |at: usize| {
            let (i, j) = (at / 6, at % 6);
            let dot: f64 = (0..6).map(|k| entries[6 * i + k] * entries[6 * j + k]).sum();
            dot + f64::from(u8::from(i == j))
        };
        (0..36).map(entry).collect()
    }

    #[test]
    fn nothing_to_do_and_points_that_cannot_move() {
        assert_eq!(projected_gauss_seidel(&[], &[], &mut [], None, 1e-9, 5), 1);
        let mut lambda = [3.0];
        projected_gauss_seidel(&[0.0], &[-1.0], &mut lambda, None, 1e-9, 5);
        assert_eq!(lambda, [0.0]);
    }
}
