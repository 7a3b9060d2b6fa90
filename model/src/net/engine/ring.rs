//! Keys and values of the last `window` frames, and attention over them.
//!
//! Order inside the ring does not matter: each slot's age gives its bias. Slots
//! that were never written are not looked at.

use super::dtype::Dtype;
use super::kernels::{self, Cpu};
use super::pool::Team;

/// Which slot of the rings is written now, and how many hold something.
#[derive(Clone, Debug)]
pub(crate) struct Clock {
    window: usize,
    frame: u64,
}

impl Clock {
    pub fn new(window: usize) -> Self {
        Self { window, frame: 0 }
    }

    /// Frames before the one that is being processed.
    pub fn frame(&self) -> u64 {
        self.frame
    }

    /// The slot of the frame that is being processed.
    pub fn slot(&self) -> usize {
        (self.frame % self.window as u64) as usize
    }

    /// Slots that hold something once it is written.
    fn filled(&self) -> usize {
        (self.frame + 1).min(self.window as u64) as usize
    }

    /// To the next frame.
    pub fn advance(&mut self) {
        self.frame += 1;
    }

    /// To any frame, as if all before had been processed.
    pub fn jump(&mut self, frame: u64) {
        self.frame = frame;
    }
}

/// The shape of an attention: heads, their width, the slope of each.
#[derive(Clone, Debug)]
pub(crate) struct Heads {
    pub window: usize,
    width: usize,
    slopes: Vec<f32>,
}

impl Heads {
    pub fn new(slopes: Vec<f32>, width: usize, window: usize) -> Self {
        Self {
            window,
            width,
            slopes,
        }
    }

    /// Width of all heads together.
    pub fn wide(&self) -> usize {
        self.width * self.slopes.len()
    }

    /// Width of a head, filled up to whole eights.
    fn padded(&self) -> usize {
        self.width.next_multiple_of(8)
    }
}

/// Numbers of a cache: f32 beside f32 weights, else f16.
#[derive(Clone, Debug)]
enum Store {
    F32(Vec<f32>),
    /// Bits of f16.
    F16(Vec<u16>),
}

impl Store {
    fn new(length: usize, dtype: Dtype) -> Self {
        match dtype {
            Dtype::F32 => Self::F32(vec![0.0; length]),
            _ => Self::F16(vec![0; length]),
        }
    }

    fn bytes(&self) -> usize {
        match self {
            Self::F32(all) => 4 * all.len(),
            Self::F16(all) => 2 * all.len(),
        }
    }

    fn write(&mut self, cpu: Cpu, at: usize, values: &[f32]) {
        match self {
            Self::F32(all) => all[at..at + values.len()].copy_from_slice(values),
            Self::F16(all) => kernels::to_half(cpu, &mut all[at..at + values.len()], values),
        }
    }
}

/// The cache of one layer and lane, [heads, window, width].
#[derive(Clone, Debug)]
pub(crate) struct Ring {
    keys: Store,
    values: Store,
}

impl Ring {
    pub fn new(heads: &Heads, dtype: Dtype) -> Self {
        let length = heads.slopes.len() * heads.window * heads.padded();
        Self {
            keys: Store::new(length, dtype),
            values: Store::new(length, dtype),
        }
    }

    /// Bytes of all slots.
    pub fn bytes(&self) -> usize {
        self.keys.bytes() + self.values.bytes()
    }
}

/// Room for the attention of all lanes: queries, and for each head what comes
/// out with its scores behind it.
#[derive(Clone, Debug)]
pub(crate) struct Scene {
    queries: Vec<f32>,
    mixed: Vec<f32>,
    row: Vec<f32>,
}

impl Scene {
    pub fn new(heads: &Heads, lanes: usize) -> Self {
        let count = heads.slopes.len() * lanes;
        Self {
            queries: vec![0.0; count * heads.padded()],
            mixed: vec![0.0; count * (heads.padded() + heads.window)],
            row: vec![0.0; heads.wide()],
        }
    }

    /// Takes `heads.wide()` outputs from `first` on, of one lane, as queries.
    pub fn ask(&mut self, heads: &Heads, products: &[f32], first: usize, lane: (usize, usize)) {
        let scale = (heads.width as f32).sqrt().recip();
        let (width, padded) = (heads.width, heads.padded());
        gather(&mut self.row, products, first, lane);
        let to = self.queries[lane.0 * heads.slopes.len() * padded..].chunks_exact_mut(padded);
        for (to, from) in to.zip(self.row.chunks_exact(width)) {
            to.iter_mut()
                .zip(from)
                .for_each(|(to, from)| *to = from * scale);
        }
    }

    /// Takes keys (outputs from `first` on) and values (behind them) of a lane
    /// into its ring.
    pub fn remember(
        &mut self,
        cpu: Cpu,
        heads: &Heads,
        ring: &mut Ring,
        slot: usize,
        (products, first): (&[f32], usize),
        lane: (usize, usize),
    ) {
        let (width, padded) = (heads.width, heads.padded());
        for (store, first) in [
            (&mut ring.keys, first),
            (&mut ring.values, first + heads.wide()),
        ] {
            gather(&mut self.row, products, first, lane);
            for (head, row) in self.row.chunks_exact(width).enumerate() {
                store.write(cpu, (head * heads.window + slot) * padded, row);
            }
        }
    }

    /// Attention of every head of every lane over its ring.
    pub fn attend(&mut self, team: &Team, heads: &Heads, clock: &Clock, rings: &[Ring]) {
        let (cpu, count, padded) = (team.cpu(), heads.slopes.len(), heads.padded());
        let (filled, slot) = (clock.filled(), clock.slot());
        let queries = &self.queries;
        team.share(&mut self.mixed, padded + heads.window, |i, room| {
            let (out, scores) = room.split_at_mut(padded);
            let scores = &mut scores[..filled];
            let query = &queries[i * padded..][..padded];
            let (ring, head) = (&rings[i / count], i % count);
            let slots = head * heads.window * padded..(head * heads.window + filled) * padded;
            match &ring.keys {
                Store::F32(all) => kernels::scores_f32(cpu, scores, &all[slots.clone()], query),
                Store::F16(all) => {
                    kernels::scores_f16(cpu, scores, &all[slots.clone()], query);
                }
            }
            let slope = heads.slopes[head];
            if slope != 0.0 {
                // The ring begins with this round's frames; behind `slot` are
                // those of the round before.
                let (newer, older) = scores.split_at_mut(slot + 1);
                kernels::fade(cpu, newer, slope, slot as f32);
                kernels::fade(cpu, older, slope, (heads.window - 1) as f32);
            }
            kernels::softmax(cpu, scores);
            match &ring.values {
                Store::F32(all) => kernels::mix_f32(cpu, out, scores, &all[slots]),
                Store::F16(all) => kernels::mix_f16(cpu, out, scores, &all[slots]),
            }
        });
    }

    /// What came out for a lane.
    pub fn found(&self, heads: &Heads, lane: usize, out: &mut [f32]) {
        let room = heads.padded() + heads.window;
        let rows = self.mixed[lane * heads.slopes.len() * room..].chunks_exact(room);
        for (out, row) in out.chunks_exact_mut(heads.width).zip(rows) {
            out.copy_from_slice(&row[..heads.width]);
        }
    }
}

/// Outputs from `first` on of one lane (of so many).
fn gather(row: &mut [f32], products: &[f32], first: usize, (lane, lanes): (usize, usize)) {
    let from = &products[first * lanes + lane..];
    match lanes {
        1 => row.copy_from_slice(&from[..row.len()]),
        _ => row
            .iter_mut()
            .zip(from.iter().step_by(lanes))
            .for_each(|(to, from)| *to = *from),
    }
}
