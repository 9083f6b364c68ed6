"""A cantilever in its first bending mode: the period, and the energy that each transfer keeps.

python -m cases.verification.vibrating_beam          the whole study: table and figures
python -m cases.verification.vibrating_beam.fem      finite elements alone, in plain dolfinx
"""
