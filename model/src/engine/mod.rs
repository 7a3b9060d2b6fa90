//! What computes the networks, and which engine runs where.
//!
//! | computation | engine | why |
//! |---|---|---|
//! | the step of a dance: one frame, one or two lanes (`VqDecoder`, `MotionSeq`) | own, the default | reads each packed weight once a frame, allocates nothing, gives the same bits for any number of threads and on every processor |
//! | the same step with [`EngineKind::Candle`] | candle | a second, independent implementation on a public library: the check of the own one and the place to begin for other devices; takes several times as long (`bench model --engine candle`) |
//! | `VqEncoder`: a recorded motion to codes | candle | hundreds of frames at once are products of whole matrices, which candle does well |
//! | Encodec and CLIP | candle | convolutions, an LSTM and a text tower of public checkpoints; once a dance, or apart from the step |
//! | training of both networks | the tape of the crate for training | needs gradients and batches; candle's fused kernels have no backward pass |
//!
//! Both step engines draw the same codes for the same seed until a draw falls within
//! rounding of the border between two codes, after which the dances differ. Measured
//! on the built-in weights: no such draw in 2,000 frames with `--dtype f32` (logits
//! agree to 2e-5), two with the file's own f16 (to 2e-4: cached keys and values round
//! to neighbours). The own engine alone repeats a dance to the bit everywhere.
//!
//! So a layer has three forms under the same weight names: packed (this folder),
//! tensors (`candle/`), trainable (on the tape). They stay apart because each
//! stores its weights otherwise; tests hold each against the PyTorch reference.
//!
//! A build without the feature `candle` (in a browser) has the own engine alone; in the
//! places of candle's modules stand those called `no_candle`, which refuse to load.
//!
//! Both engines share the order of codes, the sampler, style scales and the number
//! format: candle computes in f32 with the weights as the format has rounded them.

mod alibi;
mod attention;
mod avx2;
#[cfg(test)]
mod bits_tests;
mod blocks;
#[cfg_attr(not(feature = "candle"), path = "no_candle.rs")]
pub(crate) mod candle;
mod input;
mod kernels;
mod kv_cache;
mod lanes;
mod linear;
mod neon;
mod options;
mod pool;
mod product;
mod simd128;
#[cfg(test)]
mod tests;

pub use options::{Engine, EngineKind, EngineOptions};
pub use pool::{Pool, Team, default_threads};

pub(crate) use attention::AttentionScratch;
pub(crate) use blocks::{AttentionBlock, AttentionKind, BlockScratch, FeedForwardBlock};
#[cfg(feature = "candle")]
pub(crate) use candle::{AttentionWindow, attention_bias};
pub(crate) use input::{Input, copy_lane};
pub(crate) use kernels::styled;
pub(crate) use kv_cache::{AttentionShape, CachePosition, KvCache};
pub(crate) use linear::{After, EmbeddingTable, LayerNorm, PackedLinear};
