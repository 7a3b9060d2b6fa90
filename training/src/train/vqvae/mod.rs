//! The VQ-VAE: motion to one code a body part and frame, and back.

pub(crate) mod codebook;
pub(crate) mod loss;
pub(crate) mod network;
pub(crate) mod training;
pub(crate) mod vqvae_weights;
