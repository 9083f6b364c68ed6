"""tawami: implicit material point method with the mixed displacement - volumetric strain form.

`__init__.pyi` lists the names and their modules, which are imported when a name is first used.
"""

from tawami.base.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
