//! Access control: a request needs a token, and comes from the page or no page.
//!
//! - Every address begins with a token, 128 random bits of each run; other users
//!   and web pages of this machine do not know it. There are two: the operator's
//!   link may command, the audience's link may only watch.
//! - `Host` must be an address or a name of this machine: a foreign name that
//!   was made to point here (DNS rebinding) is refused.
//! - `Origin`, which browsers add, must be this page's own.

use rand::RngCore;
use std::net::IpAddr;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// What a link is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    Operator,
    Audience,
}

/// The tokens of the two links.
#[derive(Debug)]
pub struct Tokens {
    pub operator: AccessToken,
    pub audience: AccessToken,
    /// Leads to the operator's link once: for the command line of a browser, which other
    /// users of this machine can read.
    once: Mutex<Option<(AccessToken, Instant)>>,
}

/// How long a link for once is good, seconds.
const ONCE_S: f64 = 30.0;

impl Tokens {
    pub fn random() -> Self {
        let (operator, audience) = (AccessToken::random(), AccessToken::random());
        Self { operator, audience, once: Mutex::default() }
    }

    /// A token that leads to the operator's link once; an older one is void.
    pub fn for_once(&self) -> String {
        let token = AccessToken::random();
        let text = token.text().to_owned();
        *self.once() = Some((token, Instant::now()));
        text
    }

    /// Whether this is the token for once, which is void from now on.
    pub fn redeem(&self, text: &str) -> bool {
        let is_it = |(token, made): &mut (AccessToken, Instant)| {
            token.is(text) && made.elapsed().as_secs_f64() < ONCE_S
        };
        self.once().take_if(is_it).is_some()
    }

    fn once(&self) -> MutexGuard<'_, Option<(AccessToken, Instant)>> {
        self.once.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What the holder of a token may do.
    pub fn role(&self, token: &str) -> Option<Role> {
        // Both are looked at: the answer takes as long whichever it is.
        match (self.operator.is(token), self.audience.is(token)) {
            (true, _) => Some(Role::Operator),
            (_, true) => Some(Role::Audience),
            _ => None,
        }
    }
}

#[derive(Clone, Debug)]
pub struct AccessToken(String);

impl AccessToken {
    pub fn random() -> Self {
        let mut bytes = [0_u8; 16];
        rand::rng().fill_bytes(&mut bytes);
        Self(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
    }

    pub fn text(&self) -> &str {
        &self.0
    }

    /// Whether this is it; takes as long for a near miss as for a far one.
    pub fn is(&self, other: &str) -> bool {
        let pairs = self.0.bytes().zip(other.bytes());
        let differs = pairs.fold(0, |differs, (a, b)| differs | (a ^ b));
        other.len() == self.0.len() && differs == 0
    }
}

/// Whether a request may be answered; `own_name` is what this machine is called.
pub fn is_own(host: Option<&str>, origin: Option<&str>, own_name: &str) -> bool {
    let Some(host) = host else { return false };
    let name = host_name(host);
    let local = [own_name, &format!("{own_name}.local")].map(str::to_ascii_lowercase);
    let known = name.parse::<IpAddr>().is_ok()
        || name == "localhost"
        || (!own_name.is_empty() && local.contains(&name));
    // Encrypted, where something else does that in front of this program.
    let bare = |origin: &str| {
        let bare = origin.strip_prefix("http://").or(origin.strip_prefix("https://"));
        bare.map(str::to_owned)
    };
    let same = |origin: &str| bare(origin).as_deref() == Some(host);
    known && origin.is_none_or(same)
}

/// `Host` without its port, in small letters and without brackets.
fn host_name(host: &str) -> String {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or_default(),
        None => host.split(':').next().unwrap_or_default(),
    };
    name.to_ascii_lowercase()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_is_itself_and_nothing_else() {
        let token = AccessToken::random();
        assert_eq!(token.text().len(), 32);
        assert!(token.is(token.text()));
        assert!(!token.is("") && !token.is(&token.text()[1..]));
        assert!(!token.is(&format!("{}0", token.text())));
        assert_ne!(AccessToken::random().text(), AccessToken::random().text());
    }

    #[test]
    fn a_token_for_once_is_good_once() {
        let tokens = Tokens::random();
        assert!(!tokens.redeem(""));
        let (void, once) = (tokens.for_once(), tokens.for_once());
        assert_eq!(tokens.role(&once), None);
        assert_eq!(
            [void, once.clone(), once].map(|text| tokens.redeem(&text)),
            [false, true, false]
        );
    }

    #[test]
    fn only_this_machine_and_its_own_page_are_answered() {
        let own = |host, origin| is_own(host, origin, "stage");
        for (host, origin) in [
            ("127.0.0.1:8080", None),
            ("localhost:8080", Some("http://localhost:8080")),
            ("[::1]:8080", Some("http://[::1]:8080")),
            ("192.168.1.7:80", None),
            ("Stage:8080", None),
            ("stage.local", Some("http://stage.local")),
        ] {
            assert!(own(Some(host), origin), "{host} {origin:?}");
        }
        for (host, origin) in [
            (None, None),
            (Some(""), None),
            (Some("evil.example:8080"), None),
            (Some("127.0.0.1.evil.example"), None),
            (Some("127.0.0.1:8080"), Some("http://evil.example")),
            (Some("127.0.0.1:8080"), Some("http://127.0.0.1:9090")),
            (Some("127.0.0.1:8080"), Some("null")),
            (Some("evil.example"), Some("http://evil.example")),
        ] {
            assert!(!own(host, origin), "{host:?} {origin:?}");
        }
        assert!(!is_own(Some(""), None, ""));
    }
}
