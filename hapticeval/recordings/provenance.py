"""What a recording states of how it was made, wherever in its meta that stands: model, scene, gains, force floor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hapticeval.recordings.recording import Recording


def model_of(recording: Recording) -> dict[str, Any] | None:
    """The model that was touched, as a suite gives it (`kind` and parameters): in the scene, or beside it."""
    for place in (recording.meta.get("scene"), recording.meta):
        model = place.get("model") if isinstance(place, Mapping) else None
        if isinstance(model, Mapping) and "kind" in model:
            return dict(model)
    return None


def scene_of(recording: Recording) -> dict[str, Any]:
    """The entries of the scene, and the gains that stand beside it, without those that are None."""
    found: dict[str, Any] = {}
    for table in (recording.meta.get("gains"), recording.meta.get("scene")):
        if isinstance(table, Mapping):
            found |= {str(key): each for key, each in table.items() if each is not None}
    return found


def spring_of(recording: Recording) -> tuple[float | None, str]:
    """K_p, N/m, where the force is that of a spring alone; else None, and the damping in words where there is one."""
    why = ""
    for table in (recording.meta.get("gains"), recording.meta.get("scene")):
        if isinstance(table, Mapping) and "stiffness" in table:
            if not table.get("damping"):
                return float(table["stiffness"]), ""
            why = f"the recording has a damping K_d of {table['damping']:.6g} N s/m"
    return None, why


def is_bilateral(recording: Recording) -> bool:
    """Whether the scene holds the tool from both sides."""
    return bool(scene_of(recording).get("bilateral"))


def declared_floor(recording: Recording) -> float | None:
    """The force that the sensor may read in free motion, N; None where it is not declared."""
    declared = recording.meta.get("force_floor")
    return float(declared) if isinstance(declared, int | float) else None
