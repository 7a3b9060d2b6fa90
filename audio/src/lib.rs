//! Music in: recordings or raw samples to timed blocks, features and beats.
//!
//! [`song`] renders music by code with known beats.

pub mod song;
