//! The songs of a session: the one that is danced, and those that wait. The control loop
//! never locks them: they change between dances alone.

use crate::pipeline::audio_input::{AudioChoice, AudioInput};
use crate::pipeline::page_sound::PageSound;
use crate::process::speed::Speed;
use anyhow::{Context, bail};
use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tempfile::TempDir;

/// Most songs that wait.
const MOST: usize = 32;
/// Most bytes of a song's name: file systems take 255.
const LONGEST_NAME: usize = 200;
/// Most bytes of a song.
pub const MOST_BYTES: usize = 40_000_000;

/// Shared by the session, which dances the songs, and the page, which plays and adds them.
#[derive(Clone, Debug, Default)]
pub struct Songs(Arc<Mutex<Playlist>>);

#[derive(Debug, Default)]
struct Playlist {
    /// Counts songs, so that pages know when to fetch another.
    number: u32,
    /// What the page can play: nothing of a microphone's.
    now: Option<AudioChoice>,
    /// Where the song lies that is danced, until the next one is.
    folder: Option<TempDir>,
    waiting: VecDeque<WaitingSong>,
}

#[derive(Debug)]
struct WaitingSong {
    name: String,
    sound: AudioChoice,
    /// Where its file lies; a microphone has none.
    folder: Option<TempDir>,
}

impl Songs {
    /// Of a session that begins with this music.
    pub fn new(first: &AudioChoice) -> Self {
        let songs = Self::default();
        songs.lock().now = first.is_recording().then(|| first.clone());
        songs
    }

    fn lock(&self) -> MutexGuard<'_, Playlist> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Number and source of the song that is danced, where a page can play it.
    pub fn now(&self) -> Option<(u32, AudioChoice)> {
        let list = self.lock();
        list.now.clone().map(|song| (list.number, song))
    }

    /// The names of the songs that wait.
    pub fn waiting(&self) -> Vec<String> {
        self.lock().waiting.iter().map(|song| song.name.clone()).collect()
    }

    /// Puts a file, as its pieces come, behind the songs that wait. Refuses what no dance can be
    /// danced to.
    pub fn add(
        &self,
        name: &str,
        pieces: impl IntoIterator<Item = io::Result<impl AsRef<[u8]>>>,
    ) -> anyhow::Result<()> {
        let name = last_part(name);
        let folder = tempfile::tempdir().context("the song cannot be kept")?;
        let path = folder.path().join(&name);
        write(&path, pieces).context("the song cannot be kept")?;
        if let Err(error) = AudioInput::open(&AudioChoice::File(path.clone()), Speed::Max) {
            bail!(format!("{error:#}").replace(&path.display().to_string(), &name));
        }
        let sound = AudioChoice::File(path);
        self.lock().wait(WaitingSong { name, sound, folder: Some(folder) })
    }

    /// Puts the microphone of a page behind the songs that wait.
    pub fn add_microphone(&self, sound: PageSound) -> anyhow::Result<()> {
        let (name, sound) = ("microphone".to_owned(), AudioChoice::Page(sound));
        self.lock().wait(WaitingSong { name, sound, folder: None })
    }

    /// The next song, which is danced from now on. Microphones that were closed meanwhile are
    /// passed over.
    pub fn next(&self) -> Option<AudioChoice> {
        let mut list = self.lock();
        let is_over =
            |sound: &AudioChoice| matches!(sound, AudioChoice::Page(sound) if sound.is_over());
        while list.waiting.front().is_some_and(|song| is_over(&song.sound)) {
            list.waiting.pop_front();
        }
        let WaitingSong { sound, folder, .. } = list.waiting.pop_front()?;
        list.number += 1;
        list.now = sound.is_recording().then(|| sound.clone());
        list.folder = folder;
        Some(sound)
    }
}

impl Playlist {
    fn wait(&mut self, song: WaitingSong) -> anyhow::Result<()> {
        if self.waiting.len() == MOST {
            bail!("{MOST} songs wait already");
        }
        self.waiting.push_back(song);
        Ok(())
    }
}

fn write(
    path: &Path,
    pieces: impl IntoIterator<Item = io::Result<impl AsRef<[u8]>>>,
) -> io::Result<()> {
    let mut file = File::create(path)?;
    for piece in pieces {
        file.write_all(piece?.as_ref())?;
    }
    Ok(())
}

/// A name without folders or what a line cannot show, short enough for a file system.
fn last_part(name: &str) -> String {
    let name = name.rsplit(['/', '\\']).next().unwrap_or_default();
    let mut shown: String = name.chars().filter(|c| !c.is_control()).collect();
    while shown.len() > LONGEST_NAME {
        shown.pop();
    }
    shown
}

#[cfg(all(test, feature = "view"))]
mod tests {
    use super::*;

    #[test]
    fn songs_are_danced_in_the_order_in_which_they_came() {
        let songs = Songs::new(&AudioChoice::BuiltIn);
        assert!(matches!(songs.now(), Some((0, AudioChoice::BuiltIn))));
        assert!(songs.next().is_none());
        let wav = crate::viewer::song_wav::song_wav(&AudioChoice::BuiltIn).unwrap();
        for name in ["../one.wav", "two.wav"] {
            songs.add(name, [Ok(&wav[..9]), Ok(&wav[9..])]).unwrap();
        }
        assert_eq!(songs.waiting(), ["one.wav", "two.wav"]);
        let Some(AudioChoice::File(path)) = songs.next() else { panic!("a file") };
        assert_eq!(std::fs::read(&path).unwrap(), wav);
        assert!(matches!(songs.now(), Some((1, AudioChoice::File(now))) if now == path));
        songs.next();
        assert!(!path.exists(), "a song that is over leaves nothing behind");
    }

    #[test]
    fn a_long_name_is_cut_between_characters_so_that_a_file_can_have_it() {
        assert_eq!(last_part("a/song.wav"), "song.wav");
        assert_eq!(last_part(&"x".repeat(300)).len(), LONGEST_NAME);
        let songs = Songs::default();
        let wav = crate::viewer::song_wav::song_wav(&AudioChoice::BuiltIn).unwrap();
        songs.add(&format!("{}.wav", "音".repeat(90)), [Ok(&wav)]).unwrap();
        assert_eq!(songs.waiting(), ["音".repeat(66)]);
    }

    #[test]
    fn a_microphone_that_was_closed_while_it_waited_is_passed_over() {
        let songs = Songs::default();
        let (microphone, sound) = crate::pipeline::page_sound::page_sound(48_000);
        songs.add_microphone(sound).unwrap();
        let wav = crate::viewer::song_wav::song_wav(&AudioChoice::BuiltIn).unwrap();
        songs.add("two.wav", [Ok(&wav)]).unwrap();
        drop(microphone);
        assert!(matches!(songs.next(), Some(AudioChoice::File(_))));
        assert!(songs.next().is_none());
    }

    #[test]
    fn what_is_no_song_is_refused_by_its_name() {
        let songs = Songs::default();
        let error = songs.add("notes.txt", [Ok(b"la la la")]).unwrap_err().to_string();
        assert!(error.starts_with("notes.txt"), "{error}");
        let wav = crate::viewer::song_wav::song_wav(&AudioChoice::BuiltIn).unwrap();
        let broken = io::Error::other("not all of it came");
        assert!(songs.add("half.wav", [Ok(&wav[..]), Err(broken)]).is_err());
        assert!(songs.waiting().is_empty());
    }
}
