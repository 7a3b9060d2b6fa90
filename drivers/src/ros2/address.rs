//! Where rosbridge listens, and which robot's topics are meant: `HOST:PORT[/NAMESPACE]`.

use std::fmt;

/// rosbridge's address and the namespace of the topics.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ros2Address {
    /// `HOST:PORT`.
    pub server: String,
    /// Before the topics' names, without slashes at its ends; may be empty.
    pub namespace: String,
}

impl Ros2Address {
    /// Reads `HOST:PORT[/NAMESPACE]`; the error says what is wrong.
    pub fn parse(text: &str) -> Result<Self, String> {
        let (server, namespace) = text.split_once('/').unwrap_or((text, ""));
        let (host, port) = server.rsplit_once(':').ok_or("ros2 needs HOST:PORT")?;
        if host.is_empty() {
            return Err("ros2 needs a host before the port".into());
        }
        port.parse::<u16>().map_err(|_| format!("\"{port}\" is no port"))?;
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '/';
        let namespace = namespace.trim_matches('/');
        if !namespace.chars().all(plain) {
            return Err(format!(
                "\"{namespace}\" is no ROS 2 namespace (letters, digits, _ and /)"
            ));
        }
        Ok(Self { server: server.to_owned(), namespace: namespace.to_owned() })
    }

    /// A topic's whole name.
    pub(super) fn topic(&self, name: &str) -> String {
        match self.namespace.as_str() {
            "" => format!("/{name}"),
            namespace => format!("/{namespace}/{name}"),
        }
    }
}

impl fmt::Display for Ros2Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.server)?;
        match self.namespace.as_str() {
            "" => Ok(()),
            namespace => write!(f, "/{namespace}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_and_topics_follow_the_namespace() {
        let plain = Ros2Address::parse("g1.local:9090").unwrap();
        assert_eq!(plain.topic("joint_states"), "/joint_states");
        let named = Ros2Address::parse("127.0.0.1:9090/stage/left/").unwrap();
        assert_eq!(named.topic("joint_states"), "/stage/left/joint_states");
        assert_eq!(named.to_string(), "127.0.0.1:9090/stage/left");
        for wrong in ["", "host", ":9090", "host:port", "host:99999", "host:1/a b"] {
            assert!(Ros2Address::parse(wrong).is_err(), "{wrong}");
        }
    }
}
