//! MotionSeq on the tape: the next code of every body part, from the codes
//! before, the music and a style.

use crate::train::autodiff::ops::AttentionMask;
use crate::train::autodiff::parameters::{ParamId, ParamInit};
use crate::train::autodiff::tape::{Batch, Tape, Var};
use crate::train::layers::{
    CrossAttentionLayer, Dropout, FeedForwardLayer, LayerNorm, LayerWidths, LinearLayer,
    ParamBuilder, SelfAttentionLayer,
};
use servodance_model::config::{ModelConfig, Positions};

const EMBEDDING: ParamInit = ParamInit::Normal(0.32);
/// Longest period of the sinusoidal positions, as in `net`.
const PERIOD: f64 = 10_000.0;

#[derive(Clone, Debug)]
struct MotionSeqLayer {
    norm1: LayerNorm,
    attention: SelfAttentionLayer,
    norm2: LayerNorm,
    cross: CrossAttentionLayer,
    style: LinearLayer,
    norm3: LayerNorm,
    feed_forward: FeedForwardLayer,
}

#[derive(Clone, Debug)]
struct CodeHead {
    embed: ParamId,
    /// Tells later heads this code; none for the last. The table `embed` for residual codes.
    given: Option<ParamId>,
    refine: Option<(LayerNorm, FeedForwardLayer)>,
    head: LinearLayer,
}

#[derive(Clone, Debug)]
pub(crate) struct MotionSeqInputs {
    pub batch: Batch,
    /// Per code of a frame that of the frame before, [rows].
    pub previous: Vec<Vec<u32>>,
    /// Per code of a frame itself, for those after it, [rows].
    pub chosen: Vec<Vec<u32>>,
    /// Normalised music, [rows, music_dim].
    pub music: Vec<f32>,
    pub has_music: Vec<bool>,
    /// The style of each sequence; the last row of the table is no style.
    pub styles: Vec<u32>,
}

/// The network of MotionSeq; its numbers are in the parameters.
#[derive(Clone, Debug)]
pub(crate) struct MotionSeqNetwork {
    config: ModelConfig,
    music_in: LinearLayer,
    music_null: ParamId,
    style: ParamId,
    layers: Vec<MotionSeqLayer>,
    norm: LayerNorm,
    heads: Vec<CodeHead>,
    mask: AttentionMask,
    cross_mask: AttentionMask,
}

impl MotionSeqNetwork {
    pub fn new(make: &mut ParamBuilder, config: &ModelConfig) -> Self {
        let seq = &config.seq;
        let dim = seq.dim;
        let widths = LayerWidths { dim, inner: seq.heads * seq.width_of_head(), hidden: seq.ff };
        let mask = AttentionMask { slopes: seq.used_slopes(), window: seq.window, ahead: 0 };
        let cross_mask = match seq.cross_aligned {
            true => AttentionMask {
                slopes: seq.used_cross_slopes(),
                window: seq.window,
                ahead: seq.lookahead,
            },
            false => AttentionMask::everything(seq.heads),
        };
        let null = ParamInit::Constant(0.0);
        Self {
            music_in: LinearLayer::new(make, "seq.music_in", config.music_dim, dim),
            music_null: make.tensor("seq.music_null".into(), &[dim], null),
            style: make.tensor(
                "seq.style.weight".into(),
                &[seq.styles.len() + 1, seq.style_dim],
                ParamInit::Normal(1.0),
            ),
            layers: (0..seq.layers)
                .map(|i| MotionSeqLayer::new(make, &format!("seq.layers.{i}"), widths, config))
                .collect(),
            norm: LayerNorm::new(make, "seq.norm", dim),
            heads: (0..config.codes_a_frame()).map(|i| CodeHead::new(make, i, config)).collect(),
            mask,
            cross_mask,
            config: config.clone(),
        }
    }

    /// Hidden vectors [rows, dim].
    pub fn hidden(&self, t: &mut Tape, inputs: &MotionSeqInputs, drop: &mut Dropout) -> Var {
        let (seq, batch) = (&self.config.seq, &inputs.batch);
        let music = t.constant(inputs.music.clone(), self.config.music_dim);
        let stream = self.music_in.forward(t, music);
        let mut stream = t.or_else(stream, self.music_null, batch.length, inputs.has_music.clone());
        let mut sum = seq.music_at_input.then_some(stream);
        for (head, codes) in self.heads.iter().zip(&inputs.previous) {
            sum = Some(t.lookup(sum, head.embed, seq.dim, codes.clone()));
        }
        let mut x = sum.unwrap_or(stream);
        if seq.positions == Positions::Sinusoidal {
            let positions = t.constant(sinusoids(batch, seq.dim), seq.dim);
            x = t.add(x, positions);
            stream = t.add(stream, positions);
        }
        let style = t.lookup(None, self.style, seq.style_dim, inputs.styles.clone());
        for layer in &self.layers {
            let normal = layer.norm1.forward(t, x);
            x = layer.attention.onto(t, normal, x, (&self.mask, batch), drop);
            let normal = layer.norm2.forward(t, x);
            x = layer.cross.onto(t, (normal, stream), x, (&self.cross_mask, batch), drop);
            let scale = layer.style.forward(t, style);
            x = t.modulate(x, scale, batch.length);
            let normal = layer.norm3.forward(t, x);
            x = layer.feed_forward.onto(t, normal, x, batch, drop);
        }
        self.norm.forward(t, x)
    }

    /// Logits of every code of a frame, [rows, classes].
    pub fn logits(&self, t: &mut Tape, inputs: &MotionSeqInputs, drop: &mut Dropout) -> Vec<Var> {
        let mut hidden = self.hidden(t, inputs, drop);
        let mut logits = Vec::with_capacity(self.heads.len());
        // Heads are not dropped: they are no residual branches of the body.
        let mut never = Dropout { rate: 0.0, rng: drop.rng };
        for (head, chosen) in self.heads.iter().zip(&inputs.chosen) {
            let seen = match &head.refine {
                Some((norm, refine)) => {
                    let normal = norm.forward(t, hidden);
                    refine.onto(t, normal, hidden, &inputs.batch, &mut never)
                }
                None => hidden,
            };
            logits.push(head.head.forward(t, seen));
            if let Some(given) = head.given {
                hidden = t.lookup(Some(hidden), given, self.config.seq.dim, chosen.clone());
            }
        }
        logits
    }
}

impl MotionSeqLayer {
    fn new(make: &mut ParamBuilder, name: &str, widths: LayerWidths, config: &ModelConfig) -> Self {
        let LayerWidths { dim, hidden, .. } = widths;
        let style = format!("{name}.style.scale");
        Self {
            norm1: LayerNorm::new(make, &format!("{name}.norm1"), dim),
            attention: SelfAttentionLayer::new(make, &format!("{name}.attn"), widths),
            norm2: LayerNorm::new(make, &format!("{name}.norm2"), dim),
            cross: CrossAttentionLayer::new(make, &format!("{name}.cross"), widths),
            style: LinearLayer::begun(
                make,
                &style,
                config.seq.style_dim,
                dim,
                ParamInit::Constant(0.0),
            ),
            norm3: LayerNorm::new(make, &format!("{name}.norm3"), dim),
            feed_forward: FeedForwardLayer::new(
                make,
                &format!("{name}.ff"),
                dim,
                hidden,
                config.activation,
            ),
        }
    }
}

impl CodeHead {
    fn new(make: &mut ParamBuilder, index: usize, config: &ModelConfig) -> Self {
        let names = config.code_names();
        let (dim, codes, name) = (config.seq.dim, config.codes, &names[index]);
        let table = |kind: &str| format!("seq.{kind}.{name}.weight");
        let refine = format!("seq.refine.{name}");
        let is_first_level = config.is_first_level(index);
        let embed = make.tensor(table("embed"), &[codes, dim], EMBEDDING);
        Self {
            embed,
            given: (index + 1 < names.len()).then(|| match is_first_level {
                true => make.tensor(table("given"), &[codes, dim], EMBEDDING),
                false => embed,
            }),
            refine: (index > 0 && is_first_level).then(|| {
                let norm = LayerNorm::new(make, &format!("seq.refine_norm.{name}"), dim);
                (norm, FeedForwardLayer::new(make, &refine, dim, dim, config.activation))
            }),
            head: LinearLayer::new(make, &format!("seq.head.{name}"), dim, config.classes(index)),
        }
    }
}

/// Sine and cosine by turns, [rows, dim]: the absolute position of each frame.
fn sinusoids(batch: &Batch, dim: usize) -> Vec<f32> {
    let angle =
        |frame: usize, i: usize| frame as f64 * PERIOD.powf(-2.0 * (i / 2) as f64 / dim as f64);
    let of_row = |row: usize| {
        let frame = row % batch.length;
        (0..dim).map(move |i| match i % 2 {
            0 => angle(frame, i).sin() as f32,
            _ => angle(frame, i).cos() as f32,
        })
    };
    (0..batch.rows()).flat_map(of_row).collect()
}
