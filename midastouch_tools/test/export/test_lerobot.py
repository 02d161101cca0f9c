"""The dataset against what the format's documents say of v3.0, read back with PyArrow."""

import json

import cv2
import numpy as np
import pytest

from midastouch_common import se3
from midastouch_tools.cli import main
from midastouch_tools.export.recording import Recording

FRAMES = 6


@pytest.fixture(scope="module")
def dataset(runs, parquet, tmp_path_factory):
    """Two episodes: their recordings, and the folder."""
    out = tmp_path_factory.mktemp("datasets") / "exported"
    assert main(["export", *map(str, runs), "--format", "lerobot", "--out", str(out)]) == 0
    return [Recording(path) for path in runs], out


def frames(parquet, folder, info, episode):
    where = info["data_path"].format(chunk_index=episode["data/chunk_index"], file_index=episode["data/file_index"])
    return parquet.read_table(folder / where).to_pylist()


def test_info_describes_what_is_there(dataset, parquet):
    recordings, folder = dataset
    info = json.loads((folder / "meta/info.json").read_text())
    assert info["codebase_version"] == "v3.0"
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (2, 2 * FRAMES, 2)
    assert info["splits"] == {"train": "0:2"}
    assert info["fps"] == round(recordings[0].rate)
    assert info["video_path"] is None
    assert not any("/" in name for name in info["features"])
    table = parquet.read_table(folder / "data/chunk-000/file-000.parquet")
    assert set(table.column_names) == set(info["features"])
    for name, feature in info["features"].items():
        kind = str(table.schema.field(name).type)
        if feature["dtype"] == "image":
            assert kind == "struct<bytes: binary, path: string>"
            continue
        of_one = {"float32": "float", "int64": "int64", "bool": "bool"}[feature["dtype"]]
        shape = feature["shape"]
        assert of_one in kind
        assert kind.count("list") == (0 if shape == [1] else len(shape))
        assert np.shape(table.column(name)[0].as_py()) == (() if shape == [1] else tuple(shape))


def test_frames_are_those_of_the_bags(dataset, parquet):
    recordings, folder = dataset
    info = json.loads((folder / "meta/info.json").read_text())
    episodes = parquet.read_table(folder / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    index = 0
    for number, (recording, episode) in enumerate(zip(recordings, episodes, strict=True)):
        rows, found = list(recording.rows()), frames(parquet, folder, info, episode)
        assert (episode["episode_index"], episode["length"]) == (number, len(rows))
        assert (episode["dataset_from_index"], episode["dataset_to_index"]) == (index, index + len(rows))
        for i, (row, one) in enumerate(zip(rows, found, strict=True)):
            png = np.frombuffer(one["observation.images.tactile"]["bytes"], np.uint8)
            assert (cv2.imdecode(png, cv2.IMREAD_COLOR)[..., ::-1] == row["image"]).all()
            assert one["observation.state"] == pytest.approx(row["base_from_gel"], abs=1e-6)
            assert one["observation.estimate"] == pytest.approx(row["estimate"], abs=1e-6)
            assert one["observation.stamp_ns"] == row["stamp_ns"][0]
            assert one["observation.filter_state"] == row["filter_state"][0]
            assert one["observation.penetration"] == row["penetration"].tolist()
            assert one["observation.penetration_valid"] == bool(row["penetration_valid"][0])
            assert one["timestamp"] == pytest.approx(i / info["fps"])
            assert (one["index"], one["frame_index"], one["episode_index"]) == (index, i, number)
            index += 1


def test_an_action_leads_to_the_next_frame(dataset, parquet):
    _, folder = dataset
    found = parquet.read_table(folder / "data/chunk-000/file-001.parquet").to_pylist()
    poses = [se3.from_xyzquat(np.array(one["observation.state"])) for one in found]
    for i in range(len(found) - 1):
        reached = poses[i] @ se3.exp(np.array(found[i]["action"]))
        np.testing.assert_allclose(reached, poses[i + 1], atol=1e-6)
    assert found[-1]["action"] == [0] * 6


def test_tasks_are_indexed_by_their_words(dataset, parquet):
    _, folder = dataset
    table = parquet.read_table(folder / "meta/tasks.parquet")
    assert table.to_pylist() == [
        {"task_index": 0, "task": "slide over cup"},
        {"task_index": 1, "task": "slide over can"},
    ]
    assert json.loads(table.schema.metadata[b"pandas"])["index_columns"] == ["task"]
    first = parquet.read_table(folder / "data/chunk-000/file-001.parquet").to_pylist()[0]
    assert first["task_index"] == 1


def test_statistics_are_of_all_frames_and_of_each_episode(dataset, parquet):
    recordings, folder = dataset
    whole = json.loads((folder / "meta/stats.json").read_text())
    episodes = parquet.read_table(folder / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    states = [np.stack([row["base_from_gel"] for row in one.rows()]) for one in recordings]
    assert whole["observation.state"]["mean"] == pytest.approx(np.concatenate(states).mean(axis=0))
    assert whole["observation.state"]["count"] == [2 * FRAMES]
    for episode, state in zip(episodes, states, strict=True):
        assert episode["stats/observation.state/max"] == pytest.approx(state.max(axis=0))
        assert np.shape(episode["stats/observation.images.tactile/mean"]) == (3, 1, 1)
    assert 0 < whole["observation.images.tactile"]["mean"][0][0][0] < 1


def test_recordings_that_differ_are_refused(run, runs, parquet, tmp_path, capsys):
    _, bare = run("jug", without={"/pose"})
    assert main(["export", str(runs[0]), str(bare), "--format", "lerobot", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert "jug.mcap" in said
    assert "estimate" in said
    assert not (tmp_path / "out").exists()
