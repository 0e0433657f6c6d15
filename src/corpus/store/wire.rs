//! Object stores over a real socket: answers that are cut, late, lost or refused, from a server that plays what it is given.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use object_store::RetryConfig;
use object_store::aws::AmazonS3Builder;

use super::backoff::Limits;
use super::inspected_client::InspectedClient;
use super::objects::ObjectFolder;
use super::{Put, Store};
use crate::corpus::CorpusError;

const KEY: &str = "AKIDEXAMPLE";
const SECRET: &str = "hush-hush-hush";

/// Plays one answer a connection, the last one again and again; keeps the requests' first lines and headers.
struct Server {
    port: u16,
    requests: Arc<Mutex<Vec<String>>>,
}

/// A connection, plain or through TLS.
trait Wire: Read + Write {}
impl<T: Read + Write> Wire for T {}

impl Server {
    fn playing(answers: Vec<Vec<u8>>) -> Server {
        Server::through(
            |stream| Box::new(stream),
            move |number, stream| {
                let _ = stream.write_all(&answers[number.min(answers.len() - 1)]);
            },
        )
    }

    /// Each connection made a wire; `play` answers it.
    fn through(
        wire: impl Fn(TcpStream) -> Box<dyn Wire> + Send + 'static,
        play: impl Fn(usize, &mut dyn Wire) + Send + 'static,
    ) -> Server {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let requests = Arc::new(Mutex::new(Vec::new()));
        let seen = Arc::clone(&requests);
        // Ends with the process, as it waits for the next connection.
        std::thread::spawn(move || {
            for (number, stream) in listener.incoming().enumerate() {
                let mut stream = wire(stream.unwrap());
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
                    play(number, &mut *stream);
                }
            }
        });
        Server { port, requests }
    }

    fn store(&self, patience_s: f64) -> ObjectFolder {
        self.store_by("http", patience_s)
    }

    fn store_by(&self, scheme: &str, patience_s: f64) -> ObjectFolder {
        let client = AmazonS3Builder::new()
            .with_endpoint(format!("{scheme}://127.0.0.1:{}", self.port))
            .with_allow_http(true)
            .with_bucket_name("yards")
            .with_access_key_id(KEY)
            .with_secret_access_key(SECRET)
            .with_retry(RetryConfig { max_retries: 0, ..RetryConfig::default() })
            .with_disable_bulk_delete(true)
            .with_http_connector(InspectedClient)
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

#[test]
fn extreme_a_server_that_announces_or_sends_too_much_is_refused_at_once() {
    // 10^15 bytes, all of them to come.
    let endless = answer("200 OK", "ETag: \"one\"\r\n", 1_000_000_000_000_000, &"x".repeat(100_000));
    let begun = Instant::now();
    let server = Server::playing(vec![endless.clone()]);
    let said = server.store(60.0).read("a").unwrap_err().to_string();
    assert!(said.contains("it has 1000000000000000 bytes, more than"), "{said}");
    let said = server.store(60.0).read_within("a", 9).unwrap_err().to_string();
    assert!(said.contains("more than the 9 that are read"), "{said}");
    assert_eq!(server.store(60.0).size("a").unwrap(), Some(1_000_000_000_000_000));
    assert_eq!(server.requests().len(), 3);
    // A page of a listing without an end.
    let page = answer("200 OK", "", 1_000_000_000_000, &format!("<ListBucketResult>{}", " ".repeat(40 << 20)));
    let server = Server::playing(vec![page]);
    let said = server.store(60.0).list("data").unwrap_err().to_string();
    assert!(said.contains("more than was asked for"), "{said}");
    // An error that goes on and on is cut; its code stands in front.
    let head = "HTTP/1.1 403 Forbidden\r\nConnection: close\r\n\r\n<Error><Code>AccessDenied</Code>";
    let server = Server::through(
        |stream| Box::new(stream),
        move |_, stream| {
            let _ = stream.write_all(head.as_bytes());
            while stream.write_all(&[b'x'; 4096]).is_ok() {}
        },
    );
    let said = server.store(60.0).read("a").unwrap_err().to_string();
    assert!(said.contains("AccessDenied (403)"), "{said}");
    assert!(begun.elapsed() < Duration::from_secs(20), "{:?}", begun.elapsed());
}

/// A page of a listing, with the names of these files and word of more.
fn page(names: std::ops::Range<usize>) -> Vec<u8> {
    let entry = |k: usize| {
        format!(
            "<Contents><Key>corpus/data/{k}</Key><LastModified>2026-11-21T00:00:00.000Z</LastModified><Size>1</Size><ETag>\"e\"</ETag></Contents>"
        )
    };
    let entries: String = names.map(entry).collect();
    let body = format!(
        "<ListBucketResult><IsTruncated>true</IsTruncated><NextContinuationToken>n</NextContinuationToken>{entries}</ListBucketResult>"
    );
    answer("200 OK", "", body.len(), &body)
}

#[test]
fn extreme_listings_and_bodies_that_never_end_are_given_up_in_bounded_time() {
    let begun = Instant::now();
    // Page after page of one name, slower than a name is worth; a byte, and a byte, and a byte. On loopback a page takes less than the
    // millisecond that its name earns: then only the number of names ends it.
    let names = Server::through(
        |stream| Box::new(stream),
        |_, stream| {
            std::thread::sleep(Duration::from_millis(20));
            let _ = stream.write_all(&page(0..1));
        },
    );
    let drip = Server::through(
        |stream| Box::new(stream),
        |_, stream| {
            let _ = stream.write_all(&answer("200 OK", "ETag: \"one\"\r\n", 100_000, ""));
            while stream.write_all(b"x").is_ok() && stream.flush().is_ok() {
                std::thread::sleep(Duration::from_millis(50));
            }
        },
    );
    let listed = names.store(0.5).list("data").unwrap_err();
    assert!(matches!(listed, CorpusError::Unreachable { .. }), "{listed:?}");
    let dripped = drip.store(0.5).read("a").unwrap_err();
    let said = dripped.to_string();
    assert!(
        matches!(dripped, CorpusError::Unreachable { .. }) && said.contains("bytes came in all that time"),
        "{said}"
    );
    assert!(begun.elapsed() < Duration::from_secs(15), "{:?}", begun.elapsed());
}

#[test]
fn extreme_redirects_are_not_followed_and_take_no_token_along() {
    let other = Server::playing(vec![answer("200 OK", "ETag: \"one\"\r\n", 3, "abc")]);
    for status in ["301 Moved", "302 Found", "303 See Other", "307 Temporary Redirect", "308 Permanent Redirect"] {
        let location = format!("Location: http://127.0.0.1:{}/yards/corpus/a\r\n", other.port);
        let server = Server::playing(vec![answer(status, &location, 0, "")]);
        let refused = server.store(60.0).read("a").unwrap_err();
        let said = refused.to_string();
        assert!(
            matches!(refused, CorpusError::Refused { .. }) && said.contains("redirects are not followed"),
            "{said}"
        );
        assert!(server.store(60.0).put("a", b"x").is_err() && server.store(60.0).list("data").is_err());
    }
    assert_eq!(other.requests().len(), 0, "another host was asked");
}

#[test]
fn extreme_a_server_with_a_certificate_of_nobody_is_refused_at_once() {
    use rustls::pki_types::pem::PemObject;
    use rustls::pki_types::{CertificateDer, PrivateKeyDer};
    let _ = rustls::crypto::ring::default_provider().install_default();
    let certificate =
        CertificateDer::from_pem_slice(include_bytes!("../../../tests/fixtures/loopback/certificate.pem"));
    let key = PrivateKeyDer::from_pem_slice(include_bytes!("../../../tests/fixtures/loopback/key.pem"));
    let config = rustls::ServerConfig::builder().with_no_client_auth();
    let config = Arc::new(config.with_single_cert(vec![certificate.unwrap()], key.unwrap()).unwrap());
    let secured = Server::through(
        move |stream| {
            let server = rustls::ServerConnection::new(Arc::clone(&config)).unwrap();
            Box::new(rustls::StreamOwned::new(server, stream))
        },
        |_, stream| drop(stream.write_all(&answer("200 OK", "ETag: \"one\"\r\n", 3, "abc"))),
    );
    // And one that speaks no TLS at all.
    let plain = Server::through(
        |mut stream| {
            let _ = stream.write_all(b"HTTP/1.1 400 Bad Request\r\nConnection: close\r\n\r\n");
            Box::new(stream)
        },
        |_, _| (),
    );
    let begun = Instant::now();
    for server in [secured, plain] {
        let refused = server.store_by("https", 60.0).read("a").unwrap_err();
        let said = refused.to_string();
        assert!(matches!(refused, CorpusError::Untrusted { .. }), "{refused:?}");
        assert!(said.contains("SSL_CERT_FILE") && !said.contains(SECRET), "{said}");
    }
    assert!(begun.elapsed() < Duration::from_secs(20), "{:?}", begun.elapsed());
}

/// The answer to a put, with the MD5 of what is stored as tag.
fn stored(tag: &str) -> Vec<u8> {
    answer("200 OK", &format!("ETag: \"{tag}\"\r\n"), 0, "")
}

#[test]
fn law_a_put_that_stores_other_bytes_is_noticed_and_mended_once() {
    let abc = "900150983cd24fb0d6963f7d28e17f72";
    let other = || answer("200 OK", "ETag: \"x\"\r\n", 3, "abd");
    let methods = |server: &Server| -> Vec<String> {
        server.requests().iter().map(|head| head.split(' ').next().unwrap_or_default().to_owned()).collect()
    };
    // As it should be: the tag says so, and nothing is read.
    let server = Server::playing(vec![stored(abc)]);
    assert_eq!(server.store(20.0).put("a", b"abc").unwrap(), Put::Created);
    assert_eq!(methods(&server), ["put"]);
    // A tag that says nothing: read back.
    let server = Server::playing(vec![stored("0"), answer("200 OK", "ETag: \"0\"\r\n", 3, "abc")]);
    assert_eq!(server.store(20.0).put("a", b"abc").unwrap(), Put::Created);
    assert_eq!(methods(&server), ["put", "get"]);
    // A flipped bit: removed, put again, and well.
    let gone = || answer("204 No Content", "", 0, "");
    let server = Server::playing(vec![stored("1"), other(), gone(), stored(abc)]);
    assert_eq!(server.store(20.0).put("a", b"abc").unwrap(), Put::Created);
    assert_eq!(methods(&server), ["put", "get", "delete", "put"]);
    // A longer object is as altered as a flipped bit.
    let longer = answer("200 OK", "ETag: \"y\"\r\n", 4, "abcd");
    let server = Server::playing(vec![stored("1"), longer, gone(), stored(abc)]);
    assert_eq!(server.store(20.0).put("a", b"abc").unwrap(), Put::Created);
    assert_eq!(methods(&server), ["put", "get", "delete", "put"]);
    // And again: told, and not left there.
    let server = Server::playing(vec![stored("1"), other(), gone(), stored("1"), other(), gone()]);
    let said = server.store(20.0).put("a", b"abc").unwrap_err().to_string();
    assert!(said.contains("twice other bytes were stored"), "{said}");
    assert_eq!(methods(&server), ["put", "get", "delete", "put", "get", "delete"]);
    // What may replace is put over.
    let server = Server::playing(vec![stored("1"), other(), stored(abc)]);
    server.store(20.0).replace("a", b"abc").unwrap();
    assert_eq!(methods(&server), ["put", "get", "put"]);
}
