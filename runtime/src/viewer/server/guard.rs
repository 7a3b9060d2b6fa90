//! Access control: a request needs the token, and comes from the page or no page.
//!
//! - Every address begins with the token, 128 random bits of each run; other users
//!   and web pages of this machine do not know it.
//! - `Host` must be an address or a name of this machine: a foreign name that
//!   was made to point here (DNS rebinding) is refused.
//! - `Origin`, which browsers add, must be this page's own.

use rand::RngCore;
use std::net::IpAddr;

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
    let same = |origin: &str| origin.strip_prefix("http://") == Some(host);
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
