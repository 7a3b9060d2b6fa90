use super::*;

const SECOND: i64 = 1_000_000_000;

fn report(leader: &Leader, follower: u64, number: u32, needed_ms: u16) -> Vec<u8> {
    let report = FollowerReport {
        follower,
        instance: leader.instance(),
        number,
        needed_ms,
        transit_ms: 0,
        lost: 0,
        name: "neck".into(),
        style: String::new(),
    };
    Message::FollowerReport(report).encode()
}

#[test]
fn the_lead_is_that_of_the_neediest_and_shrinks_slowly() {
    let mut leader = Leader::new(0, [1; 32]);
    assert_eq!(leader.lead_s(0), LEAST_S);
    for (follower, needed_ms) in [(1, 700), (2, 1200)] {
        let bytes = report(&leader, follower, 1, needed_ms);
        leader.receive(0, &bytes, || 0).unwrap();
    }
    assert_eq!(leader.lead_s(SECOND), 1.2);
    let bytes = report(&leader, 2, 2, 60_000);
    leader.receive(SECOND, &bytes, || 0).unwrap();
    assert_eq!(leader.lead_s(2 * SECOND), MOST_S);
    leader.receive(3 * SECOND, &bytes, || 0).unwrap();
    assert_eq!(leader.dropped, 1, "a report that was seen before");
    let later = leader.lead_s(22 * SECOND);
    assert!((later - (MOST_S - 20.0 * SHORTER_PER_S)).abs() < 1e-9, "{later}");
    assert_eq!(leader.followers().count(), 0, "gone");
}

#[test]
fn a_cue_is_heeded_once_and_a_role_of_ones_own_goes_before_that_of_all() {
    let mut leader = Leader::new(0, [1; 32]);
    let report = report(&leader, 1, 1, 0);
    leader.receive(0, &report, || 0).unwrap();
    let mut cue = |nonce, follower: &str, amplitude| {
        let role = Role { amplitude: Some(amplitude), ..Role::default() };
        let follower = follower.to_owned();
        let bytes = Message::Cue(Cue { nonce, follower, role }).encode();
        leader.receive(0, &bytes, || 0).unwrap()
    };
    let reached = |out| {
        let Outgoing::Cued { nonce, reply, roles } = out else { panic!("{out:?}") };
        let Ok(Message::CueReply(reply)) = Message::decode(&reply) else { panic!("a reply") };
        assert_eq!((reply.nonce, reply.names), (nonce, vec!["neck".to_owned()]));
        (reply.reached, roles)
    };
    assert_eq!(reached(cue(1, "neck", 0.5)).0, 1);
    assert_eq!(cue(1, "neck", 0.5), Outgoing::Nothing);
    assert_eq!(reached(cue(3, "nobody", 0.9)).0, 0);
    let (all, bytes) = reached(cue(2, "all", 0.2));
    assert_eq!(all, 1);
    let Ok(Message::Roles(roles)) = Message::decode(&bytes) else { panic!("roles") };
    let amplitudes = roles.roles.iter().map(|(n, r)| (n.as_str(), r.amplitude));
    let wanted = [("all", Some(0.2)), ("neck", Some(0.2))];
    assert_eq!(amplitudes.collect::<Vec<_>>(), wanted);
}

fn frame(n: i64) -> StageFrame {
    StageFrame {
        present_ns: n,
        music_ns: n,
        beat: Default::default(),
        presence: 0.0,
        level: 0.0,
        contacts: Default::default(),
        positions: Default::default(),
        posture: Default::default(),
    }
}

#[test]
fn who_comes_late_gets_what_was_sent_and_is_not_over() {
    let mut leader = Leader::new(0, [1; 32]);
    for n in 0..100 {
        leader.frames(0, 0, "hype", frame(n * SECOND / 20));
    }
    let question =
        TimeRequest { follower: 7, instance: leader.instance(), nonce: 1, resend: Some(0) };
    let bytes = Message::TimeRequest(question).encode();
    let told = leader.receive(3 * SECOND, &bytes, || 0).unwrap();
    let Outgoing::Reply(7, messages) = told else { panic!("an answer") };
    let numbers = messages[1..].iter().flat_map(|bytes| {
        let Ok(Message::Frames(frames)) = Message::decode(bytes) else { panic!("frames") };
        let numbers: Vec<u64> = frames.numbered().map(|(number, _)| number).collect();
        numbers
    });
    assert_eq!(numbers.collect::<Vec<_>>(), (50..100).collect::<Vec<_>>());
    let bytes = Message::TimeRequest(TimeRequest { resend: None, ..question }).encode();
    let told = leader.receive(3 * SECOND, &bytes, || 0).unwrap();
    assert!(matches!(told, Outgoing::Reply(7, messages) if messages.len() == 1));
}

#[test]
fn every_message_carries_the_frames_before_it() {
    let mut leader = Leader::new(0, [1; 32]);
    let sent: Vec<Vec<u64>> = (0..5)
        .map(|n| {
            let bytes = leader.frames(n, 0, "hype", frame(n));
            let Ok(Message::Frames(frames)) = Message::decode(&bytes) else { panic!("frames") };
            frames.numbered().map(|(number, _)| number).collect()
        })
        .collect();
    assert_eq!(sent[0], [0]);
    assert_eq!(sent[4], [2, 3, 4]);
}
