//! Writes a model for other programs: ONNX, or weights as JSON.

use std::path::{Path, PathBuf};

use clap::Args;

use super::Failure;
use super::evaluate::{model_file, read_model};
use super::output::{errln, out};
use super::place::{corpus_failure, must_be_local, write_named};
use crate::corpus::owner;
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
    /// Write an ONNX file: its input is float features as the columns hold them; its outputs are that of the network and, of a
    /// calibrated model, the probability. Scaling and clipping are in the graph.
    #[arg(long, value_name = "FILE")]
    onnx: Option<PathBuf>,
    /// Write metadata, weights and rows to check against as JSON; `-` prints it.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

pub(super) fn run(args: &ExportArgs) -> Result<(), Failure> {
    if args.to.onnx.as_deref().is_some_and(|path| path.as_os_str() == "-") {
        let help = "name a file: --onnx model.onnx; --json - prints the weights";
        return Err(Failure::usage(miette::miette!(help = help, "--onnx -: an ONNX file is binary, and not printed")));
    }
    let model = read_model(&args.model)?;
    let inputs = [model_file(&args.model)];
    let json = args.to.json.as_deref().filter(|path| path.as_os_str() != "-");
    args.to.onnx.iter().try_for_each(|path| check(path, &inputs, onnx::is_ours))?;
    json.iter().try_for_each(|path| check(path, &inputs, export::is_ours))?;
    if let Some((onnx, json)) = args.to.onnx.as_deref().zip(json).filter(|(onnx, json)| is_one(onnx, json)) {
        return Err(Failure::usage(miette::miette!(
            help = "name two files",
            "--onnx {} and --json {} are one file",
            onnx.display(),
            json.display()
        )));
    }
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

/// Refuses a file that no export wrote, and the model itself, before anything is written.
fn check(path: &Path, inputs: &[PathBuf], is_ours: fn(&[u8]) -> bool) -> Result<(), Failure> {
    must_be_local("--onnx and --json", path)?;
    owner::check_file(path, inputs, is_ours).map_err(corpus_failure)
}

/// Whether two names of files to be written are of one file, also where it is not there yet.
fn is_one(a: &Path, b: &Path) -> bool {
    let folder =
        |path: &Path| path.parent().filter(|p| !p.as_os_str().is_empty()).map_or(".".into(), Path::to_path_buf);
    owner::is_same_file(a, b) || a.file_name() == b.file_name() && owner::is_same_file(&folder(a), &folder(b))
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    write_named(path, bytes)?;
    errln!("{}: {} bytes", path.display(), bytes.len());
    Ok(())
}
