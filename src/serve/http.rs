//! HTTP/1.1 (RFC 9112), as much as a browser on the same machine needs: one request a connection, bodies of known length.
//!
//! A head may take 16 KiB, a body 1 MiB; a request has to be there within 10 s, and an answer is given up where nothing of it
//! was taken for 10 s, or not all within a minute.

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

/// Bytes of request line and headers at the most: browsers end at 8 to 16 KiB for their own.
const HEAD: usize = 16 << 10;
/// Bytes of a body at the most.
pub(super) const BODY: usize = 1 << 20;
/// A request is there within this time.
const ASKING: Duration = Duration::from_secs(10);
/// Something of an answer is taken within this time.
pub(super) const TAKING: Duration = Duration::from_secs(10);
/// All of it within this one.
const ANSWERING: Duration = Duration::from_secs(60);
/// An answer goes to the system in pieces of this size, bytes.
const PIECE: usize = 64 << 10;
/// What a client still sends after its answer is read for so long, and so much of it: a connection that is closed with bytes
/// unread takes the answer along (RFC 9112, section 9.6).
const LINGERING: Duration = Duration::from_secs(2);
const LINGERED: usize = 4 * BODY;

/// What every answer forbids. The viewer draws textures from blobs, and asks nobody but this server.
pub(super) const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; \
    connect-src 'self' blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// A request.
#[derive(Debug)]
pub(super) struct Request {
    pub(super) method: String,
    /// Without the query.
    pub(super) path: String,
    query: String,
    /// Names in lower case.
    headers: Vec<(String, String)>,
    pub(super) body: Vec<u8>,
}

impl Request {
    /// Reads one; the answer to give where it is none.
    pub(super) fn read(stream: &mut TcpStream) -> Result<Self, Response> {
        let end = Instant::now() + ASKING;
        let mut bytes = Vec::new();
        let length = loop {
            if let Some(at) = bytes.windows(4).position(|four| four == b"\r\n\r\n") {
                break at;
            }
            if bytes.len() > HEAD {
                return Err(Response::refusal(
                    431,
                    "the head of the request is too long",
                ));
            }
            more(stream, end, &mut bytes)?;
        };
        let mut body = bytes.split_off(length + 4);
        if length > HEAD {
            return Err(Response::refusal(
                431,
                "the head of the request is too long",
            ));
        }
        let mut request = Self::parse(&bytes[..length])?;
        let size = request.size()?;
        if size > BODY {
            return Err(Response::refusal(413, "the body is larger than 1 MiB"));
        }
        while body.len() < size {
            more(stream, end, &mut body)?;
        }
        body.truncate(size);
        request.body = body;
        Ok(request)
    }

    pub(super) fn parse(head: &[u8]) -> Result<Self, Response> {
        let bad = |what: &str| Response::refusal(400, what);
        let head = std::str::from_utf8(head).map_err(|_| bad("the head is not text"))?;
        let mut lines = head.split("\r\n");
        let line: Vec<&str> = lines.next().unwrap_or("").split(' ').collect();
        let [method, target, version] = line[..] else {
            return Err(bad("the first line is not METHOD TARGET VERSION"));
        };
        if !matches!(version, "HTTP/1.1" | "HTTP/1.0") {
            return Err(Response::refusal(505, "HTTP/1.1 is spoken here"));
        }
        if !target.starts_with('/') {
            return Err(bad("the target does not begin with a slash"));
        }
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        let mut headers = Vec::new();
        for line in lines {
            let (name, value) = line.split_once(':').unwrap_or(("", ""));
            // No space within or after a name, and no line that goes on (RFC 9112, section 5).
            if name.is_empty() || !name.bytes().all(|b| b.is_ascii_graphic()) {
                return Err(bad("a header has no name"));
            }
            headers.push((name.to_ascii_lowercase(), value.trim().to_owned()));
        }
        Ok(Self {
            method: method.to_owned(),
            path: path.to_owned(),
            query: query.to_owned(),
            headers,
            body: Vec::new(),
        })
    }

    /// Bytes of the body.
    fn size(&self) -> Result<usize, Response> {
        if self.all("transfer-encoding").next().is_some() {
            return Err(Response::refusal(411, "say how long the body is"));
        }
        let lengths: Vec<&str> = self.all("content-length").collect();
        match lengths[..] {
            [] => Ok(0),
            [one] if !one.is_empty() && one.bytes().all(|b| b.is_ascii_digit()) => {
                // More digits than fit are too many bytes.
                Ok(one.parse().unwrap_or(usize::MAX))
            }
            _ => Err(Response::refusal(
                400,
                "the length of the body is no number",
            )),
        }
    }

    fn all(&self, name: &str) -> impl Iterator<Item = &str> {
        let of_name = self.headers.iter().filter(move |(n, _)| n == name);
        of_name.map(|(_, value)| value.as_str())
    }

    /// A header that may be there once at the most; an error where it is there more often.
    pub(super) fn header(&self, name: &str) -> Result<Option<&str>, Response> {
        let mut all = self.all(name);
        let first = all.next();
        match all.next() {
            None => Ok(first),
            Some(_) => Err(Response::refusal(400, &format!("there are two of {name}"))),
        }
    }

    /// A value of the query. Nothing here needs percent signs.
    pub(super) fn asked(&self, key: &str) -> Option<&str> {
        let pairs = self
            .query
            .split('&')
            .filter_map(|pair| pair.split_once('='));
        pairs.into_iter().find(|(k, _)| *k == key).map(|(_, v)| v)
    }
}

/// Reads what is there, until `end`.
fn more(stream: &mut TcpStream, end: Instant, bytes: &mut Vec<u8>) -> Result<(), Response> {
    let mut piece = [0; 4096];
    let late = || Response::refusal(408, "the request took too long");
    let left = end.saturating_duration_since(Instant::now());
    if left.is_zero() {
        return Err(late());
    }
    stream.set_read_timeout(Some(left)).map_err(|_| late())?;
    match stream.read(&mut piece) {
        Ok(0) => Err(Response::refusal(400, "the request ends too early")),
        Ok(n) => {
            bytes.extend(&piece[..n]);
            Ok(())
        }
        Err(problem) if problem.kind() == io::ErrorKind::Interrupted => Ok(()),
        Err(_) => Err(late()),
    }
}

/// An answer.
#[derive(Debug)]
pub(super) struct Response {
    pub(super) status: u16,
    kind: &'static str,
    headers: Vec<(&'static str, String)>,
    body: Vec<u8>,
}

impl Response {
    /// A body of some media type.
    pub(super) fn of(kind: &'static str, body: impl Into<Vec<u8>>) -> Self {
        Self {
            status: 200,
            kind,
            headers: Vec::new(),
            body: body.into(),
        }
    }

    /// Nothing to be had, and no fault.
    pub(super) fn nothing() -> Self {
        Self {
            status: 204,
            ..Self::of("text/plain", "")
        }
    }

    /// A word for what is not answered.
    pub(super) fn refusal(status: u16, what: &str) -> Self {
        Self {
            status,
            ..Self::of("text/plain; charset=utf-8", format!("{what}\n"))
        }
    }

    /// The same with a header.
    pub(super) fn with(mut self, name: &'static str, value: impl Into<String>) -> Self {
        self.headers.push((name, value.into()));
        self
    }

    /// Sends it, and ends the connection.
    pub(super) fn send(&self, stream: &mut TcpStream) -> io::Result<()> {
        let end = Instant::now() + ANSWERING;
        let length = [("Content-Length", self.body.len().to_string())];
        let headers = self.headers.iter().chain(&length);
        stream.set_write_timeout(Some(TAKING))?;
        stream.write_all(head(self.status, self.kind, headers).as_bytes())?;
        for piece in self.body.chunks(PIECE) {
            if Instant::now() > end {
                return Err(io::ErrorKind::TimedOut.into());
            }
            stream.write_all(piece)?;
        }
        stream.flush()?;
        linger(stream)
    }
}

/// The head of a stream of events (HTML, section 9.2), which has no length.
pub(super) fn stream_head() -> String {
    head(200, "text/event-stream", [].iter())
}

fn head<'a>(
    status: u16,
    kind: &str,
    headers: impl Iterator<Item = &'a (&'static str, String)>,
) -> String {
    let reason = match status {
        200 => "OK",
        202 => "Accepted",
        204 => "No Content",
        303 => "See Other",
        400 => "Bad Request",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        408 => "Request Timeout",
        411 => "Length Required",
        413 => "Content Too Large",
        431 => "Request Header Fields Too Large",
        503 => "Service Unavailable",
        505 => "HTTP Version Not Supported",
        _ => "Error",
    };
    let mut out = format!(
        "HTTP/1.1 {status} {reason}\r\nContent-Type: {kind}\r\nConnection: close\r\nCache-Control: no-store\r\n\
         Content-Security-Policy: {POLICY}\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\
         Cross-Origin-Resource-Policy: same-origin\r\nCross-Origin-Opener-Policy: same-origin\r\n"
    );
    for (name, value) in headers {
        out += &format!("{name}: {value}\r\n");
    }
    out + "\r\n"
}

/// Ends the sending side and reads what still comes, for a while.
fn linger(stream: &mut TcpStream) -> io::Result<()> {
    stream.shutdown(Shutdown::Write)?;
    let end = Instant::now() + LINGERING;
    let (mut piece, mut sum) = ([0; 4096], 0);
    while sum < LINGERED {
        let left = end.saturating_duration_since(Instant::now());
        if left.is_zero() {
            break;
        }
        stream.set_read_timeout(Some(left))?;
        match stream.read(&mut piece) {
            Ok(0) | Err(_) => break,
            Ok(n) => sum += n,
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_are_read_or_refused() {
        let read = |text: &str| Request::parse(text.as_bytes());
        let request = read("GET /light?mesh=2&have=1 HTTP/1.1\r\nHost: a:1\r\nX-Y:  z ").unwrap();
        assert_eq!(
            (request.method.as_str(), request.path.as_str()),
            ("GET", "/light")
        );
        assert_eq!(
            (request.asked("have"), request.asked("hav")),
            (Some("1"), None)
        );
        assert_eq!(request.header("host").unwrap(), Some("a:1"));
        assert_eq!(request.header("x-y").unwrap(), Some("z"));
        for (text, status) in [
            ("", 400),
            ("GET /", 400),
            ("GET  / HTTP/1.1", 400),
            ("GET http://a/ HTTP/1.1", 400),
            ("GET / HTTP/2.0", 505),
            ("GET / HTTP/1.1\r\nHost : a", 400),
            ("GET / HTTP/1.1\r\n folded: a", 400),
            ("GET / HTTP/1.1\r\nnothing", 400),
        ] {
            assert_eq!(read(text).unwrap_err().status, status, "{text}");
        }
        let size = |text: &str| read(&format!("POST / HTTP/1.1\r\n{text}")).unwrap().size();
        assert_eq!(size("Content-Length: 12").unwrap(), 12);
        for bad in [
            "Content-Length: -1",
            "Content-Length: ",
            "Content-Length: 1\r\nContent-Length: 1",
        ] {
            assert_eq!(size(bad).unwrap_err().status, 400, "{bad}");
        }
        assert_eq!(size("Transfer-Encoding: chunked").unwrap_err().status, 411);
        assert!(size("Content-Length: 99999999999999999999999").unwrap() > BODY);
        let twice = read("GET / HTTP/1.1\r\nHost: a\r\nHost: b").unwrap();
        assert!(twice.header("host").is_err());
    }
}
