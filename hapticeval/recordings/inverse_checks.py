"""Which inverse checks a recording allows, of those that were asked for, and why the others were not made."""

from __future__ import annotations

from hapticeval.geometry.model import Model
from hapticeval.recordings import implied, inverse
from hapticeval.recordings.inverse import Check
from hapticeval.recordings.recording import Recording


def inverse_checks(
    recording: Recording,
    *,
    device: inverse.Kinematics | None = None,
    model: Model | None = None,
    stiffness: float | None = None,
) -> tuple[Check, ...]:
    """The checks that a device, a model and a stiffness K_p (N/m, where K_d = 0) ask for, each made or with its reason.

    Without an IHIP, stiffness and model together are checked against HIP and force.
    """
    checks = []
    if device is not None:
        checks += [inverse.forward_kinematics(recording, device), inverse.transposed_jacobian(recording, device)]
    if stiffness is not None:
        checks.append(inverse.spring(recording, stiffness))
    if model is not None:
        checks.append(inverse.on_the_model(recording, model))
        if stiffness is not None and "ihip" not in recording.channels:
            checks.append(implied.implied_tool(recording, model, stiffness))
        checks.append(implied.contact(recording, model))
    return tuple(checks)
