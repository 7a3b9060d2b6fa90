//! General MIDI programs and drum keys by the words of `styles.txt`.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// A program of a sound.
pub fn program(sound: &str, rng: &mut ChaCha8Rng) -> u8 {
    let choice: &[u8] = match sound {
        "piano" => &[0, 0, 1, 2, 3],
        "chords" => &[0, 0, 1, 4, 5, 5, 16, 17, 24, 25],
        "harpsichord" => &[6],
        "mallet" => &[11, 12, 13, 108, 114],
        "organ" => &[16, 17, 18, 19],
        "accordion" => &[21, 23],
        "harmonica" => &[22],
        "nylon" => &[24],
        "guitar" => &[24, 25, 25, 26, 27, 27, 28, 29],
        "jazz guitar" => &[26],
        "metal" => &[29, 30, 30],
        "acoustic" => &[32],
        "finger" => &[33, 33, 34, 35],
        "pick" => &[33, 34, 34],
        "slap" => &[36, 37, 33],
        "synth" => &[38, 39, 80, 81, 81, 82, 84, 87, 90, 62, 63],
        "strings" => &[40, 41, 48, 48, 49, 50, 51],
        "violin" => &[40, 40, 48, 48, 49, 45],
        "viola" => &[41, 41, 42, 48, 49],
        "spiccato" => &[45, 48, 40],
        "cello" => &[32, 42, 43, 48, 70],
        "harp" => &[46],
        "choir" => &[52, 53, 54],
        "tuba" => &[57, 58, 32],
        "horns" => &[57, 60, 61],
        "brass" => &[56, 57, 60, 61, 61, 62],
        "reed" => &[64, 65, 66, 67, 68, 71],
        "flute" => &[72, 73, 74, 75, 79],
        "fiddle" => &[40, 110],
        "banjo" => &[105],
        "voice" => &[52, 53, 54, 65, 73, 40, 80],
        "chip" => &[80, 80, 81, 38],
        "pad" => &[48, 49, 50, 88, 89, 90, 91, 92, 94, 95, 52],
        _ => &[0],
    };
    choice[rng.random_range(0..choice.len())]
}

/// The lowest key in which a lead instrument plays.
pub fn lead_floor(sound: &str) -> i32 {
    match sound {
        "metal" | "guitar" | "nylon" | "banjo" => 57,
        "flute" | "fiddle" | "chip" | "mallet" => 69,
        _ => 62,
    }
}

/// The drum key of a voice, of several that there are.
pub fn drum_key(voice: char, variant: usize) -> u8 {
    let keys: [u8; 2] = match voice {
        'K' => [36, 35],
        'S' => [38, 40],
        'H' => [42, 42],
        'O' => [46, 46],
        'R' => [51, 59],
        'C' => [49, 57],
        'L' => [41, 43],
        'P' => [39, 39],
        'I' => [37, 37],
        'W' => [56, 56],
        'B' => [70, 82],
        'Y' => [63, 62],
        'Z' => [64, 61],
        'D' => [54, 54],
        'V' => [75, 76],
        'A' => [67, 68],
        'G' => [73, 70],
        'U' => [65, 66],
        _ => [37, 37],
    };
    keys[variant % 2]
}
