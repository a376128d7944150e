"""Interactive simulation of inhomogeneous soft objects, with error bars.

Units are SI unless a name says otherwise (m, N, Pa, s). Positions, forces and displacements are in scanner axes: right,
anterior, superior. Whatever is refused raises `yawara.Error`, a `ValueError` that names the place, the value and the limit.
"""

from ._yawara import BisectionForest, Error, materials
from .identify import Identified, Measurement, Modulus, Skin, feel, identify
from .inverse import SparseInverse
from .simulation import Frame, Simulation, StepReport, Tool, ToolReport, scenes

__all__ = [
    "BisectionForest",
    "Error",
    "Frame",
    "Identified",
    "Measurement",
    "Modulus",
    "Simulation",
    "Skin",
    "SparseInverse",
    "StepReport",
    "Tool",
    "ToolReport",
    "feel",
    "identify",
    "materials",
    "scenes",
]
