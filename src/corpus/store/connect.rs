//! A bucket's name -> a store in it, with credentials from the environment and the standard files.
//!
//! | | environment | files |
//! |---|---|---|
//! | `s3://` | `AWS_ACCESS_KEY_ID`, `AWS_SECRET_ACCESS_KEY`, `AWS_SESSION_TOKEN`, `AWS_REGION`, `AWS_ENDPOINT_URL`, web identity, containers | `~/.aws/credentials`, `~/.aws/config` (`AWS_PROFILE`) |
//! | `gs://` | `GOOGLE_SERVICE_ACCOUNT`, `GOOGLE_SERVICE_ACCOUNT_KEY` | `GOOGLE_APPLICATION_CREDENTIALS`, gcloud's own |
//! | `az://` | `AZURE_STORAGE_ACCOUNT_NAME` with `AZURE_STORAGE_ACCOUNT_KEY`, `AZURE_STORAGE_SAS_KEY`, or a client, token or identity | |
//!
//! Without any of them, the cloud machine's own identity is used where there is one to ask; that is found out in a second
//! here rather than by minutes of retries. Plain http is for this machine (loopback), or for `AWS_ALLOW_HTTP=true` and its like.

use std::collections::HashMap;
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::path::PathBuf;
use std::sync::{Arc, LazyLock, Mutex};
use std::time::Duration;

use object_store::aws::{AmazonS3Builder, AmazonS3ConfigKey};
use object_store::azure::{AzureConfigKey, MicrosoftAzureBuilder};
use object_store::gcp::{GoogleCloudStorageBuilder, GoogleConfigKey};
use object_store::{BackoffConfig, ClientConfigKey, ObjectStore, RetryConfig};

use super::address::Service;
use super::inspected_client::InspectedClient;
use super::objects::ObjectFolder;
use super::{profile, secrets};
use crate::corpus::CorpusError;

/// Where cloud machines tell their programs who they are, in all three clouds.
const IDENTITY: &str = "169.254.169.254:80";

/// A client a bucket: connections and tokens are shared by all places in it.
static CLIENTS: LazyLock<Mutex<HashMap<Bucket, Arc<dyn ObjectStore>>>> = LazyLock::new(Mutex::default);

/// Its service and name.
type Bucket = (Service, String);

/// Opens a place in a bucket; the bucket itself is not asked.
pub(crate) fn connect(service: Service, bucket: &str, prefix: &str) -> Result<ObjectFolder, CorpusError> {
    let url = format!("{}://{bucket}", service.scheme());
    let mut clients = CLIENTS.lock().expect("no thread panics while it holds the clients");
    let client = match clients.get(&(service, bucket.to_owned())) {
        Some(client) => Arc::clone(client),
        None => {
            let client = match service {
                Service::S3 => amazon(&url, bucket)?,
                Service::Google => google(&url, bucket)?,
                Service::Azure => azure(&url, bucket)?,
            };
            clients.insert((service, bucket.to_owned()), Arc::clone(&client));
            client
        }
    };
    Ok(ObjectFolder::new(client, &url, prefix))
}

/// Retries within a request, for what is over in a moment; longer trouble is [`ObjectFolder`]'s.
fn retry() -> RetryConfig {
    let backoff =
        BackoffConfig { init_backoff: Duration::from_millis(100), max_backoff: Duration::from_secs(1), base: 2.0 };
    RetryConfig { backoff, max_retries: 2, retry_timeout: Duration::from_secs(10) }
}

fn amazon(url: &str, bucket: &str) -> Result<Arc<dyn ObjectStore>, CorpusError> {
    use AmazonS3ConfigKey as Key;
    let mut builder =
        AmazonS3Builder::from_env().with_bucket_name(bucket).with_retry(retry()).with_disable_bulk_delete(true);
    let has = |builder: &AmazonS3Builder, keys: &[Key]| keys.iter().any(|key| builder.get_config_value(key).is_some());
    let own = [Key::AccessKeyId, Key::SecretAccessKey, Key::WebIdentityTokenFile];
    let container = [Key::ContainerCredentialsRelativeUri, Key::ContainerCredentialsFullUri];
    let unsigned = builder.get_config_value(&Key::SkipSignature).is_some_and(|value| value == "true");
    if !unsigned && !has(&builder, &own) && !has(&builder, &container) {
        let profile = profile::of_environment().map_err(|no| refused(url, &no.reason, &no.cure))?;
        let region = profile.region.filter(|_| !has(&builder, &[Key::Region, Key::DefaultRegion]));
        let endpoint = profile.endpoint.filter(|_| !has(&builder, &[Key::Endpoint, Key::S3Endpoint]));
        if profile.key_id.is_none() {
            let switched_off = std::env::var("AWS_EC2_METADATA_DISABLED").is_ok_and(|value| value == "true");
            let asked = builder.get_config_value(&Key::MetadataEndpoint);
            must_have_identity(
                url,
                switched_off,
                asked.as_deref(),
                "set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or AWS_PROFILE",
            )?;
        }
        let settings = [
            (Key::AccessKeyId, profile.key_id),
            (Key::SecretAccessKey, profile.secret),
            (Key::Token, profile.token),
            (Key::Region, region),
            (Key::Endpoint, endpoint),
        ];
        for (key, value) in settings {
            builder = value.into_iter().fold(builder, |builder, value| builder.with_config(key, value));
        }
    }
    let endpoint = builder.get_config_value(&Key::S3Endpoint).or_else(|| builder.get_config_value(&Key::Endpoint));
    let allowed = builder.get_config_value(&Key::Client(ClientConfigKey::AllowHttp));
    if may_be_plain(url, endpoint.as_deref(), allowed.as_deref(), "AWS_ENDPOINT_URL", "AWS_ALLOW_HTTP")? {
        builder = builder.with_allow_http(true);
    }
    built(url, builder.with_http_connector(InspectedClient).build())
}

fn google(url: &str, bucket: &str) -> Result<Arc<dyn ObjectStore>, CorpusError> {
    use GoogleConfigKey as Key;
    let mut builder = GoogleCloudStorageBuilder::from_env().with_bucket_name(bucket).with_retry(retry());
    let keys = [Key::ServiceAccount, Key::ServiceAccountKey, Key::ApplicationCredentials, Key::BearerToken];
    let unsigned = builder.get_config_value(&Key::SkipSignature).is_some_and(|value| value == "true");
    let gcloud = std::env::var_os("HOME")
        .map(|home| PathBuf::from(home).join(".config/gcloud/application_default_credentials.json"));
    let known = unsigned
        || keys.iter().any(|key| builder.get_config_value(key).is_some())
        || gcloud.is_some_and(|file| file.is_file());
    if !known {
        let switched_off = std::env::var("NO_GCE_CHECK").is_ok_and(|value| value == "true");
        must_have_identity(url, switched_off, None, "set GOOGLE_APPLICATION_CREDENTIALS to a key file")?;
    }
    let endpoint = builder.get_config_value(&Key::BaseUrl);
    let allowed = builder.get_config_value(&Key::Client(ClientConfigKey::AllowHttp));
    if may_be_plain(url, endpoint.as_deref(), allowed.as_deref(), "GOOGLE_BASE_URL", "GOOGLE_ALLOW_HTTP")? {
        builder = builder.with_config(Key::Client(ClientConfigKey::AllowHttp), "true");
    }
    built(url, builder.with_http_connector(InspectedClient).build())
}

fn azure(url: &str, bucket: &str) -> Result<Arc<dyn ObjectStore>, CorpusError> {
    use AzureConfigKey as Key;
    let mut builder = MicrosoftAzureBuilder::from_env().with_container_name(bucket).with_retry(retry());
    let value = |builder: &MicrosoftAzureBuilder, key: Key| builder.get_config_value(&key);
    let on = |key: Key| value(&builder, key).is_some_and(|value| value == "true");
    let emulator = on(Key::UseEmulator);
    if !emulator && value(&builder, Key::AccountName).is_none() {
        return Err(refused(url, "the storage account is not named", "set AZURE_STORAGE_ACCOUNT_NAME"));
    }
    let keys = [Key::AccessKey, Key::SasKey, Key::Token, Key::ClientSecret, Key::FederatedTokenFile, Key::MsiEndpoint];
    let other = emulator || on(Key::SkipSignature) || on(Key::UseAzureCli);
    if !other && keys.into_iter().all(|key| value(&builder, key).is_none()) {
        must_have_identity(url, false, None, "set AZURE_STORAGE_ACCOUNT_KEY, or AZURE_STORAGE_SAS_KEY")?;
    }
    let endpoint = value(&builder, Key::Endpoint);
    let allowed = value(&builder, Key::Client(ClientConfigKey::AllowHttp));
    if may_be_plain(url, endpoint.as_deref(), allowed.as_deref(), "AZURE_STORAGE_ENDPOINT", "AZURE_ALLOW_HTTP")? {
        builder = builder.with_allow_http(true);
    }
    built(url, builder.with_http_connector(InspectedClient).build())
}

fn refused(place: &str, reason: &str, cure: &str) -> CorpusError {
    CorpusError::Refused { place: place.into(), reason: reason.into(), cure: cure.into() }
}

fn built<S: ObjectStore>(url: &str, built: object_store::Result<S>) -> Result<Arc<dyn ObjectStore>, CorpusError> {
    match built {
        Ok(store) => Ok(Arc::new(store)),
        Err(error) => {
            let cure = "look at the variables AWS_*, GOOGLE_* or AZURE_* and at the files that they name";
            Err(refused(url, &secrets::stripped(&error.to_string()), cure))
        }
    }
}

/// There are no credentials: is there a cloud machine around us, to ask?
fn must_have_identity(url: &str, switched_off: bool, asked: Option<&str>, cure: &str) -> Result<(), CorpusError> {
    let authority = asked.map(|endpoint| authority(endpoint).to_owned());
    let address = authority.map(|at| if at.contains(':') { at } else { format!("{at}:80") });
    let address = address.as_deref().unwrap_or(IDENTITY);
    let answers = |at: SocketAddr| TcpStream::connect_timeout(&at, Duration::from_secs(1)).is_ok();
    if !switched_off && address.to_socket_addrs().is_ok_and(|mut all| all.any(answers)) {
        return Ok(());
    }
    Err(refused(url, "there are no credentials, neither in the environment nor in the standard files", cure))
}

/// Host and port of an endpoint.
fn authority(endpoint: &str) -> &str {
    let rest = endpoint.split_once("://").map_or(endpoint, |(_, rest)| rest);
    rest.split('/').next().unwrap_or_default()
}

/// Whether plain http is to be allowed; refused where it is asked for and not safe.
fn may_be_plain(
    url: &str,
    endpoint: Option<&str>,
    allowed: Option<&str>,
    variable: &str,
    switch: &str,
) -> Result<bool, CorpusError> {
    let Some(endpoint) = endpoint else { return Ok(false) };
    let authority = authority(endpoint);
    if authority.contains('@') || endpoint.contains('?') {
        let cure = format!("leave it out of {variable}");
        return Err(refused(url, "the endpoint holds a user name, a key or a signature", &cure));
    }
    if endpoint.starts_with("https://") {
        return Ok(false);
    }
    if !endpoint.starts_with("http://") {
        let cure = format!("write {variable}=https://HOST or http://HOST:PORT");
        return Err(refused(url, "the endpoint is no URL", &cure));
    }
    let bracketed = authority.strip_prefix('[').and_then(|rest| rest.split(']').next());
    let host = bracketed.unwrap_or_else(|| authority.split(':').next().unwrap_or_default());
    let loopback = host == "localhost" || host.parse::<std::net::IpAddr>().is_ok_and(|ip| ip.is_loopback());
    if loopback || allowed == Some("true") {
        return Ok(true);
    }
    let cure = format!("use https://, or set {switch}=true where the network is your own");
    Err(refused(url, "the endpoint is plain http on another machine: keys and data could be read on the way", &cure))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(endpoint: Option<&str>, allowed: Option<&str>) -> Result<bool, String> {
        may_be_plain("s3://b", endpoint, allowed, "AWS_ENDPOINT_URL", "AWS_ALLOW_HTTP").map_err(|e| e.to_string())
    }

    #[test]
    fn exact_plain_http_is_for_loopback_and_for_who_asks() {
        for endpoint in ["http://127.0.0.1:9000", "http://localhost:1/x", "http://[::1]:80", "http://127.8.8.8"] {
            assert_eq!(plain(Some(endpoint), None), Ok(true), "{endpoint}");
        }
        assert_eq!(plain(Some("https://127.0.0.1"), None), Ok(false));
        assert_eq!(plain(None, None), Ok(false));
        assert_eq!(plain(Some("http://store.lab:9000"), Some("true")), Ok(true));
        for endpoint in ["http://store.lab:9000", "http://10.0.0.1", "http://127.0.0.1.evil.example"] {
            assert!(plain(Some(endpoint), None).unwrap_err().contains("AWS_ALLOW_HTTP=true"), "{endpoint}");
        }
        assert!(plain(Some("store.lab:9000"), None).unwrap_err().contains("no URL"));
        assert!(!plain(Some("http://key:hush@127.0.0.1"), None).unwrap_err().contains("hush"));
    }

    #[test]
    fn exact_endpoints_have_an_authority() {
        assert_eq!(authority("http://127.0.0.1:9000/x"), "127.0.0.1:9000");
        assert_eq!(authority("host"), "host");
    }

    #[test]
    fn law_without_credentials_and_without_a_cloud_around_nothing_is_tried() {
        let started = std::time::Instant::now();
        // Nobody listens at the discard port of this machine.
        let said = must_have_identity("s3://b", false, Some("http://127.0.0.1:9"), "set X").unwrap_err().to_string();
        assert!(said.contains("no credentials") && said.contains("set X"), "{said}");
        assert!(must_have_identity("s3://b", true, None, "set X").is_err());
        assert!(started.elapsed() < Duration::from_secs(5));
    }
}
