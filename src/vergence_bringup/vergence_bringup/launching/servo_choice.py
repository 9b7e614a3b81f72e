"""Which servos a launch file drives: the file and the backend given, checked before anything starts."""

from collections.abc import Mapping

from vergence_rig.banner import banner
from vergence_servo.calibration import ServoCalibrationError, load_servos
from vergence_servo.drivers.protocol import DriverUnavailableError
from vergence_servo.drivers.registry import find_backend

FAKES = banner(
    "NO SERVO MOVES: this head runs on fake servos",
    "for a real one: servos:=/path/of/your/servos.yaml (and backend:=, if not kernel_pwm); see docs/servos.md",
)
"""Shown at the start of a head whose servos are simulated."""


def chosen_backend(values: Mapping[str, str]) -> str:
    """Return the backend of a launch file's arguments: the one given, else kernel_pwm with servos, fake without."""
    return values["backend"] or ("kernel_pwm" if values["servos"] else "fake")


def problems(values: Mapping[str, str]) -> list[str]:
    """Return one sentence for each reason why servo_node could not start with these arguments."""
    try:
        backend = find_backend(chosen_backend(values))
        if values["servos"]:
            load_servos(values["servos"])
    except DriverUnavailableError as error:
        return [str(error).replace("parameter 'backend'", "backend")]
    except ServoCalibrationError as error:
        return [str(error)]
    if backend.moves_servos and not values["servos"]:
        return [
            f"servos must be the path of your servos.yaml with backend {backend.name!r}, "
            "whose channels are your wiring's: got none"
        ]
    return []
