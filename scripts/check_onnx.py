"""Does the ONNX file of a model say what marsyard says? Exit 0 where all outputs agree.

    marsyard export MODEL --onnx model.onnx --json model.json
    pip install onnx onnxruntime numpy
    python scripts/check_onnx.py model.onnx model.json [--tolerance 1e-6]

`model.json` holds rows of features over the whole range that the model was trained on, and beyond it, with marsyard's own
outputs, and probabilities where the model has a calibration. They are compared with onnxruntime's, all rows at once and row by row, and with
plain NumPy from the weights.
"""

import argparse
import json
import sys

import numpy as np
import onnx
import onnxruntime

import network_json


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("onnx")
    parser.add_argument("json")
    parser.add_argument("--tolerance", type=float, default=1e-6)
    args = parser.parse_args()

    with open(args.json) as file:
        model = json.load(file)
    features = np.array(model["check"]["features"], dtype=np.float32)
    expected = np.array(model["check"]["outputs"])

    graph = onnx.load(args.onnx)
    onnx.checker.check_model(graph, full_check=True)
    about = {pair.key: pair.value for pair in graph.metadata_props}["marsyard"]
    if json.loads(about) != model["about"]:
        print("the metadata of the two files differ")
        return 1

    session = onnxruntime.InferenceSession(args.onnx, providers=["CPUExecutionProvider"])
    own = network_json.outputs(model, features)
    wanted = {"untraversable": (expected, own)}
    if "calibration" in model["about"]:
        wanted["probability"] = (np.array(model["check"]["probabilities"]), network_json.probabilities(model["about"], own))
    failed = [output.name for output in session.get_outputs()] != list(wanted)
    for output, (expected, own) in wanted.items():
        together = session.run([output], {"features": features})[0][:, 0]
        one_by_one = np.array([session.run([output], {"features": row[None, :]})[0][0, 0] for row in features])
        print(f"{output}: {len(features)} rows from {expected.min():.4f} to {expected.max():.4f}")
        for name, found in {"onnxruntime": together, "onnxruntime, row by row": one_by_one, "NumPy": own}.items():
            worst = float(np.abs(found - expected).max())
            good = bool(np.isfinite(found).all()) and worst <= args.tolerance
            failed |= not good
            print(f"  {name:<26} largest difference {worst:.2e}  {'ok' if good else 'TOO LARGE'}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
