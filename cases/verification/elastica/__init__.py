"""A strip bent far by a dead load at its tip, compared with Euler's elastica.

python -m cases.verification.elastica
"""
