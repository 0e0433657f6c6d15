//! What a config refuses, and how it says so; what it accepts, and that it comes back from its resolved form.

mod broken;
mod fidelity;
mod fuzz;
mod resolved;
mod schemas;
mod shipped;
