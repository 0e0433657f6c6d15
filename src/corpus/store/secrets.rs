//! A message -> the same without the values of secret environment variables.
//!
//! Messages about object stores are made of status, code and place; this stands behind them for the texts of others (a
//! builder that cannot read a key, say), which may quote what they could not read.

/// Begin the names of the variables that object stores are set up with.
const FAMILIES: [&str; 5] = ["AWS_", "AZURE_", "GOOGLE_", "IDENTITY_", "SERVICE_ACCOUNT"];

/// A value this short would strip half of any text.
const MIN_LENGTH: usize = 6;

/// Whether what the variable holds must never be shown. Places, paths and switches may.
fn is_secret(name: &str) -> bool {
    let harmless =
        ["REGION", "ENDPOINT", "ALLOW_HTTP", "PROFILE", "FILE", "CREDENTIALS", "ACCOUNT_NAME", "BUCKET", "PATH"];
    let family = FAMILIES.iter().any(|family| name.starts_with(family));
    family && !harmless.iter().any(|end| name.contains(end))
}

/// `***` in place of each secret.
pub(crate) fn stripped(text: &str) -> String {
    let mut text = text.to_owned();
    for (name, value) in std::env::vars_os() {
        if let (Some(name), Some(value)) = (name.to_str(), value.to_str())
            && is_secret(name)
            && value.len() >= MIN_LENGTH
        {
            text = text.replace(value, "***");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_keys_and_tokens_are_secrets_and_places_are_not() {
        for secret in [
            "AWS_SECRET_ACCESS_KEY",
            "AWS_ACCESS_KEY_ID",
            "AWS_SESSION_TOKEN",
            "AZURE_STORAGE_ACCOUNT_KEY",
            "AZURE_STORAGE_SAS_KEY",
            "AZURE_CLIENT_SECRET",
            "GOOGLE_SERVICE_ACCOUNT_KEY",
        ] {
            assert!(is_secret(secret), "{secret}");
        }
        for plain in
            ["AWS_REGION", "AWS_ENDPOINT_URL", "HOME", "GOOGLE_APPLICATION_CREDENTIALS", "AZURE_STORAGE_ACCOUNT_NAME"]
        {
            assert!(!is_secret(plain), "{plain}");
        }
    }
}
