"""Fit the constants of `vergence_metric.disparity.semi_global_model` to pairs with ground truth, and print them.

    python -m bench.photos_disparity_fit FOLDER --leave-out Motorcycle --dense LEFT RIGHT TRUTH 2

Of the folder with `targets.json` every other pair is used, so that the others can judge the result; targets count for
the choice and the confidence only, as their truth is no better than the sub-pixel answer. `--dense` (repeatable) names
a left and a right image, the left one's disparities in whole pixels of an image or in .npz, and what divides them;
they count as the targets do, and points that the right image does not show are left out. The left half of
scikit-image's motorcycle, the only truth finer than the answers, fits the standard deviation; its right half judges.
Drawn rods teach thin things, and drawn pairs without an answer what to refuse.
"""

import argparse
import json
from collections.abc import Iterator
from dataclasses import astuple, dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from bench.disparity_pairs import clean, deceptive, hard, thin
from bench.photos_data import MOTORCYCLE, grey_pair, motorcycle_points
from vergence_metric.disparity.candidates import profiles
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.search import pair_about
from vergence_metric.disparity.semi_global import PointMatching
from vergence_metric.disparity.semi_global_model import Evidence

Image = NDArray[np.uint8]
Matrix = NDArray[np.float64]

_DENSE_POINTS = 450
_DECEPTIVE = 960
_PLAIN = 30
_THIN = 150
_BORDER_PX = 10
_RIGHT_PX = 2.0
_OCCLUDED_PX = 1.5
_QUANTILE = 0.97  # of the answers within 2 px: with the others it holds about 0.94 of all
_SOFT = 0.05
_DAMPING = 1e-3


@dataclass(frozen=True)
class Case:
    """A point of a pair. The disparity is NaN where there is none, `precise` if it is known to a tenth of a pixel."""

    left: Image
    right: Image
    point_px: tuple[float, float]
    disparity_px: float
    precise: bool
    expected_px: float | None = None


@dataclass(frozen=True)
class Seen:
    """What the estimator saw at a point: the candidates' support and whether each is right; of the best the rest."""

    supports: Matrix
    right: NDArray[np.bool_]
    evidence: list[Evidence]
    errors: NDArray[np.float64]
    judged: list[bool]
    precise: bool


def target_cases(folder: Path, left_out: list[str]) -> Iterator[Case]:
    """Yield the targets of every other pair of a folder with targets.json, but for the pairs left out."""
    for name, pair in list(json.loads((folder / "targets.json").read_text()).items())[::2]:
        if name in left_out:
            continue
        left, right = (_grey(folder / f"{name}_{eye}.jpg") for eye in ("left", "right"))
        for one in pair["targets"]:
            yield Case(left, right, (float(one["x_px"]), float(one["y_px"])), float(one["disparity_px"]), False)


def dense_cases(left: Image, right: Image, disparity: Matrix, count: int, seed: int) -> list[Case]:
    """Return random points that both eyes see of a pair with dense truth (NaN where unknown)."""
    height, width = disparity.shape
    rows, columns = np.nonzero(np.isfinite(disparity))
    d = disparity[rows, columns]
    seen_at = columns - d
    nearest = np.full((height, width + 2), -np.inf)
    inside = seen_at >= 0
    for step in (0, 1):
        np.maximum.at(nearest, (rows[inside], np.floor(seen_at[inside]).astype(int) + step), d[inside])
    hidden = np.where(inside, nearest[rows, np.maximum(np.rint(seen_at), 0).astype(int)] - d > _OCCLUDED_PX, True)
    far_in = (
        (columns > _BORDER_PX) & (columns < width - _BORDER_PX) & (rows > _BORDER_PX) & (rows < height - _BORDER_PX)
    )
    usable = np.flatnonzero(~hidden & far_in)
    chosen = np.random.default_rng(seed).choice(usable, min(count, len(usable)), replace=False)
    return [Case(left, right, (float(columns[i]), float(rows[i])), float(d[i]), False) for i in chosen]


def motorcycle_cases(count: int, seed: int) -> Iterator[Case]:
    """Yield points of the half of scikit-image's motorcycle that is there to fit on."""
    left, right = grey_pair(MOTORCYCLE)
    for one in motorcycle_points(count, seed, to_fit_on=True):
        yield Case(left, right, (one.x_px, one.y_px), one.disparity_px, True)


def drawn_cases() -> Iterator[Case]:
    """Yield pairs without an answer, with an expectation that nothing supports every other time, and plain ones."""
    centre, rng = (319.5, 239.5), np.random.default_rng(7)
    pairs = [pair for _, pair in deceptive(_DECEPTIVE, 77)] + [*clean(_PLAIN, 78, 100.0), *hard(_PLAIN, 79, 100.0)]
    for pair in pairs:
        disparity_px = np.nan if pair.disparity_px is None else pair.disparity_px
        yield Case(pair.left, pair.right, centre, disparity_px, True)
        yield Case(pair.left, pair.right, centre, disparity_px, True, float(rng.uniform(-100.0, 100.0)))


def thin_cases() -> Iterator[Case]:
    """Yield drawn rods: what stands before a background is in no photograph whose depth is known."""
    for pair in thin(_THIN, 80):
        yield Case(pair.left, pair.right, (319.5, 239.5), float(pair.disparity_px or 0.0), True)


def look(case: Case, parameters: DisparityParameters) -> Seen | None:
    """Return what the estimator sees at a point, None where it has no texture or no candidate."""
    pair = pair_about(case.left, case.right, case.point_px, parameters)
    layers = profiles(pair, parameters)
    if not any(layer.textured for layer in layers):
        return None
    matching = PointMatching(pair, layers, parameters, case.expected_px)
    if not matching.choices:
        return None
    measured = [matching.measure(one) for one in matching.choices]
    return Seen(
        np.array([astuple(one.support) for one in matching.choices]),
        np.array([abs(one.disparity_px - case.disparity_px) <= _RIGHT_PX for one in matching.choices]),
        [evidence for evidence, *_ in measured],
        np.array([horizontal - case.disparity_px for _, horizontal, *_ in measured]),
        [
            matching.beyond_chance(one, evidence) and not matching.repeated(one)
            for one, (evidence, *_) in zip(matching.choices, measured, strict=True)
        ],
        case.precise,
    )


def fit_choice(seen: list[Seen]) -> Matrix:
    """Return bias and weights of the conditional logit that names the right candidate, or none."""
    where = np.repeat(np.arange(len(seen)), [len(one.right) for one in seen])
    design = np.column_stack([np.ones(len(where)), np.concatenate([one.supports for one in seen])])
    right = np.concatenate([one.right for one in seen])
    some = np.array([one.right.any() for one in seen])

    def loss(model: Matrix) -> float:
        odds = np.exp(np.clip(design @ model, -30.0, 30.0))
        total = 1.0 + np.bincount(where, odds, len(seen))
        good = np.where(some, np.bincount(where, odds * right, len(seen)), 1.0)
        return float(np.mean(np.log(total) - np.log(np.maximum(good, 1e-12)))) + _damped(model)

    return np.asarray(minimize(loss, np.zeros(design.shape[1])).x)


def fit_confidence(evidence: list[Evidence], errors: Matrix) -> Matrix:
    """Return bias and weights of the logistic model of an error of at most 2 px."""
    design = np.array([(1.0, *one.terms) for one in evidence])
    sign = np.where(np.abs(errors) <= _RIGHT_PX, 1.0, -1.0)
    return np.asarray(
        minimize(
            lambda model: float(np.logaddexp(0.0, -sign * (design @ model)).mean()) + _damped(model),
            np.zeros(design.shape[1]),
        ).x
    )


def fit_sigma(evidence: list[Evidence], errors: Matrix) -> Matrix:
    """Return bias and weights of half a high quantile of the error, log-linear, by its smoothed pinball loss."""
    design = np.array([(1.0, *one.scales) for one in evidence])
    halves = np.log(np.abs(errors) + 0.005) - np.log(2.0)

    def loss(model: Matrix) -> float:
        off = halves - design @ model
        return float((_QUANTILE * off + _SOFT * np.logaddexp(0.0, -off / _SOFT)).mean()) + 0.1 * _damped(model)

    return np.asarray(minimize(loss, np.array([-1.0, *np.zeros(design.shape[1] - 1)])).x)


def main() -> None:
    """Fit and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder with targets.json and the pairs")
    parser.add_argument("--dense", nargs=4, action="append", default=[], metavar=("LEFT", "RIGHT", "TRUTH", "DIVISOR"))
    parser.add_argument("--leave-out", action="append", default=[], help="name of a pair that judges the result")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    photographs = list(target_cases(arguments.folder, arguments.leave_out))
    for left, right, truth, divisor in arguments.dense:
        dense = _truth(Path(truth), float(divisor))
        photographs += dense_cases(_grey(Path(left)), _grey(Path(right)), dense, _DENSE_POINTS, 1)
    photographs += motorcycle_cases(_DENSE_POINTS, 1)
    parameters = DisparityParameters()
    photographs += thin_cases()
    seen = [one for case in photographs if (one := look(case, parameters))]
    drawn = [one for case in drawn_cases() if (one := look(case, parameters))]
    choice = fit_choice(seen)
    best = [(one, _likeliest(one.supports, choice)) for one in seen + drawn]
    best = [(one, i) for one, i in best if one.judged[i]]
    scores = [float(choice[0] + one.supports[i] @ choice[1:]) for one, i in best]
    evidence = [replace(one.evidence[i], score=score) for (one, i), score in zip(best, scores, strict=True)]
    errors = np.array([one.errors[i] for one, i in best])
    good = [k for k, (one, _) in enumerate(best) if one.precise and abs(errors[k]) <= _RIGHT_PX]
    for name, model in (
        ("CHOICE", choice),
        ("CONFIDENCE", fit_confidence(evidence, errors)),
        ("SIGMA", fit_sigma([evidence[k] for k in good], errors[good])),
    ):
        print(f"{name} = ({', '.join(f'{value:.2f}' for value in model)})")


def _likeliest(supports: Matrix, choice: Matrix) -> int:
    """Return the index of the candidate that the estimator would measure with this model."""
    scores = choice[0] + supports @ choice[1:]
    own = np.where((supports[:, 0] > 0.0) & (scores > 0.0), scores, -np.inf)
    return int((own if np.isfinite(own).any() else scores).argmax())


def _damped(model: Matrix) -> float:
    return 0.5 * _DAMPING * float(np.square(model[1:]).sum())


def _grey(path: Path) -> Image:
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise SystemExit(f"photos_disparity_fit: {path} is no image that can be read")
    return np.asarray(image, np.uint8)


def _truth(path: Path, divisor: float) -> Matrix:
    """Return disparities, NaN where unknown: 0 in an image, not finite in a .npz."""
    if path.suffix == ".npz":
        values = np.asarray(next(iter(np.load(path).values())), np.float64) / divisor
    else:
        values = _grey(path).astype(np.float64) / divisor
        values[values == 0.0] = np.nan
    values[~np.isfinite(values)] = np.nan
    return values


if __name__ == "__main__":
    main()
