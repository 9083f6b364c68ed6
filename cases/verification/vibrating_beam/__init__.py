"""A cantilever in its first bending mode: its period, and the energy that each transfer conserves.

python -m cases.verification.vibrating_beam          the whole study: table and figures
python -m cases.verification.vibrating_beam.fem      finite elements alone, in plain dolfinx
"""
