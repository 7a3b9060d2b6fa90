//! Which features of the music a data set holds.

use anyhow::bail;
use servodance_model::conditioning::{Encodec, MusicKind};
use servodance_runtime::pipeline::conditioning::open_encodec;
use std::path::PathBuf;

/// Which features of the music are written.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct FeatureArgs {
    /// servodance39 (librosa35 is part of it), or encodec128 beside it.
    #[arg(long, default_value = "servodance39", value_parser = music_kind)]
    pub music_features: MusicKind,
    /// Encodec's model.safetensors, if it is not in servodance/encodec_24khz in
    /// the user's data folder (see docs/conditioning.md).
    #[arg(long, value_name = "FILE.safetensors")]
    pub encodec: Option<PathBuf>,
}

impl FeatureArgs {
    /// The encoder that is asked for.
    pub fn encodec(&self) -> anyhow::Result<Option<Encodec>> {
        match (self.music_features, &self.encodec) {
            (MusicKind::Encodec128, path) => open_encodec(path.as_deref()).map(Some),
            (_, None) => Ok(None),
            (_, Some(_)) => bail!("--encodec needs --music-features encodec128"),
        }
    }
}

fn music_kind(text: &str) -> Result<MusicKind, String> {
    let names = MusicKind::ALL.map(MusicKind::name).join(", ");
    MusicKind::from_name(text).ok_or_else(|| format!("choose one of {names}"))
}
