//! Trains a network on a corpus and judges it on scenes that it never saw.
//!
//! `cargo run --release --example train [CORPUS]`. Without a corpus a small one is built first, in a temporary folder.

use std::error::Error;
use std::path::{Path, PathBuf};

use marsyard::corpus::{Split, address};
use marsyard::evaluate::{Options, evaluate};
use marsyard::{build_corpus, config, train_network};

fn main() -> Result<(), Box<dyn Error>> {
    let temporary = tempfile::tempdir()?;
    let corpus = match std::env::args().nth(1) {
        Some(place) => PathBuf::from(place),
        None => {
            let place = temporary.path().join("corpus");
            let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/quickstart.yaml");
            let plan = config::load(&config, &["scenes=40", "scenes_per_shard=2"].map(String::from))?;
            build_corpus(&plan, &place, std::thread::available_parallelism()?.get())?;
            place
        }
    };

    // As `marsyard train --set ...`: every key of a training config, checked.
    let params = config::load_train(None, &["network.hidden=[8]", "epochs=2"].map(String::from))?;
    let model = train_network(&corpus, params, &temporary.path().join("run"))?;
    let about = &model.about;
    println!(
        "{} weights on {} features of {}",
        model.network.weights.len(),
        about.features.len(),
        about.corpus_names.join(", ")
    );

    let report = evaluate(&model, address::open(&corpus)?.as_ref(), &[], &Options::of(Split::Test))?;
    println!("{report}");
    Ok(())
}
