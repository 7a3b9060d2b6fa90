//! The studio as functions that a page can call: numbers in and out, memory for the rest.
//!
//! A call that takes bytes finds them where [`input`] said, put there by the page just
//! before. Calls give 0 or more, or -1 with one line about the error in the text. Text and
//! rows stay where they are until the next call. One studio a module: a page that wants
//! two instantiates it twice.
#![allow(unsafe_code)] // names that are not mangled count as unsafe

use crate::error::WebError;
use crate::studio::Studio;
use std::cell::RefCell;

#[derive(Default)]
struct Desk {
    studio: Studio,
    /// From the page, in whole numbers of four bytes.
    input: Vec<f32>,
    text: String,
    song: Vec<f32>,
}

thread_local! {
    static DESK: RefCell<Desk> = RefCell::default();
}

impl Desk {
    fn bytes(&self, count: usize) -> &[u8] {
        let all = bytemuck::cast_slice(&self.input);
        &all[..count.min(all.len())]
    }

    fn numbers(&self, count: usize) -> &[f32] {
        &self.input[..count.min(self.input.len())]
    }

    /// What is said in the text, and what the call gives.
    fn answer(&mut self, answer: Result<String, WebError>) -> i32 {
        let (text, status) = match answer {
            Ok(text) => (text, 0),
            Err(error) => (error.to_string(), -1),
        };
        self.text = text;
        status
    }
}

fn at_desk<T>(work: impl FnOnce(&mut Desk) -> T) -> T {
    DESK.with_borrow_mut(work)
}

/// Room for so many bytes, until the next call of this function.
#[unsafe(no_mangle)]
pub extern "C" fn input(bytes: usize) -> *mut f32 {
    at_desk(|desk| {
        desk.input.clear();
        desk.input.resize(bytes.div_ceil(size_of::<f32>()), 0.0);
        desk.input.as_mut_ptr()
    })
}

/// Where the text of the last call is: UTF-8.
#[unsafe(no_mangle)]
pub extern "C" fn text_at() -> *const u8 {
    at_desk(|desk| desk.text.as_ptr())
}

/// Bytes of that text.
#[unsafe(no_mangle)]
pub extern "C" fn text_bytes() -> usize {
    at_desk(|desk| desk.text.len())
}

/// Takes a weights file of so many bytes; the text tells the choices as JSON.
#[unsafe(no_mangle)]
pub extern "C" fn open(bytes: usize) -> i32 {
    at_desk(|desk| {
        let weights = std::mem::take(&mut desk.input);
        let all: &[u8] = bytemuck::cast_slice(&weights);
        let choices = desk.studio.open(&all[..bytes.min(all.len())]);
        desk.answer(choices.map(|choices| choices.to_string()))
    })
}

/// Begins a dance as the JSON in the input says; the text is the scene as JSON.
#[unsafe(no_mangle)]
pub extern "C" fn start(bytes: usize) -> i32 {
    at_desk(|desk| {
        let options = serde_json::from_slice(desk.bytes(bytes)).map_err(WebError::from);
        let scene = options.and_then(|options| desk.studio.start(options));
        desk.answer(scene.map(|scene| scene.to_string()))
    })
}

/// Dances to so many samples, f32.
#[unsafe(no_mangle)]
pub extern "C" fn hear(samples: usize) -> i32 {
    at_desk(|desk| {
        let samples = desk.numbers(samples).to_vec();
        let heard = desk.studio.hear(&samples).map(|_| String::new());
        desk.answer(heard)
    })
}

/// Ends the dance: the robot's last rows.
#[unsafe(no_mangle)]
pub extern "C" fn finish() -> i32 {
    at_desk(|desk| {
        let finished = desk.studio.finish().map(|_| String::new());
        desk.answer(finished)
    })
}

/// Dances on in the style whose name is in the input.
#[unsafe(no_mangle)]
pub extern "C" fn set_style(bytes: usize) -> i32 {
    at_desk(|desk| {
        let style = String::from_utf8_lossy(desk.bytes(bytes)).into_owned();
        let changed = desk.studio.set_style(&style);
        desk.answer(changed.map(|()| String::new()))
    })
}

/// Renders the built-in song; gives its rate in hertz.
#[unsafe(no_mangle)]
pub extern "C" fn song() -> u32 {
    at_desk(|desk| {
        let (samples, rate_hz) = Studio::song();
        desk.song = samples;
        rate_hz
    })
}

/// Where the song's samples are, f32.
#[unsafe(no_mangle)]
pub extern "C" fn song_at() -> *const f32 {
    at_desk(|desk| desk.song.as_ptr())
}

/// How many samples the song has.
#[unsafe(no_mangle)]
pub extern "C" fn song_samples() -> usize {
    at_desk(|desk| desk.song.len())
}

/// Where the music rows of the last call are, f32.
#[unsafe(no_mangle)]
pub extern "C" fn music_at() -> *const f32 {
    at_desk(|desk| desk.studio.rows().music.as_ptr())
}

/// How many numbers they have together.
#[unsafe(no_mangle)]
pub extern "C" fn music_numbers() -> usize {
    at_desk(|desk| desk.studio.rows().music.len())
}

/// Where the robot's rows of the last call are, f32.
#[unsafe(no_mangle)]
pub extern "C" fn robot_at() -> *const f32 {
    at_desk(|desk| desk.studio.rows().robot.as_ptr())
}

/// How many numbers they have together.
#[unsafe(no_mangle)]
pub extern "C" fn robot_numbers() -> usize {
    at_desk(|desk| desk.studio.rows().robot.len())
}
