//! A name that nobody knows -> the one that was likely meant, and the names to choose from.

/// The one that was most likely meant.
pub(super) fn did_you_mean<'a>(typed: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = |s: &str| s.to_lowercase().replace(['-', '_', ' '], "");
    let typed = plain(typed);
    let score = |known: &str| {
        let name = plain(known);
        let unit_less = name.strip_suffix('m').or(name.strip_suffix("deg")).unwrap_or(&name);
        let alike = strsim::jaro_winkler(&typed, &name).max(strsim::jaro_winkler(&typed, unit_less) - 0.01);
        // A name cut short, or one of its words alone, says more than letters in common: 'tall', 'noise'.
        let is_part = typed.len() >= 4 && (name.starts_with(&typed) || known.split('_').any(|word| word == typed));
        if is_part { alike.max(0.95) } else { alike }
    };
    // The first of equals.
    let first = |best: (f64, &'a str), next: (f64, &'a str)| if next.0 > best.0 { next } else { best };
    let best = known.into_iter().map(|name| (score(name), name)).reduce(first)?;
    (best.0 > 0.82).then_some(best.1)
}

/// 'a', 'b' or 'c'.
pub(super) fn listed<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.into_iter().collect();
    match names.as_slice() {
        [] => "nothing".into(),
        [one] => (*one).into(),
        [rest @ .., last] => format!("{} or {last}", rest.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_likely_slips_find_their_key() {
        let keys = ["extent_m", "ground", "rocks", "boxes", "trees", "vegetation"];
        for (typed, meant) in [
            ("extent", Some("extent_m")),
            ("Extent_M", Some("extent_m")),
            ("rock", Some("rocks")),
            ("rokcs", Some("rocks")),
            ("vegitation", Some("vegetation")),
            ("terrain", None),
            ("", None),
        ] {
            assert_eq!(did_you_mean(typed, keys), meant, "{typed}");
        }
        // A name cut short, and a word of a name; two letters of a name are no guess.
        let rules = ["taller_than_wheel", "all", "taller_than_m"];
        assert_eq!(did_you_mean("tall", rules), Some("taller_than_wheel"));
        assert_eq!(did_you_mean("noise", ["range_noise", "intensity", "gates"]), Some("range_noise"));
        assert_eq!(did_you_mean("xy", rules), None);
    }
}
