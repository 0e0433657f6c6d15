//! What can be wrong with a cloud and what goes with it; each message names the file, the place, the rule and the cure.

/// Why a cloud cannot be read or used.
#[derive(Debug, thiserror::Error)]
pub enum CloudError {
    #[error("{file}: {}", unreadable(source))]
    Io { file: String, source: std::io::Error },
    #[error(
        "{file}: the format of a cloud is told by its name: .ply, .pcd, .las, .csv, .xyz, .txt or .bin (KITTI); rename it or convert it"
    )]
    UnknownFormat { file: String },
    #[error(
        "{file}: {place} ends after {there} bytes where {needed} were announced: the file was cut off; copy it again"
    )]
    Truncated { file: String, place: String, needed: u64, there: u64 },
    #[error("{file}: {place}: {reason}")]
    Malformed { file: String, place: String, reason: String },
    #[error("{file}: {feature} is not supported; {cure}")]
    NotSupported { file: String, feature: String, cure: &'static str },
    #[error(
        "{file}: there is no point in it{}; give a scan with returns",
        if *not_finite == 0 { String::new() } else { format!(" with finite coordinates ({not_finite} are NaN or infinite)") }
    )]
    NoPoints { file: String, not_finite: u64 },
    #[error("{file}: label {label} (point {point}) is not in the label mapping; add it, or add `others: ignore`")]
    UnmappedLabel { file: String, label: i64, point: usize },
    #[error("{file}: no pose for the cloud {cloud}: {reason}")]
    NoPose { file: String, cloud: String, reason: String },
}

/// Why a file that a user named cannot be read, and what to do.
fn unreadable(source: &std::io::Error) -> String {
    use std::io::ErrorKind;
    match source.kind() {
        ErrorKind::NotFound => "there is no such file; check its name, and the folder that this was started in".into(),
        ErrorKind::NotADirectory => {
            "there is no such file: what stands before its name is no folder; check the path".into()
        }
        ErrorKind::IsADirectory => "it is a folder; name the files in it, one by one or as FOLDER/*.ply".into(),
        ErrorKind::PermissionDenied => {
            "it may not be read by you; make it readable (`chmod u+r`), or run this as its owner".into()
        }
        _ => format!("it cannot be read: {source}"),
    }
}
