"""A free disc of nearly incompressible rubber spins ten times.

python -m cases.verification.spinning_disc
"""
