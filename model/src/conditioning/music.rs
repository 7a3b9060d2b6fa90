//! What is heard in one frame, and which of its numbers the networks take.

use servodance_types::MusicFrame;

use crate::config::{LATENT_DIM, MusicKind};

/// What Encodec hears in one frame.
pub type Latent = [f32; LATENT_DIM];

/// One frame of music, and its Encodec latent where that is listened for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeardFrame {
    /// The 35 features and the tracked beat.
    pub frame: MusicFrame,
    /// What Encodec hears of it.
    pub latent: Option<Latent>,
}

impl From<MusicFrame> for HeardFrame {
    fn from(frame: MusicFrame) -> Self {
        Self { frame, latent: None }
    }
}

impl HeardFrame {
    /// Writes the numbers that a kind of features consists of; false if they
    /// were not listened for.
    pub fn features(&self, kind: MusicKind, out: &mut Vec<f32>) -> bool {
        out.clear();
        match (kind, &self.latent) {
            (MusicKind::Encodec128, None) => return false,
            (MusicKind::Encodec128, Some(latent)) => out.extend_from_slice(latent),
            (MusicKind::Servodance39 | MusicKind::Librosa35, _) => {
                out.extend_from_slice(&self.frame.vector()[..kind.dim()]);
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_takes_as_many_numbers_as_it_says() {
        let mut heard = HeardFrame::from(MusicFrame::default());
        let mut out = vec![7.0];
        assert!(!heard.features(MusicKind::Encodec128, &mut out));
        heard.latent = Some([0.5; LATENT_DIM]);
        for kind in MusicKind::ALL {
            assert!(heard.features(kind, &mut out));
            assert_eq!(out.len(), kind.dim());
            assert!(kind.measured() <= kind.dim());
            assert_eq!(MusicKind::from_name(kind.name()), Some(kind));
            let json = serde_json::to_string(&kind).unwrap();
            assert_eq!(json, format!("{:?}", kind.name()));
        }
    }
}
