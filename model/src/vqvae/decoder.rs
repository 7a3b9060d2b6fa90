//! The VQ-VAE's causal decoder: the codes of a frame to its 137 normalised
//! numbers, on the engine that was asked for.

use super::candle::{CandleDecoder, CandleDecoderState};
use super::own::{OwnDecoder, OwnDecoderState};
use crate::engine::{Engine, EngineKind, Team};
use crate::error::ModelError;
use crate::weights::Weights;

/// The weights of the decoder; start as many streams from it as you like.
#[derive(Clone, Debug)]
pub struct VqDecoder(DecoderNetwork);

#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // one of them for each generator
enum DecoderNetwork {
    Own(OwnDecoder),
    Candle(CandleDecoder),
}

/// Where one stream of frames stands: it belongs to the decoder that started it.
#[derive(Clone, Debug)]
pub struct DecoderState(State);

#[derive(Clone, Debug)]
enum State {
    Own(Box<OwnDecoderState>),
    Candle(CandleDecoderState),
}

impl VqDecoder {
    /// Takes the tensors under `vq.` out of the file.
    pub fn load(w: &Weights, engine: &Engine) -> Result<Self, ModelError> {
        Ok(Self(match engine.kind() {
            EngineKind::Own => DecoderNetwork::Own(OwnDecoder::load(w, engine.dtype())?),
            EngineKind::Candle => DecoderNetwork::Candle(CandleDecoder::load(w, engine.dtype())?),
        }))
    }

    /// A stream before its first frame.
    pub fn start(&self) -> DecoderState {
        DecoderState(match &self.0 {
            DecoderNetwork::Own(network) => State::Own(Box::new(network.start())),
            DecoderNetwork::Candle(network) => State::Candle(network.start()),
        })
    }

    /// The next frame, 137 normalised numbers, from one code per part.
    pub fn step<'a>(
        &self,
        team: &Team,
        state: &'a mut DecoderState,
        codes: &[usize],
    ) -> Result<&'a [f32], ModelError> {
        match (&self.0, &mut state.0) {
            (DecoderNetwork::Own(network), State::Own(state)) => {
                Ok(network.step(team, state, codes))
            }
            (DecoderNetwork::Candle(network), State::Candle(state)) => {
                team.install(|| network.frames(state, &[codes]))
            }
            _ => unreachable!("a state of another engine's decoder"),
        }
    }

    /// Bytes of keys and values that a step reads once the window is full.
    pub fn cache_bytes(&self) -> usize {
        match &self.0 {
            DecoderNetwork::Own(network) => network.cache_bytes(),
            DecoderNetwork::Candle(network) => network.cache_bytes(),
        }
    }

    /// Bytes of weights that a step reads.
    pub fn bytes(&self) -> usize {
        match &self.0 {
            DecoderNetwork::Own(network) => network.bytes(),
            DecoderNetwork::Candle(network) => network.bytes(),
        }
    }
}

impl DecoderState {
    /// Forgets all frames: the next one is the first again.
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
}
