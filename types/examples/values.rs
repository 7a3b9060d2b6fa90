//! Prints the human skeleton and the conditioning vector of one music frame:
//! `cargo run -p servodance-types --example values`.

use servodance_types::{Beat, BodyJoint, MusicFrame, SPECTRAL_DIM};

fn main() {
    for joint in BodyJoint::ALL {
        let parent = joint.parent().map_or("the world", BodyJoint::name);
        println!("{:2} {:14} on {parent}", joint as usize, joint.name());
    }
    let music = MusicFrame {
        beat: Beat { phase: 0.25, tempo_bpm: 126.0, confidence: 0.9, ..Beat::default() },
        ..MusicFrame::default()
    };
    let [sine, cosine, octaves, confidence] = music.vector()[SPECTRAL_DIM..] else {
        unreachable!("the vector ends with four values of the beat");
    };
    println!(
        "beat: sin {sine:.2}, cos {cosine:.2}, {octaves:+.2} octaves from 120 BPM, confidence {confidence}"
    );
}
