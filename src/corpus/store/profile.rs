//! The standard AWS files (`~/.aws/credentials`, `~/.aws/config`) -> keys, region and endpoint of a profile.
//!
//! `object_store` reads the environment alone. Source: the AWS SDKs and Tools reference guide, "shared config and credentials
//! files". Taken: static keys, session token, `region`, `endpoint_url`. Not: roles to assume, single sign-on, processes; a
//! profile that needs one of them is refused with the command that turns it into environment variables.

use std::collections::BTreeMap;
use std::path::PathBuf;

/// What a profile says.
#[derive(Clone, Default, PartialEq, Eq)]
pub(crate) struct Profile {
    pub key_id: Option<String>,
    pub secret: Option<String>,
    pub token: Option<String>,
    pub region: Option<String>,
    pub endpoint: Option<String>,
}

/// Why a profile cannot be used, without its values.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct NoProfile {
    pub reason: String,
    pub cure: String,
}

type Section = BTreeMap<String, String>;

/// Keys of a profile that gets its credentials in a way that is not known here.
const OTHER_WAYS: [&str; 5] = ["role_arn", "sso_session", "sso_start_url", "credential_process", "login_session"];

/// The profile of the environment (`AWS_PROFILE`, else `default`); empty where nobody asked and there is none.
pub(crate) fn of_environment() -> Result<Profile, NoProfile> {
    let variable = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    let asked = variable("AWS_PROFILE").or_else(|| variable("AWS_DEFAULT_PROFILE"));
    let file = |name: &str, usual: &str| {
        let usual = || Some(PathBuf::from(variable("HOME")?).join(".aws").join(usual));
        let path = variable(name).map(PathBuf::from).or_else(usual)?;
        std::fs::read_to_string(path).ok()
    };
    let credentials = file("AWS_SHARED_CREDENTIALS_FILE", "credentials").unwrap_or_default();
    let config = file("AWS_CONFIG_FILE", "config").unwrap_or_default();
    choose(asked.as_deref(), &credentials, &config)
}

fn choose(asked: Option<&str>, credentials: &str, config: &str) -> Result<Profile, NoProfile> {
    let name = asked.unwrap_or("default");
    let in_config = if name == "default" { name.to_owned() } else { format!("profile {name}") };
    let config = sections(config).remove(&in_config);
    let credentials = sections(credentials).remove(name);
    if credentials.is_none() && config.is_none() {
        return match asked {
            None => Ok(Profile::default()),
            Some(name) => Err(NoProfile {
                reason: format!("AWS_PROFILE is '{name}', and neither ~/.aws/credentials nor ~/.aws/config has it"),
                cure: "mend AWS_PROFILE, or write the profile with `aws configure`".into(),
            }),
        };
    }
    // The credentials file wins.
    let mut all = config.unwrap_or_default();
    all.extend(credentials.unwrap_or_default());
    let mut take = |key: &str| all.remove(key);
    let (key_id, secret) = (take("aws_access_key_id"), take("aws_secret_access_key"));
    let token = take("aws_session_token");
    let (region, endpoint) = (take("region"), take("endpoint_url"));
    match (&key_id, &secret) {
        (None, None) if OTHER_WAYS.iter().any(|way| all.contains_key(*way)) => Err(NoProfile {
            reason: format!("the AWS profile '{name}' has no keys of its own"),
            cure: format!("run: eval \"$(aws configure export-credentials --profile {name} --format env)\""),
        }),
        (Some(_), None) | (None, Some(_)) => Err(NoProfile {
            reason: format!("the AWS profile '{name}' has one half of a key pair"),
            cure: "give it both aws_access_key_id and aws_secret_access_key".into(),
        }),
        _ => Ok(Profile { key_id, secret, token, region, endpoint }),
    }
}

/// Sections of an INI file; keys in small letters, settings of a service (indented) left out.
fn sections(text: &str) -> BTreeMap<String, Section> {
    let mut sections: BTreeMap<String, Section> = BTreeMap::new();
    let mut here = None;
    for line in text.lines() {
        let bare = line.trim();
        if bare.starts_with(['#', ';']) || bare.is_empty() {
            continue;
        }
        if let Some(name) = bare.strip_prefix('[').and_then(|rest| rest.split(']').next()) {
            let name = name.split_whitespace().collect::<Vec<_>>().join(" ");
            here = Some(sections.entry(name).or_default());
        } else if let (Some(section), Some((key, value))) = (&mut here, bare.split_once('='))
            && !line.starts_with([' ', '\t'])
        {
            let value = value.split(" #").next().unwrap_or_default().trim();
            section.insert(key.trim().to_ascii_lowercase(), value.to_owned());
        }
    }
    sections
}

#[cfg(test)]
mod tests {
    use super::*;

    const CREDENTIALS: &str = "# mine\n[default]\naws_access_key_id = AK1\naws_secret_access_key=s1/+=\n\n[lab]\n\
                               AWS_ACCESS_KEY_ID = AK2\naws_secret_access_key = s2  # old\naws_session_token = t2\n[half]\naws_access_key_id = AK3\n";
    const CONFIG: &str = "[default]\nregion = eu-north-1\ns3 =\n  addressing_style = path\n[profile lab]\nendpoint_url = http://127.0.0.1:9000\n\
                          [profile sso]\nsso_session = corp\nregion = us-west-2\n[profile  bare]\nregion = x\n";

    fn profile(asked: Option<&str>) -> Result<Profile, String> {
        choose(asked, CREDENTIALS, CONFIG).map_err(|no| format!("{}; {}", no.reason, no.cure))
    }

    #[test]
    fn exact_profiles_are_put_together_of_both_files() {
        let default = profile(None).ok().unwrap();
        assert_eq!((default.key_id.as_deref(), default.secret.as_deref()), (Some("AK1"), Some("s1/+=")));
        assert_eq!((default.region.as_deref(), default.token), (Some("eu-north-1"), None));
        let lab = profile(Some("lab")).ok().unwrap();
        assert_eq!((lab.key_id.as_deref(), lab.secret.as_deref()), (Some("AK2"), Some("s2")));
        assert_eq!((lab.token.as_deref(), lab.endpoint.as_deref()), (Some("t2"), Some("http://127.0.0.1:9000")));
        assert_eq!(profile(Some("bare")).ok().unwrap().region.as_deref(), Some("x"));
    }

    #[test]
    fn exact_what_cannot_be_used_is_refused_with_a_cure_and_without_values() {
        let said = |asked| profile(asked).err().unwrap();
        assert!(said(Some("gone")).contains("AWS_PROFILE is 'gone'"));
        assert!(said(Some("sso")).contains("aws configure export-credentials --profile sso"));
        let half = said(Some("half"));
        assert!(half.contains("one half") && !half.contains("AK3"), "{half}");
    }

    #[test]
    fn exact_no_files_and_no_wish_are_no_profile() {
        assert!(choose(None, "", "").ok() == Some(Profile::default()));
        assert!(choose(None, "not an ini file", "[").ok() == Some(Profile::default()));
    }
}
