"""The cost of accuracy: the settings of five cases, measured against closed forms and finest runs.

python -m cases.costs.trade [NAME ...]      run cantilever, cook, collapse, self_weight, spinning_disc
python -m cases.costs.trade --words         print the results that come with the repository
"""
