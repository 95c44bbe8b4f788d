"""Export of an identified motor to other programs.

    model.py      model with the inputs of another program, from a result
    language.py   printer of CasADi expressions in C, Python, MATLAB and Modelica
    c_code.py     C file, and the error of a fixed number of substeps
    fmu.py        FMU for co-simulation, FMI 2.0 and 3.0
    linear.py     transfer function and state space at a temperature
    scripts.py    scripts for other programs, with the continuous equations
    formats.py    the formats by name, CSV among them, and `export`

All formats are printed from the expressions that `predict` simulates.
"""

from __future__ import annotations

from identification.export.formats import FORMATS, Export, export
from identification.export.linear import state_space, transfer_function

__all__ = ["FORMATS", "Export", "export", "state_space", "transfer_function"]
