//! The VQ-VAE: motion to codes of body parts, frame by frame, and back.

pub(crate) mod codebook;
pub(crate) mod loss;
pub(crate) mod network;
pub(crate) mod residual_codebooks;
pub(crate) mod training;
pub(crate) mod vqvae_weights;
