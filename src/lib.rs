//! The command line of servodance: [`cli`] has one file a command.
//!
//! What the commands do stands in library crates: `servodance-runtime` (a dance),
//! `servodance-training` (weights) and `servodance-lab` (benches and soak).

// A closed standard output is no reason to panic: see `servodance_runtime::process::console`.
#![deny(clippy::print_stdout, clippy::print_stderr)]

#[doc(hidden)] // for the binary and the tests of the program
pub mod cli;
