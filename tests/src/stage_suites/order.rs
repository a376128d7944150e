//! The order at which errors fall.

/// Slope of ln e over ln h by least squares; infinite where every error is at most `rounding`.
pub fn order(steps: &[f64], errors: &[f64], rounding: f64) -> f64 {
    if errors.iter().all(|&e| e <= rounding) {
        return f64::INFINITY;
    }
    let mean = |values: &[f64]| values.iter().map(|v| v.ln()).sum::<f64>() / values.len() as f64;
    let (h, e) = (mean(steps), mean(errors));
    let pairs = || steps.iter().zip(errors).map(|(s, d)| (s.ln() - h, d.ln() - e));
    pairs().map(|(s, d)| s * d).sum::<f64>() / pairs().map(|(s, _)| s * s).sum::<f64>()
}
