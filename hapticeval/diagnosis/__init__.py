"""Why a force or a contact point is off: one family of explanations, for simulated runs and for logs."""

from hapticeval.diagnosis.causes import Cause
from hapticeval.diagnosis.contact import RightContact, right_contact
from hapticeval.diagnosis.ranking import Diagnosis, diagnose

__all__ = ["Cause", "Diagnosis", "RightContact", "diagnose", "right_contact"]
