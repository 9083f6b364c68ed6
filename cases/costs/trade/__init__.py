"""What accuracy costs: the knobs of five cases, measured against closed forms and finest runs.

python -m cases.costs.trade [NAME ...]      of cantilever, cook, collapse, self_weight, spinning_disc
python -m cases.costs.trade --words         says what the shipped results say
"""
