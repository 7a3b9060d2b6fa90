//! R-Precision and MM-Dist: how well motions match their texts, as points that
//! the T2M extractors ([`super::t2m`]) compute.
//!
//! As where the published figures come from: in pools of 32 pairs, each text
//! looks for its motion among the 32. (Papers say that a motion looks for its
//! text; the code of T2M and of those after it does it this way around.)

pub const POOL: usize = 32;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Retrieval {
    /// Share of texts whose motion is the nearest, one of the nearest two, of the nearest three.
    pub r_precision: [f64; 3],
    pub mm_dist: f64,
}

/// Of pairs in the order of pooling, without those after the last whole pool, if there is one.
pub fn retrieval(texts: &[&[f32]], motions: &[&[f32]]) -> Option<Retrieval> {
    let pools = texts.chunks_exact(POOL).zip(motions.chunks_exact(POOL));
    let (mut found, mut pairs) = (Retrieval::default(), 0.0);
    for (texts, motions) in pools {
        for (own, text) in texts.iter().enumerate() {
            let distances: Vec<f64> = motions.iter().map(|m| distance(text, m)).collect();
            let nearer = distances.iter().filter(|d| **d < distances[own]).count();
            for share in found.r_precision.iter_mut().skip(nearer) {
                *share += 1.0;
            }
            found.mm_dist += distances[own];
            pairs += 1.0;
        }
    }
    found.r_precision.iter_mut().for_each(|share| *share /= pairs);
    found.mm_dist /= pairs;
    (pairs > 0.0).then_some(found)
}

fn distance(a: &[f32], b: &[f32]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2));
    squares.sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::golden::{Golden, noise};

    /// Points on a line.
    fn line(places: impl Iterator<Item = f32>) -> Vec<Vec<f32>> {
        places.map(|place| vec![place, 0.0]).collect()
    }

    fn found(texts: &[Vec<f32>], motions: &[Vec<f32>]) -> Option<Retrieval> {
        let [texts, motions] = [texts, motions]
            .map(|points| -> Vec<&[f32]> { points.iter().map(Vec::as_slice).collect() });
        retrieval(&texts, &motions)
    }

    #[test]
    fn a_motion_beside_its_text_is_found() {
        let texts = line((0..40).map(|i| i as f32));
        let motions = line((0..40).map(|i| i as f32 + 0.25));
        // The last eight are no pool.
        let expected = Retrieval { r_precision: [1.0; 3], mm_dist: 0.25 };
        assert_eq!(found(&texts, &motions), Some(expected));
        assert_eq!(found(&texts[..31], &motions[..31]), None);
    }

    #[test]
    fn a_motion_with_three_nearer_ones_before_it_is_not_found() {
        // Text i stands at i, its motion at i + 2: the motions of the three texts
        // before it are nearer, where there are so many; that of the fourth is as
        // far and does not count.
        let texts = line((0..32).map(|i| i as f32));
        let motions = line((0..32).map(|i| i as f32 + 2.0));
        let got = found(&texts, &motions).unwrap();
        assert_eq!(got.r_precision, [1.0, 2.0, 3.0].map(|n| n / 32.0));
        assert_eq!(got.mm_dist, 2.0);
    }

    #[test]
    fn figures_agree_with_the_independent_script() {
        // numpy.argsort over 64 pairs: t2m/golden/make.py.
        let golden = Golden::open(include_bytes!("t2m/golden/t2m.safetensors"));
        let points = |name| -> Vec<Vec<f32>> {
            noise(name, 64 * 3).collect::<Vec<_>>().chunks(3).map(<[f32]>::to_vec).collect()
        };
        let mut motions = points("motion points");
        let texts = points("text points");
        for (motion, text) in motions.iter_mut().flatten().zip(texts.iter().flatten()) {
            *motion = text + 0.3 * *motion;
        }
        let got = found(&texts, &motions).unwrap();
        let expected: [f64; 4] = golden.json("retrieval");
        let [top @ .., mm_dist] = expected;
        for (a, b) in got.r_precision.iter().chain([&got.mm_dist]).zip(top.iter().chain([&mm_dist]))
        {
            assert!((a - b).abs() < 1e-6, "{got:?} is not {expected:?}");
        }
    }
}
