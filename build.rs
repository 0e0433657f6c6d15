//! Tells the binary which commit, compiler and target made it; the manifest of a corpus repeats them.

use std::process::Command;

fn main() {
    let git = |args: &[&str]| said(Command::new("git").args(args));
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    println!("cargo::rustc-env=MARSYARD_COMMIT={}", git(&["rev-parse", "HEAD"]));
    println!("cargo::rustc-env=MARSYARD_RUSTC={}", said(Command::new(rustc).arg("--version")));
    println!("cargo::rustc-env=MARSYARD_TARGET={}", std::env::var("TARGET").unwrap_or_else(|_| "unknown".into()));
    println!("cargo::rerun-if-changed=build.rs");
    // Grows with every commit and checkout, in the main tree and in worktrees alike.
    let head_log = git(&["rev-parse", "--git-path", "logs/HEAD"]);
    if std::path::Path::new(&head_log).exists() {
        println!("cargo::rerun-if-changed={head_log}");
    }
}

/// What a command prints, or "unknown" where it cannot be run (a source tree without git).
fn said(command: &mut Command) -> String {
    command
        .output()
        .ok()
        .filter(|output| output.status.success())
        .and_then(|output| String::from_utf8(output.stdout).ok())
        .map_or_else(|| "unknown".into(), |text| text.trim().to_string())
}
