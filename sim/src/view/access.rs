//! Who is let in: whoever knows the token, from a page of this server.

use std::net::IpAddr;

use crate::SimError;

/// A token of 128 random bits, hexadecimal.
///
/// # Errors
/// [`SimError::Io`] if the system has no randomness.
pub(super) fn token() -> Result<String, SimError> {
    let mut bytes = [0u8; 16];
    getrandom::fill(&mut bytes)
        .map_err(|error| SimError::Io("randomness".into(), std::io::Error::other(error)))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Whether two tokens are the same, in a time that does not tell where they differ.
pub(super) fn is_same(a: &str, b: &str) -> bool {
    let differs = a.bytes().zip(b.bytes()).fold(0, |sum, (a, b)| sum | (a ^ b));
    a.len() == b.len() && differs == 0
}

/// Whether a request's `Host` is this machine by number or as `localhost`, at any port (a tunnel has its own).
/// Names are refused: that of a foreign page may be made to lead here (DNS rebinding). Beyond loopback
/// only where `is_open`.
pub(super) fn is_host(host: &str, is_open: bool) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or_default(),
        None => host.rsplit_once(':').map_or(host, |(name, _)| name),
    };
    match name.parse::<IpAddr>() {
        Ok(address) => address.is_loopback() || is_open,
        Err(_) => name.eq_ignore_ascii_case("localhost"),
    }
}

/// Whether a request's `Origin` is the page of this `Host`.
pub(super) fn is_origin(origin: &str, host: &str) -> bool {
    let rest = origin.strip_prefix("http://").or_else(|| origin.strip_prefix("https://"));
    rest.is_some_and(|of| of.eq_ignore_ascii_case(host))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hosts_by_number_and_localhost_are_this_machine() {
        for host in ["127.0.0.1:8080", "localhost:9", "LOCALHOST", "[::1]:80", "127.0.0.1"] {
            assert!(is_host(host, false), "{host}");
        }
        for host in
            ["evil.example:8080", "127.0.0.1.evil.example", "192.168.0.7:1", "", "[", "[::2]"]
        {
            assert!(!is_host(host, false), "{host}");
        }
        assert!(is_host("192.168.0.7:1", true) && !is_host("evil.example", true));
    }

    #[test]
    fn an_origin_is_the_page_itself() {
        assert!(is_origin("http://localhost:80", "localhost:80"));
        for origin in
            ["http://localhost:81", "null", "", "file://", "http://evil.example", "localhost:80"]
        {
            assert!(!is_origin(origin, "localhost:80"), "{origin}");
        }
    }

    #[test]
    fn tokens_differ_and_are_compared_whole() {
        let (a, b) = (token().unwrap(), token().unwrap());
        assert!(a.len() == 32 && a != b);
        assert!(is_same(&a, &a) && !is_same(&a, &b) && !is_same(&a, &a[..31]) && !is_same(&a, ""));
    }
}
