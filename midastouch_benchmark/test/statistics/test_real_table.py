from pathlib import Path
from types import SimpleNamespace

import pytest

from midastouch_benchmark.statistics.real_table import real_table, require_real
from midastouch_common.errors import InputError


def test_the_paper_s_figures_stand_beside_ours():
    """Paper: 1.97 cm and 21.48 deg (section 6.2); closest mode 1.11 cm and 10.76 deg (appendix E)."""
    errors = {key: {"mean": 9.87, "median": 4.56} for key in ("e_trans_mm", "e_rot_deg", "min_cluster_trans_mm")}
    header, rows = real_table({"trials": 3, **errors, "min_cluster_rot_deg": {"missing": 3}})
    assert len(header) == 6
    assert rows == [["paper", 500, "19.7", "21.5", "11.1", "10.8"], ["ours", 3, "9.9", "9.9", "4.6", "-"]]


def test_simulated_slides_are_no_real_ones():
    real, simulated = (SimpleNamespace(path=Path(layout), layout=layout) for layout in ("real", "simulated"))
    require_real([real])
    with pytest.raises(InputError, match=r"simulated: not a real slide.*download ycb-slide real"):
        require_real([real, simulated])
