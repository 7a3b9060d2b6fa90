//! MotionSeq on the engine that was asked for.

use super::candle::{CandleSeq, CandleSeqState};
use super::own::{OwnSeq, OwnSeqState};
use crate::conditioning::StyleConditioning;
use crate::engine::{Engine, EngineKind, Team};
use crate::error::ModelError;
use crate::weights::Weights;

/// The weights of MotionSeq; start as many dances from it as you like.
#[derive(Clone, Debug)]
pub struct MotionSeq {
    network: SeqNetwork,
    styles: StyleConditioning,
}

#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // one of them for each generator
enum SeqNetwork {
    Own(OwnSeq),
    Candle(CandleSeq),
}

/// Where one dance stands, in every lane; for the network that started it.
#[derive(Clone, Debug)]
pub struct SeqState(State);

#[derive(Clone, Debug)]
enum State {
    Own(Box<OwnSeqState>),
    Candle(CandleSeqState),
}

impl MotionSeq {
    /// Takes the tensors under `seq.` out of the file.
    pub fn load(w: &Weights, engine: &Engine) -> Result<Self, ModelError> {
        let dtype = engine.dtype();
        Ok(Self {
            styles: StyleConditioning::load(w, dtype)?,
            network: match engine.kind() {
                EngineKind::Own => SeqNetwork::Own(OwnSeq::load(w, dtype)?),
                EngineKind::Candle => SeqNetwork::Candle(CandleSeq::load(w, dtype)?),
            },
        })
    }

    /// A dance before its first frame, of so many lanes, in the null style.
    pub fn start(&self, lanes: usize) -> SeqState {
        let mut state = SeqState(match &self.network {
            SeqNetwork::Own(network) => State::Own(Box::new(network.start(lanes))),
            SeqNetwork::Candle(network) => State::Candle(network.start(lanes)),
        });
        self.set_style(&mut state, self.style(None));
        state
    }

    /// The first lane alone, with all that it remembers.
    pub fn first_lane(&self, state: &SeqState) -> Result<SeqState, ModelError> {
        Ok(SeqState(match (&self.network, &state.0) {
            (SeqNetwork::Own(network), State::Own(state)) => {
                State::Own(Box::new(network.first_lane(state)))
            }
            (SeqNetwork::Candle(_), State::Candle(state)) => State::Candle(state.first_lane()?),
            _ => other_engine(),
        }))
    }

    /// The learned vector of a style, an index into the configuration's styles;
    /// none is the null style.
    pub fn style(&self, style: Option<usize>) -> &[f32] {
        self.styles.vector(style)
    }

    pub(crate) fn scales(&self, style: &[f32]) -> Vec<f32> {
        self.styles.scales(style)
    }

    /// Dances on in the style of a vector, in every lane.
    pub fn set_style(&self, state: &mut SeqState, style: &[f32]) {
        self.set_styles(state, &vec![style; state.lanes()]);
    }

    /// Dances on in the style of a vector for each lane.
    pub fn set_styles(&self, state: &mut SeqState, styles: &[&[f32]]) {
        let scales = styles.iter().flat_map(|style| self.scales(style)).collect();
        match &mut state.0 {
            State::Own(state) => state.style = scales,
            State::Candle(state) => state.style = scales,
        }
    }

    /// The next frame, from the codes of the frame before it and the music of
    /// each lane (none: as if there were no music). Then ask for logits.
    pub fn step(
        &self,
        team: &Team,
        state: &mut SeqState,
        previous: &[usize],
        music: &[Option<&[f32]>],
    ) -> Result<(), ModelError> {
        match (&self.network, &mut state.0) {
            (SeqNetwork::Own(network), State::Own(state)) => {
                network.step(team, state, previous, music);
                Ok(())
            }
            (SeqNetwork::Candle(network), State::Candle(state)) => {
                team.install(|| network.frames(state, &[previous], music))
            }
            _ => other_engine(),
        }
    }

    /// Logits of one code for the frame of the last step; `chosen` are those
    /// before it. One slice a lane.
    pub fn logits<'a>(
        &self,
        team: &Team,
        state: &'a mut SeqState,
        index: usize,
        chosen: &[usize],
    ) -> Result<impl Iterator<Item = &'a [f32]> + use<'a>, ModelError> {
        let lanes = state.lanes();
        let logits = match (&self.network, &mut state.0) {
            (SeqNetwork::Own(network), State::Own(state)) => {
                network.logits(team, state, index, chosen)
            }
            (SeqNetwork::Candle(network), State::Candle(state)) => {
                team.install(|| network.logits(state, index, &[chosen]))?
            }
            _ => other_engine(),
        };
        Ok(logits.chunks_exact(logits.len() / lanes))
    }

    /// Bytes of keys and values that a step reads with full windows.
    pub fn cache_bytes(&self, lanes: usize) -> usize {
        match &self.network {
            SeqNetwork::Own(network) => network.cache_bytes(lanes),
            SeqNetwork::Candle(network) => network.cache_bytes(lanes),
        }
    }

    /// Bytes of weights that a step and its logits read.
    pub fn bytes(&self) -> usize {
        match &self.network {
            SeqNetwork::Own(network) => network.bytes(),
            SeqNetwork::Candle(network) => network.bytes(),
        }
    }
}

fn other_engine() -> ! {
    unreachable!("a state of another engine's network")
}

impl SeqState {
    /// Forgets all frames, not the style.
    pub fn restart(&mut self) {
        self.jump(0);
    }

    /// Stands at a frame as if all before had been processed (with zeros): to
    /// measure what a step takes there.
    pub fn jump(&mut self, frame: u64) {
        match &mut self.0 {
            State::Own(state) => state.jump(frame),
            State::Candle(state) => state.jump(frame),
        }
    }

    /// What the heads read in a lane, after a step.
    pub fn hidden(&self, lane: usize) -> &[f32] {
        let hidden = match &self.0 {
            State::Own(state) => state.hidden(),
            State::Candle(state) => state.hidden(),
        };
        let dim = hidden.len() / self.lanes();
        &hidden[lane * dim..][..dim]
    }

    /// How many lanes there are.
    pub fn lanes(&self) -> usize {
        match &self.0 {
            State::Own(state) => state.lanes(),
            State::Candle(state) => state.lanes(),
        }
    }
}
