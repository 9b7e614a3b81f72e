"""Renders data, trains, evaluates and exports the detector; a second run continues where the first one stopped."""

import argparse
import time
from pathlib import Path

import cv2
import torch

from training.card import write_figures
from training.dataset import HELD_OUT, TRAINING, load, make, render_head_world, render_world
from training.evaluation import evaluate
from training.export import add_metadata, export
from training.network import Detector
from training.training import Schedule, train
from vergence_metric.boxes.session import SHIPPED_MODEL

TRAINING_SEEDS = 20_000
HEAD_SEEDS = 30_000
HELD_OUT_SEEDS = 900_000


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m training", description=__doc__)
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("out/train_detector"),
        help="folder for renders, training state and figures (default %(default)s)",
    )
    parser.add_argument(
        "--worlds", type=int, default=200, help="number of rooms to render for training (default %(default)s)"
    )
    parser.add_argument("--views", type=int, default=60, help="renders of each of these rooms (default %(default)s)")
    parser.add_argument(
        "--head-worlds",
        type=int,
        default=120,
        help="number of rooms to render as the head sees its target (default %(default)s)",
    )
    parser.add_argument(
        "--head-views", type=int, default=40, help="renders of each of these rooms (default %(default)s)"
    )
    parser.add_argument("--held-out", type=int, default=12, help="number of rooms to evaluate on (default %(default)s)")
    parser.add_argument(
        "--minutes", type=float, default=120.0, help="wall time of the training [min] (default %(default)s)"
    )
    parser.add_argument("--rate", type=float, default=3e-3, help="peak learning rate (default %(default)s)")
    parser.add_argument("--start", type=Path, help="weights.pt of an earlier run from which training starts")
    parser.add_argument("--threads", type=int, default=1, help="threads of the training (default %(default)s)")
    parser.add_argument("--model", type=Path, help="file of the exported model (default OUT/rubik_cube.onnx)")
    parser.add_argument(
        "--ship",
        action="store_true",
        help="write the model and its figures into the package, in place of the shipped ones",
    )
    options = parser.parse_args()

    def say(text: str) -> None:
        print(f"{time.strftime('%H:%M:%S')} {text}", flush=True)

    cv2.setNumThreads(1)
    torch.set_num_threads(options.threads)
    torch.manual_seed(1)
    folder = options.out
    training = range(TRAINING_SEEDS, TRAINING_SEEDS + options.worlds)
    held_out = range(HELD_OUT_SEEDS, HELD_OUT_SEEDS + options.held_out)
    head = range(HEAD_SEEDS, HEAD_SEEDS + options.head_worlds)
    make(folder / "data", training, lambda seed: render_world(seed, options.views, TRAINING), say)
    make(folder / "head", head, lambda seed: render_head_world(seed, options.head_views), say)
    make(folder / "held_out", held_out, lambda seed: render_world(seed, options.views, HELD_OUT), say)
    detector = Detector(classes=1)
    if options.start is not None:
        detector.load_state_dict(torch.load(options.start))
    # Renders of the head count twice.
    shown = sorted((folder / "data").glob("world_*.npz")) + 2 * sorted((folder / "head").glob("world_*.npz"))
    renders = load(shown)
    say(f"training on {len(renders.images)} renders for {options.minutes:g} min")
    averaged = train(detector, lambda: renders, Schedule(options.minutes, rate=options.rate), folder, say)
    torch.save(averaged.state_dict(), folder / "weights.pt")
    path = SHIPPED_MODEL if options.ship else options.model or folder / "rubik_cube.onnx"
    path.parent.mkdir(parents=True, exist_ok=True)
    about = {"description": "Rubik's cube, trained on the simulator's renders", "license": "Apache-2.0"}
    apart = export(averaged, path, ("cube",), about)
    say(f"{path}: {path.stat().st_size / 1e6:.1f} MB, boxes at most {apart:.1g} px from the trained network's")
    scores = evaluate(path, load(sorted((folder / "held_out").glob("world_*.npz"))))
    add_metadata(path, {"threshold": f"{scores.threshold:g}"})
    (folder / "scores.json").write_text(scores.as_json() + "\n", encoding="utf-8")
    if options.ship:
        write_figures(SHIPPED_MODEL.with_suffix(".md"), scores)
    say(scores.as_json())
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
