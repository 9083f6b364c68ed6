"""The field problem: (form, particle data, reduction) -> residual and reduced tangent."""

from tawami.field.assembly import Assembly
from tawami.field.attachment import Attachment
from tawami.field.layout import Layout
from tawami.field.points import PointAssembly
from tawami.field.reduction import Reduction
from tawami.field.reference import ReferenceAssembly

__all__ = [
    "Assembly",
    "Attachment",
    "Layout",
    "PointAssembly",
    "Reduction",
    "ReferenceAssembly",
]
