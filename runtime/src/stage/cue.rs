//! Tells a follower, by its leader, to dance otherwise from now on.

use super::{keys, open};
use anyhow::{Context, bail};
use rand::Rng;
use servodance_stage::messages::is_valid_name;
use servodance_stage::messages::{Cue, CueReply, Message, Role};
use servodance_stage::net::{NetConfig, NetSession, StageKeys};
use std::sync::mpsc::channel;
use std::time::Duration;

/// How long a leader is looked for.
const LOOK: Duration = Duration::from_millis(400);
const LOOKS: usize = 10;
/// How long the leader's answer may take.
const ANSWER: Duration = Duration::from_secs(2);

/// Sends the cue to the leader of the stage. Fails where nobody leads, and where the cue
/// reaches no follower.
pub fn cue(place: &NetConfig, stage: &str, follower: &str, role: Role) -> anyhow::Result<()> {
    let role = role.checked()?;
    if role == Role::default() {
        bail!("nothing to change: give --mirror, --amplitude, --canon or --style");
    }
    if !is_valid_name(follower) {
        bail!("\"{follower}\" cannot be the name of a follower; `all` means everybody");
    }
    let keys = keys(stage)?;
    let net = open(place)?;
    for _ in 0..LOOKS {
        if net.live_keys(&keys.leaders(), LOOK)?.is_empty() {
            std::thread::sleep(LOOK / 4);
            continue;
        }
        let cue = Cue { nonce: rand::rng().random(), follower: follower.to_owned(), role };
        return reached(&ask(&net, &keys, cue)?, follower);
    }
    bail!("nobody leads the stage \"{stage}\" at {place}")
}

fn ask(net: &NetSession, keys: &StageKeys, cue: Cue) -> anyhow::Result<CueReply> {
    let nonce = cue.nonce;
    let (sender, inbox) = channel();
    let _subscriber = net.subscribe(&keys.to_follower(nonce), move |bytes| {
        if let Ok(Message::CueReply(reply)) = Message::decode(bytes) {
            let _ = sender.send(reply);
        }
    })?;
    net.put(&keys.cue(), Message::Cue(cue).encode())?;
    inbox.recv_timeout(ANSWER).context("the leader did not answer: it may have lost the cue")
}

fn reached(reply: &CueReply, follower: &str) -> anyhow::Result<()> {
    match (reply.reached, reply.names.as_slice()) {
        (0, []) => bail!("nobody follows: the cue changes nothing"),
        (0, names) => bail!("nobody is called \"{follower}\"; there are: {}", names.join(", ")),
        _ => Ok(()),
    }
}
