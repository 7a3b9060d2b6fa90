//! Many robots on one beat: programs of their own in networks of their own,
//! strangers that say anything, leaders that come and go, connections that stall.

#[cfg(feature = "stage")]
mod connections;
#[cfg(feature = "stage")]
mod strangers;
#[cfg(feature = "stage")]
mod together;

#[cfg(not(feature = "stage"))]
#[test]
fn without_its_network_the_program_says_how_to_build_it() {
    let program = crate::program::Program::new();
    for words in [&["lead"][..], &["follow"], &["cue", "all"], &["bench", "stage"]] {
        program.refused(words, &[words[0], "--features stage"]);
    }
}
