"""One line of the weak form smooths the mean stress."""

from cases.showcase import one_line
from cases.showcase.collapse.pile import roughness


def test_the_line_smooths_the_mean_stress():
    without, with_it = (
        roughness(solution.x, solution.mean_stress, one_line.H)
        for solution in (
            one_line.solve(residual) for residual in (one_line.unstable, one_line.stable)
        )
    )
    assert without > 0.25
    assert with_it < 0.035
