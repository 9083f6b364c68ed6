"""Large bending of a strip by a dead load at its tip, compared with Euler's elastica.

python -m cases.verification.elastica
"""
