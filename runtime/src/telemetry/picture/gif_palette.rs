//! The colours of one GIF, chosen from what it shows.
//!
//! The box of all colours is cut in two where it is longest, then the longest of those, until
//! there are enough: no colour is far from its box's mean, however rare it is.

use std::collections::HashMap;

/// Stands for a pixel that stays as it was.
pub const TRANSPARENT: u8 = 255;
/// Colours beside that one.
const COLOURS: usize = 255;

type Rgb = [u8; 3];

/// Colours to show, and which of them is nearest to one that is drawn.
pub struct GifPalette {
    chosen: Vec<Rgb>,
    known: HashMap<Rgb, u8>,
}

impl GifPalette {
    /// Chooses colours for pixels like these: red, green, blue, alpha.
    pub fn new(rgba: &[u8]) -> Self {
        let mut counts: HashMap<Rgb, u64> = HashMap::new();
        for pixel in rgba.chunks_exact(4) {
            *counts.entry([pixel[0], pixel[1], pixel[2]]).or_default() += 1;
        }
        // In order, so that every run chooses the same.
        let mut counts: Vec<(Rgb, u64)> = counts.into_iter().collect();
        counts.sort_unstable();
        let mut boxes = vec![counts];
        while boxes.len() < COLOURS {
            let longest = (0..boxes.len()).max_by_key(|place| longest_side(&boxes[*place]).1);
            let Some(longest) = longest.filter(|place| longest_side(&boxes[*place]).1 > 0) else {
                break;
            };
            let cut = boxes.swap_remove(longest);
            boxes.extend(halves(cut));
        }
        let chosen = boxes.iter().filter(|colours| !colours.is_empty());
        Self { chosen: chosen.map(|colours| mean(colours)).collect(), known: HashMap::new() }
    }

    /// Red, green and blue of 256 colours.
    pub fn colours(&self) -> Vec<u8> {
        let mut colours = self.chosen.concat();
        colours.resize(3 * (COLOURS + 1), 0);
        colours
    }

    /// The nearest colour of each pixel.
    pub fn indices(&mut self, rgba: &[u8]) -> Vec<u8> {
        let chosen = &self.chosen;
        let nearest = |pixel: &[u8]| {
            let pixel = [pixel[0], pixel[1], pixel[2]];
            *self.known.entry(pixel).or_insert_with(|| nearest(chosen, pixel))
        };
        rgba.chunks_exact(4).map(nearest).collect()
    }
}

fn nearest(chosen: &[Rgb], pixel: Rgb) -> u8 {
    let distance = |colour: &Rgb| {
        let off = |n: usize| u32::from(colour[n].abs_diff(pixel[n]));
        off(0).pow(2) + off(1).pow(2) + off(2).pow(2)
    };
    let place = (0..chosen.len()).min_by_key(|place| distance(&chosen[*place]));
    place.unwrap_or_default() as u8
}

/// The channel in which the colours differ most, and by how much.
fn longest_side(colours: &[(Rgb, u64)]) -> (usize, u8) {
    let side = |channel: usize| {
        let values = || colours.iter().map(|(rgb, _)| rgb[channel]);
        values().max().unwrap_or_default() - values().min().unwrap_or_default()
    };
    let longest = (0..3).max_by_key(|channel| side(*channel)).unwrap_or_default();
    (longest, side(longest))
}

/// Cut in the middle of the longest side; neither half is empty.
fn halves(colours: Vec<(Rgb, u64)>) -> [Vec<(Rgb, u64)>; 2] {
    let (channel, side) = longest_side(&colours);
    let least = colours.iter().map(|(rgb, _)| rgb[channel]).min().unwrap_or_default();
    let (low, high) = colours.into_iter().partition(|(rgb, _)| rgb[channel] - least <= side / 2);
    [low, high]
}

fn mean(colours: &[(Rgb, u64)]) -> Rgb {
    let count: u64 = colours.iter().map(|(_, count)| count).sum();
    std::array::from_fn(|channel| {
        let sum: u64 = colours.iter().map(|(rgb, count)| u64::from(rgb[channel]) * count).sum();
        ((sum + count / 2) / count.max(1)) as u8
    })
}
