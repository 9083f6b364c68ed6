"""A weak form: its contract, the names in its residual, its derived tangent and its kernels."""

from tawami.form.compilation import CompiledForm, compile_form
from tawami.form.fields import Field, scalar, vector
from tawami.form.form import Form
from tawami.form.kinematics import Kinematics, StrainMeasure

__all__ = [
    "CompiledForm", "Field", "Form", "Kinematics", "StrainMeasure", "compile_form", "scalar", "vector"
]  # fmt: skip
