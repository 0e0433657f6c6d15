//! Control steps a second of whole drives, by contact solver. One thread, CPU time.
//!
//! `cargo bench --bench drive`

mod shared;

use marsyard::drive;
use marsyard::random::Stage;
use shared::paper::{prepared, replays};
use shared::rate;

fn main() {
    for (ground, shape) in [("polynomial", None), ("raw at 0.1 m", Some("scene.ground.shape={raw: {spacing_m: 0.1}}"))]
    {
        for solver in ["gauss_newton", "nelder_mead", "plane_fit"] {
            let contact = format!("drive.contact={solver}");
            let sets: Vec<&str> = shape.into_iter().chain([contact.as_str()]).collect();
            let prepared = prepared("paper.yaml", &sets);
            let plan = &prepared.plan;
            let family = plan.family_of(0);
            let replays = replays(&prepared, 5);
            let steps: usize = replays.iter().map(|replay| replay.drive.truth.len()).sum();
            rate(&format!("{solver}, {ground}"), "steps", steps as f64, || {
                for (scene_id, replay) in replays.iter().enumerate() {
                    let streams = plan.streams(scene_id as u64, replay.attempts - 1, Stage::Drive);
                    let log = drive::drive(&family.drive, &replay.scene, &replay.drawn, &streams);
                    assert_eq!(log.expect("driven before").truth.len(), replay.drive.truth.len());
                }
            });
        }
    }
}
