//! The figures of a beam that is let go, swings and comes to rest.

use std::f64::consts::PI;

use super::recording::Recording;

/// How far a beam has to fall, as part of all that it falls, to have been let go.
const LET_GO: f64 = 0.05;

/// Swings count until they are smaller than this part of the first.
const SMALLEST: f64 = 0.1;

/// What is seen of a swing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swing {
    /// From straight to rest, mm.
    pub drop_mm: f64,
    /// Of the damped swing, Hz.
    pub frequency_hz: f64,
    /// ζ: amplitudes fall by e^(−2πζ/√(1−ζ²)) in a period.
    pub damping_ratio: f64,
}

impl Swing {
    /// That of a recording from before a beam is let go until it rests; none where there are fewer than three swings.
    ///
    /// Heights between those of a recording are those of a parabola through three of them. Each swing is taken from one
    /// extreme to the next, so that where the beam creeps to its rest plays no part.
    pub fn of(recording: &Recording) -> Option<Self> {
        let heights = &recording.heights_mm;
        let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
        let (start, rest) = (mean(&heights[..10]), mean(&heights[heights.len() - 20..]));
        Self::between(recording, start, rest)
    }

    /// The same of one that is known to fall from `start` to `rest`, mm.
    pub fn between(recording: &Recording, start: f64, rest: f64) -> Option<Self> {
        let heights = &recording.heights_mm;
        let drop_mm = start - rest;
        let begin = heights.iter().position(|h| start - h > LET_GO * drop_mm)?;
        let extremes: Vec<[f64; 2]> = (begin..heights.len() - 1)
            .filter_map(|i| {
                let [before, here, after] = [i.checked_sub(1)?, i, i + 1].map(|i| heights[i]);
                let (rise, bend) = (0.5 * (after - before), before - 2.0 * here + after);
                let is_extreme = (here - before) * (after - here) < 0.0;
                let time = (i as f64 - rise / bend) * recording.interval_s;
                is_extreme.then(|| [time, here - 0.5 * rise * rise / bend])
            })
            .collect();
        let swings: Vec<f64> =
            extremes.windows(2).map(|pair| (pair[1][1] - pair[0][1]).abs()).collect();
        let small = swings.iter().position(|swing| *swing < SMALLEST * swings[0]);
        let count = small.unwrap_or(swings.len());
        if count < 6 {
            return None;
        }
        let times: Vec<f64> = extremes[..=count].iter().map(|extreme| extreme[0]).collect();
        let logs: Vec<f64> = swings[..count].iter().map(|swing| swing.ln()).collect();
        let (half_period, slope) = (slope(&times), slope(&logs));
        let damping_ratio = -slope / slope.hypot(PI);
        Some(Self { drop_mm, frequency_hz: 0.5 / half_period, damping_ratio })
    }
}

/// By how much values grow from one to the next, by least squares.
fn slope(values: &[f64]) -> f64 {
    let middle = 0.5 * (values.len() - 1) as f64;
    let off = |i: usize| i as f64 - middle;
    let (mut rise, mut squares) = (0.0, 0.0);
    for (i, value) in values.iter().enumerate() {
        rise += off(i) * value;
        squares += off(i) * off(i);
    }
    rise / squares
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A swing of known figures that creeps to its rest besides.
    #[test]
    fn figures_of_a_made_up_swing_are_found() {
        let (f, zeta): (f64, f64) = (7.3, 0.06);
        let height = |i: usize| {
            let t = 0.01 * i as f64 - 0.3;
            let omega = 2.0 * PI * f;
            let decay = (-zeta / (1.0 - zeta * zeta).sqrt() * omega * t).exp();
            let creep = 0.6 * (-1.2 * t).exp();
            if t < 0.0 { 6.0 } else { 5.4 * decay * (omega * t).cos() + creep }
        };
        let heights_mm = (0..500).map(height).collect();
        let found = Swing::of(&Recording { interval_s: 0.01, heights_mm }).unwrap();
        println!("{found:?}");
        assert!((found.drop_mm - 6.0).abs() < 0.02);
        assert!((found.frequency_hz / f - 1.0).abs() < 2e-3);
        assert!((found.damping_ratio / zeta - 1.0).abs() < 0.02);
        let still = Recording { interval_s: 0.01, heights_mm: vec![1.0; 100] };
        assert_eq!(Swing::of(&still), None);
    }
}
