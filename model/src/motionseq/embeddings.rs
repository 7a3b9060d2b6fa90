//! What codes are to MotionSeq: vectors that are added to its input, and absolute
//! positions in the ablation without ALiBi.

use crate::config::Positions;
use crate::engine::EmbeddingTable;
use crate::error::ModelError;
use crate::weights::Weights;

#[derive(Clone, Debug)]
pub(super) struct CodeEmbeddings {
    /// The codes of the frame before, a table for each.
    previous: Vec<EmbeddingTable>,
    /// A code just chosen, told to those after it: the parts' first codes, all but the last of
    /// the frame. Residual codes have one table for both.
    chosen: Vec<EmbeddingTable>,
    absolute: bool,
}

impl CodeEmbeddings {
    pub fn load(w: &Weights) -> Result<Self, ModelError> {
        let config = w.config();
        let tables = |kind: &str, names: &[String]| {
            let table = |name: &String| {
                let name = format!("seq.{kind}.{name}.weight");
                EmbeddingTable::load(w, &name, config.codes, config.seq.dim)
            };
            names.iter().map(table).collect::<Result<_, _>>()
        };
        let names = config.code_names();
        let earlier = config.parts.len().min(names.len().saturating_sub(1));
        Ok(Self {
            previous: tables("embed", &names)?,
            chosen: tables("given", &names[..earlier])?,
            absolute: config.seq.positions == Positions::Sinusoidal,
        })
    }

    /// Adds the codes of the frame before to a vector.
    pub fn add_previous(&self, x: &mut [f32], codes: &[usize]) {
        add_rows(x, self.previous.iter(), codes);
    }

    /// Adds the codes that were chosen first in this frame.
    pub fn add_chosen(&self, x: &mut [f32], codes: &[usize]) {
        let residual = self.previous.iter().skip(self.chosen.len());
        add_rows(x, self.chosen.iter().chain(residual), codes);
    }

    /// Adds where a frame stands, if the model is told so.
    pub fn add_position(&self, x: &mut [f32], frame: u64) {
        if self.absolute {
            add_sinusoids(x, frame);
        }
    }
}

fn add_rows<'a>(x: &mut [f32], tables: impl Iterator<Item = &'a EmbeddingTable>, codes: &[usize]) {
    for (table, code) in tables.zip(codes) {
        x.iter_mut().zip(table.row(*code)).for_each(|(x, e)| *x += e);
    }
}

/// Longest period of the sinusoidal positions, as in "Attention is all you need".
const PERIOD: f64 = 10_000.0;

/// Adds the absolute position of a frame: sine and cosine by turns.
fn add_sinusoids(x: &mut [f32], frame: u64) {
    let dim = x.len() as f64;
    for (i, pair) in x.chunks_mut(2).enumerate() {
        let angle = frame as f64 * PERIOD.powf(-2.0 * i as f64 / dim);
        pair[0] += angle.sin() as f32;
        if let Some(second) = pair.get_mut(1) {
            *second += angle.cos() as f32;
        }
    }
}
