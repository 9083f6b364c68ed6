"""tawami: implicit material point method with the mixed displacement - volumetric strain form."""

from tawami._rust import Material
from tawami._rust import __version__ as __version__
from tawami.base.errors import (
    CheckpointError,
    CheckpointWarning,
    ConvergenceError,
    EnergyWarning,
    FormError,
    GeometryWarning,
    IncompleteWarning,
    InexactSumWarning,
    InputError,
    InstabilityWarning,
    LockingWarning,
    MissingDependencyError,
    NotModelledError,
    OutputError,
    ParameterWarning,
    QuadratureWarning,
    RotationWarning,
    SingularError,
    SmallStrainWarning,
    SofteningWarning,
    SolverError,
    SolverWarning,
    SupportError,
    SupportWarning,
    TangentWarning,
    TawamiError,
    TawamiWarning,
)
from tawami.base.program import run
from tawami.body.body import Body
from tawami.body.box import box
from tawami.body.disc import disc
from tawami.body.level_set import level_set
from tawami.body.mesh import mesh
from tawami.body.polygon import polygon
from tawami.border.pieces import Border
from tawami.border.polyline import polyline
from tawami.border.shapes import half_plane, rigid_disc, rigid_polygon
from tawami.check.form_check import check_form
from tawami.check.report import FormReport
from tawami.domain.earlier import earlier
from tawami.domain.table import table
from tawami.estimate.error import ErrorEstimate
from tawami.estimate.goal import Goal
from tawami.form.form import Form
from tawami.grid.grid import Grid
from tawami.motion.dynamics import Dynamics
from tawami.motion.modes import Modes, modes
from tawami.motion.path import follow
from tawami.motion.stepping import ramp, settle
from tawami.particles.laws import (
    cam_clay,
    drucker_prager,
    law,
    linear_elastic,
    mohr_coulomb,
    neo_hookean,
    von_mises,
)
from tawami.particles.numpy_law import NumpyLaw
from tawami.quantities.quantities import Quantity
from tawami.results.outputs import BorderOutput, GridOutput, ParticleOutput
from tawami.results.plot import plot
from tawami.results.results import Results
from tawami.results.table import TableOutput
from tawami.scene.scene import Scene
from tawami.scene.solution import Solution
from tawami.study import Series, Study, recommend
from tawami.study.front import Trade
from tawami.study.trade import trade

__all__ = [
    "Body",
    "Border",
    "BorderOutput",
    "CheckpointError",
    "CheckpointWarning",
    "ConvergenceError",
    "Dynamics",
    "EnergyWarning",
    "ErrorEstimate",
    "Form",
    "FormError",
    "FormReport",
    "GeometryWarning",
    "Goal",
    "Grid",
    "GridOutput",
    "IncompleteWarning",
    "InexactSumWarning",
    "InputError",
    "InstabilityWarning",
    "LockingWarning",
    "Material",
    "MissingDependencyError",
    "Modes",
    "NotModelledError",
    "NumpyLaw",
    "OutputError",
    "ParameterWarning",
    "ParticleOutput",
    "QuadratureWarning",
    "Quantity",
    "Results",
    "RotationWarning",
    "Scene",
    "Series",
    "SingularError",
    "SmallStrainWarning",
    "SofteningWarning",
    "Solution",
    "SolverError",
    "SolverWarning",
    "Study",
    "SupportError",
    "SupportWarning",
    "TableOutput",
    "TangentWarning",
    "TawamiError",
    "TawamiWarning",
    "Trade",
    "box",
    "cam_clay",
    "check_form",
    "disc",
    "drucker_prager",
    "earlier",
    "follow",
    "half_plane",
    "law",
    "level_set",
    "linear_elastic",
    "mesh",
    "modes",
    "mohr_coulomb",
    "neo_hookean",
    "plot",
    "polygon",
    "polyline",
    "ramp",
    "recommend",
    "rigid_disc",
    "rigid_polygon",
    "run",
    "settle",
    "table",
    "trade",
    "von_mises",
]
