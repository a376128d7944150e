//! The Pareto front.

/// Who is beaten by no one: the points (x, y) for which no other is at most as large in both and
/// smaller in one, as positions in `points`, by ascending x. What is not positive and finite takes
/// no part. Of equal points the first counts. Cost: O(n log n).
pub fn front(points: &[(f64, f64)]) -> Vec<usize> {
    let valid = |value: f64| value > 0.0 && value.is_finite();
    let mut order: Vec<usize> =
        (0..points.len()).filter(|&i| valid(points[i].0) && valid(points[i].1)).collect();
    order.sort_by(|&i, &j| {
        let (a, b) = (points[i], points[j]);
        a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)).then(i.cmp(&j))
    });
    let mut lowest = f64::INFINITY;
    order.retain(|&i| {
        let better = points[i].1 < lowest;
        lowest = lowest.min(points[i].1);
        better
    });
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_is_on_the_front_if_none_beats_it() {
        let points = [(3.0, 1.0), (1.0, 3.0), (2.0, 2.0), (2.0, 2.5), (3.0, 3.0), (2.0, 2.0)];
        assert_eq!(front(&points), [1, 2, 0]);
        assert_eq!(front(&[(1.0, 1.0), (2.0, 1.0)]), [0], "slower and no better");
    }

    #[test]
    fn what_is_no_point_takes_no_part() {
        let points = [(f64::NAN, 0.1), (0.5, f64::INFINITY), (0.0, 1.0), (2.0, 2.0)];
        assert_eq!(front(&points), [3]);
        assert!(front(&[]).is_empty());
    }
}
