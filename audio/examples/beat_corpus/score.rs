//! A score as a synthesiser plays it, and the standard MIDI file that holds it.

/// One note; channel 9 is the drums.
#[derive(Clone, Copy)]
pub struct Note {
    pub start_s: f64,
    pub length_s: f64,
    pub channel: u8,
    pub key: u8,
    pub velocity: u8,
}

#[derive(Default)]
pub struct Score {
    pub notes: Vec<Note>,
    /// General MIDI program and volume (0 to 127) of each channel.
    pub programs: Vec<(u8, u8, u8)>,
}

const TICKS_PER_S: f64 = 960.0;

impl Score {
    /// The file: one track, 120 quarters a minute of 480 ticks, so that ticks are time.
    pub fn midi(&self) -> Vec<u8> {
        let mut events: Vec<(u32, [u8; 3])> = Vec::new();
        for &(channel, program, volume) in &self.programs {
            events.push((0, [0xC0 | channel, program, 0]));
            events.push((0, [0xB0 | channel, 7, volume]));
        }
        for note in &self.notes {
            let start = (note.start_s.max(0.0) * TICKS_PER_S).round() as u32;
            let end = start + ((note.length_s * TICKS_PER_S).round() as u32).max(20);
            events.push((start, [0x90 | note.channel, note.key, note.velocity.clamp(1, 127)]));
            events.push((end, [0x80 | note.channel, note.key, 0]));
        }
        // Note offs before note ons of the same tick.
        events.sort_by_key(|(tick, bytes)| (*tick, bytes[0] & 0xF0 == 0x90));
        let mut track = vec![0, 0xFF, 0x51, 3, 0x07, 0xA1, 0x20];
        let mut now = 0;
        for (tick, bytes) in events {
            write_length(&mut track, tick - now);
            now = tick;
            let length = if bytes[0] & 0xF0 == 0xC0 { 2 } else { 3 };
            track.extend(&bytes[..length]);
        }
        track.extend([0, 0xFF, 0x2F, 0]);
        let mut file = b"MThd\0\0\0\x06\0\0\0\x01\x01\xE0MTrk".to_vec();
        file.extend((track.len() as u32).to_be_bytes());
        file.extend(track);
        file
    }
}

fn write_length(out: &mut Vec<u8>, value: u32) {
    for shift in [21, 14, 7] {
        if value >> shift > 0 {
            out.push((value >> shift & 0x7F) as u8 | 0x80);
        }
    }
    out.push((value & 0x7F) as u8);
}
