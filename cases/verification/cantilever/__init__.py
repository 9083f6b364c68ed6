"""The cantilever of Okagawa, Hashimoto and Higo: mixed u-eps_v MPM compared with B-bar and FEM.

python -m cases.verification.cantilever          the whole study: tables, figures, report
python -m cases.verification.cantilever.mpm      the material point method alone
python -m cases.verification.cantilever.fem      finite elements alone, in plain dolfinx
"""
