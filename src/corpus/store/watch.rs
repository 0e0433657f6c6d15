//! One attempt at an object store -> what it gave, or the fault, sorted by whether trying again may help.
//!
//! Sits between `object_store` and its HTTP client and notes how each request was answered, so that faults are told apart
//! by status and error code, not by the wording of a message. Texts of faults are made of status, code and the operating
//! system's words alone: bodies and URLs of requests can hold keys and signatures, and are never repeated.

use std::cell::RefCell;
use std::error::Error;
use std::time::Duration;

use async_trait::async_trait;
use bytes::Bytes;
use object_store::ClientOptions;
use object_store::client::{
    HttpClient, HttpConnector, HttpError, HttpErrorKind, HttpRequest, HttpResponse, HttpService, ReqwestConnector,
};

/// Why an attempt failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fault {
    /// There is no such object.
    NotFound,
    /// A create-only put found the name taken, or another writer at it.
    Taken,
    /// A range that begins behind the object's end.
    BeyondEnd,
    /// Bucket, credentials or rights: trying again does not help.
    Refused { reason: String, cure: &'static str },
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
}

tokio::task_local! {
    /// The last request's failure within one attempt.
    static ANSWER: RefCell<Option<Answer>>;
}

/// The longest error answer that is looked at.
const MAX_ERROR_BYTES: usize = 64 * 1024;

/// Runs one attempt, which ends in time or is a fault.
pub async fn attempt<T>(
    limit: Duration,
    work: impl Future<Output = Result<T, object_store::Error>>,
) -> Result<T, Fault> {
    let watched = async {
        match tokio::time::timeout(limit, work).await {
            Err(_) => Err(Fault::Passing(format!("no answer within {:.0} s", limit.as_secs_f64()))),
            Ok(Ok(value)) => Ok(value),
            Ok(Err(error)) => Err(fault(&error, ANSWER.with(|cell| cell.borrow().clone()))),
        }
    };
    ANSWER.scope(RefCell::new(None), watched).await
}

/// Sorts an error by what the server answered, or else by what `object_store` made of it.
fn fault(error: &object_store::Error, answer: Option<Answer>) -> Fault {
    use object_store::Error as E;
    match answer {
        Some(Answer::Transport(why)) => return Fault::Passing(why),
        Some(Answer::Status { status, code }) => return of_status(status, &code),
        None => {}
    }
    match error {
        E::NotFound { .. } => Fault::NotFound,
        E::AlreadyExists { .. } | E::Precondition { .. } => Fault::Taken,
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
        (301 | 302 | 307 | 308, _) => refused("the bucket lies elsewhere: set AWS_REGION (or the endpoint) to its own"),
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

/// Makes HTTP clients whose answers are noted.
#[derive(Debug)]
pub struct Watched;

impl HttpConnector for Watched {
    fn connect(&self, options: &ClientOptions) -> object_store::Result<HttpClient> {
        // TLS needs to know its cryptography; whoever comes second finds it known.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let inner = ReqwestConnector::default().connect(options)?;
        Ok(HttpClient::new(WatchedClient { inner }))
    }
}

#[derive(Debug)]
struct WatchedClient {
    inner: HttpClient,
}

fn note(answer: Option<Answer>) {
    // Outside an attempt nobody asks.
    let _ = ANSWER.try_with(|cell| cell.replace(answer));
}

#[async_trait]
impl HttpService for WatchedClient {
    async fn call(&self, request: HttpRequest) -> Result<HttpResponse, HttpError> {
        note(None);
        let response = self.inner.execute(request).await.inspect_err(|error| {
            let what = match error.kind() {
                HttpErrorKind::Connect => "cannot connect: ",
                HttpErrorKind::Timeout => "timed out: ",
                _ => "the connection broke: ",
            };
            note(Some(Answer::Transport(format!("{what}{}", innermost(error)))));
        })?;
        if response.status().is_success() {
            return Ok(response);
        }
        let (parts, body) = response.into_parts();
        let status = parts.status.as_u16();
        let bytes = body.bytes().await.unwrap_or_else(|_| Bytes::new());
        let header = parts.headers.get("x-ms-error-code").and_then(|code| code.to_str().ok());
        let code = header.map_or_else(|| error_code(&bytes), plain_code);
        note(Some(Answer::Status { status, code }));
        Ok(HttpResponse::from_parts(parts, bytes.into()))
    }
}

/// What stands between `<Code>` and `</Code>`.
fn error_code(body: &[u8]) -> String {
    let text = String::from_utf8_lossy(&body[..body.len().min(MAX_ERROR_BYTES)]);
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
    fn law_an_attempt_ends_in_time() {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
        let never = std::future::pending::<Result<(), object_store::Error>>();
        let ended = runtime.block_on(attempt(Duration::from_millis(20), never));
        assert!(matches!(ended, Err(Fault::Passing(_))), "{ended:?}");
    }
}
