use super::*;
use crate::clock::PlaybackClock;
use crate::messages::{Cue, StageFrame};
use crate::net::Deduplicator;
use crate::{Leader, Outgoing};
use rand_chacha::ChaCha8Rng;

const STEP_NS: i64 = 10_000_000;
const SECOND: i64 = 1_000_000_000;
const REACH_S: f64 = 0.45;

/// A leader whose clock runs otherwise, and whose music began at its zero.
struct Lead {
    leader: Leader,
    ahead_ns: i64,
    drift: f64,
    sent: i64,
    style: &'static str,
}

impl Lead {
    fn new(term: u32, seed: u8) -> Self {
        Self {
            leader: Leader::new(term, [seed; 32]),
            ahead_ns: i64::from(seed) * 1_000 * SECOND,
            drift: 5e-5,
            sent: 0,
            style: "hype",
        }
    }

    fn clock(&self, true_ns: i64) -> i64 {
        true_ns + (true_ns as f64 * self.drift) as i64
    }

    /// Messages that are due; music time is its own clock less `ahead_ns`.
    fn send(&mut self, true_ns: i64) -> Vec<Vec<u8>> {
        let now_ns = self.clock(true_ns) + self.ahead_ns;
        let lead_ns = (self.leader.lead_s(now_ns) * 1e9) as i64;
        let mut out = Vec::new();
        while self.sent * 50_000_000 <= self.clock(true_ns) + lead_ns {
            let music_ns = self.sent * 50_000_000;
            let frame = StageFrame {
                present_ns: music_ns + self.ahead_ns,
                music_ns,
                beat: servodance_types::Beat { tempo_bpm: 120.0, ..Default::default() },
                presence: 1.0,
                level: 0.0,
                contacts: Default::default(),
                positions: Default::default(),
                posture: Default::default(),
            };
            out.push(self.leader.frames(now_ns, 0, self.style, frame));
            self.sent += 1;
        }
        out
    }
}

/// One direction of a connection, as the relay of `bench stage` has it: what
/// is lost comes a fifth of a second and the way there and back later, lost again
/// after twice as long, and nothing overtakes it.
#[derive(Clone, Copy, Default)]
struct Tcp {
    last_ns: i64,
}

impl Tcp {
    fn arrival_ns(&mut self, rng: &mut ChaCha8Rng, at_ns: i64, way_ns: i64, loss: f64) -> i64 {
        let (mut arrival_ns, mut again_ns) = (at_ns + way_ns, 200_000_000 + 2 * way_ns);
        while rng.random::<f64>() < loss {
            arrival_ns += again_ns;
            again_ns *= 2;
        }
        self.last_ns = self.last_ns.max(arrival_ns);
        self.last_ns
    }
}

/// A follower behind a network with delay, jitter and loss.
struct World {
    now_ns: i64,
    rng: ChaCha8Rng,
    delay_ns: i64,
    jitter_ns: i64,
    loss: f64,
    /// Connections, if what is lost stalls what comes after it: the leader's to
    /// the follower, and back.
    tcp: Vec<[Tcp; 2]>,
    copies: Deduplicator,
    /// Messages on their way to the follower.
    flying: Vec<(i64, Vec<u8>)>,
    follower: Follower,
    playback: PlaybackClock,
    idle: f64,
    /// Music time of the newest frame that was handed over, motion time of it.
    frames: Vec<(f64, f64)>,
    shown: f64,
}

impl World {
    fn new(delay_ms: i64, loss: f64) -> Self {
        Self {
            now_ns: 0,
            rng: ChaCha8Rng::seed_from_u64(1),
            delay_ns: delay_ms * 1_000_000,
            jitter_ns: delay_ms * 300_000,
            loss,
            tcp: Vec::new(),
            copies: Deduplicator::default(),
            flying: Vec::new(),
            follower: Follower::new("neck", Role::default(), REACH_S, [9; 32]),
            playback: PlaybackClock::new(0.01),
            idle: 1.0,
            frames: Vec::new(),
            shown: 0.0,
        }
    }

    /// The same behind so many connections that stall.
    fn stalling(delay_ms: i64, loss: f64, connections: usize) -> Self {
        let tcp = vec![[Tcp::default(); 2]; connections];
        Self { tcp, ..Self::new(delay_ms, loss) }
    }

    /// When what is sent one way (0: to the follower) at a moment arrives.
    fn arrivals(&mut self, one_way: usize, at_ns: i64) -> Vec<i64> {
        let way_ns = self.delay_ns + self.rng.random_range(0..=self.jitter_ns.max(1));
        let (rng, loss) = (&mut self.rng, self.loss);
        if self.tcp.is_empty() {
            let lost = rng.random::<f64>() < loss;
            return (!lost).then_some(at_ns + way_ns).into_iter().collect();
        }
        let connections = self.tcp.iter_mut();
        connections.map(|tcp| tcp[one_way].arrival_ns(rng, at_ns, way_ns, loss)).collect()
    }

    fn fly(&mut self, at_ns: i64, bytes: &[u8]) {
        for arrival_ns in self.arrivals(0, at_ns) {
            self.flying.push((arrival_ns, bytes.to_vec()));
        }
    }

    /// Lets time pass; leaders that are `None` are cut off.
    fn run(&mut self, seconds: f64, leads: &mut [&mut Lead]) {
        for _ in 0..(seconds * 100.0) as usize {
            self.now_ns += STEP_NS;
            let now_ns = self.now_ns;
            for lead in leads.iter_mut() {
                for bytes in lead.send(now_ns) {
                    self.fly(now_ns, &bytes);
                }
            }
            let (mut come, fly): (Vec<_>, Vec<_>) =
                std::mem::take(&mut self.flying).into_iter().partition(|(at, _)| *at <= now_ns);
            self.flying = fly;
            come.sort_by_key(|(at_ns, _)| *at_ns);
            for (at_ns, bytes) in come {
                if self.copies.is_new(&bytes) {
                    let _ = self.follower.receive(at_ns, &bytes);
                }
            }
            let mut questions = self.follower.time_requests(now_ns);
            questions.extend(self.follower.report(now_ns));
            for bytes in questions {
                // The first copy is answered.
                let Some(at_ns) = self.arrivals(1, now_ns).into_iter().min() else {
                    continue;
                };
                for lead in leads.iter_mut() {
                    let heard = lead.clock(at_ns) + lead.ahead_ns;
                    let out = lead.leader.receive(heard, &bytes, || heard + 1000);
                    if let Ok(Outgoing::Reply(_, messages)) = out {
                        for message in messages {
                            self.fly(at_ns, &message);
                        }
                    }
                }
            }
            self.cycle();
        }
    }

    /// One control cycle: idle fades within a second.
    fn cycle(&mut self) {
        let now_ns = self.now_ns;
        let hidden = self.idle >= 1.0;
        let shown = Some(self.shown);
        while let Some(released) = self.follower.next_frame(now_ns, shown, hidden) {
            let offset_s = released.motion.time_s - released.music.time_s;
            assert_eq!(offset_s, 0.0);
            self.frames.push((released.motion.time_s, seconds(now_ns)));
        }
        let away = self.follower.is_leaving(now_ns) || self.follower.due(now_ns).is_none();
        self.idle = (self.idle + if away { 0.01 } else { -0.01 }).clamp(0.0, 1.0);
        let due_s = self.follower.due(now_ns).map(|due| due.at(now_ns));
        self.shown = self.playback.next(due_s, hidden);
    }

    /// Seconds by which what is shown differs from the leader's music.
    fn error_s(&self, lead: &Lead) -> f64 {
        self.shown - self.follower.base_s - seconds(lead.clock(self.now_ns))
    }
}

#[test]
fn a_follower_is_on_time_through_delay_jitter_and_loss() {
    for (delay_ms, loss) in [(1, 0.0), (20, 0.05), (50, 0.05)] {
        let (mut world, mut lead) = (World::new(delay_ms, loss), Lead::new(0, 1));
        world.run(3.0, &mut [&mut lead]);
        assert_eq!(world.idle, 0.0, "on the beat within 3 s, {delay_ms} ms");
        let mut worst = 0.0_f64;
        for _ in 0..300 {
            world.run(0.1, &mut [&mut lead]);
            worst = worst.max(world.error_s(&lead).abs());
        }
        assert!(worst < 0.003, "{delay_ms} ms {loss}: {worst}");
        let figures = world.follower.stats();
        assert_eq!((figures.joined, figures.left, figures.lost), (1, 0, 0));
        let steps = world.frames.windows(2).map(|w| w[1].0 - w[0].0);
        assert!(steps.into_iter().all(|s| (s - 0.05).abs() < 1e-6));
        let late = world.frames[20..].iter().filter(|(motion_s, at_s)| {
            let needed_s = seconds(lead.clock((*at_s * 1e9) as i64)) + REACH_S;
            *motion_s < world.follower.base_s + needed_s - 0.05
        });
        assert_eq!(late.count(), 0, "{delay_ms} ms {loss}");
    }
}

#[test]
fn what_stalls_one_connection_is_ridden_out_by_another() {
    let [one, two] = [1, 2].map(|connections| {
        let (mut world, mut lead) = (World::stalling(50, 0.05, connections), Lead::new(0, 1));
        world.run(5.0, &mut [&mut lead]);
        let (mut faded_s, before) = (0.0, world.follower.stats().dropped);
        for _ in 0..2400 {
            world.run(0.05, &mut [&mut lead]);
            faded_s += if world.idle > 0.0 { 0.05 } else { 0.0 };
        }
        let figures = world.follower.stats();
        assert_eq!(figures.dropped, before, "second copies are no replays");
        let error_s = world.error_s(&lead);
        assert!(error_s.abs() < 0.003, "{error_s}");
        (faded_s, figures.lead_s)
    });
    assert!(one.0 > 1.0, "its one connection stalls: {one:?}");
    assert_eq!(two.0, 0.0);
    assert!(two.1 < one.1, "frames need not be so early: {one:?} {two:?}");
}

#[test]
fn the_lead_grows_with_the_way() {
    let mut leads = [5, 200].map(|delay_ms| {
        let (mut world, mut lead) = (World::new(delay_ms, 0.0), Lead::new(0, 1));
        world.run(10.0, &mut [&mut lead]);
        world.follower.stats().lead_s
    });
    leads[0] += 0.1;
    assert!(leads[0] < leads[1], "{leads:?}");
}

#[test]
fn a_lost_leader_is_left_within_half_a_second_and_joined_again() {
    let (mut world, mut lead) = (World::new(10, 0.0), Lead::new(0, 1));
    world.run(5.0, &mut [&mut lead]);
    assert!(!world.follower.is_leaving(world.now_ns));
    world.run(0.5, &mut []);
    assert!(world.follower.is_leaving(world.now_ns));
    world.run(3.0, &mut []);
    assert_eq!(world.idle, 1.0);
    // Cut off, not dead: the music went on.
    world.run(2.5, &mut [&mut lead]);
    assert_eq!(world.idle, 0.0);
    assert!(world.error_s(&lead).abs() < 0.003);
    assert_eq!(world.follower.stats().joined, 2);
    // A sign of life goes, but the leader is heard by another connection.
    world.follower.note_leader_gone(lead.leader.instance());
    world.run(1.0, &mut [&mut lead]);
    assert_eq!((world.idle, world.follower.stats().joined), (0.0, 2));
    // It goes, and nothing more is heard: sooner than by silence alone.
    world.run(0.05, &mut []);
    world.follower.note_leader_gone(lead.leader.instance());
    world.run(0.15, &mut []);
    assert!(world.follower.is_leaving(world.now_ns));
}

#[test]
fn a_silence_that_ends_in_time_is_a_dip_in_the_dance_and_no_more() {
    let (mut world, mut lead) = (World::new(10, 0.0), Lead::new(0, 1));
    world.run(5.0, &mut [&mut lead]);
    let mut faded = 0.0_f64;
    for seconds in [0.6, 1.2] {
        world.run(seconds, &mut []);
        faded = faded.max(world.idle);
        world.run(1.0, &mut [&mut lead]);
        assert_eq!(world.idle, 0.0);
    }
    assert!((0.2..0.6).contains(&faded), "{faded}");
    let figures = world.follower.stats();
    assert_eq!((figures.joined, figures.left, figures.lost), (1, 0, 0));
    let steps = world.frames.windows(2).map(|w| w[1].0 - w[0].0);
    assert!(steps.into_iter().all(|s| (s - 0.05).abs() < 1e-6));
    assert!(world.error_s(&lead).abs() < 0.003);
}

#[test]
fn the_next_leader_is_followed_and_the_old_one_never_again() {
    let (mut world, mut first) = (World::new(10, 0.0), Lead::new(0, 1));
    world.run(5.0, &mut [&mut first]);
    world.run(2.0, &mut []);
    let (old, mut second) = (world.frames.len(), Lead::new(0, 2));
    second.sent = 0;
    world.run(4.0, &mut [&mut second]);
    assert_eq!(world.follower.leader(), Some(second.leader.instance()));
    assert!(world.error_s(&second).abs() < 0.003);
    let motion = |i: usize| world.frames[i].0;
    assert!(motion(old) - motion(old - 1) > 1.0, "motion begins anew");
    let replayed = world.follower.stats().dropped.replayed;
    world.run(1.0, &mut [&mut first, &mut second]);
    assert_eq!(world.follower.leader(), Some(second.leader.instance()));
    assert!(world.follower.stats().dropped.replayed > replayed + 10);
}

#[test]
fn a_second_leader_is_not_heeded_unless_it_took_over() {
    let (mut world, mut first) = (World::new(10, 0.0), Lead::new(0, 1));
    let mut rival = Lead::new(0, 2);
    world.run(5.0, &mut [&mut first]);
    world.run(5.0, &mut [&mut first, &mut rival]);
    assert_eq!(world.follower.leader(), Some(first.leader.instance()));
    assert_eq!(world.idle, 0.0);
    assert!(world.follower.stats().dropped.rivals > 50);
    let mut next = Lead::new(1, 3);
    world.run(5.0, &mut [&mut first, &mut next]);
    assert_eq!(world.follower.leader(), Some(next.leader.instance()));
    assert_eq!(world.idle, 0.0);
}

#[test]
fn a_rival_does_not_take_over_in_a_short_silence() {
    let (mut world, mut first) = (World::new(10, 0.0), Lead::new(0, 1));
    let mut rival = Lead::new(0, 2);
    world.run(5.0, &mut [&mut first]);
    world.run(0.9, &mut [&mut rival]);
    assert!(world.idle > 0.2 && world.follower.candidate.is_some());
    world.run(5.0, &mut [&mut first, &mut rival]);
    assert_eq!(world.follower.leader(), Some(first.leader.instance()));
    assert_eq!(world.idle, 0.0);
}

#[test]
fn a_recording_of_a_leader_moves_nobody() {
    let (mut world, mut lead) = (World::new(10, 0.0), Lead::new(9, 1));
    let recorded: Vec<Vec<u8>> = (1..500).flat_map(|t| lead.send(t * STEP_NS)).collect();
    for (i, bytes) in recorded.iter().cycle().take(2000).enumerate() {
        let at_ns = i as i64 * STEP_NS;
        let _ = world.follower.receive(at_ns, bytes);
        world.follower.time_requests(at_ns);
        assert_eq!(world.follower.next_frame(at_ns, None, true), None);
    }
    assert_eq!(world.follower.leader(), None);
    assert!(world.follower.stats().dropped.replayed > 1000);
}

#[test]
fn each_stop_of_any_leader_is_obeyed_once() {
    let (mut world, mut lead) = (World::new(10, 0.0), Lead::new(0, 1));
    let mut other = Lead::new(0, 2);
    other.leader.stop();
    world.run(5.0, &mut [&mut lead]);
    let mut stops_after = |message: &[u8]| {
        world.follower.receive(world.now_ns, message).unwrap();
        world.follower.stops()
    };
    assert_eq!(stops_after(&other.leader.stop_message()), 1);
    for number in 2..5 {
        lead.leader.stop();
        let message = lead.leader.stop_message();
        assert_eq!([stops_after(&message), stops_after(&message)], [number, number]);
    }
}

#[test]
fn a_canon_is_so_many_beats_late() {
    let (mut world, mut lead) = (World::new(10, 0.0), Lead::new(0, 1));
    world.run(5.0, &mut [&mut lead]);
    let cue = Message::Cue(Cue {
        nonce: 1,
        follower: "neck".into(),
        role: Role { canon_beats: Some(3.0), ..Role::default() },
    });
    let out = lead.leader.receive(0, &cue.encode(), || 0).unwrap();
    let Outgoing::Cued { roles: bytes, .. } = out else { panic!("roles") };
    world.follower.receive(world.now_ns, &bytes).unwrap();
    world.run(12.0, &mut [&mut lead]);
    let error_s = world.error_s(&lead);
    assert!((error_s + 1.5).abs() < 0.003, "{error_s}");
    assert_eq!(world.follower.stats().left, 0, "the dance slowed down");
}

#[test]
fn a_cue_outlives_the_leader_that_it_was_given_to() {
    let (mut world, mut first) = (World::new(10, 0.0), Lead::new(0, 1));
    let mut second = Lead::new(0, 2);
    let cue = |role| {
        let follower = "neck".into();
        let nonce = 1;
        let cue = Cue { nonce, follower, role };
        Message::Cue(cue).encode()
    };
    let give = |world: &mut World, lead: &mut Lead, role| {
        let Ok(Outgoing::Cued { roles: bytes, .. }) = lead.leader.receive(0, &cue(role), || 0)
        else {
            panic!("roles")
        };
        world.follower.receive(world.now_ns, &bytes).unwrap();
    };
    let (half, mirrored) = (Some(0.5), Some(true));
    world.run(5.0, &mut [&mut first]);
    let smaller = Role { amplitude: half, ..Role::default() };
    give(&mut world, &mut first, smaller);
    assert_eq!(world.follower.role().amplitude, half);
    world.run(2.0, &mut []);
    world.run(4.0, &mut [&mut second]);
    assert_eq!(world.follower.leader(), Some(second.leader.instance()));
    let bytes = second.leader.roles(); // it knows of no cue
    world.follower.receive(world.now_ns, &bytes).unwrap();
    assert_eq!(world.follower.role().amplitude, half);
    let mirror = Role { mirror: mirrored, ..Role::default() };
    give(&mut world, &mut second, mirror);
    let role = world.follower.role();
    assert_eq!((role.amplitude, role.mirror), (half, mirrored));
}

#[test]
fn who_comes_late_to_a_long_lead_is_sent_what_is_due_now() {
    let (mut world, mut lead) = (World::new(20, 0.0), Lead::new(0, 1));
    let needy = crate::messages::FollowerReport {
        follower: 9,
        instance: lead.leader.instance(),
        number: 1,
        needed_ms: 3000,
        transit_ms: 0,
        lost: 0,
        name: "needy".into(),
        style: String::new(),
    };
    world.now_ns = 10 * SECOND;
    let heard_ns = lead.clock(world.now_ns) + lead.ahead_ns;
    let report = Message::FollowerReport(needy).encode();
    lead.leader.receive(heard_ns, &report, || heard_ns).unwrap();
    lead.send(world.now_ns);
    lead.send(world.now_ns); // everything until 13 s, to nobody
    assert!(lead.sent >= 260, "{}", lead.sent);
    world.run(1.5, &mut [&mut lead]);
    let first_s = world.frames[0].0 - world.follower.base_s;
    assert!((9.0..11.5).contains(&first_s), "{first_s}");
    assert!(world.error_s(&lead).abs() < 0.003);
}

#[test]
fn what_is_damaged_is_counted_and_dropped() {
    let (mut world, mut lead) = (World::new(10, 0.0), Lead::new(0, 1));
    world.run(3.0, &mut [&mut lead]);
    let before = world.follower.stats().dropped;
    let mut frames = lead.send(100 * SECOND).pop().unwrap();
    frames[2] = 77;
    for bytes in [&b"hello"[..], &frames, &vec![0; 1 << 20], &frames[..40]] {
        assert!(world.follower.receive(world.now_ns, bytes).is_err());
    }
    let answer = Message::TimeReply(crate::messages::TimeReply {
        instance: lead.leader.instance(),
        nonce: 5,
        received_ns: 0,
        replied_ns: 0,
    });
    world.follower.receive(world.now_ns, &answer.encode()).unwrap();
    let after = world.follower.stats().dropped;
    assert_eq!(after.malformed, before.malformed + 1);
    assert_eq!(after.huge, before.huge + 1);
    assert_eq!(after.other_version, before.other_version + 2);
    assert_eq!(after.unasked, before.unasked + 1);
    world.run(1.0, &mut [&mut lead]);
    assert!(world.error_s(&lead).abs() < 0.003);
}
