//! Places for connections: strangers wait at the door, who holds a token has a place.
//!
//! Whose connection it is, only its first request tells. Until then it is a stranger's, for
//! [`STRANGER_S`] at most; where too many wait, of one host or of all, the one that has waited
//! longest goes, not the new one: a page sends its request at once. With a token it gets a
//! place of those that are kept for operators or for the audience.

use super::guard::Role;
use std::collections::{HashMap, VecDeque};
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::oneshot;

/// A request must show its token within so long, seconds.
pub const STRANGER_S: u64 = 2;
/// A request and its answer take no longer: the music over a slow network. What is sent to
/// us may pause no longer.
const REQUEST: Duration = Duration::from_secs(60);
const STRANGERS: usize = 64;
const STRANGERS_OF_A_HOST: usize = 32;
const OPERATORS: usize = 32;
const AUDIENCE: usize = 160;
/// Of one host, other than this machine itself.
const AUDIENCE_OF_A_HOST: usize = 16;

/// All connections of the server.
#[derive(Debug, Default)]
pub struct Connections(Mutex<Places>);

#[derive(Debug, Default)]
struct Places {
    newest: u64,
    /// Oldest first.
    strangers: VecDeque<Stranger>,
    operators: usize,
    audience: usize,
    audience_of: HashMap<IpAddr, usize>,
}

#[derive(Debug)]
struct Stranger {
    id: u64,
    host: IpAddr,
    turn_away: oneshot::Sender<()>,
}

/// One connection, until it is dropped.
#[derive(Debug)]
pub struct Connection {
    all: Arc<Connections>,
    id: u64,
    host: IpAddr,
    role: Mutex<Option<Role>>,
    /// When it began, or the newest piece of what it sends came.
    progress: Mutex<Instant>,
}

impl Connections {
    /// A new connection, and word for when it must make room for a newer one.
    pub fn enter(self: &Arc<Self>, host: IpAddr) -> (Connection, oneshot::Receiver<()>) {
        let host = host.to_canonical();
        let mut places = self.places();
        let of_host = places.strangers.iter().filter(|stranger| stranger.host == host).count();
        let oldest = match of_host >= STRANGERS_OF_A_HOST {
            true => places.strangers.iter().position(|stranger| stranger.host == host),
            false => (places.strangers.len() >= STRANGERS).then_some(0),
        };
        if let Some(oldest) = oldest.and_then(|place| places.strangers.remove(place)) {
            let _ = oldest.turn_away.send(()); // it may have gone by itself
        }
        let (turn_away, turned_away) = oneshot::channel();
        places.newest += 1;
        let id = places.newest;
        places.strangers.push_back(Stranger { id, host, turn_away });
        drop(places);
        let (all, role) = (Arc::clone(self), Mutex::default());
        let progress = Mutex::new(Instant::now());
        (Connection { all, id, host, role, progress }, turned_away)
    }

    fn places(&self) -> MutexGuard<'_, Places> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Connection {
    /// A piece of what is sent to us has come.
    pub fn goes_on(&self, now: Instant) {
        *self.progress.lock().unwrap_or_else(PoisonError::into_inner) = now;
    }

    /// How much longer it may take without progress.
    pub fn left(&self, now: Instant) -> Duration {
        let progress = *self.progress.lock().unwrap_or_else(PoisonError::into_inner);
        REQUEST.saturating_sub(now.saturating_duration_since(progress))
    }

    /// Gives a place to who has shown a token; false if there is none.
    pub fn admit(&self, role: Role) -> bool {
        let mut held = self.role.lock().unwrap_or_else(PoisonError::into_inner);
        let mut places = self.all.places();
        if held.is_some() {
            return true;
        }
        let of_host = places.audience_of.get(&self.host).copied().unwrap_or_default();
        let room = match role {
            Role::Operator => places.operators < OPERATORS,
            Role::Audience => {
                let few = of_host < AUDIENCE_OF_A_HOST || self.host.is_loopback();
                places.audience < AUDIENCE && few
            }
        };
        if room {
            places.strangers.retain(|stranger| stranger.id != self.id);
            *held = Some(role);
            match role {
                Role::Operator => places.operators += 1,
                Role::Audience => {
                    places.audience += 1;
                    places.audience_of.insert(self.host, of_host + 1);
                }
            }
        }
        room
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        let held = *self.role.get_mut().unwrap_or_else(PoisonError::into_inner);
        let mut places = self.all.places();
        match held {
            None => places.strangers.retain(|stranger| stranger.id != self.id),
            Some(Role::Operator) => places.operators -= 1,
            Some(Role::Audience) => {
                places.audience -= 1;
                let left = places.audience_of.get(&self.host).map_or(0, |count| count - 1);
                match left {
                    0 => places.audience_of.remove(&self.host),
                    left => places.audience_of.insert(self.host, left),
                };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn host(last: u8) -> IpAddr {
        IpAddr::from([192, 168, 1, last])
    }

    #[test]
    fn a_slow_song_has_time_as_long_as_it_goes_on() {
        let (connection, _) = Arc::new(Connections::default()).enter(host(1));
        let began = Instant::now();
        assert!(connection.left(began) <= REQUEST);
        for piece in 1..10 {
            let now = began + piece * REQUEST * 2 / 3;
            assert!(!connection.left(now).is_zero(), "piece {piece}");
            connection.goes_on(now);
        }
        assert!(connection.left(began + 7 * REQUEST).is_zero());
    }

    #[test]
    fn a_flood_of_strangers_turns_its_own_oldest_away_and_nobody_else() {
        let all = Arc::new(Connections::default());
        let (_honest, mut turned_away) = all.enter(host(1));
        let mut flood: Vec<_> = (0..1000).map(|_| all.enter(host(2))).collect();
        assert!(turned_away.try_recv().is_err(), "another host's flood");
        let gone = flood.iter_mut().map(|(_, away)| away.try_recv()).filter(Result::is_ok).count();
        assert_eq!(gone, 1000 - STRANGERS_OF_A_HOST);
        assert!(flood[999].0.admit(Role::Operator), "the newest still has its chance");
        let _others: Vec<_> = (3..200).map(|last| all.enter(host(last))).collect();
        assert!(turned_away.try_recv().is_ok(), "the oldest of all goes");
        drop(flood);
        assert_eq!(all.places().operators, 0);
    }

    #[test]
    fn operators_have_places_however_large_the_audience_is() {
        let all = Arc::new(Connections::default());
        let enter = |last, role| {
            let (connection, _) = all.enter(host(last));
            connection.admit(role).then_some(connection)
        };
        let of_one: Vec<_> = (0..20).filter_map(|_| enter(1, Role::Audience)).collect();
        assert_eq!(of_one.len(), AUDIENCE_OF_A_HOST);
        let many: Vec<_> = (2..=255).filter_map(|last| enter(last, Role::Audience)).collect();
        assert_eq!(of_one.len() + many.len(), AUDIENCE);
        let operators: Vec<_> = (0..40).filter_map(|_| enter(1, Role::Operator)).collect();
        assert_eq!(operators.len(), OPERATORS);
        drop((of_one, many, operators));
        assert!(enter(1, Role::Audience).is_some());
        let places = all.places();
        assert!(places.audience_of.is_empty() && places.strangers.is_empty());
    }
}
