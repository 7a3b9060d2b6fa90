//! Which clips are held out: whole takes, the same ones every time.

use sha2::{Digest, Sha256};

use super::clip_entry::{ClipEntry, Split};
use super::styles::STYLES;

/// Clips of one take show one performance, or were danced to one song: they share a split.
fn take(entry: &ClipEntry) -> String {
    let stem = entry.stem();
    match entry.source.as_str() {
        // Partners 60 and 61 dance the same takes.
        "cmu_salsa" => match stem.split_once('_') {
            Some((_, take)) => format!("salsa {take}"),
            None => entry.name.clone(),
        },
        // gBR_sBM_cAll_d04_mBR0_ch01: the song is mBR0.
        "aist" => stem.split('_').nth(4).unwrap_or(stem).to_owned(),
        // M012314 is 012314 in a mirror.
        "humanml3d" => stem.trim_start_matches('M').to_owned(),
        // dance1_subject2: several people in one take.
        _ => match stem.split_once("_subject") {
            Some((take, _)) => take.to_owned(),
            None => entry.name.clone(),
        },
    }
}

/// Holds out 8 % of the minutes of every style for test, 8 % for validation: takes by their names.
pub fn assign_splits(entries: &mut [ClipEntry]) {
    const SHARE: f64 = 0.08;
    for style in 0..STYLES.len() {
        let members: Vec<usize> =
            (0..entries.len()).filter(|i| entries[*i].style() == style).collect();
        let mut takes: Vec<String> = members.iter().map(|i| take(&entries[*i])).collect();
        takes.sort_by_key(|take| (Sha256::digest(take.as_bytes()), take.clone()));
        takes.dedup();
        let total: f64 = members.iter().map(|i| entries[*i].minutes).sum();
        let mut room = [SHARE * total; 2];
        for take in takes {
            let clips: Vec<usize> =
                members.iter().copied().filter(|i| self::take(&entries[*i]) == take).collect();
            let minutes: f64 = clips.iter().map(|i| entries[*i].minutes).sum();
            // A take may overshoot its room by half of itself: rounding.
            let split = if minutes / 2.0 <= room[0] {
                room[0] -= minutes;
                Split::Test
            } else if minutes / 2.0 <= room[1] {
                room[1] -= minutes;
                Split::Validation
            } else {
                Split::Train
            };
            for i in clips {
                entries[i].split = split;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn partners_of_one_take_share_a_split() {
        let mut entries: Vec<ClipEntry> = (1..13)
            .flat_map(|take| {
                ["60", "61"]
                    .map(|s| ClipEntry::example(&format!("{s}_{take:02}"), "cmu_salsa", true, ""))
            })
            .collect();
        assign_splits(&mut entries);
        for pair in entries.chunks(2) {
            assert_eq!(pair[0].split, pair[1].split, "{}", pair[0].name);
        }
        for split in [Split::Test, Split::Validation] {
            assert_eq!(entries.iter().filter(|e| e.split == split).count(), 2);
        }
    }

    #[test]
    fn copies_and_partners_are_one_take() {
        let same = |source: &str, a: &str, b: &str| {
            let [a, b] = [a, b].map(|name| take(&ClipEntry::example(name, source, true, "")));
            a == b
        };
        assert!(same("humanml3d", "012314", "M012314"));
        assert!(same("lafan1", "dance1_subject2", "dance1_subject3"));
        assert!(same("aist", "gBR_sBM_cAll_d04_mBR0_ch01", "gBR_sFM_cAll_d06_mBR0_ch09"));
        assert!(!same("aist", "gBR_sBM_cAll_d04_mBR0_ch01", "gBR_sBM_cAll_d04_mBR1_ch01"));
    }
}
