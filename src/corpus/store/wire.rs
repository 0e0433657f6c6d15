//! Object stores over a real socket: answers that are cut, late, lost or refused, from a server that plays what it is given.

use std::io::{Read, Write};
use std::net::TcpListener;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use object_store::RetryConfig;
use object_store::aws::AmazonS3Builder;

use super::objects::ObjectFolder;
use super::patience::Limits;
use super::watch::Watched;
use super::{Put, Store};
use crate::corpus::CorpusError;

const KEY: &str = "AKIDEXAMPLE";
const SECRET: &str = "hush-hush-hush";

/// Plays one answer a connection, the last one again and again; keeps the requests' first lines and headers.
struct Server {
    port: u16,
    requests: Arc<Mutex<Vec<String>>>,
}

impl Server {
    fn playing(answers: Vec<Vec<u8>>) -> Server {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let requests = Arc::new(Mutex::new(Vec::new()));
        let seen = Arc::clone(&requests);
        // Ends with the process, as it waits for the next connection.
        std::thread::spawn(move || {
            for (number, stream) in listener.incoming().enumerate() {
                let mut stream = stream.unwrap();
                let mut head = Vec::new();
                let mut byte = [0];
                while !head.ends_with(b"\r\n\r\n") && stream.read(&mut byte).is_ok_and(|read| read == 1) {
                    head.push(byte[0]);
                }
                let head = String::from_utf8(head).unwrap().to_lowercase();
                let length = head.split("content-length: ").nth(1).and_then(|rest| rest.lines().next()?.parse().ok());
                let mut body = vec![0; length.unwrap_or(0)];
                let whole = stream.read_exact(&mut body).is_ok();
                seen.lock().unwrap().push(head);
                if whole {
                    let _ = stream.write_all(&answers[number.min(answers.len() - 1)]);
                }
            }
        });
        Server { port, requests }
    }

    fn store(&self, patience_s: f64) -> ObjectFolder {
        let client = AmazonS3Builder::new()
            .with_endpoint(format!("http://127.0.0.1:{}", self.port))
            .with_allow_http(true)
            .with_bucket_name("yards")
            .with_access_key_id(KEY)
            .with_secret_access_key(SECRET)
            .with_retry(RetryConfig { max_retries: 0, ..RetryConfig::default() })
            .with_http_connector(Watched)
            .build()
            .unwrap();
        ObjectFolder::new(Arc::new(client), "s3://yards", "corpus").with_limits(Limits::of(patience_s))
    }

    fn requests(&self) -> Vec<String> {
        self.requests.lock().unwrap().clone()
    }
}

/// An answer whose header promises `length` bytes, whatever comes.
fn answer(status: &str, headers: &str, length: usize, body: &str) -> Vec<u8> {
    let date = "Last-Modified: Sat, 21 Nov 2026 00:00:00 GMT";
    format!("HTTP/1.1 {status}\r\n{headers}{date}\r\nConnection: close\r\nContent-Length: {length}\r\n\r\n{body}")
        .into_bytes()
}

fn error(status: &str, code: &str) -> Vec<u8> {
    let body = format!("<Error><Code>{code}</Code><AWSAccessKeyId>{KEY}</AWSAccessKeyId><X>{SECRET}</X></Error>");
    answer(status, "", body.len(), &body)
}

#[test]
fn exact_a_body_that_is_cut_is_read_on_where_it_broke() {
    let server = Server::playing(vec![
        answer("200 OK", "ETag: \"one\"\r\n", 10, "0123"),
        answer("206 Partial Content", "ETag: \"one\"\r\nContent-Range: bytes 4-9/10\r\n", 6, "45"),
        answer("206 Partial Content", "ETag: \"one\"\r\nContent-Range: bytes 6-9/10\r\n", 4, "6789"),
    ]);
    assert_eq!(server.store(20.0).read("a").unwrap(), b"0123456789");
    let requests = server.requests();
    assert!(requests[0].starts_with("get /yards/corpus/a ") && !requests[0].contains("range: "), "{}", requests[0]);
    assert!(
        requests[1].contains("range: bytes=4-\r\n") && requests[1].contains("if-match: \"one\""),
        "{}",
        requests[1]
    );
    assert!(requests[2].contains("range: bytes=6-\r\n"), "{}", requests[2]);
}

#[test]
fn exact_an_object_that_is_replaced_while_it_is_read_is_read_anew() {
    let server = Server::playing(vec![
        answer("200 OK", "ETag: \"one\"\r\n", 10, "0123"),
        error("412 Precondition Failed", "PreconditionFailed"),
        answer("200 OK", "ETag: \"two\"\r\n", 3, "abc"),
    ]);
    assert_eq!(server.store(20.0).read("a").unwrap(), b"abc");
}

#[test]
fn law_what_passes_is_borne_with() {
    let busy = || error("503 Slow Down", "SlowDown");
    let server = Server::playing(vec![
        busy(),
        Vec::new(),
        error("500 Internal Server Error", "InternalError"),
        answer("200 OK", "ETag: \"one\"\r\n", 3, "abc"),
    ]);
    assert_eq!(server.store(20.0).read("a").unwrap(), b"abc");
    assert_eq!(server.requests().len(), 4);
}

#[test]
fn exact_a_put_whose_answer_was_lost_finds_its_own_bytes() {
    let server = Server::playing(vec![
        Vec::new(),
        error("409 Conflict", "ConditionalRequestConflict"),
        error("404 Not Found", "NoSuchKey"),
        error("412 Precondition Failed", "PreconditionFailed"),
        answer("200 OK", "ETag: \"one\"\r\n", 3, "abc"),
    ]);
    assert_eq!(server.store(20.0).put("a", b"abc").unwrap(), Put::Same);
    let requests = server.requests();
    let puts = requests.iter().filter(|head| head.starts_with("put ")).collect::<Vec<_>>();
    assert!(puts.len() == 3 && puts.iter().all(|head| head.contains("if-none-match: *")), "{requests:?}");
}

#[test]
fn extreme_refusals_are_told_at_once_and_without_keys() {
    for (status, code, said) in [
        ("403 Forbidden", "InvalidAccessKeyId", "InvalidAccessKeyId (403)"),
        ("404 Not Found", "NoSuchBucket", "there is no such bucket"),
        ("301 Moved", "PermanentRedirect", "AWS_REGION"),
        ("400 Bad Request", "ExpiredToken", "new credentials"),
    ] {
        let server = Server::playing(vec![error(status, code)]);
        let store = server.store(60.0);
        let refused = store.read("a").unwrap_err();
        assert!(matches!(refused, CorpusError::Refused { .. }), "{refused:?}");
        for error in [refused, store.put("a", b"x").unwrap_err(), store.list("data").unwrap_err()] {
            let text = format!("{error} {error:?}");
            assert!(text.contains(said) && !text.contains(KEY) && !text.contains(SECRET), "{text}");
        }
        assert_eq!(server.requests().len(), 3, "{code} was tried again");
    }
}

#[test]
fn extreme_what_never_ends_is_given_up_in_bounded_time_and_tries() {
    let cut = answer("200 OK", "ETag: \"one\"\r\n", 10, "0123");
    let cut_again = answer("206 Partial Content", "ETag: \"one\"\r\nContent-Range: bytes 4-9/10\r\n", 6, "");
    for endless in [vec![error("503 Slow Down", "SlowDown")], vec![Vec::new()], vec![cut, cut_again]] {
        let server = Server::playing(endless);
        let started = Instant::now();
        let error = server.store(0.5).read("a").unwrap_err();
        assert!(matches!(error, CorpusError::Unreachable { .. }), "{error:?}");
        assert!(started.elapsed() < Duration::from_secs(20) && server.requests().len() < 30, "{:?}", started.elapsed());
        let said = error.to_string();
        assert!(said.starts_with("s3://yards/corpus/a: ") && said.contains("the same command goes on"), "{said}");
    }
}
