//! In place of `candle.rs` in a build without it: loading says so, and nothing else can
//! be called.

use std::convert::Infallible;

use crate::error::ModelError;
use crate::weights::{Dtype, Weights};

#[derive(Clone, Debug)]
pub(crate) struct CandleDecoder(Infallible);

#[derive(Clone, Debug)]
pub(crate) struct CandleDecoderState(Infallible);

impl CandleDecoder {
    pub fn load(_: &Weights, _: Dtype) -> Result<Self, ModelError> {
        Err(ModelError::NotBuiltIn { what: "engine candle" })
    }

    pub fn start(&self) -> CandleDecoderState {
        match self.0 {}
    }

    pub fn frames<'a>(
        &self,
        _: &'a mut CandleDecoderState,
        _: &[&[usize]],
    ) -> Result<&'a [f32], ModelError> {
        match self.0 {}
    }

    pub fn cache_bytes(&self) -> usize {
        match self.0 {}
    }

    pub fn bytes(&self) -> usize {
        match self.0 {}
    }
}

impl CandleDecoderState {
    pub fn jump(&mut self, _: u64) {
        match self.0 {}
    }
}
