//! Styles: rhythm patterns on a grid of 16 steps a bar, instruments, tempi.
//!
//! A pattern is a string with one character a step, 16 or 32 steps long.
//! Drums: `X` accent, `x` stroke, `o` ghost stroke. Bass: `r` root, `f` fifth,
//! `o` octave, `n` approach to the next root, `-` hold. Chords and lead:
//! `x` play, `-` hold. Everywhere `.` is silence.

use super::drums::Drum;
use super::synth::Instrument;

use Drum::*;
use Instrument::*;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)] // the variant names are the documentation
pub enum Style {
    House,
    Disco,
    HipHop,
    Rock,
    Funk,
    Salsa,
    Ballad,
    Electro,
    Reggaeton,
    Techno,
    Soul,
    Trap,
}

pub(super) type DrumPattern = &'static [(Drum, &'static str)];

pub(super) struct StyleSheet {
    pub(super) tempo_bpm: (f64, f64),
    /// Range of the delay of every second sixteenth, in sixteenths.
    pub(super) swing: (f32, f32),
    pub(super) drums: &'static [DrumPattern],
    pub(super) bass: &'static [&'static str],
    pub(super) chords: &'static [&'static str],
    pub(super) lead: &'static [&'static str],
    pub(super) bass_kind: &'static [Instrument],
    pub(super) chord_kind: &'static [Instrument],
    pub(super) lead_kind: &'static [Instrument],
    pub(super) sevenths: bool,
}

impl Style {
    /// All styles in the order of their declaration.
    pub const ALL: [Style; 12] = {
        use Style::*;
        [House, Disco, HipHop, Rock, Funk, Salsa, Ballad, Electro, Reggaeton, Techno, Soul, Trap]
    };

    /// Lowest and highest usual tempo of the style, beats a minute.
    pub fn tempo_range_bpm(self) -> (f64, f64) {
        self.sheet().tempo_bpm
    }

    pub(super) fn sheet(self) -> &'static StyleSheet {
        const SHEETS: [&StyleSheet; Style::ALL.len()] = [
            &HOUSE, &DISCO, &HIP_HOP, &ROCK, &FUNK, &SALSA, &BALLAD, &ELECTRO, &REGGAETON, &TECHNO,
            &SOUL, &TRAP,
        ];
        SHEETS[self as usize]
    }
}

static HOUSE: StyleSheet = StyleSheet {
    tempo_bpm: (116.0, 130.0),
    swing: (0.0, 0.2),
    drums: &[
        &[
            (Kick, "X...X...X...X..."),
            (Clap, "....X.......X..."),
            (OpenHat, "..x...x...x...x."),
            (Shaker, "x.o.x.o.x.o.x.o."),
        ],
        &[
            (Kick, "X...X...X...X..x"),
            (Snare, "....x.......x..."),
            (ClosedHat, "x.x.x.x.x.x.x.x."),
            (OpenHat, "..X...X...X...X."),
            (Rim, "...o..o....o..o."),
        ],
    ],
    bass: &["..r-..r-..r-..o.", "r..r..r.r..r..o.", "r.....r.r..f..o."],
    chords: &["..x...x..x....x.", "x--x--x-----x--.", "....x.......x..."],
    lead: &["x..x..x.x.......", "..x.x.x...x.x...", "x-------x---x---"],
    bass_kind: &[SubBass, SynthBass],
    chord_kind: &[Stab, Organ, Pad, ElectricPiano],
    lead_kind: &[Lead, Pluck, Bell],
    sevenths: true,
};

static DISCO: StyleSheet = StyleSheet {
    tempo_bpm: (108.0, 130.0),
    swing: (0.0, 0.05),
    drums: &[
        &[
            (Kick, "X...X...X...X..."),
            (Snare, "....X.......X..."),
            (ClosedHat, "x.o.x.o.x.o.x.o."),
            (OpenHat, "..X...X...X...X."),
        ],
        &[
            (Kick, "X...X...X...X..."),
            (Clap, "....X.......X..."),
            (ClosedHat, "xoxoxoxoxoxoxoxo"),
            (Cowbell, "..o...o...o...oo"),
        ],
    ],
    bass: &["r.o.r.o.r.o.r.o.", "r.oor.oor.oor.on", "r..ro.r.r..fo.on"],
    chords: &["..x-..x-..x-..x-", "x-..x-.x..x-..x-", "x---------------"],
    lead: &["x-..x-..x---....", "x.x.x-....x.x-..", "..x-x-x-x---...."],
    bass_kind: &[PluckBass, SynthBass],
    chord_kind: &[ElectricPiano, Stab, Pad],
    lead_kind: &[Lead, Bell, Flute],
    sevenths: true,
};

static HIP_HOP: StyleSheet = StyleSheet {
    tempo_bpm: (82.0, 104.0),
    swing: (0.1, 0.5),
    drums: &[
        &[(Kick, "X.....x.x.x....."), (Snare, "....X.......X..."), (ClosedHat, "x.x.x.x.x.x.x.x.")],
        &[
            (Kick, "X..x......X..x.."),
            (Clap, "....X.......X..."),
            (ClosedHat, "x.xxx.x.x.xxx.x."),
            (Snare, ".......o.o......"),
        ],
    ],
    bass: &["r--...r.r.f.....", "r-----..r-.o.n..", "r-.r....r-.f...."],
    chords: &["x---......x---..", "x---------------", "..x...x...x...x."],
    lead: &["x..x..x.........", "....x.x.x---....", "x.......x.x.x..."],
    bass_kind: &[SubBass, PluckBass],
    chord_kind: &[ElectricPiano, Pluck, Pad],
    lead_kind: &[Bell, Flute, Pluck],
    sevenths: true,
};

static ROCK: StyleSheet = StyleSheet {
    tempo_bpm: (96.0, 168.0),
    swing: (0.0, 0.02),
    drums: &[
        &[(Kick, "X.......X.x....."), (Snare, "....X.......X..."), (ClosedHat, "X.x.X.x.X.x.X.x.")],
        &[(Kick, "X..x....X.X....."), (Snare, "....X.......X..."), (Crash, "x...x...x...x...")],
        &[(Kick, "X.x...x.X.x...x."), (Snare, "....X.......X..."), (ClosedHat, "x.x.x.x.x.x.x.x.")],
    ],
    bass: &["r.r.r.r.r.r.r.r.", "r-..r-..r-r.f.n.", "r---....r.r.r.f."],
    chords: &["x---------------", "x.x.x.x.x.x.x.x.", "x-----x-----x---"],
    lead: &["x-..x.x.x---....", "x.x.x.x.x-------", "......x.x.x-x---"],
    bass_kind: &[PluckBass],
    chord_kind: &[Guitar],
    lead_kind: &[Guitar, Lead],
    sevenths: false,
};

static FUNK: StyleSheet = StyleSheet {
    tempo_bpm: (92.0, 118.0),
    swing: (0.0, 0.2),
    drums: &[
        &[(Kick, "X.x.....x.x..x.."), (Snare, "....X..o.o..X..o"), (ClosedHat, "x.x.x.x.x.x.x.xx")],
        &[
            (Kick, "X..x..x...x..x.."),
            (Snare, "....X.......X..."),
            (ClosedHat, "xxxxxxxxxxxxxxxx"),
            (OpenHat, "..............x."),
        ],
    ],
    bass: &["r..o.r....r.f.on", "r-.r..o.r..r.fo.", "r.o...r.r.oo..n."],
    chords: &["..x..x....x..x..", "x..x..x....x..x.", "....x.x.....x..x"],
    lead: &["x.x...x-....x.x.", "..xx..x.........", "x..x..x.x.x-...."],
    bass_kind: &[PluckBass, SynthBass],
    chord_kind: &[Stab, ElectricPiano, Organ],
    lead_kind: &[Stab, Lead, Organ],
    sevenths: true,
};

static SALSA: StyleSheet = StyleSheet {
    tempo_bpm: (88.0, 112.0),
    swing: (0.0, 0.05),
    drums: &[
        &[
            (Clave, "X..X...X....X..."),
            (HighConga, "..x..xX...x..xX."),
            (LowConga, "............x.x."),
            (Cowbell, "X...x...X...x..."),
            (Kick, "......x.......x."),
        ],
        &[
            (Clave, "....X.X.....X..X..X............."),
            (HighConga, "x.o.X.o.x.o.X.x."),
            (LowConga, "......x.......xx"),
            (Cowbell, "X.x.x.x.X.x.x.x."),
            (Kick, "x.......x......."),
            (Shaker, "xoxoxoxoxoxoxoxo"),
        ],
    ],
    bass: &["r.....f-....o---", "......f-....o-.."],
    chords: &["x..x..x...x.x.x.", "x.x..x.x..x..x.x"],
    lead: &["x-..x-..x-x-....", "..x.x.x.x.......", "x---x---x-x-x---"],
    bass_kind: &[PluckBass],
    chord_kind: &[ElectricPiano, Pluck],
    lead_kind: &[Lead, Flute],
    sevenths: true,
};

static BALLAD: StyleSheet = StyleSheet {
    tempo_bpm: (70.0, 92.0),
    swing: (0.0, 0.1),
    drums: &[
        &[(Kick, "X.........x....."), (Rim, "....x.......x..."), (ClosedHat, "x.o.x.o.x.o.x.o.")],
        &[(Kick, "X.......x......."), (Snare, "....x.......x..."), (Shaker, "x.x.x.x.x.x.x.x.")],
    ],
    bass: &["r-------f-------", "r-----r-r-----n-"],
    chords: &["x---x---x---x---", "x-x-x-x-x-x-x-x-", "x---------------"],
    lead: &["x---....x-x-x---", "....x-x-x---x---", "x-------x-------"],
    bass_kind: &[SubBass, PluckBass],
    chord_kind: &[ElectricPiano, Pad, Pluck],
    lead_kind: &[Flute, Bell],
    sevenths: true,
};

static ELECTRO: StyleSheet = StyleSheet {
    tempo_bpm: (108.0, 134.0),
    swing: (0.0, 0.05),
    drums: &[
        &[
            (Kick, "X.....X...X....."),
            (Snare, "....X.......X..."),
            (ClosedHat, "x.xxx.xxx.xxx.xx"),
            (Cowbell, "...x..x...x....."),
        ],
        &[(Kick, "X..X....x.X..X.."), (Clap, "....X.......X..."), (ClosedHat, "xxxxxxxxxxxxxxxx")],
    ],
    bass: &["r.rro.r.r.rro.r.", "rrorrrorrrorrror", "r..r..r.o..r..o."],
    chords: &["x---....x---....", "..x..x..x.......", "x.x.x.x.x.x.x.x."],
    lead: &["xxx.xxx.xxx.xxx.", "x.x.x.x.x.x.x.x.", "x..x..x..x..x.x."],
    bass_kind: &[SynthBass],
    chord_kind: &[Stab, Pad],
    lead_kind: &[Lead, Bell],
    sevenths: false,
};

static REGGAETON: StyleSheet = StyleSheet {
    tempo_bpm: (86.0, 104.0),
    swing: (0.0, 0.05),
    drums: &[
        &[(Kick, "X...X...X...X..."), (Snare, "...X..X....X..X."), (ClosedHat, "x.x.x.x.x.x.x.x.")],
        &[
            (Kick, "X...x...X...x..."),
            (Rim, "...X..x....X..x."),
            (Shaker, "xoxoxoxoxoxoxoxo"),
            (Clap, "......x.......x."),
        ],
    ],
    bass: &["r--r--r-r--r--r-", "r---....r--r--f-"],
    chords: &["x--x--x-x--x--x-", "..x...x...x...x."],
    lead: &["x..x..x.....x...", "x-x-x--x--x-...."],
    bass_kind: &[SubBass],
    chord_kind: &[Pluck, Stab, Pad],
    lead_kind: &[Flute, Bell, Pluck],
    sevenths: false,
};

static TECHNO: StyleSheet = StyleSheet {
    tempo_bpm: (124.0, 145.0),
    swing: (0.0, 0.05),
    drums: &[
        &[
            (Kick, "X...X...X...X..."),
            (OpenHat, "..X...X...X...X."),
            (ClosedHat, "oxoxoxoxoxoxoxox"),
            (Rim, "...x.....x......"),
        ],
        &[
            (Kick, "X...X...X...X..."),
            (Clap, "....x.......x..."),
            (ClosedHat, "..x...x...x...x."),
            (Tom, ".....x..x....x.."),
        ],
    ],
    bass: &["..r...r...r...r.", ".rrr.rrr.rrr.rrr"],
    chords: &["..x.....x.......", "x---------------"],
    lead: &["x.x.xx.x.x.xx.x.", "x..x..x..x..x..x"],
    bass_kind: &[SynthBass, SubBass],
    chord_kind: &[Stab, Pad],
    lead_kind: &[Pluck, Bell, Lead],
    sevenths: false,
};

static SOUL: StyleSheet = StyleSheet {
    tempo_bpm: (76.0, 124.0),
    swing: (0.1, 0.66),
    drums: &[
        &[(Kick, "X.......X......."), (Snare, "....X.......X..."), (ClosedHat, "x.x.x.x.x.x.x.x.")],
        &[(Kick, "X..x....x..x...."), (Snare, "X...X...X...X..."), (Shaker, "x.x.x.x.x.x.x.x.")],
    ],
    bass: &["r-..r-f-o-..f-n-", "r---r---o---n---"],
    chords: &["....x.......x...", "x--x----x--x----", "x---x---x---x---"],
    lead: &["x-..x.x-....x-..", "....x-x-x---...."],
    bass_kind: &[PluckBass],
    chord_kind: &[Organ, ElectricPiano],
    lead_kind: &[Organ, Flute, Lead],
    sevenths: true,
};

static TRAP: StyleSheet = StyleSheet {
    tempo_bpm: (65.0, 80.0),
    swing: (0.0, 0.05),
    drums: &[
        &[(Kick, "X.....x...x....."), (Clap, "....X.......X..."), (ClosedHat, "x.x.x.x.x.x.xxxx")],
        &[
            (Kick, "X..x......x..x.."),
            (Snare, "....X.......X..."),
            (ClosedHat, "xxx.xxx.xxx.xxxx"),
            (OpenHat, "..........x....."),
        ],
    ],
    bass: &["r-----r-..r-----", "r--r------r--r--"],
    chords: &["x---------------", "x--x--x-x--x--x-"],
    lead: &["x.x.x.x.........", "x..x..x..x..x.x."],
    bass_kind: &[SubBass],
    chord_kind: &[Pad, Bell, Pluck],
    lead_kind: &[Bell, Flute],
    sevenths: false,
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_are_whole_bars() {
        for style in Style::ALL {
            let sheet = style.sheet();
            let drums = sheet.drums.iter().flat_map(|p| p.iter().map(|lane| lane.1));
            let tunes = sheet.bass.iter().chain(sheet.chords).chain(sheet.lead);
            for pattern in drums.chain(tunes.copied()) {
                assert_eq!(pattern.len() % 16, 0, "{style:?}: {pattern}");
            }
        }
    }
}
