//! One attempt at an object store -> what it gave, or the fault, sorted by whether trying again may help.
//!
//! Sits between `object_store` and its HTTP client and notes how each request was answered, so that faults are told apart
//! by status and error code, not by the wording of a message. Texts of faults are made of status, code and the operating
//! system's words alone: bodies and URLs of requests can hold keys and signatures, and are never repeated.
//!
//! What a server sends is bounded: no attempt takes in more bytes than it was allowed, whatever is announced. Redirects are not
//! followed: what another host answers is not the corpus that was asked for, and tokens would go along.

use std::cell::RefCell;
use std::error::Error;
use std::time::Duration;

use async_trait::async_trait;
use bytes::Bytes;
use futures_util::TryStreamExt;
use http_body_util::{BodyExt, LengthLimitError, Limited};
use object_store::client::{
    HttpClient, HttpConnector, HttpError, HttpErrorKind, HttpRequest, HttpResponse, HttpResponseBody, HttpService,
};
use object_store::{ClientConfigKey, ClientOptions};

use super::stored::Stored;

/// Why an attempt failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    /// There is no such object.
    NotFound,
    /// A create-only put found the name taken, or another writer at it.
    Taken,
    /// A range that begins behind the object's end.
    BeyondEnd,
    /// Bucket, credentials or rights: trying again does not help.
    Refused { reason: String, cure: &'static str },
    /// Who answers is not known to be the store.
    Untrusted(String),
    /// A put stored other bytes than were sent.
    Altered,
    /// An object is longer than whoever reads it takes.
    TooLong(String),
    /// May work again.
    Passing(String),
    /// Will not.
    Lasting(String),
}

/// How a request ended that was not answered with success.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Answer {
    Status { status: u16, code: String },
    Transport(String),
    Untrusted(String),
}

/// What is noted of the requests within one attempt.
#[derive(Default)]
struct Notes {
    /// The last request's failure.
    answer: Option<Answer>,
    /// What the last answer says of an object's bytes.
    stored: Stored,
}

tokio::task_local! {
    static NOTES: RefCell<Notes>;
    /// Bytes that each answer within an attempt may have.
    static MOST: u64;
}

/// The longest error answer that is looked at.
const MAX_ERROR_BYTES: usize = 64 * 1024;
/// The longest answer that is no object: a page of a listing has some thousand names, a token a few lines.
pub(crate) const MAX_ANSWER_BYTES: u64 = 32 << 20;

/// Runs one attempt, which ends in time and within so many bytes an answer, or is a fault.
pub(super) async fn attempt<T>(
    limit: Duration,
    most: u64,
    work: impl Future<Output = Result<T, object_store::Error>>,
) -> Result<T, Fault> {
    noted(limit, most, work).await.map(|(value, _)| value)
}

/// The same, with what the store said of the bytes that it keeps.
pub(crate) async fn attempt_put<T>(
    limit: Duration,
    work: impl Future<Output = Result<T, object_store::Error>>,
) -> Result<Stored, Fault> {
    noted(limit, MAX_ANSWER_BYTES, work).await.map(|(_, stored)| stored)
}

async fn noted<T>(
    limit: Duration,
    most: u64,
    work: impl Future<Output = Result<T, object_store::Error>>,
) -> Result<(T, Stored), Fault> {
    let watched = async {
        match tokio::time::timeout(limit, work).await {
            Err(_) => Err(Fault::Passing(format!("no answer within {:.0} s", limit.as_secs_f64()))),
            Ok(Ok(value)) => Ok((value, NOTES.with(|notes| notes.take().stored))),
            Ok(Err(error)) => Err(fault(&error, NOTES.with(|notes| notes.take().answer))),
        }
    };
    MOST.scope(most, NOTES.scope(RefCell::default(), watched)).await
}

/// Sorts an error by what the server answered, or else by what `object_store` made of it.
fn fault(error: &object_store::Error, answer: Option<Answer>) -> Fault {
    use object_store::Error as E;
    match answer {
        Some(Answer::Transport(why)) => return Fault::Passing(why),
        Some(Answer::Untrusted(why)) => return Fault::Untrusted(why),
        Some(Answer::Status { status, code }) => return of_status(status, &code),
        None => {}
    }
    match error {
        E::NotFound { .. } => Fault::NotFound,
        E::AlreadyExists { .. } | E::Precondition { .. } => Fault::Taken,
        _ if chain(error).any(|e| e.is::<LengthLimitError>()) => {
            Fault::Lasting("the store sends more than was asked for".into())
        }
        // An answer that began well and ended badly.
        _ if chain(error).any(|e| e.is::<HttpError>()) => Fault::Passing(innermost(error)),
        E::PermissionDenied { .. } | E::Unauthenticated { .. } => {
            Fault::Refused { reason: "access is denied".into(), cure: RIGHTS }
        }
        E::Generic { .. } if chain(error).any(|e| e.is::<std::io::Error>()) => Fault::Lasting(innermost(error)),
        other => Fault::Lasting(super::secrets::stripped(&other.to_string())),
    }
}

const RIGHTS: &str = "look at the credentials in the environment (AWS_*, GOOGLE_*, AZURE_*) or the standard files, and at their \
                      rights: to list, read, write and delete";

fn of_status(status: u16, code: &str) -> Fault {
    let told = if code.is_empty() { format!("the store answered {status}") } else { format!("{code} ({status})") };
    let refused = |cure| Fault::Refused { reason: told.clone(), cure };
    match (status, code) {
        (_, "NoSuchBucket" | "ContainerNotFound" | "InvalidBucketName" | "InvalidResourceName") => {
            refused("there is no such bucket: create it first, or mend its name in the URL")
        }
        (_, "RequestTimeTooSkewed") => refused("this machine's clock is wrong: set it"),
        (400, "ExpiredToken" | "InvalidToken" | "TokenRefreshRequired") => refused("get new credentials"),
        (401 | 403, _) => refused(RIGHTS),
        (301 | 302 | 303 | 307 | 308, _) => refused(
            "the bucket lies elsewhere, and redirects are not followed: set AWS_REGION (or the endpoint) to its own",
        ),
        (404, _) => Fault::NotFound,
        (409 | 412 | 304, _) => Fault::Taken,
        (416, _) => Fault::BeyondEnd,
        (501, _) => {
            refused("the server lacks something that is needed, such as puts with If-None-Match: use a newer one")
        }
        (408 | 425 | 429, _) | (500..=599, _) => Fault::Passing(told),
        // Throttled or interrupted, by S3-like servers that say so in the code.
        (_, "SlowDown" | "RequestTimeout" | "InternalError" | "IncompleteBody") => Fault::Passing(told),
        (200..=299, _) => Fault::Passing(told),
        _ => Fault::Lasting(told),
    }
}

fn chain<'e>(error: &'e (dyn Error + 'static)) -> impl Iterator<Item = &'e (dyn Error + 'static)> {
    std::iter::successors(Some(error), |&error| error.source())
}

/// The cause of causes: what the system said, without anything about the request.
fn innermost(error: &(dyn Error + 'static)) -> String {
    chain(error).last().map_or(String::new(), |cause| super::secrets::stripped(&cause.to_string()))
}

/// Why a server's certificate, or its TLS, is refused; `None` where that is not what happened.
fn distrust(error: &(dyn Error + 'static)) -> Option<String> {
    use rustls::Error as Tls;
    let tls = chain(error).find_map(|cause| wrapped(cause).downcast_ref::<Tls>())?;
    is_lasting(tls).then(|| tls.to_string())
}

/// Whether another try would be answered alike: the two cannot agree, or one of them is not trusted.
fn is_lasting(tls: &rustls::Error) -> bool {
    use rustls::{AlertDescription as Alert, Error as Tls};
    match tls {
        Tls::InvalidCertificate(_) | Tls::NoCertificatesPresented | Tls::PeerIncompatible(_) => true,
        Tls::InvalidMessage(_) => true,
        Tls::AlertReceived(alert) => !matches!(
            alert,
            Alert::CloseNotify
                | Alert::InternalError
                | Alert::UserCanceled
                | Alert::BadRecordMac
                | Alert::RecordOverflow
        ),
        _ => false,
    }
}

/// What an `io::Error` is made of: as a chain of causes goes, it shows the cause of that, and not that itself.
fn wrapped<'e>(mut error: &'e (dyn Error + 'static)) -> &'e (dyn Error + 'static) {
    while let Some(inside) = error.downcast_ref::<std::io::Error>().and_then(std::io::Error::get_ref) {
        error = inside;
    }
    error
}

/// Makes HTTP clients whose answers are noted and bounded.
#[derive(Debug)]
pub(crate) struct InspectedClient;

impl HttpConnector for InspectedClient {
    fn connect(&self, options: &ClientOptions) -> object_store::Result<HttpClient> {
        // TLS needs to know its cryptography; whoever comes second finds it known.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let failed = |source: reqwest::Error| object_store::Error::Generic { store: "HTTP", source: source.into() };
        let client = client(options).and_then(reqwest::ClientBuilder::build).map_err(failed)?;
        Ok(HttpClient::new(WatchedClient { inner: HttpClient::new(client) }))
    }
}

/// A client as the options say, which goes nowhere else than it was sent to. Attempts as a whole are limited by what they carry.
fn client(options: &ClientOptions) -> reqwest::Result<reqwest::ClientBuilder> {
    use ClientConfigKey as Key;
    let value = |key: Key| options.get_config_value(&key);
    let on = |key: Key| value(key).is_some_and(|value| value == "true");
    let mut builder = reqwest::Client::builder()
        .redirect(reqwest::redirect::Policy::none())
        .user_agent(concat!("marsyard/", env!("CARGO_PKG_VERSION")))
        .connect_timeout(Duration::from_secs(10))
        .timeout(Duration::from_secs(3600))
        .https_only(!on(Key::AllowHttp))
        // A compressed answer would have another length than its object.
        .no_gzip()
        .no_brotli()
        .no_zstd()
        .no_deflate();
    if on(Key::Http1Only) {
        builder = builder.http1_only();
    }
    if on(Key::AllowInvalidCertificates) {
        builder = builder.tls_danger_accept_invalid_certs(true);
    }
    if on(Key::NoSystemCertificates) {
        builder = builder.tls_certs_only([]);
    }
    if let Some(url) = value(Key::ProxyUrl) {
        let excluded = value(Key::ProxyExcludes).and_then(|hosts| reqwest::NoProxy::from_string(&hosts));
        builder = builder.proxy(reqwest::Proxy::all(url)?.no_proxy(excluded));
    }
    match value(Key::ProxyCaCertificate) {
        Some(pem) => Ok(builder.tls_certs_merge([reqwest::Certificate::from_pem(pem.as_bytes())?])),
        None => Ok(builder),
    }
}

#[derive(Debug)]
struct WatchedClient {
    inner: HttpClient,
}

fn note(answer: Option<Answer>, stored: Stored) {
    // Outside an attempt nobody asks.
    let _ = NOTES.try_with(|notes| notes.replace(Notes { answer, stored }));
}

#[async_trait]
impl HttpService for WatchedClient {
    async fn call(&self, request: HttpRequest) -> Result<HttpResponse, HttpError> {
        note(None, Stored::default());
        let response = self.inner.execute(request).await.inspect_err(|error| {
            let what = match error.kind() {
                HttpErrorKind::Connect => "cannot connect: ",
                HttpErrorKind::Timeout => "timed out: ",
                _ => "the connection broke: ",
            };
            let broken = || Answer::Transport(format!("{what}{}", innermost(error)));
            note(Some(distrust(error).map_or_else(broken, Answer::Untrusted)), Stored::default());
        })?;
        let (parts, body) = response.into_parts();
        if parts.status.is_success() {
            note(None, Stored::of(&parts.headers));
            let most = MOST.try_with(|most| *most).unwrap_or(MAX_ANSWER_BYTES);
            let most = usize::try_from(most).unwrap_or(usize::MAX);
            let bounded = Limited::new(body, most).map_err(|error| HttpError::new_boxed(HttpErrorKind::Decode, error));
            return Ok(HttpResponse::from_parts(parts, HttpResponseBody::new(bounded)));
        }
        let status = parts.status.as_u16();
        let bytes = beginning(body).await;
        let header = parts.headers.get("x-ms-error-code").and_then(|code| code.to_str().ok());
        let code = header.map_or_else(|| error_code(&bytes), plain_code);
        note(Some(Answer::Status { status, code }), Stored::default());
        Ok(HttpResponse::from_parts(parts, Bytes::from(bytes).into()))
    }
}

/// The first bytes of an error answer; the rest is not waited for.
async fn beginning(body: HttpResponseBody) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut pieces = body.bytes_stream();
    while let Ok(Some(piece)) = pieces.try_next().await {
        bytes.extend_from_slice(&piece);
        if bytes.len() >= MAX_ERROR_BYTES {
            break;
        }
    }
    bytes.truncate(MAX_ERROR_BYTES);
    bytes
}

/// What stands between `<Code>` and `</Code>`.
fn error_code(body: &[u8]) -> String {
    let text = String::from_utf8_lossy(body);
    let inside = text.split_once("<Code>").and_then(|(_, rest)| rest.split_once("</Code>"));
    inside.map_or_else(String::new, |(code, _)| plain_code(code))
}

/// A code is a word; anything else is not shown.
fn plain_code(code: &str) -> String {
    let word = code.len() <= 64 && code.chars().all(|c| c.is_ascii_alphanumeric());
    if word { code.into() } else { String::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_codes_are_read_and_anything_but_a_word_is_not_shown() {
        let body = b"<?xml version=\"1.0\"?><Error><Code>SlowDown</Code><AWSAccessKeyId>AKIA</AWSAccessKeyId></Error>";
        assert_eq!(error_code(body), "SlowDown");
        assert_eq!(error_code(b"<Code>a secret, perhaps</Code>"), "");
        assert_eq!(error_code(b"<Code>never closed"), "");
        assert_eq!(error_code(&[0xff; 100]), "");
    }

    #[test]
    fn exact_statuses_are_sorted_by_whether_trying_again_helps() {
        for passing in [500, 502, 503, 504, 429, 408] {
            assert!(matches!(of_status(passing, ""), Fault::Passing(_)), "{passing}");
        }
        assert!(matches!(of_status(400, "RequestTimeout"), Fault::Passing(_)));
        for (status, code) in [(403, "SignatureDoesNotMatch"), (401, ""), (404, "NoSuchBucket"), (301, ""), (501, "")] {
            assert!(matches!(of_status(status, code), Fault::Refused { .. }), "{status}");
        }
        assert_eq!(of_status(404, "NoSuchKey"), Fault::NotFound);
        assert_eq!(of_status(404, ""), Fault::NotFound);
        assert_eq!(of_status(412, "PreconditionFailed"), Fault::Taken);
        assert_eq!(of_status(409, "ConditionalRequestConflict"), Fault::Taken);
        assert_eq!(of_status(416, "InvalidRange"), Fault::BeyondEnd);
        assert!(matches!(of_status(400, "MalformedXML"), Fault::Lasting(_)));
    }

    #[test]
    fn exact_alerts_are_lasting_but_for_those_of_a_broken_connection() {
        use rustls::{AlertDescription as Alert, Error as Tls};
        let lasting = |alert| is_lasting(&Tls::AlertReceived(alert));
        let refusals = [Alert::ProtocolVersion, Alert::HandshakeFailure, Alert::UnknownCA, Alert::CertificateExpired];
        assert!(refusals.into_iter().all(lasting));
        assert!(![Alert::CloseNotify, Alert::InternalError, Alert::BadRecordMac].into_iter().any(lasting));
    }

    #[test]
    fn law_an_attempt_ends_in_time() {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
        let never = std::future::pending::<Result<(), object_store::Error>>();
        let ended = runtime.block_on(attempt(Duration::from_millis(20), 1, never));
        assert!(matches!(ended, Err(Fault::Passing(_))), "{ended:?}");
    }
}
