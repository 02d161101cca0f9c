import pytest

from midastouch_benchmark.tables.trust_plots import regions_figure


def condition(fraction: float, interval: tuple[float, float]) -> dict:
    """Of a 95 % region, in frames of either kind."""
    regions = {"0.95": {"share": fraction, "interval": interval}}
    return {
        "levels": [0.95],
        "observed": {kind: [fraction] for kind in ("converged", "right")},
        "regions": dict.fromkeys(("converged", "right"), regions),
    }


@pytest.mark.parametrize("count", [3, 12])
def test_conditions_with_too_small_regions_look_different(count):
    late = {f"late {k}": condition(0.8, (0.7, 0.9)) for k in range(count)}
    figure = regions_figure(late | {"plain": condition(0.97, (0.96, 0.98)), "few": condition(0.9, (0.8, 0.97))})
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [*late, "any other condition"]
    looks = {(line.get_color(), line.get_linestyle()) for line in legend.get_lines()}
    assert len(looks) == count + 1
