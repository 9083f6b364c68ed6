"""One nonlinear step as algebra: Newton iteration, measures, scaling, linear solvers, diagnosis."""
