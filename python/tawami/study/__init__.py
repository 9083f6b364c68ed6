"""Studies of cost and accuracy: settings run one by one, errors, Pareto fronts, recommendations.

study = tawami.Study("beam", run, {"n": (4, 8, 16), "alpha": (0.01, 0.1)}, {"deflection_m": 0.01025})
table = study.run()
print(tawami.study.verdict(table))
print(tawami.recommend(study, tolerance=0.01))

`tawami.trade("beam.py", "tip", budget=60)` estimates errors without a reference.
"""

from tawami.study.effects import verdict
from tawami.study.recommendation import recommend
from tawami.study.row import Change, Row
from tawami.study.series import Series
from tawami.study.study import Study
from tawami.study.table import Table

__all__ = ["Change", "Row", "Series", "Study", "Table", "recommend", "verdict"]
