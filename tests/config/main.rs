//! What a config refuses, and how it says so; what it accepts, and that it comes back from its resolved form. And the page of the paper.

mod broken;
mod fidelity;
mod fuzz;
mod laws;
mod paper;
mod resolved;
mod schemas;
mod shipped;
