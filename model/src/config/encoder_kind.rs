//! What the VQ-VAE quantises.

use serde::{Deserialize, Serialize};

/// What gives the vectors that become codes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EncoderKind {
    /// A transformer a part, trained with the decoder (the paper's).
    #[default]
    Transformer,
    /// No network: the normalised positions of the part's own joints, and with the pelvis how
    /// the root moves. Nothing is trained, so nothing is fitted to the motion learned from.
    Positions,
}
