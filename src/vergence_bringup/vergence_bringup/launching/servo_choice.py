"""Which servos a launch file drives: the file and the backend given, checked before anything starts."""

from collections.abc import Mapping

from vergence_rig.banner import banner
from vergence_rig.rig import JOINT_NAMES
from vergence_servo.calibration import ServoCalibrationError, load_servos
from vergence_servo.driver_set import backends_of
from vergence_servo.drivers.protocol import DriverUnavailableError
from vergence_servo.drivers.registry import find_backend


def chosen_backend(values: Mapping[str, str]) -> str:
    """Return the backend of the servos that name none: the one given, else kernel_pwm with servos, fake without."""
    return values["backend"] or ("kernel_pwm" if values["servos"] else "fake")


def problems(values: Mapping[str, str]) -> list[str]:
    """Return one sentence for each reason why servo_node could not start with these arguments."""
    try:
        backend = find_backend(chosen_backend(values))
        if values["servos"]:
            _backends(values)
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


def fakes_banner(values: Mapping[str, str]) -> str:
    """Return what is shown at the start of a head whose servos, or some of them, are simulated; "" for a real one."""
    moving = {joint: find_backend(backend).moves_servos for joint, backend in _backends(values).items()}
    if all(moving.values()):
        return ""
    still = [joint for joint, moves in moving.items() if not moves]
    which = f"{', '.join(still)} of this head" if any(moving.values()) else "this head"
    return banner(
        f"NO SERVO MOVES: {which} runs on fake servos",
        "for a real one: servos:=/path/of/your/servos.yaml (and backend:=, if not kernel_pwm); see docs/servos.md",
    )


def _backends(values: Mapping[str, str]) -> dict[str, str]:
    servos = load_servos(values["servos"])
    return backends_of(servos, [joint for joint in JOINT_NAMES if joint in servos], chosen_backend(values))
