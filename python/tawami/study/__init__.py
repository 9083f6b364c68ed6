"""Studies of cost and accuracy: settings run one by one, their errors, their front, a recommendation.

study = tawami.Study("beam", run, {"n": (4, 8, 16), "alpha": (0.01, 0.1)}, {"deflection_m": 0.01025})
table = study.run()
print(table.in_words("deflection_m"))
print(tawami.recommend(study, tolerance=0.01))
"""

from tawami.study.study import Series, Study
from tawami.study.table import Row, Table, recommend

__all__ = ["Row", "Series", "Study", "Table", "recommend"]
