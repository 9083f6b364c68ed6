"""What accuracy costs: every knob of four cases, measured against closed forms and finest runs.

python -m cases.trade [cantilever] [cook] [collapse] [self_weight]    runs what has not been run
python -m cases.trade --words                                         says what the shipped results say
"""
