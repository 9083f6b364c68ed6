"""tawami: implicit material point method with the mixed displacement - volumetric strain form."""

from tawami._rust import Material
from tawami.body import Body, box
from tawami.disc import disc
from tawami.dynamics import Dynamics
from tawami.errors import (
    CheckpointError,
    CheckpointWarning,
    ConvergenceError,
    EnergyWarning,
    FormError,
    GeometryWarning,
    InexactSumWarning,
    InputError,
    InstabilityWarning,
    LockingWarning,
    MissingDependencyError,
    NotModelledError,
    OutputError,
    ParameterWarning,
    QuadratureWarning,
    SingularError,
    SupportError,
    TawamiDeprecationWarning,
    TawamiError,
    TawamiWarning,
)
from tawami.form_check import FormReport, check_form
from tawami.formulation import Form
from tawami.grid import Grid
from tawami.level_set import level_set
from tawami.materials import (
    drucker_prager,
    linear_elastic,
    mohr_coulomb,
    neo_hookean,
    von_mises,
)
from tawami.mesh import mesh
from tawami.numpy_law import NumpyLaw
from tawami.output import GridOutput, ParticleOutput, TableOutput
from tawami.polygon import polygon
from tawami.ranks import run
from tawami.results import Results
from tawami.scene import Scene
from tawami.solution import Solution
from tawami.source import earlier, table
from tawami.stepping import ramp, settle
from tawami.study import Series, Study, recommend

__all__ = [
    "Body",
    "CheckpointError",
    "CheckpointWarning",
    "ConvergenceError",
    "Dynamics",
    "EnergyWarning",
    "Form",
    "FormError",
    "FormReport",
    "GeometryWarning",
    "Grid",
    "GridOutput",
    "InexactSumWarning",
    "InputError",
    "InstabilityWarning",
    "LockingWarning",
    "Material",
    "MissingDependencyError",
    "NotModelledError",
    "NumpyLaw",
    "OutputError",
    "ParameterWarning",
    "ParticleOutput",
    "QuadratureWarning",
    "Results",
    "Scene",
    "Series",
    "SingularError",
    "Solution",
    "Study",
    "SupportError",
    "TableOutput",
    "TawamiDeprecationWarning",
    "TawamiError",
    "TawamiWarning",
    "box",
    "check_form",
    "disc",
    "drucker_prager",
    "earlier",
    "level_set",
    "linear_elastic",
    "mesh",
    "mohr_coulomb",
    "neo_hookean",
    "polygon",
    "ramp",
    "recommend",
    "run",
    "settle",
    "table",
    "von_mises",
]
