//! Colours and measures that all pictures share.

pub type Rgba = [u8; 4];

pub(super) const MARGIN: f32 = 40.0;
pub(super) const HEADER: f32 = 92.0;

pub(super) const PAPER: Rgba = [250, 249, 246, 255];
pub(super) const INK: Rgba = [34, 38, 46, 255];
pub(super) const FAINT: Rgba = [120, 126, 138, 255];
pub(super) const PANEL: Rgba = [255, 255, 255, 255];
pub(super) const BEAT: Rgba = [214, 64, 69, 90];
pub(super) const TRACK: Rgba = [28, 107, 160, 255];
pub(super) const LIMIT: Rgba = [214, 64, 69, 255];
pub(super) const KINEMATIC: Rgba = [36, 140, 84, 255];
