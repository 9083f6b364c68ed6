"""What the method survives, what it refuses, and where each of that ends.

python -m cases.extremes
"""
