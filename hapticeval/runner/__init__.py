"""Cases x renderers -> recordings -> verdicts -> results on disk, told as one stream of events."""

from hapticeval.runner.execution import execute
from hapticeval.runner.interrupts import Interrupts
from hapticeval.runner.planning import Job, Plan, plan

__all__ = ["Interrupts", "Job", "Plan", "execute", "plan"]
