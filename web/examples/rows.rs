//! The rows that the page shows, computed with this machine's own instructions:
//! `rows WEIGHTS ROBOT STYLE SEED OUT [HEARD]` dances to the built-in song, or to what a
//! page has heard of it (its music rows, f32 little endian), and writes OUT.music and
//! OUT.robot in the same form. The browser's test (tests/browser/web.py) holds the page
//! against it.

use servodance_web::{DanceOptions, MUSIC_ROW, Studio, heard_of_row};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [weights, robot, style, seed, out, heard @ ..] = &arguments[..] else {
        return Err("rows WEIGHTS ROBOT STYLE SEED OUT [HEARD]".into());
    };
    let mut studio = Studio::default();
    studio.open(&std::fs::read(weights)?)?;
    let (samples, rate_hz) = Studio::song();
    let (robot, style) = (robot.clone(), Some(style.clone()));
    studio.start(DanceOptions { robot, style, seed: seed.parse()?, rate_hz })?;
    let mut rows = match heard {
        [] => studio.hear(&samples)?.clone(),
        [file, ..] => {
            let mut rows = servodance_web::Rows::default();
            let heard = read(file)?;
            for (frame, row) in heard.chunks_exact(MUSIC_ROW).enumerate() {
                let heard = row.first_chunk().ok_or("a row is too short")?;
                let step = studio.hear_frame(&heard_of_row(heard, frame as u64))?;
                rows.music.extend_from_slice(&step.music);
                rows.robot.extend_from_slice(&step.robot);
            }
            rows
        }
    };
    rows.robot.extend_from_slice(&studio.finish()?.robot);
    write(&format!("{out}.music"), &rows.music)?;
    Ok(write(&format!("{out}.robot"), &rows.robot)?)
}

fn read(path: &str) -> std::io::Result<Vec<f32>> {
    let bytes = std::fs::read(path)?;
    Ok(bytes.as_chunks().0.iter().map(|number| f32::from_le_bytes(*number)).collect())
}

fn write(path: &str, numbers: &[f32]) -> std::io::Result<()> {
    let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
    std::fs::write(path, bytes)
}
