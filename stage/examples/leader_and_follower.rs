//! A leader and a follower in memory, without network or sleep: clocks that differ
//! by a minute, a delay of 20 ms each way; prints how the follower finds the beat.
//! `cargo run -p servodance-stage --example leader_and_follower`.

use servodance_stage::clock::PlaybackClock;
use servodance_stage::messages::{MessageError, Role, StageFrame};
use servodance_stage::{Follower, Leader, Outgoing};
use servodance_types::{MotionFrame, MusicFrame, Posture};

const MS: i64 = 1_000_000;
/// Leader's clock less follower's clock.
const OFFSET_NS: i64 = 60_000 * MS;
const DELAY_NS: i64 = 20 * MS;
const CYCLE_NS: i64 = 10 * MS;
const FRAME_NS: i64 = 50 * MS;

fn main() -> Result<(), MessageError> {
    let mut leader = Leader::new(0, [1; 32]);
    let mut follower = Follower::new("neck", Role::default(), 0.4, [2; 32]);
    let mut playback = PlaybackClock::new(CYCLE_NS as f64 * 1e-9);
    let (mut sent, mut frames, mut shown_s) = (0, 0, 0.0);
    for cycle in 0..500 {
        let now_ns = cycle * CYCLE_NS;
        let leader_ns = now_ns + OFFSET_NS;
        let ahead_ns = (leader.lead_s(leader_ns) * 1e9) as i64;
        // Music and motion begin with the program; frames are sent ahead of time.
        while sent * FRAME_NS <= now_ns + ahead_ns {
            let motion =
                MotionFrame { time_s: (sent * FRAME_NS) as f64 * 1e-9, ..MotionFrame::default() };
            let present_ns = OFFSET_NS + sent * FRAME_NS;
            let music = MusicFrame::default();
            let frame = StageFrame::new(present_ns, &music, &motion, Posture::default());
            let message = leader.frames(leader_ns, 0, "hype", frame);
            follower.receive(now_ns + DELAY_NS, &message)?;
            sent += 1;
        }
        let mut requests = follower.time_requests(now_ns);
        requests.extend(follower.report(now_ns));
        for request in requests {
            let there_ns = leader_ns + DELAY_NS;
            let outgoing = leader.receive(there_ns, &request, || there_ns)?;
            if let Outgoing::Reply(_, replies) = outgoing {
                for reply in replies {
                    follower.receive(now_ns + 2 * DELAY_NS, &reply)?;
                }
            }
        }
        let hidden = follower.leader().is_none();
        while follower.next_frame(now_ns, Some(shown_s), hidden).is_some() {
            frames += 1;
        }
        let due_s = follower.due(now_ns).map(|due| due.at(now_ns));
        shown_s = playback.next(due_s, hidden);
        if cycle % 100 == 99 {
            let clock = follower.stats().clock;
            let offset_s = clock.map_or(f64::NAN, |clock| clock.offset_ns * 1e-9);
            println!(
                "{:.1} s: leader's clock {offset_s:+.4} s, {frames} frames, shown {shown_s:.3} s",
                now_ns as f64 * 1e-9
            );
        }
    }
    Ok(())
}
