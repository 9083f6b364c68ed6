"""Cook's membrane: mixed u-eps_v MPM compared with B-bar, displacement only and FEM.

python -m cases.verification.cook          the whole study: table and figures
python -m cases.verification.cook.fem      finite elements alone, in plain dolfinx
"""
