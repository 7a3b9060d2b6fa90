//! So many frames of a dance and nothing else: what `model/reference/count_arm.py` counts the
//! instructions of. `frames N [FORMAT [candle]]`, the formats of `servodance weights convert`.

use servodance_model::{Dtype, EngineKind, EngineOptions, Generator, GeneratorOptions};
use servodance_types::{Beat, MusicFrame};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let frames: u32 = arguments.next().ok_or("how many frames?")?.parse()?;
    let dtype: Option<Dtype> = arguments.next().map(|dtype| dtype.parse()).transpose()?;
    let kind = match arguments.next().as_deref() {
        Some("candle") => EngineKind::Candle,
        _ => EngineKind::Own,
    };
    let options = EngineOptions { threads: Some(1), dtype, kind };
    let generator = Generator::built_in_with(options)?;
    let mut dance = generator.start(GeneratorOptions::default())?;
    for k in 0..frames {
        let time_s = f64::from(k) / 20.0;
        let phase = (2.0 * time_s % 1.0) as f32; // 120 beats a minute
        let beat = Beat { phase, tempo_bpm: 120.0, confidence: 1.0, ..Beat::default() };
        dance.step(&MusicFrame { time_s, beat, presence: 1.0, ..MusicFrame::default() })?;
    }
    println!("{:?}", dance.codes());
    Ok(())
}
