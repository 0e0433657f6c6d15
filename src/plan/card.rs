//! The `card` section of a config: what the corpus's card says of licence, authors and citation.
//!
//! It changes no row: it stands outside the plan's hashes, and a finished corpus takes another card without a shard being built.
//! Licences are named as SPDX does (<https://spdx.org/licenses>), of which the common ones for data are known here.

use garde::Validate;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Licences for data by their SPDX names, each with the name that Hugging Face has for it.
const LICENSES: [(&str, &str); 17] = [
    ("CC0-1.0", "cc0-1.0"),
    ("CC-BY-3.0", "cc-by-3.0"),
    ("CC-BY-4.0", "cc-by-4.0"),
    ("CC-BY-SA-3.0", "cc-by-sa-3.0"),
    ("CC-BY-SA-4.0", "cc-by-sa-4.0"),
    ("CC-BY-NC-4.0", "cc-by-nc-4.0"),
    ("CC-BY-NC-SA-4.0", "cc-by-nc-sa-4.0"),
    ("CC-BY-NC-ND-4.0", "cc-by-nc-nd-4.0"),
    ("CC-BY-ND-4.0", "cc-by-nd-4.0"),
    ("ODbL-1.0", "odbl"),
    ("ODC-By-1.0", "odc-by"),
    ("PDDL-1.0", "pddl"),
    ("CDLA-Permissive-1.0", "cdla-permissive-1.0"),
    ("CDLA-Permissive-2.0", "cdla-permissive-2.0"),
    ("CDLA-Sharing-1.0", "cdla-sharing-1.0"),
    ("MIT", "mit"),
    ("Apache-2.0", "apache-2.0"),
];

/// What the card of the corpus (`README.md`, `croissant.json`) says beside what the plan tells: changes no row and no id.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, Validate)]
#[serde(deny_unknown_fields, default)]
pub struct CardParams {
    /// Licence that the data is given under, by its SPDX name: CC-BY-4.0, CC0-1.0, ODbL-1.0 ...; one's own as LicenseRef-NAME.
    /// Absent = not stated, which the card says.
    #[garde(custom(spdx_name))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub license: Option<String>,
    /// Who made it, one name an entry.
    #[garde(custom(lines))]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub authors: Vec<String>,
    /// How to cite it, as text or BibTeX; absent = by the corpus_id.
    #[garde(custom(not_empty))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub citation: Option<String>,
    /// Where it is published.
    #[garde(custom(web_address))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub url: Option<String>,
    /// When it was published, as YYYY-MM-DD. It is not filled in: the same plan gives the same bytes on any day.
    #[garde(custom(date))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub date_published: Option<String>,
}

impl CardParams {
    /// The licence as Hugging Face writes it, where it has a name for it.
    pub fn hub_license(&self) -> Option<&'static str> {
        let license = self.license.as_deref()?;
        LICENSES.iter().find(|(spdx, _)| *spdx == license).map(|(_, hub)| *hub)
    }

    /// The licence's page, where SPDX has one.
    pub fn license_url(&self) -> Option<String> {
        let license = self.license.as_deref().filter(|license| !license.starts_with(OWN))?;
        Some(format!("https://spdx.org/licenses/{license}"))
    }
}

/// How the name of a licence begins that SPDX does not list.
const OWN: &str = "LicenseRef-";

fn spdx_name(license: &Option<String>, _: &()) -> garde::Result {
    let Some(license) = license else { return Ok(()) };
    if let Some((known, _)) = LICENSES.iter().find(|(known, _)| known.eq_ignore_ascii_case(license) && known != license)
    {
        return Err(garde::Error::new(format!("must be written as SPDX does: {known}, got {license}")));
    }
    let letters = license.chars().all(|c| c.is_ascii_alphanumeric() || "-.+".contains(c));
    let is_name = letters && license.starts_with(|c: char| c.is_ascii_alphanumeric()) && license != OWN;
    if is_name && !license.eq_ignore_ascii_case("unknown") {
        return Ok(());
    }
    let rule =
        "must be an SPDX name such as CC-BY-4.0 or CC0-1.0 (spdx.org/licenses), or LicenseRef-NAME for one's own";
    Err(garde::Error::new(format!("{rule}, got {license}")))
}

fn lines(texts: &[String], _: &()) -> garde::Result {
    match texts.iter().find(|text| text.trim().is_empty() || text.contains(char::is_control)) {
        Some(text) => Err(garde::Error::new(format!("needs a name on one line in each entry, got {text:?}"))),
        None => Ok(()),
    }
}

fn not_empty(text: &Option<String>, _: &()) -> garde::Result {
    match text {
        Some(text) if text.trim().is_empty() => Err(garde::Error::new("needs some text, or is to be left out")),
        _ => Ok(()),
    }
}

fn web_address(url: &Option<String>, _: &()) -> garde::Result {
    let is_one = |url: &str| {
        let rest = url.strip_prefix("https://").or_else(|| url.strip_prefix("http://"));
        rest.is_some_and(|rest| !rest.is_empty())
            && !url.contains(|c: char| c.is_whitespace() || c.is_control() || "<>\"".contains(c))
    };
    match url {
        Some(url) if !is_one(url) => {
            Err(garde::Error::new(format!("must begin with https:// and hold no spaces, got {url}")))
        }
        _ => Ok(()),
    }
}

fn date(date: &Option<String>, _: &()) -> garde::Result {
    let is_one = |date: &str| {
        let parts: Vec<&str> = date.split('-').collect();
        let [year, month, day] = parts[..] else { return false };
        let is_number = |text: &str, digits: usize| text.len() == digits && text.bytes().all(|b| b.is_ascii_digit());
        let within = |text: &str, most: u32| text.parse().is_ok_and(|value: u32| (1..=most).contains(&value));
        is_number(year, 4) && is_number(month, 2) && is_number(day, 2) && within(month, 12) && within(day, 31)
    };
    match date {
        Some(date) if !is_one(date) => Err(garde::Error::new(format!("must be a date as YYYY-MM-DD, got {date}"))),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(card: &CardParams) -> Option<String> {
        card.validate().err().map(|report| report.to_string())
    }

    #[test]
    fn exact_licences_are_spdx_names() {
        let with = |license: &str| CardParams { license: Some(license.into()), ..CardParams::default() };
        for good in ["CC-BY-4.0", "ODbL-1.0", "EUPL-1.2", "LicenseRef-Lab", "0BSD"] {
            assert_eq!(fault(&with(good)), None, "{good}");
        }
        let said = fault(&with("cc-by-4.0")).unwrap();
        assert!(said.contains("SPDX does: CC-BY-4.0"), "{said}");
        for bad in ["", "unknown", "CC BY 4.0", "LicenseRef-", "-x", "https://example.org/license", "a\nb"] {
            assert!(fault(&with(bad)).is_some(), "{bad:?}");
        }
        assert_eq!(with("ODbL-1.0").hub_license(), Some("odbl"));
        assert_eq!((with("EUPL-1.2").hub_license(), with("LicenseRef-Lab").license_url()), (None, None));
        assert_eq!(with("EUPL-1.2").license_url().unwrap(), "https://spdx.org/licenses/EUPL-1.2");
    }

    #[test]
    fn exact_dates_addresses_and_names_are_checked() {
        let good = CardParams {
            authors: vec!["Ann Example".into()],
            citation: Some("@misc{mine}".into()),
            url: Some("https://example.org/data".into()),
            date_published: Some("2026-11-22".into()),
            ..CardParams::default()
        };
        assert_eq!(fault(&good), None);
        for date in ["22.11.2026", "2026-13-01", "2026-1-1", "2026-00-10", "+026-01-01"] {
            assert!(fault(&CardParams { date_published: Some(date.into()), ..good.clone() }).is_some(), "{date}");
        }
        for url in ["example.org", "https://", "https://a b", "javascript:alert(1)"] {
            assert!(fault(&CardParams { url: Some(url.into()), ..good.clone() }).is_some(), "{url}");
        }
        assert!(fault(&CardParams { authors: vec!["a\nb".into()], ..good.clone() }).is_some());
        assert!(fault(&CardParams { citation: Some(" ".into()), ..good }).is_some());
    }
}
