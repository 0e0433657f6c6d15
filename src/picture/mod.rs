//! Scenes, sweeps and cells -> pictures a person can judge.
