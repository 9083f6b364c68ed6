"""Particles: their material laws, their cells and ranks, and their responses to an increment."""

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
from tawami.particles.responses import Responses

__all__ = [
    "NumpyLaw",
    "Responses",
    "cam_clay",
    "drucker_prager",
    "law",
    "linear_elastic",
    "mohr_coulomb",
    "neo_hookean",
    "von_mises",
]
