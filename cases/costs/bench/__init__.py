"""Speed and memory of a Newton step, stage by stage.

python -m cases.costs.bench                      sizes, particles per cell, threads, ranks
python -m cases.costs.bench --against CHECKOUT   compared with another checkout, interleaved
"""
