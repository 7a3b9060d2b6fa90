//! A style of music as `styles.txt` describes it: tempi, bar, swing, patterns.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// One voice of a drum pattern: its letter and the strokes.
pub type DrumLine = (char, Vec<u8>);

/// A bass or an accompanying instrument: its sound and its patterns.
pub struct Part {
    pub sound: String,
    pub patterns: Vec<Vec<u8>>,
}

pub struct Style {
    pub name: String,
    pub weight: f64,
    pub beats: usize,
    pub bpm: (f64, f64),
    pub swing: (f64, f64),
    /// Whether sixteenths swing in place of eighths.
    pub sixteenths: bool,
    pub drums: Vec<Vec<DrumLine>>,
    pub bass: Vec<Part>,
    pub comps: Vec<Part>,
    pub leads: Vec<String>,
    pub rhythms: Vec<String>,
}

impl Style {
    /// All styles of `styles.txt`.
    pub fn all() -> Vec<Style> {
        let mut styles: Vec<Style> = Vec::new();
        for line in include_str!("styles.txt").lines().map(str::trim) {
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            match line.strip_prefix('[') {
                Some(head) => styles.push(Style::head(head)),
                None => styles.last_mut().expect("a style comes first").add(line),
            }
        }
        styles
    }

    /// A style by weight.
    pub fn draw<'a>(styles: &'a [Style], rng: &mut ChaCha8Rng) -> &'a Style {
        let total: f64 = styles.iter().map(|s| s.weight).sum();
        let mut left = rng.random_range(0.0..total);
        for style in styles {
            left -= style.weight;
            if left < 0.0 {
                return style;
            }
        }
        &styles[0]
    }

    /// Whether its guitars and snare are usually the loudest of all.
    pub fn is_loud(&self) -> bool {
        ["rock", "metal", "punk", "thrash", "doom", "skank", "loud"]
            .iter()
            .any(|w| self.name.contains(w))
    }

    fn head(line: &str) -> Style {
        let (name, rest) = line.split_once(']').expect("a name in brackets");
        let words: Vec<&str> = rest.split_whitespace().collect();
        let number = |i: usize| -> f64 { words[i].parse().expect("a number") };
        Style {
            name: name.to_string(),
            weight: number(0),
            beats: number(1) as usize,
            bpm: (number(2), number(3)),
            swing: (number(4), number(5)),
            sixteenths: words.get(6) == Some(&"16"),
            drums: Vec::new(),
            bass: Vec::new(),
            comps: Vec::new(),
            leads: Vec::new(),
            rhythms: Vec::new(),
        }
    }

    fn add(&mut self, line: &str) {
        let (kind, rest) = line.split_once(' ').expect("a kind of line");
        let words =
            |text: &str| -> Vec<String> { text.split_whitespace().map(String::from).collect() };
        let part = || {
            let (sound, patterns) = rest.split_once(':').expect("a sound, then patterns");
            let patterns = words(patterns).into_iter().map(String::into_bytes).collect();
            Part { sound: sound.to_string(), patterns }
        };
        match kind {
            "drums" => self.drums.push(rest.split_whitespace().map(drum_line).collect()),
            "bass" => self.bass.push(part()),
            "comp" => self.comps.push(part()),
            "lead" => {
                let (sounds, rhythms) = rest.split_once(';').expect("sounds; rhythms");
                self.leads = words(sounds);
                self.rhythms = words(rhythms);
            }
            other => panic!("a line of kind {other}"),
        }
    }
}

fn drum_line(word: &str) -> DrumLine {
    let (voice, pattern) = word.split_once(':').expect("VOICE:pattern");
    (voice.chars().next().expect("a voice"), pattern.as_bytes().to_vec())
}

/// Where in the bars the steps of a pattern fall: how many bars it covers and the
/// length of a step in beats.
pub fn raster(pattern: &[u8], beats: usize) -> (usize, f64) {
    let bars = if pattern.len() > 4 * beats { 2 } else { 1 };
    (bars, (bars * beats) as f64 / pattern.len() as f64)
}
