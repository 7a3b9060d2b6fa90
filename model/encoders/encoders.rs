//! The trained encoders of the built-in VQ-VAE, as the bytes of a weights file in f16.
//!
//! A dance does not need them: only recorded motion goes through them. They are a crate of
//! their own because a package registry takes 10 MB at most, and `servodance-model` carries
//! the weights of a dance. [`Codec`] puts both together.
//!
//! [`Codec`]: https://docs.rs/servodance-model/latest/servodance_model/struct.Codec.html

/// `encoders.safetensors`: `servodance weights convert` makes it of the trained weights.
pub static ENCODERS: &[u8] = include_bytes!("encoders.safetensors");
