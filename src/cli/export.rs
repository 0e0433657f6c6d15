//! Writes a model for other programs: ONNX, or weights as JSON.

use std::path::PathBuf;

use clap::Args;

use super::Failure;
use super::evaluate::read_model;
use super::output::{errln, out};
use super::place::must_be_local;
use crate::train::{export, onnx};

#[derive(Debug, Args)]
pub(super) struct ExportArgs {
    /// A trained model: the model.safetensors of a run folder, or the folder, or a URL of either.
    model: PathBuf,
    #[command(flatten)]
    to: To,
}

#[derive(Debug, Args)]
#[group(required = true, multiple = true)]
struct To {
    /// Write an ONNX file: float features as the columns hold them in, the output out; scaling and clipping are in the graph.
    #[arg(long, value_name = "FILE")]
    onnx: Option<PathBuf>,
    /// Write metadata, weights and rows to check against as JSON; `-` prints it.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

pub(super) fn run(args: &ExportArgs) -> Result<(), Failure> {
    let model = read_model(&args.model)?;
    if let Some(path) = &args.to.onnx {
        write(path, &onnx::onnx(&model))?;
    }
    if let Some(path) = &args.to.json {
        let text = export::json(&model);
        if path.as_os_str() == "-" {
            out!("{text}");
        } else {
            write(path, text.as_bytes())?;
        }
    }
    Ok(())
}

fn write(path: &std::path::Path, bytes: &[u8]) -> Result<(), Failure> {
    must_be_local("--onnx and --json", path)?;
    let failed = |error| Failure::new(Failure::TRY_AGAIN, miette::miette!("{}: {error}", path.display()));
    std::fs::write(path, bytes).map_err(failed)?;
    errln!("{}: {} bytes", path.display(), bytes.len());
    Ok(())
}
