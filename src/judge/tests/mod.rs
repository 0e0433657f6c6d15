//! Scans that are known by hand, judged; and the files that go out, read back.

mod outputs;
mod scans;
