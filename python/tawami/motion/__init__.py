"""From step to step: load ramps, settling, Newmark integration, transfers and energy."""

from tawami.motion.dynamics import Dynamics
from tawami.motion.energy import Energies
from tawami.motion.observer import Observer, Recorder, Snapshot
from tawami.motion.pace import Step
from tawami.motion.stepping import ramp, settle

__all__ = [
    "Dynamics",
    "Energies",
    "Observer",
    "Recorder",
    "Snapshot",
    "Step",
    "ramp",
    "settle",
]
