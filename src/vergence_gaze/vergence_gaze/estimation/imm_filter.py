"""A target in motion: a calm and a manoeuvring model, combined by the likelihood of each (IMM).

Blom and Bar-Shalom, "The interacting multiple model algorithm for systems with Markovian switching coefficients"
(1988). A calm model alone loses a target that swings; a manoeuvring one alone passes the images' noise on to the eyes.
"""

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_CALM_FOR_S = 2.0
_MANOEUVRES_FOR_S = 0.3
_LEAST_WEIGHT = 1e-3


class ImmWeights:
    """The weights of the calm and the manoeuvring model; what they combine is (2, 6) and (2, 6, 6)."""

    def __init__(self) -> None:
        self.reset((1.0, 0.0))

    def reset(self, weights: tuple[float, float]) -> None:
        """Start with these weights."""
        self.weights = _normalised(*weights)

    def combined(self, states: Array, covariances: Array) -> tuple[Array, Array]:
        """Return mean (6,) and covariance (6, 6) of both models together."""
        first, second = self.weights
        apart = states[0] - states[1]
        covariance = first * covariances[0] + second * covariances[1]
        return first * states[0] + second * states[1], covariance + first * second * (apart[:, None] * apart)

    def mixed(self, states: Array, covariances: Array, duration_s: float) -> tuple[Array, Array]:
        """Return where both models start from, for a prediction over `duration_s`, and weight them for its end.

        The longer it is, the likelier that the target has begun or ended a manoeuvre.
        """
        begins, ends = 1.0 - math.exp(-duration_s / _CALM_FOR_S), 1.0 - math.exp(-duration_s / _MANOEUVRES_FOR_S)
        calm, manoeuvring = self.weights
        # How likely a target that is in each mode now was calm before.
        calm_now = (1.0 - begins) * calm + ends * manoeuvring
        shares = (1.0 - begins) * calm / calm_now, begins * calm / (1.0 - calm_now)
        apart = states[0] - states[1]
        spread = apart[:, None] * apart
        self.weights = _normalised(calm_now, 1.0 - calm_now)
        return (
            np.stack([share * states[0] + (1.0 - share) * states[1] for share in shares]),
            np.stack([s * covariances[0] + (1.0 - s) * (covariances[1] + s * spread) for s in shares]),
        )

    def loss(self, losses: Array) -> float:
        """Return the mixture's negative logarithm of the likelihood from that of each model (2,)."""
        first, second = losses.tolist()
        least = min(first, second)
        likelihoods = math.exp(least - first), math.exp(least - second)
        return least - math.log(self.weights[0] * likelihoods[0] + self.weights[1] * likelihoods[1] + 1e-12)

    def update(self, losses: Array) -> None:
        """Weight the models by their likelihoods, given as negative logarithms (2,)."""
        first, second = losses.tolist()
        least = min(first, second)
        self.weights = _normalised(
            self.weights[0] * math.exp(least - first), self.weights[1] * math.exp(least - second)
        )


def _normalised(calm: float, manoeuvring: float) -> tuple[float, float]:
    """Return weights that sum to one, none of them zero: the other model may be right at any time."""
    whole = max(calm + manoeuvring, 1e-300)
    held = max(calm / whole, _LEAST_WEIGHT), max(manoeuvring / whole, _LEAST_WEIGHT)
    return held[0] / (held[0] + held[1]), held[1] / (held[0] + held[1])
