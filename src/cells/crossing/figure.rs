//! `docs/labels-rovers.svg`: one yard as two rovers label it, held to what they say.

use std::fmt::Write;

use super::params::Limits;
use super::tests::{SIZE_M, judged};
use super::*;
use crate::geometry::DVec3;
use crate::scene::{Class, Convex, Ground, Raster, Shape};

/// Rewrites the file instead: `MARSYARD_WRITE_FIGURES=1 cargo test --release --lib crossing::figure`.
const WRITE: &str = "MARSYARD_WRITE_FIGURES";
const PATH: &str = "docs/labels-rovers.svg";
/// Rows and columns that are drawn, and pixels a cell.
const CELLS: std::ops::Range<i32> = 34..66;
const PIXELS: i32 = 12;

/// A ditch 0.17 m wide and 0.4 m deep in the west, a flat stone 0.12 m tall in the middle, a boulder in the east.
fn yard() -> Scene {
    let ditch = |x: f64, _: f64| if (x - 4.0).abs() < 0.085 { -0.4 } else { 0.0 };
    let stone = |x, y, half: DVec3, yaw_rad| Shape::Convex(Convex::cuboid(DVec3::new(x, y, 0.0), half, yaw_rad));
    Scene::bare(10.0, Ground::Raster(Raster::sampled(10.0, 0.01, ditch)))
        .with_obstacle(Class::Rock, stone(5.05, 5.05, DVec3::new(0.3, 0.22, 0.12), 0.4))
        .with_obstacle(Class::Rock, stone(6.05, 5.3, DVec3::new(0.25, 0.3, 0.5), 0.9))
}

fn limits_of(yaml: &str) -> Limits {
    let rover: Rover = serde_saphyr::from_str(yaml).expect("a shipped rover");
    RoverRule::default().limits(&rover).expect("a shipped rover has limits")
}

fn rovers() -> [(&'static str, Limits); 2] {
    [
        ("Kapvik: step 0.10 m, gap 0.10 m", limits_of(include_str!("../../../configs/rovers/kapvik.yaml"))),
        ("Husky: step 0.15 m, gap 0.22 m", limits_of(include_str!("../../../configs/rovers/husky-a200.yaml"))),
    ]
}

fn colour(crossing: Crossing) -> &'static str {
    match crossing.limit {
        _ if crossing.margin_m >= 0.05 => "#cfe8cf",
        _ if crossing.margin_m >= 0.0 => "#a5cfa5",
        Limit::Climb => "#d6604d",
        Limit::Drop => "#e8927c",
        Limit::Gap => "#4a7ab5",
        Limit::Belly => "#8c5a8c",
        Limit::Tilt | Limit::SideSlip => "#c9a227",
    }
}

fn drawn() -> String {
    let size = (CELLS.end - CELLS.start) * PIXELS;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" font-family=\"sans-serif\" font-size=\"14\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
        2 * size + 60,
        size + 80
    );
    let mut line = |text: String| writeln!(out, "{text}").expect("a text grows");
    for (panel, (title, limits)) in (0..).zip(rovers()) {
        let left = 20 + panel * (size + 20);
        line(format!("<text x=\"{left}\" y=\"25\" font-weight=\"bold\">{title}</text>"));
        let verdicts = judged(limits, &yard(), CELLS, CELLS);
        // Neighbours of one colour on a row are one rectangle.
        for run in verdicts.chunk_by(|a, b| a.0.row == b.0.row && colour(a.1) == colour(b.1)) {
            let (x, y) = (left + (run[0].0.col - CELLS.start) * PIXELS, 40 + (CELLS.end - 1 - run[0].0.row) * PIXELS);
            let (width, fill) = (run.len() as i32 * PIXELS, colour(run[0].1));
            line(format!("<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{PIXELS}\" fill=\"{fill}\"/>"));
        }
    }
    let words = ["passable", "within 0.05 m of a limit", "climb", "drop", "gap", "belly"];
    let fills = ["#cfe8cf", "#a5cfa5", "#d6604d", "#e8927c", "#4a7ab5", "#8c5a8c"];
    for (k, (word, fill)) in (0..).zip(words.into_iter().zip(fills)) {
        let (x, y) = (20 + [0, 110, 310, 390, 470, 550][k as usize], size + 55);
        line(format!("<rect x=\"{x}\" y=\"{y}\" width=\"14\" height=\"14\" fill=\"{fill}\"/>"));
        line(format!("<text x=\"{}\" y=\"{}\">{word}</text>", x + 20, y + 12));
    }
    out + "</svg>\n"
}

#[test]
fn exact_one_rover_crosses_the_stone_and_the_ditch_and_the_other_does_not() {
    let worst = |limits: Limits, cols: std::ops::Range<i32>, rows: std::ops::Range<i32>| {
        judged(limits, &yard(), rows, cols).into_iter().fold(f32::INFINITY, |least, (_, c)| least.min(c.margin_m))
    };
    let [(_, kapvik), (_, husky)] = rovers();
    let (ditch, stone, boulder) = (38..42, 46..54, 57..65);
    for (cols, rows) in [(ditch, 36..64), (stone, 45..57)] {
        assert!(worst(kapvik, cols.clone(), rows.clone()) < 0.0 && worst(husky, cols, rows) >= 0.0);
    }
    assert!(worst(kapvik, boulder.clone(), 48..58) < 0.0 && worst(husky, boulder, 48..58) < 0.0);
    assert_eq!(SIZE_M, 0.1);
}

#[test]
fn equal_the_figure_of_the_docs_and_what_the_rovers_say() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(PATH);
    let drawn = drawn();
    if std::env::var_os(WRITE).is_some() {
        std::fs::write(&path, &drawn).expect("a writable checkout");
    }
    let there = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(there == drawn, "{PATH} is not what the rovers say: run the test with {WRITE}=1");
}
