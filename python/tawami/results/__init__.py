"""Results of a run: files, tables, checkpoints, log and pictures, made by observers of its phases.

`tawami.plot` draws a run.
"""

from tawami.results.output import Output
from tawami.results.outputs import BorderOutput, GridOutput, ParticleOutput
from tawami.results.results import Results
from tawami.results.single import write_grid, write_particles
from tawami.results.table import TableOutput

__all__ = [
    "BorderOutput",
    "GridOutput",
    "Output",
    "ParticleOutput",
    "Results",
    "TableOutput",
    "write_grid",
    "write_particles",
]
