//! The outline of liver and gallbladder as implicit functions, negative inside.
//!
//! Units: the organ's length from right to left is 1. Axes: right, anterior, superior.

use nalgebra::Vector3;

/// Half edges of a box around 0 that holds liver and gallbladder.
pub(super) const HALF_EXTENT: [f64; 3] = [0.5, 0.335, 0.345];

/// Middle of the right lobe's ellipsoid.
pub(super) const RIGHT_LOBE: Vector3<f64> = Vector3::new(0.17, 0.0, 0.0);

/// Where the portal vein enters, on the hollow underside.
pub(super) const HILUM: Vector3<f64> = Vector3::new(0.02, 0.0, -0.09);

/// A sphere: centre and radius.
pub(super) type Ball = (Vector3<f64>, f64);

/// Neck and fundus of the pear-shaped gallbladder.
pub(super) const GALLBLADDER: (Ball, Ball) =
    ((Vector3::new(0.03, 0.03, -0.17), 0.03), (Vector3::new(0.02, 0.15, -0.27), 0.07));

/// Right lobe, left lobe, left tip: centres and semi-axes.
const LOBES: [(Vector3<f64>, Vector3<f64>); 3] = [
    (RIGHT_LOBE, Vector3::new(0.32, 0.33, 0.34)),
    (Vector3::new(-0.12, 0.10, 0.08), Vector3::new(0.28, 0.20, 0.17)),
    (Vector3::new(-0.33, 0.13, 0.13), Vector3::new(0.17, 0.12, 0.08)),
];

/// Stomach, duodenum and kidney press the underside hollow.
const HOLLOW: Ball = (Vector3::new(-0.60, -0.33, -0.60), 0.85);

/// Width of the blends between lobes, and along the edge of the hollow.
const BLEND: f64 = 0.10;
const EDGE_BLEND: f64 = 0.05;

/// Smooth minimum: min(a, b) − max(k − |a − b|, 0)²/(4k), at most k/4 below the minimum.
///
/// # Source
/// Quilez, "Smooth minimum", <https://iquilezles.org/articles/smin>.
fn smooth_min(a: f64, b: f64, k: f64) -> f64 {
    let h = (k - (a - b).abs()).max(0.0);
    a.min(b) - h * h / (4.0 * k)
}

/// k₀(k₀ − 1)/k₁ with k₀ = |p/r|, k₁ = |p/r²|: the distance to an ellipsoid to first order.
fn ellipsoid(p: Vector3<f64>, radii: Vector3<f64>) -> f64 {
    let scaled = p.component_div(&radii);
    let gradient = scaled.component_div(&radii).norm();
    // In the very middle the quotient is 0/0; the distance there is the smallest radius.
    if gradient == 0.0 { -radii.min() } else { scaled.norm() * (scaled.norm() - 1.0) / gradient }
}

/// The liver: a blend of three ellipsoids less a ball. About the distance near the surface.
pub(super) fn liver_field(p: Vector3<f64>) -> f64 {
    let [right, left, tip] = LOBES.map(|(centre, radii)| ellipsoid(p - centre, radii));
    let lobes = smooth_min(smooth_min(right, left, BLEND), tip, BLEND);
    let outside_hollow = HOLLOW.1 - (p - HOLLOW.0).norm();
    -smooth_min(-lobes, -outside_hollow, EDGE_BLEND)
}

/// The gallbladder: balls along its axis, their radius growing from neck to fundus.
pub(super) fn gallbladder(p: Vector3<f64>) -> f64 {
    let ((neck, thin), (fundus, thick)) = GALLBLADDER;
    let axis = fundus - neck;
    let along = ((p - neck).dot(&axis) / axis.norm_squared()).clamp(0.0, 1.0);
    (p - neck - axis * along).norm() - (thin + (thick - thin) * along)
}
