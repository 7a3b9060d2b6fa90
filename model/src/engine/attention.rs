//! Attention of one frame over KV caches: all heads of all lanes.

use super::alibi;
use super::input::{Input, copy_lane};
use super::kernels;
use super::kv_cache::{AttentionShape, CacheNumbers, CachePosition, KvCache};
use super::pool::Team;
use crate::weights::Dtype;

/// Memory that an attention works in, kept between frames.
#[derive(Clone, Debug)]
pub(crate) struct AttentionScratch {
    lanes: usize,
    queries: Vec<f32>,
    /// For each head of each lane the attended values, then its scores.
    heads: Vec<f32>,
    row: Vec<f32>,
    attended: Input,
}

impl AttentionScratch {
    pub fn new(shape: &AttentionShape, lanes: usize, dtype: Dtype) -> Self {
        let count = shape.slopes.len() * lanes;
        Self {
            lanes,
            queries: vec![0.0; count * shape.padded()],
            heads: vec![0.0; count * (shape.padded() + shape.window)],
            row: vec![0.0; shape.wide()],
            attended: Input::new(shape.wide(), lanes, dtype),
        }
    }

    /// Takes the first `shape.wide()` outputs of `products` as queries.
    pub fn set_queries(&mut self, shape: &AttentionShape, products: &[f32]) {
        let scale = (shape.width as f32).sqrt().recip();
        let (width, padded) = (shape.width, shape.padded());
        let of_lane = self.queries.chunks_exact_mut(shape.slopes.len() * padded).enumerate();
        for (lane, queries) in of_lane {
            copy_lane(&mut self.row, products, lane, self.lanes);
            let rows = self.row.chunks_exact(width);
            for (to, from) in queries.chunks_exact_mut(padded).zip(rows) {
                to.iter_mut().zip(from).for_each(|(to, from)| *to = from * scale);
            }
        }
    }

    /// Writes keys (outputs of `products` from `first` on) and values (the
    /// outputs behind them) of each lane into its cache.
    pub fn store(
        &mut self,
        team: &Team,
        shape: &AttentionShape,
        caches: &mut [KvCache],
        slot: usize,
        (products, first): (&[f32], usize),
    ) {
        let (width, padded) = (shape.width, shape.padded());
        for (lane, cache) in caches.iter_mut().enumerate() {
            for (numbers, first) in
                [(&mut cache.keys, first), (&mut cache.values, first + shape.wide())]
            {
                let products = &products[first * self.lanes..];
                copy_lane(&mut self.row, products, lane, self.lanes);
                for (head, row) in self.row.chunks_exact(width).enumerate() {
                    let at = (head * shape.window + slot) * padded;
                    numbers.write(team.cpu(), at, row);
                }
            }
        }
    }

    /// The attended values of all lanes, ready for a product.
    pub fn attend(
        &mut self,
        team: &Team,
        shape: &AttentionShape,
        position: &CachePosition,
        caches: &[KvCache],
    ) -> &Input {
        let (cpu, count, padded) = (team.cpu(), shape.slopes.len(), shape.padded());
        let (filled, queries) = (position.filled(), &self.queries);
        let room = padded + shape.window;
        team.share(&mut self.heads, room, |i, room| {
            let (out, scores) = room.split_at_mut(padded);
            let scores = &mut scores[..filled];
            let query = &queries[i * padded..][..padded];
            let (cache, head) = (&caches[i / count], i % count);
            let slots = head * shape.window * padded..(head * shape.window + filled) * padded;
            match &cache.keys {
                CacheNumbers::F32(keys) => {
                    kernels::scores_f32(cpu, scores, &keys[slots.clone()], query);
                }
                CacheNumbers::F16(keys) => {
                    kernels::scores_f16(cpu, scores, &keys[slots.clone()], query);
                }
            }
            alibi::subtract(cpu, scores, shape.slopes[head], position.slot());
            kernels::softmax(cpu, scores);
            match &cache.values {
                CacheNumbers::F32(values) => kernels::mix_f32(cpu, out, scores, &values[slots]),
                CacheNumbers::F16(values) => kernels::mix_f16(cpu, out, scores, &values[slots]),
            }
        });
        for (lane, heads) in self.heads.chunks_exact(count * room).enumerate() {
            let out = self.attended.lane_mut(lane).chunks_exact_mut(shape.width);
            for (out, head) in out.zip(heads.chunks_exact(room)) {
                out.copy_from_slice(&head[..shape.width]);
            }
        }
        self.attended.ready(cpu);
        &self.attended
    }
}
