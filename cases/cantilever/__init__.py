"""The cantilever of Okagawa, Hashimoto and Higo: mixed u-eps_v MPM beside B-bar and FEM.

python -m cases.cantilever          the whole study: tables, figures, report
python -m cases.cantilever.mpm      the material point method alone
python -m cases.cantilever.fem      finite elements alone, in plain dolfinx
"""
