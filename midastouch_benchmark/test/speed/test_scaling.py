import signal

import pytest
import trimesh

from midastouch_benchmark.speed.scaling import measure, sizes
from midastouch_common import se3
from midastouch_common.errors import InputError
from midastouch_common.mesh import ObjectMesh
from midastouch_filter.core.touch import Measurement
from midastouch_perception.codebook import FORMAT, Codebook
from midastouch_perception.sensor_model import SensorModel


class Deadly:
    """Ends the process that it comes to."""

    def __reduce__(self):
        return signal.raise_signal, (signal.SIGKILL,)


@pytest.mark.slow
def test_each_filter_is_timed_in_a_process_of_its_own(mesh, codebook, tmp_path):
    files = tmp_path / "block.ply", tmp_path / "block.npz"
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(files[0])
    sensor = SensorModel.load("digit_tacto")
    saved = {"format": FORMAT, "sensor": sensor.name, "sensor_id": sensor.content_id}
    saved["mesh_sha256"] = ObjectMesh.load(files[0]).sha256
    Codebook(codebook.poses, codebook.codes, codebook.meta | saved).save(files[1])
    touches = [Measurement(True, code, 1e-4) for code in codebook.codes[:5]]
    measured = measure(*files, list(zip(se3.odometry(codebook.poses[:5]), touches, strict=True)), 4000)
    assert set(measured["step_ms"]) == {"p50", "p95", "cpu"}
    assert min(*measured["step_ms"].values(), measured["memory_mb"]) > 0


def test_a_process_that_dies_says_so(tmp_path):
    with pytest.raises(InputError, match=r"block\.npz: .*100 hypotheses.*give fewer"):
        measure(tmp_path / "block.ply", tmp_path / "block.npz", [(None, Deadly())], 100)


def test_one_number_is_varied_at_a_time():
    assert list(sizes((100, 50_000), (1_000, 50_000))) == [(100, 50_000), (50_000, 50_000), (50_000, 1_000)]
