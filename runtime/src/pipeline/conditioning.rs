//! What a user brings beside the weights: Encodec's and CLIP's files, a style
//! in words. Which files, and where they are looked for: docs/conditioning.md.

use anyhow::{Context, bail};
use servodance_model::Generator;
use servodance_model::conditioning::{CLIP_DIM, ClipText, Encodec, MusicKind};
use std::path::{Path, PathBuf};

/// Options of every command that dances.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Conditioning {
    /// Dance style in words, for weights trained with
    /// CLIP's styles (see docs/conditioning.md).
    #[arg(long, value_name = "TEXT", conflicts_with = "style")]
    pub style_text: Option<String>,
    /// The folder with CLIP's model.safetensors and tokenizer.json, if it is not
    /// servodance/clip-vit-base-patch32 in the user's data folder.
    #[arg(long, value_name = "DIR", requires = "style_text")]
    pub clip: Option<PathBuf>,
    /// Encodec's model.safetensors, for weights that hear encodec128, if it is
    /// not in servodance/encodec_24khz in the user's data folder.
    #[arg(long, value_name = "FILE.safetensors")]
    pub encodec: Option<PathBuf>,
}

impl Conditioning {
    /// The encoder for weights that hear through it.
    pub fn encodec(&self, generator: &Generator) -> anyhow::Result<Option<Encodec>> {
        match (generator.music_kind(), &self.encodec) {
            (MusicKind::Encodec128, path) => open_encodec(path.as_deref()).map(Some),
            (_, None) => Ok(None),
            (kind, Some(_)) => bail!(
                "--encodec: the weights hear {} music features, not {}",
                kind.name(),
                MusicKind::Encodec128.name()
            ),
        }
    }

    /// The style in words as the weights take it, if there is one.
    pub fn style_vector(&self, generator: &Generator) -> anyhow::Result<Option<Vec<f32>>> {
        let Some(text) = &self.style_text else {
            return Ok(None);
        };
        let style_dim = generator.config().seq.style_dim;
        if style_dim != CLIP_DIM {
            bail!(
                "--style-text: the weights take styles of {style_dim} numbers, a text has {CLIP_DIM}; choose a --style of theirs: {}",
                generator.styles().join(", ")
            );
        }
        let folder = match &self.clip {
            Some(folder) => folder.clone(),
            None => data_folder()?.join("clip-vit-base-patch32"),
        };
        let clip = ClipText::load(&folder).context(
            "--clip: a folder with model.safetensors and tokenizer.json of openai/clip-vit-base-patch32 is needed",
        )?;
        Ok(Some(clip.embed(text)?))
    }
}

/// Encodec out of a file, or out of the user's data folder.
pub fn open_encodec(path: Option<&Path>) -> anyhow::Result<Encodec> {
    let path = match path {
        Some(path) => path.to_owned(),
        None => data_folder()?.join("encodec_24khz/model.safetensors"),
    };
    Encodec::load(&path)
        .context("--encodec: the model.safetensors of facebook/encodec_24khz is needed")
}

/// Where a user keeps such files:
/// `$XDG_DATA_HOME/servodance`, else
/// `~/.local/share/servodance`.
pub fn data_folder() -> anyhow::Result<PathBuf> {
    let of = |name| std::env::var_os(name).map(PathBuf::from);
    let data = of("XDG_DATA_HOME").filter(|path| path.is_absolute());
    let data = data.or_else(|| of("HOME").map(|home| home.join(".local/share")));
    let data = data.context("no data folder: neither XDG_DATA_HOME nor HOME is set")?;
    Ok(data.join("servodance"))
}
