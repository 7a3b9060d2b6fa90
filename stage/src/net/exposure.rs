//! Warns about a session that other machines can reach without protection.

use serde_json::Value;
use zenoh::Config;

/// Transports that are encrypted and authenticate the other end.
const ENCRYPTED: [&str; 2] = ["tls", "quic"];

/// The warning about a session that others can reach without TLS or access
/// control, in one line; `None` without need.
pub fn exposure_warning(config: &Config) -> Option<String> {
    let value = |key: &str| {
        let text = config.get_json(key).unwrap_or_default();
        serde_json::from_str::<Value>(&text).unwrap_or_default()
    };
    let mut endpoints = Vec::new();
    for key in ["listen/endpoints", "connect/endpoints"] {
        collect(&value(key), &mut endpoints);
    }
    let mut open: Vec<&str> = endpoints.iter().map(String::as_str).collect();
    open.retain(|endpoint| !is_loopback(endpoint));
    let reached = match open.first() {
        Some(first) => (*first).to_owned(),
        None if value("scouting/multicast/enabled") == Value::Bool(true) => {
            "multicast scouting".to_owned()
        }
        None => return None,
    };
    let encrypted = !open.is_empty() && open.iter().all(|endpoint| is_encrypted(endpoint));
    let controlled = value("access_control/enabled") == Value::Bool(true);
    let missing = match (encrypted, controlled) {
        (true, true) => return None,
        (false, true) => "TLS: whoever is on the network can listen, and pretend to be another",
        (true, false) => "access control: whoever has a certificate can lead",
        (false, false) => "TLS and access control: whoever is on the network can listen and lead",
    };
    Some(format!(
        "WARNING: {reached} reaches beyond this machine without {missing}. Robots keep their own \
         limits whatever comes. See docs/stage.md, Security"
    ))
}

/// All endpoints in a list, or in one list a mode.
fn collect(value: &Value, endpoints: &mut Vec<String>) {
    match value {
        Value::String(text) if text.contains('/') => endpoints.push(text.clone()),
        Value::Array(items) => items.iter().for_each(|item| collect(item, endpoints)),
        Value::Object(items) => items.values().for_each(|item| collect(item, endpoints)),
        _ => {}
    }
}

fn is_encrypted(endpoint: &str) -> bool {
    let transport = endpoint.split('/').next().unwrap_or_default();
    ENCRYPTED.contains(&transport)
}

fn is_loopback(endpoint: &str) -> bool {
    let address = endpoint.split_once('/').map_or("", |(_, address)| address);
    let address = address.split(['?', '#']).next().unwrap_or_default();
    let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
    let host = host.trim_start_matches('[').trim_end_matches(']');
    let ip = host.parse::<std::net::IpAddr>();
    host == "localhost" || ip.is_ok_and(|ip| ip.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::super::config::NetConfig;
    use super::*;

    fn warning(leads: bool, endpoint: &str) -> Option<String> {
        let place = NetConfig {
            leads,
            listen: if leads { vec![endpoint.into()] } else { vec![] },
            connect: if leads { vec![] } else { vec![endpoint.into()] },
            file: None,
        };
        exposure_warning(&place.config().expect(endpoint))
    }

    #[test]
    fn loopback_is_silent_and_everything_else_is_not() {
        for quiet in ["tcp/127.0.0.1:7448", "tcp/localhost:1", "tcp/[::1]:7448"] {
            assert_eq!(warning(true, quiet), None, "{quiet}");
            assert_eq!(warning(false, quiet), None, "{quiet}");
        }
        for loud in ["tcp/0.0.0.0:7448", "udp/192.168.1.4:1", "tcp/[::]:7448", "tcp/robot:1"] {
            let warning = warning(true, loud).expect(loud);
            assert!(warning.contains("without TLS and access control"), "{warning}");
        }
        let tls = warning(false, "tls/robot:7448").unwrap();
        assert!(tls.contains("without access control"), "{tls}");
    }

    #[test]
    fn tls_with_access_control_is_silent() {
        let place = NetConfig {
            leads: true,
            listen: vec!["tls/0.0.0.0:7448".into()],
            ..NetConfig::default()
        };
        let mut config = place.config().unwrap();
        let control = r#"{ enabled: true, default_permission: "deny",
            rules: [], subjects: [], policies: [] }"#;
        config.insert_json5("access_control", control).unwrap();
        assert_eq!(exposure_warning(&config), None);
    }

    #[test]
    fn what_zenoh_does_not_know_is_refused_with_the_option() {
        let place = NetConfig { listen: vec!["nonsense".into()], ..NetConfig::default() };
        let error = place.config().unwrap_err().to_string();
        assert!(error.starts_with("--listen"), "{error}");
    }
}
