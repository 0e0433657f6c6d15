use super::*;
use std::path::Path;

#[test]
fn probe() {
    for file in std::env::var("PROBE").unwrap_or("configs/quickstart.yaml".into()).split(',') {
        match load(Path::new(file), &[]) {
            Ok(plan) => println!("{}\n{}", plan.to_yaml(), plan.scene_plan_hash()),
            Err(e) => {
                println!("{}", e.lines());
                let mut out = String::new();
                miette::GraphicalReportHandler::new_themed(miette::GraphicalTheme::unicode_nocolor())
                    .with_width(110)
                    .render_report(&mut out, &e)
                    .unwrap();
                println!("{out}");
            }
        }
    }
}
