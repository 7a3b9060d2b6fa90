use super::*;
use proptest::prelude::*;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use servodance_types::{Beat, Contacts, JOINT_COUNT, Posture};

fn frame(index: i64) -> StageFrame {
    StageFrame {
        present_ns: 50_000_000 * index,
        music_ns: 50_000_000 * index - 7,
        beat: Beat {
            phase: 0.25,
            tempo_bpm: 120.0,
            confidence: 0.5,
            lock: servodance_types::BeatLock::Holding,
            ..Beat::default()
        },
        presence: 0.75,
        level: -1.5,
        contacts: Contacts { left: false, right: true },
        positions: std::array::from_fn(|j| [j as f32, 0.5, -(index as f32)]),
        posture: Posture {
            heading_rad: -3.0,
            nod_rad: [0.1, 0.2],
            sway: [0.3, 0.4],
            feet: [[0.5, 0.6], [0.7, 0.8]],
            floor_m: -0.25,
        },
    }
}

/// One message of each kind.
fn messages() -> Vec<Message> {
    let role = Role {
        mirror: Some(true),
        canon_beats: Some(4.0),
        style: Some("hype".into()),
        ..Role::default()
    };
    vec![
        Message::Frames(Frames {
            instance: 7,
            term: 1,
            number: 41,
            sent_ns: -5,
            lead_ms: 800,
            channel: 2,
            style: "salsa".into(),
            frames: (0..3).map(frame).collect(),
        }),
        Message::TimeRequest(TimeRequest { follower: 1, instance: 2, nonce: 3, resend: Some(1) }),
        Message::TimeReply(TimeReply { instance: 2, nonce: 3, received_ns: 4, replied_ns: 5 }),
        Message::Roles(Roles {
            instance: 7,
            term: 0,
            number: 9,
            roles: vec![("all".into(), Role::default()), ("op3-2".into(), role.clone())],
        }),
        Message::StageStop(StageStop { instance: 7, number: 1 }),
        Message::Cue(Cue { nonce: 11, follower: "neck".into(), role }),
        Message::CueReply(CueReply { nonce: 11, reached: 1, names: vec!["neck".into()] }),
        Message::FollowerReport(FollowerReport {
            follower: 1,
            instance: 7,
            number: 2,
            needed_ms: 650,
            transit_ms: 90,
            lost: 3,
            name: "neck".into(),
            style: String::new(),
        }),
    ]
}

#[test]
fn what_is_written_is_read_and_what_is_cut_off_or_longer_is_not() {
    for message in messages() {
        let bytes = message.encode();
        assert_eq!(Message::decode(&bytes).as_ref(), Ok(&message));
        for end in 0..bytes.len() {
            assert!(Message::decode(&bytes[..end]).is_err(), "{message:?} {end}");
        }
        let longer = [bytes, vec![0]].concat();
        assert_eq!(Message::decode(&longer), Err(MessageError::Length));
    }
}

#[test]
fn the_bytes_of_a_message_stay_as_they_are_documented() {
    let bytes = messages()[0].encode();
    assert_eq!(bytes[..4], [b's', b'd', VERSION, 1]);
    assert_eq!(bytes[4..12], 7u64.to_le_bytes());
    assert_eq!(bytes[12..16], 1u32.to_le_bytes());
    assert_eq!(bytes[16..24], 41u64.to_le_bytes());
    assert_eq!(bytes[24..32], (-5i64).to_le_bytes());
    assert_eq!(bytes[32..35], [0x20, 0x03, 2]);
    assert_eq!(bytes[35..42], [5, b's', b'a', b'l', b's', b'a', 3]);
    assert_eq!(bytes.len(), 42 + 3 * 342);
    let newest = &bytes[42 + 2 * 342..];
    assert_eq!(newest[..8], 100_000_000i64.to_le_bytes());
    assert_eq!(newest[16..20], 0.25f32.to_le_bytes());
    assert_eq!(newest[36..38], [2, 2]);
    assert_eq!(newest[38 + 21 * 12..][..4], 21f32.to_le_bytes());
    let posture = [-3.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, -0.25f32];
    let posture = posture.map(f32::to_le_bytes);
    assert_eq!(newest[302..], *posture.as_flattened());
}

#[test]
fn another_version_is_refused_and_says_so() {
    let mut bytes = messages()[1].encode();
    bytes[2] = 9;
    let error = Message::decode(&bytes).unwrap_err();
    assert_eq!(error, MessageError::Version(9));
    assert!(error.to_string().contains("format 9"), "{error}");
}

#[test]
fn huge_foreign_and_impossible_messages_are_refused() {
    let huge = vec![0; MAX_BYTES + 1];
    assert_eq!(Message::decode(&huge), Err(MessageError::Huge(huge.len())));
    assert_eq!(Message::decode(b"GET /"), Err(MessageError::Foreign));
    assert_eq!(Message::decode(&[b's', b'd', VERSION, 99]), Err(MessageError::Kind(99)));
    let mut nan = frame(0);
    nan.positions[JOINT_COUNT - 1][2] = f32::NAN;
    let mut far = frame(0);
    far.present_ns = i64::MIN;
    let mut turned = frame(0);
    turned.posture.heading_rad = 1e9;
    for (bad, what) in [(nan, "a joint"), (far, "a time"), (turned, "a heading")] {
        let Message::Frames(mut frames) = messages().swap_remove(0) else { unreachable!() };
        frames.frames[1] = bad;
        let bytes = Message::Frames(frames).encode();
        assert_eq!(Message::decode(&bytes), Err(MessageError::Value(what)));
    }
}

/// What was read can be written again, whatever it was.
fn survives(bytes: &[u8]) {
    if let Ok(message) = Message::decode(bytes) {
        assert_eq!(Message::decode(&message.encode()), Ok(message));
    }
}

#[test]
fn a_million_damaged_messages_do_no_harm() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let whole: Vec<Vec<u8>> = messages().iter().map(Message::encode).collect();
    let mut bytes = Vec::new();
    for round in 0..1_000_000_usize {
        bytes.clone_from(&whole[round % whole.len()]);
        for _ in 0..rng.random_range(1..4) {
            // Mostly where the structure is, sometimes anywhere.
            let reach = if rng.random() { 64 } else { bytes.len() };
            let at = rng.random_range(0..reach.min(bytes.len()));
            bytes[at] = rng.random();
        }
        if rng.random_ratio(1, 8) {
            bytes.truncate(rng.random_range(0..bytes.len()));
        }
        survives(&bytes);
    }
}

proptest! {
    #[test]
    fn any_bytes_behind_a_good_beginning_do_no_harm(
        kind in 0..9u8,
        body in prop::collection::vec(any::<u8>(), 0..2000),
    ) {
        survives(&[&[b's', b'd', VERSION, kind], body.as_slice()].concat());
    }
}
