//! The medley: another style for each phrase of the music.
//!
//! Every second phrase is danced at home, the liveliest style, unless the music is quiet;
//! between them guests take turns. Where phrases begin: [`super::phrases`].

/// The name of the style that is another one for each phrase.
pub const MEDLEY: &str = "medley";
/// The style between the guests. All are learned from people nearly alone.
const HOME: &str = "salsa";
const GUESTS: [&str; 2] = ["pop", "street"];
/// Phrases are quiet whose last bar is softer, 0 to 1 between the quietest and the loudest.
const QUIET: f32 = 0.35;

/// Follows the phrases of one dance.
#[derive(Clone, Debug, Default)]
pub(super) struct StyleByPhrase {
    home: usize,
    guests: Vec<usize>,
    /// Guests that have danced.
    turns: usize,
    is_away: bool,
}

impl StyleByPhrase {
    /// `None` for weights that know no home or no guest.
    pub fn new(styles: &[String]) -> Option<Self> {
        let place = |name: &str| styles.iter().position(|style| style == name);
        let guests: Vec<usize> = GUESTS.into_iter().filter_map(place).collect();
        let home = place(HOME)?;
        Some(Self { home, guests, ..Self::default() }).filter(|styles| !styles.guests.is_empty())
    }

    /// The style that a dance begins with.
    pub fn home(&self) -> usize {
        self.home
    }

    /// Forgets the music.
    pub fn reset(&mut self) {
        (self.turns, self.is_away) = (0, false);
    }

    /// The style of a phrase that begins, `loudness` being that of the bar before it, 0 to 1.
    pub fn next_style(&mut self, loudness: f32) -> usize {
        self.is_away = !self.is_away || loudness < QUIET;
        if !self.is_away {
            return self.home;
        }
        self.turns += 1;
        self.guests[(self.turns - 1) % self.guests.len()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STYLES: [&str; 4] = ["salsa", "pop", "street", "groove"];

    /// Names of the styles of phrases, by how loud the music was before each.
    fn danced(loudness: &[f32]) -> Vec<&'static str> {
        let mut styles = StyleByPhrase::new(&STYLES.map(String::from)).expect("known styles");
        loudness.iter().map(|loudness| STYLES[styles.next_style(*loudness)]).collect()
    }

    #[test]
    fn every_second_phrase_is_danced_at_home() {
        assert_eq!(danced(&[0.8; 5]), ["pop", "salsa", "street", "salsa", "pop"]);
    }

    #[test]
    fn quiet_music_is_danced_by_guests() {
        assert_eq!(danced(&[0.8, 0.1, 0.2, 0.8]), ["pop", "street", "pop", "salsa"]);
    }

    #[test]
    fn weights_without_these_styles_have_one_style() {
        assert!(StyleByPhrase::new(&["groove".to_owned()]).is_none());
        assert!(StyleByPhrase::new(&["salsa".to_owned(), "groove".to_owned()]).is_none());
    }
}
