//! A command and how to disturb it -> the system calls on files that it made, and how it ended.
//!
//! The tracer is a C program: Rust's library goes through libc, rustix and tempfile do not, and only the kernel sees both.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use crate::tree;

/// The compiled tracer.
pub struct Tracer {
    program: PathBuf,
}

/// What is done to a command; calls are numbered from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum How<'a> {
    /// Nothing; its changes to files are listed.
    Changes,
    /// Nothing; all its calls on files are listed.
    Calls,
    /// Killed before a change.
    Kill(usize),
    /// Killed before a change; what was not synced is lost.
    Cut(usize, Names),
    /// One call of a class fails: the first from this one of all calls on.
    Fail(usize, &'a str, Fault),
}

/// What a power cut does to names that were made, moved or removed since their folder was synced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Names {
    /// They are on disk, though the data of their files may not be.
    Keep,
    /// They are as they were.
    Undo,
}

/// How a call fails: with this error, or by moving half of the bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    Error(&'static str),
    Short,
}

/// A system call on a file in the folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Call {
    /// From 1.
    pub number: usize,
    pub name: String,
    pub class: String,
    /// From the folder on; the changing part of temporary names is left out.
    pub path: String,
}

/// How a command ended.
pub struct End {
    /// [`Tracer::KILLED`] where the tracer killed it; 128 and the signal where it died of one.
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
    pub calls: Vec<Call>,
    /// The number of the call that was made to fail first.
    pub failed: Option<usize>,
}

impl std::fmt::Display for Call {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {} {}", self.number, self.name, self.path)
    }
}

impl Tracer {
    pub const KILLED: i32 = 200;
    const UNABLE: i32 = 201;

    /// The tracer; where there can be none, says so once and gives nothing.
    pub fn get() -> Option<&'static Tracer> {
        static TRACER: OnceLock<Option<Tracer>> = OnceLock::new();
        let tracer = TRACER.get_or_init(|| match Tracer::compile() {
            Ok(tracer) => Some(tracer),
            Err(reason) => {
                // Not by a macro of the test harness, which would hide it.
                let said = format!("\nSKIPPED, nothing is tested for crashes: {reason}\n");
                std::io::stderr().write_all(said.as_bytes()).expect("stderr");
                None
            }
        });
        tracer.as_ref()
    }

    fn compile() -> Result<Tracer, String> {
        if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
            return Err("the tracer knows the calls of x86-64 Linux alone".into());
        }
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/crash/tracer.c");
        // Another test process may compile it at the same time.
        let (own, program) = (folder.join(format!("tracer-{}", std::process::id())), folder.join("tracer"));
        let compiled = Command::new("cc").args(["-O1", "-o"]).arg(&own).arg(&source).output();
        let compiled = compiled.map_err(|error| format!("no C compiler: cc: {error}"))?;
        if !compiled.status.success() {
            return Err(format!("cc: {}", String::from_utf8_lossy(&compiled.stderr)));
        }
        std::fs::rename(&own, &program).map_err(|error| error.to_string())?;
        let tracer = Tracer { program };
        let tried = tracer.run(folder, How::Calls, Command::new("true"));
        match tried.code {
            0 => Ok(tracer),
            _ => Err(tried.stderr),
        }
    }

    /// Runs a command in a folder. Files elsewhere are not seen.
    pub fn run(&self, folder: &Path, how: How, command: Command) -> End {
        let log = folder.with_extension("calls");
        let mut traced = Command::new(&self.program);
        traced.arg(&log).arg(folder).args(how.words()).arg("--").arg(command.get_program()).args(command.get_args());
        traced.current_dir(folder).stdin(Stdio::null());
        let output = traced.output().expect("the tracer starts");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let code = output.status.code().unwrap_or(Tracer::UNABLE);
        let log = std::fs::read_to_string(&log).unwrap_or_default();
        let (failed, calls): (Vec<&str>, Vec<&str>) = log.lines().partition(|line| line.starts_with("failed\t"));
        let failed = failed.first().and_then(|line| line.split('\t').nth(1)?.parse().ok());
        let calls = calls.into_iter().map(Call::of_line).collect();
        End { code, stdout: text(&output.stdout), stderr: text(&output.stderr), calls, failed }
    }
}

impl How<'_> {
    fn words(self) -> Vec<String> {
        let fault = |fault| match fault {
            // A disk that is full, or read-only, is so for the next call as well.
            Fault::Error(name @ ("ENOSPC" | "EROFS")) => format!("{name} on"),
            Fault::Error(name) => name.into(),
            Fault::Short => "short".into(),
        };
        let words = match self {
            How::Changes => "list changes".into(),
            How::Calls => "list all".into(),
            How::Kill(number) => format!("kill {number}"),
            How::Cut(number, Names::Keep) => format!("cut {number} keep"),
            How::Cut(number, Names::Undo) => format!("cut {number} undo"),
            How::Fail(number, class, how) => format!("fail {number} {class} {}", fault(how)),
        };
        words.split(' ').map(str::to_owned).collect()
    }
}

impl Call {
    fn of_line(line: &str) -> Call {
        let parts: Vec<&str> = line.split('\t').collect();
        let [number, name, class, path, _] = parts[..] else { panic!("no line of a call: {line}") };
        let number = number.parse().expect("a number");
        Call { number, name: name.into(), class: class.into(), path: timeless(path) }
    }

    /// Whether a power cut before the next call may lose more than before this one: no kill can tell the two apart.
    pub fn is_sync(&self) -> bool {
        self.class == "sync"
    }
}

/// A path whose temporary part is called the same in every run.
fn timeless(path: &str) -> String {
    let part = |part| if tree::is_temporary(part) { "TEMPORARY" } else { part };
    path.split('/').map(part).collect::<Vec<_>>().join("/")
}
