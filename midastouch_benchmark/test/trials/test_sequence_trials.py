from pathlib import Path
from types import SimpleNamespace

import pytest

from midastouch_benchmark.trials.sequence_trials import mesh_doubt, require_real
from midastouch_common.errors import InputError


def moved(sequence, metres, layout="simulated"):
    """The sequence with its poses so far above the block."""
    poses = sequence.poses_true.copy()
    poses[:, 2, 3] += metres
    return SimpleNamespace(path="block/00", layout=layout, poses_true=poses)


def test_a_mesh_is_where_the_sensor_touches_it(sequence, mesh):
    frames = list(range(sequence.n_frames))
    assert mesh_doubt(moved(sequence, 0), frames, mesh) == ""
    doubt = mesh_doubt(moved(sequence, 0.01), frames, mesh)
    assert doubt.startswith("block/00: ")
    assert "10 mm" in doubt
    with pytest.raises(InputError, match=r"block/00: .*give the mesh in metres in the gel frame"):
        mesh_doubt(moved(sequence, 0.05, "tactile_tracking"), frames, mesh)


def test_simulated_slides_are_no_real_ones():
    real, simulated = (SimpleNamespace(path=Path(layout), layout=layout) for layout in ("real", "simulated"))
    require_real([real])
    with pytest.raises(InputError, match=r"simulated: .*midastouch download ycb-slide real"):
        require_real([real, simulated])
