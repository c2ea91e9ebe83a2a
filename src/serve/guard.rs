//! Who may ask: whoever has the token, from a page of this server.
//!
//! Any page that a browser shows may send requests to 127.0.0.1, and a name of anybody's may be made to mean 127.0.0.1 (DNS
//! rebinding). So the host has to be this machine by a name that nobody else can hold, a request that comes from a page has
//! to come from this one, and all need the token. The browser is opened with a ticket that is good once, in place of the token:
//! command lines are seen by all users of a machine.

use super::http::{Request, Response};
use crate::error::{Error, Result};
use std::sync::{Mutex, PoisonError};

/// Bytes of a token: 128 bits from the system.
const BYTES: usize = 16;

/// What a server asks of requests.
#[derive(Debug)]
pub(super) struct Guard {
    token: String,
    ticket: Mutex<Option<String>>,
    hosts: [String; 2],
}

impl Guard {
    /// For a server on a port of this machine.
    pub(super) fn new(port: u16) -> Result<Self> {
        Ok(Self {
            token: random()?,
            ticket: Mutex::new(Some(random()?)),
            hosts: ["127.0.0.1", "localhost"].map(|name| format!("{name}:{port}")),
        })
    }

    /// The page's address, with the token.
    pub(super) fn address(&self) -> String {
        format!("http://{}{}", self.hosts[0], self.page())
    }

    /// The page's target, with the token.
    pub(super) fn page(&self) -> String {
        format!("/?token={}", self.token)
    }

    /// The address that leads to the page once.
    pub(super) fn ticket(&self) -> String {
        let ticket = self.ticket.lock().unwrap_or_else(PoisonError::into_inner);
        let ticket = ticket.as_deref().unwrap_or_default();
        format!("http://{}/?ticket={ticket}", self.hosts[0])
    }

    /// The token, for the page's own requests.
    pub(super) fn token(&self) -> &str {
        &self.token
    }

    /// Lets a request in, or says why not; the answer may also be the way from a ticket to the page.
    pub(super) fn check(&self, request: &Request) -> std::result::Result<(), Response> {
        let forbidden = |what| Err(Response::refusal(403, what));
        let known = |host: &str| self.hosts.iter().any(|own| own.eq_ignore_ascii_case(host));
        if !request.header("host")?.is_some_and(known) {
            return forbidden("this server answers to 127.0.0.1 and localhost only");
        }
        let own = |origin: &str| origin.strip_prefix("http://").is_some_and(known);
        if !request.header("origin")?.is_none_or(own) {
            return forbidden("this page may not ask this server");
        }
        if request.path == "/"
            && let Some(ticket) = request.asked("ticket")
        {
            let mut held = self.ticket.lock().unwrap_or_else(PoisonError::into_inner);
            if held.take_if(|held| same(held, ticket)).is_some() {
                let page = Response::refusal(303, "see there").with("Location", self.page());
                return Err(page);
            }
        }
        match request.asked("token") {
            Some(token) if same(token, &self.token) => Ok(()),
            _ => forbidden("the address lacks its token: take the one that haarlight printed"),
        }
    }
}

fn random() -> Result<String> {
    let mut bytes = [0; BYTES];
    getrandom::fill(&mut bytes)
        .map_err(|problem| Error::Internal(format!("no random numbers: {problem}")))?;
    Ok(bytes.iter().map(|b| format!("{b:02x}")).collect())
}

/// Are two texts the same? Takes as long whatever their first difference is.
fn same(a: &str, b: &str) -> bool {
    let differ = a.bytes().zip(b.bytes()).fold(0, |d, (a, b)| d | (a ^ b));
    a.len() == b.len() && differ == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_differ_and_are_compared_whole() {
        let [a, b] = [random().unwrap(), random().unwrap()];
        assert_eq!(a.len(), 2 * BYTES);
        assert!(a != b && same(&a, &a.clone()) && !same(&a, &b));
        assert!(!same(&a, &a[1..]) && !same("", &a) && !same(&a, ""));
    }

    #[test]
    fn a_ticket_leads_to_the_page_once() {
        let guard = Guard::new(8017).unwrap();
        let ticket = guard.ticket();
        let target = ticket.strip_prefix("http://127.0.0.1:8017").unwrap();
        let check = |target: &str, host: &str| {
            let head = format!("GET {target} HTTP/1.1\r\nHost: {host}");
            let request = Request::parse(head.as_bytes()).unwrap();
            guard.check(&request).map_err(|answer| answer.status)
        };
        assert!(!ticket.contains(guard.token()));
        let own = "127.0.0.1:8017";
        assert_eq!(check("/?ticket=", own), Err(403));
        assert_eq!(check(target, "evil.example:8017"), Err(403));
        assert_eq!(check(&target.replace("/?", "/room?"), own), Err(403));
        assert_eq!(check(target, own), Err(303));
        assert_eq!(check(target, own), Err(403));
        assert_eq!(check("/?ticket=", own), Err(403));
        assert_eq!(check(&guard.page(), own), Ok(()));
    }
}
