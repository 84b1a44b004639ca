//! Who may speak to the monitor: only a page of its own, on this machine.
//!
//! The port is bound to the loopback interface, but any page that is open in any browser of this machine can send
//! requests there, and every user of the machine as well. What keeps them out is a random token in the address, which
//! other pages and other users do not know. The name of the host is compared too: a page of a foreign name that was made to
//! point to 127.0.0.1 (DNS rebinding) would else count as of the same origin.

/// The token of an address, and the port.
#[derive(Clone, Debug)]
pub(super) struct Guard {
    token: String,
    port: u16,
}

/// Why a request is not served.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Denial {
    /// It is for another host than this one.
    Host,
    /// It does not know the token.
    Token,
    /// It comes from a page of another origin.
    Origin,
}

impl Denial {
    /// What to answer.
    pub const fn text(self) -> &'static str {
        match self {
            Self::Host => "403: open the address that bristle monitor has printed, by 127.0.0.1",
            Self::Token => "403: open the whole address that bristle monitor has printed",
            Self::Origin => "403: this page belongs to another program",
        }
    }
}

impl Guard {
    /// A new token: 128 bits of the operating system's randomness, stretched by a cipher.
    pub fn new(port: u16) -> Self {
        Self {
            token: format!("{:032x}", rand::random::<u128>()),
            port,
        }
    }

    /// The address of the page.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/{}/", self.port, self.token)
    }

    /// What a request asks for behind the token, if it may ask.
    pub fn admit<'a>(
        &self,
        path: &'a str,
        host: Option<&str>,
        origin: Option<&str>,
    ) -> Result<&'a str, Denial> {
        let own = ["127.0.0.1", "localhost"].map(|name| format!("{name}:{}", self.port));
        if !host.is_some_and(|host| own.iter().any(|own| host == own)) {
            return Err(Denial::Host);
        }
        let path = path.strip_prefix('/').ok_or(Denial::Token)?;
        let (token, rest) = path.split_once('/').ok_or(Denial::Token)?;
        if !is_same(token, &self.token) {
            return Err(Denial::Token);
        }
        match origin {
            Some(origin) if own.iter().all(|own| origin != format!("http://{own}")) => {
                Err(Denial::Origin)
            }
            _ => Ok(rest),
        }
    }
}

/// Compares in a time that does not tell how much is right.
fn is_same(a: &str, b: &str) -> bool {
    let pairs = a.bytes().zip(b.bytes());
    a.len() == b.len() && pairs.fold(0, |different, (a, b)| different | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    use super::{Denial, Guard};

    #[test]
    fn only_the_whole_address_on_this_host_is_let_in() {
        let guard = Guard::new(4000);
        let token = guard.token.as_str();
        let host = Some("127.0.0.1:4000");
        let path = format!("/{token}/events");
        assert_eq!(guard.admit(&path, host, None), Ok("events"));
        assert_eq!(
            guard.admit(&format!("/{token}/"), Some("localhost:4000"), None),
            Ok("")
        );
        for foreign in [
            None,
            Some("evil.example:4000"),
            Some("127.0.0.1"),
            Some("127.0.0.1:4001"),
        ] {
            assert_eq!(guard.admit(&path, foreign, None), Err(Denial::Host));
        }
        for wrong in [
            "/",
            "/events",
            "//events",
            "",
            &path[..20],
            &format!("/{token}0/"),
            &format!("/{token}"),
        ] {
            assert_eq!(
                guard.admit(wrong, host, None),
                Err(Denial::Token),
                "{wrong}"
            );
        }
        let own = Some("http://127.0.0.1:4000");
        assert_eq!(guard.admit(&path, host, own), Ok("events"));
        for foreign in ["null", "http://evil.example", "https://127.0.0.1:4000"] {
            let admitted = guard.admit(&path, host, Some(foreign));
            assert_eq!(admitted, Err(Denial::Origin));
        }
    }

    #[test]
    fn tokens_differ() {
        assert_ne!(Guard::new(1).token, Guard::new(1).token);
        assert_eq!(Guard::new(1).token.len(), 32);
    }
}
