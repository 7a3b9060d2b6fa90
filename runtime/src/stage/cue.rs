//! Tells a follower, by its leader, to dance otherwise from now on.

use super::{keys, open};
use anyhow::bail;
use rand::Rng;
use servodance_stage::messages::is_valid_name;
use servodance_stage::messages::{Cue, Message, Role};
use servodance_stage::net::NetConfig;
use std::time::Duration;

/// How long a leader is looked for.
const LOOK: Duration = Duration::from_millis(400);
const LOOKS: usize = 10;
/// What is said needs this long to be on its way.
const LEAVE: Duration = Duration::from_millis(200);

/// Sends the cue to the leader of the stage.
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
        let message =
            Message::Cue(Cue { nonce: rand::rng().random(), follower: follower.to_owned(), role });
        net.put(&keys.cue(), message.encode())?;
        std::thread::sleep(LEAVE);
        return Ok(());
    }
    bail!("nobody leads the stage \"{stage}\" at {}", whom(place))
}

fn whom(place: &NetConfig) -> String {
    match place.connect.as_slice() {
        [] => servodance_stage::net::LOOPBACK.to_owned(),
        endpoints => endpoints.join(", "),
    }
}
