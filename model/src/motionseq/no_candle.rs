//! In place of `candle.rs` in a build without it: loading says so, and nothing else can
//! be called.

use std::convert::Infallible;

use crate::error::ModelError;
use crate::weights::{Dtype, Weights};

#[derive(Clone, Debug)]
pub(crate) struct CandleSeq(Infallible);

#[derive(Clone, Debug)]
pub(crate) struct CandleSeqState {
    never: Infallible,
    pub style: Vec<f32>,
}

impl CandleSeq {
    pub fn load(_: &Weights, _: Dtype) -> Result<Self, ModelError> {
        Err(ModelError::NotBuiltIn { what: "engine candle" })
    }

    pub fn start(&self, _: usize) -> CandleSeqState {
        match self.0 {}
    }

    pub fn frames(
        &self,
        _: &mut CandleSeqState,
        _: &[&[usize]],
        _: &[Option<&[f32]>],
    ) -> Result<(), ModelError> {
        match self.0 {}
    }

    pub fn logits<'a>(
        &self,
        _: &'a mut CandleSeqState,
        _: usize,
        _: &[&[usize]],
    ) -> Result<&'a [f32], ModelError> {
        match self.0 {}
    }

    pub fn cache_bytes(&self, _: usize) -> usize {
        match self.0 {}
    }

    pub fn bytes(&self) -> usize {
        match self.0 {}
    }
}

impl CandleSeqState {
    pub fn jump(&mut self, _: u64) {
        match self.never {}
    }

    pub fn first_lane(&self) -> Result<Self, ModelError> {
        match self.never {}
    }

    pub fn hidden(&self) -> &[f32] {
        match self.never {}
    }

    pub fn lanes(&self) -> usize {
        match self.never {}
    }
}
