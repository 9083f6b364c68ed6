"""Types of the compiled module."""

from collections.abc import Sequence
from typing import Any, final

import numpy as np
import numpy.typing as npt

__all__ = [
    "MAX_COEFFICIENTS",
    "Active",
    "Assembler",
    "Grid",
    "InputError",
    "InvertedError",
    "Kernels",
    "Location",
    "Material",
    "Particles",
    "Pattern",
    "Requests",
    "Stage",
    "TawamiError",
    "__version__",
    "basis_1d",
    "basis_len",
    "carried",
    "cell_sums",
    "densities",
    "extraction",
    "functions_at",
    "gauss",
    "gradients",
    "interpolate",
    "logarithmic_strain",
    "nodal_sums",
    "parameters",
]

_Floats = npt.NDArray[np.float64]
_Numbers = npt.NDArray[np.uint32]
_Integers = npt.NDArray[np.int64]

#: Of Cargo.toml, from which pip takes the version of the package too.
__version__: str
#: Most coefficients of all fields on a cell.
MAX_COEFFICIENTS: int

class TawamiError(Exception):
    """Base of every error that tawami raises."""

class InputError(TawamiError):
    """A wrong input; the message names it."""

class InvertedError(TawamiError):
    """An iterate that turns a particle inside out."""

@final
class Grid:
    def __new__(
        cls, origin: Sequence[float], h: float, cells: Sequence[int], geometry: str = "plane_strain"
    ) -> Grid: ...
    def window(self, first: Sequence[int], cells: Sequence[int]) -> Grid: ...
    def locate(self, x: _Floats) -> Location: ...
    def place(self, cell: _Numbers, xi: _Floats) -> Location: ...
    def place_at(self, cell: _Integers, x: _Floats) -> Location: ...
    def near(
        self, whole: Sequence[int], active: npt.NDArray[np.bool_], own: npt.NDArray[np.bool_],
        x: _Floats, normal: _Floats, inward: float, reach: int,
    ) -> tuple[_Integers, npt.NDArray[np.bool_]]: ...  # fmt: skip

@final
class Location:
    @property
    def active(self) -> _Numbers: ...
    @property
    def cell(self) -> _Numbers: ...
    @property
    def xi(self) -> _Floats: ...
    def away_from_sides(self, margin: float) -> Location: ...
    def select(self, particles: _Numbers) -> Location: ...
    def __len__(self) -> int: ...

@final
class Active:
    def __new__(cls, grid: Grid, cells: _Numbers) -> Active: ...
    def functions(self, basis: str) -> npt.NDArray[np.bool_]: ...
    def parts(self, basis: str) -> tuple[int, _Integers]: ...
    def spread(self, basis: str, of_cells: _Integers) -> _Integers: ...
    def support(self, basis: str, function: int) -> _Integers: ...

@final
class Particles:
    def __new__(cls, x: _Floats, volume: _Floats, material: _Numbers) -> Particles: ...
    @property
    def x(self) -> _Floats: ...
    @property
    def volume(self) -> _Floats: ...
    @property
    def material(self) -> _Numbers: ...
    @property
    def number(self) -> _Numbers: ...
    @property
    def stress(self) -> _Floats: ...
    @property
    def displacement(self) -> _Floats: ...
    @property
    def eps_v(self) -> _Floats: ...
    @property
    def arrays(self) -> list[tuple[str, int]]: ...
    @property
    def bytes_per_particle(self) -> int: ...
    def select(self, particles: _Numbers) -> Particles: ...
    @property
    def strain(self) -> _Floats: ...
    @property
    def displacement_gradient(self) -> _Floats: ...
    def add_eps_v(self) -> None: ...
    def add_strain(self, finite: bool, geometry: str = "plane_strain") -> None: ...
    def move_to(self, x: _Floats) -> None: ...
    def add_history(self, materials: Sequence[Material]) -> None: ...
    @property
    def history_names(self) -> list[str]: ...
    def history(self, name: str) -> _Floats: ...
    def rows(self) -> _Floats: ...
    def of_rows(self, rows: _Floats) -> Particles: ...
    def assign(self, other: Particles) -> bool: ...
    def carry(self, name: str, width: int) -> None: ...
    def carried(self, name: str) -> _Floats: ...
    def check(self) -> None: ...
    def check_materials(
        self, materials: Sequence[Material], kinematics: str, finite: bool
    ) -> None: ...
    def __len__(self) -> int: ...

@final
class Material:
    @staticmethod
    def linear_elastic_e_nu(e: float, nu: float) -> Material: ...
    @staticmethod
    def linear_elastic_e_one_minus_2nu(e: float, one_minus_2nu: float) -> Material: ...
    @staticmethod
    def of(name: str, elastic: tuple[float, float], parameters: Sequence[float]) -> Material: ...
    @staticmethod
    def external(name: str, elastic: tuple[float, float], history: Sequence[str]) -> Material: ...
    @property
    def name(self) -> str: ...
    @property
    def history_names(self) -> list[str]: ...
    @property
    def finite_only(self) -> bool: ...
    @property
    def pressure_dependent(self) -> bool: ...
    @property
    def bulk_modulus(self) -> float: ...
    @property
    def shear_modulus(self) -> float: ...

# law quantity, value or derivative, first column, factor of each particle
_Request = tuple[str, str, int, _Floats | None]
# stress, tangent, plastic volumetric strain, history, d history / d strain
_Given = tuple[_Floats, _Floats, _Floats, _Floats, _Floats]
_Starts = npt.NDArray[np.int32]
_Selection = tuple[_Starts, _Starts, _Floats, npt.NDArray[np.int64]]

@final
class Assembler:
    def __new__(
        cls,
        location: Location,
        fields: Sequence[tuple[str, int, int]],  # basis, components, degree of the element
        nodes: Sequence[Sequence[int]],
        vertices: Sequence[Sequence[int]],
    ) -> Assembler: ...
    def vector(
        self,
        kernels: Kernels,
        data: Sequence[_Floats],
        volume: _Floats,
        coefficients: _Floats,
        absolute: bool = False,
    ) -> _Floats: ...
    def pattern(self, selection: _Selection) -> Pattern: ...
    def matrix(
        self,
        kernels: Kernels,
        couplings: Kernels,
        data: Sequence[_Floats],
        volume: _Floats,
        coefficients: _Floats,
        pattern: Pattern,
        values: _Floats,
        add: bool = False,
    ) -> None: ...

@final
class Kernels:
    # of each kernel: owner of the code, address, rank, number of packed coefficients, these in packed
    # order ('fields', 'position', or number of the array of particle data, whether it is its means
    # over cells, columns), constants, whether it reads the position, points
    def __new__(
        cls, assembler: Assembler, rank: int, kernels: Sequence[tuple[Any, ...]]
    ) -> Kernels: ...
    @staticmethod
    def elasticity(assembler: Assembler, geometry: str) -> Kernels: ...  # data: mu, lambda
    @staticmethod
    def mass(assembler: Assembler) -> Kernels: ...  # data: c

@final
class Pattern:
    @property
    def start(self) -> _Starts: ...
    @property
    def columns(self) -> _Starts: ...

@final
class Requests:
    def __new__(cls, arrays: Sequence[Sequence[_Request]]) -> Requests: ...
    @property
    def history_slopes(self) -> bool: ...

@final
class Stage:
    def __new__(
        cls,
        particles: Particles,
        location: Location,
        materials: Sequence[Material],
        kinematics: str,
        finite: bool,
        basis: str,
    ) -> Stage: ...
    def evaluate(
        self,
        u: _Floats,
        volumetric: _Floats | None,
        requests: Requests,
        data: Sequence[_Floats],
        given: _Given | None = None,
    ) -> None: ...
    def commit(
        self,
        u: _Floats,
        volumetric: _Floats | None,
        given: _Given | None = None,
        volume: _Floats | None = None,
    ) -> float: ...
    def elastic_energy(self, volume: _Floats | None = None) -> float: ...
    def strains(self, u: _Floats, volumetric: _Floats | None) -> _Floats: ...
    def volume_strains(self, u: _Floats, volumetric: _Floats | None) -> _Floats: ...

def parameters() -> dict[str, dict[str, float | None]]: ...
def interpolate(
    location: Location, basis: str, components: int, coefficients: _Floats
) -> _Floats: ...
def gradients(location: Location, basis: str, coefficients: _Floats) -> _Floats: ...
def carried(
    location: Location, basis: str, coefficients: _Floats, x: _Floats, area: _Floats,
    lost: npt.NDArray[np.bool_],
) -> tuple[_Floats, _Floats]: ...  # fmt: skip
def basis_1d(
    basis: str, n: int, cell: npt.NDArray[np.int64], t: _Floats
) -> tuple[npt.NDArray[np.int64], _Floats]: ...
def basis_len(basis: str, n: int) -> int: ...
def extraction(
    basis: str, size: Sequence[int], cells: _Integers, nodes: _Floats
) -> tuple[_Integers, _Floats]: ...
def functions_at(location: Location, basis: str) -> tuple[_Integers, _Floats, _Floats]: ...
def gauss(n: int) -> tuple[_Floats, _Floats]: ...
def logarithmic_strain(gradients: _Floats) -> _Floats: ...
def densities(
    location: Location,
    volume: _Floats,
    data: _Floats,
    points: Sequence[tuple[int, ...]],
    vertices: bool,
    rows: _Numbers,
    columns: Sequence[int],
    offset: int,
    out: _Floats,
) -> None: ...
def nodal_sums(
    location: Location, weight: _Floats, data: _Floats, basis: str, squared: bool = False
) -> _Floats: ...
def cell_sums(location: Location, weight: _Floats, data: _Floats) -> _Floats: ...
