"""Recordings as a dataset of LeRobot, version v3.0 of its format, one episode each.

The format: `meta/info.json` (schema), `meta/tasks.parquet`, `meta/episodes/` (where each episode is),
`meta/stats.json`, `data/` (frames), as huggingface/lerobot documents it (docs/source/lerobot-dataset-v3.mdx and
src/lerobot/datasets). Images are PNG files inside the tables (its dtype `image`), so nothing of a touch is lost to a
video codec.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from itertools import chain, islice, pairwise
from pathlib import Path

import cv2
import numpy as np
import pyarrow as pa
from pyarrow import parquet

from midastouch_common import se3
from midastouch_common.errors import InputError

from ..result_file import write_json
from .recording import Column, Recording
from .statistics import RowStatistics

VERSION = "v3.0"
IMAGE, STATE, ACTION = "observation.images.tactile", "observation.state", "action"
_FEATURE_OF = {"image": IMAGE, "base_from_gel": STATE}
_MOTION = ("x", "y", "z", "rx", "ry", "rz")
_DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_EPISODES_PATH = "meta/episodes/chunk-000/file-000.parquet"
_FILES_PER_CHUNK = 1000
_ROWS_AT_A_TIME = 64
_MOST_UNLIKE = 0.1  # fraction by which the rates of episodes may differ: the format has one for all


def write_lerobot(recordings: Sequence[Recording], folder: Path) -> int:
    """Write recordings as a LeRobot dataset.

    Parameters
    ----------
    recordings
        One for each episode.
    folder
        An existing folder.

    Returns
    -------
    int
        Number of frames.

    Raises
    ------
    InputError
        The recordings have different columns or rates.
    """
    columns = recordings[0].columns
    for other in recordings[1:]:
        _require_alike(recordings[0], other)
    fps = _common_rate(recordings)
    tasks: dict[str, int] = {}
    episodes, index, total = [], 0, RowStatistics({IMAGE})
    for number, recording in enumerate(recordings):
        task, own, start = f"slide over {recording.object_name or 'an object'}", RowStatistics({IMAGE}), index
        chunk, file = divmod(number, _FILES_PER_CHUNK)
        path = folder / _DATA_PATH.format(chunk_index=chunk, file_index=file)
        rows = _rows(recording, number, start, tasks.setdefault(task, len(tasks)), fps)
        for row in _write_rows(rows, columns, path):
            for statistics in (own, total):
                statistics.add(row)
            index += 1
        episode = {
            "episode_index": number,
            "tasks": [task],
            "length": index - start,
            "data/chunk_index": chunk,
            "data/file_index": file,
            "dataset_from_index": start,
            "dataset_to_index": index,
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
        }
        for name, summary in own.summary().items():
            episode |= {f"stats/{name}/{key}": value for key, value in summary.items()}
        episodes.append(episode)
    _write_table(folder / _EPISODES_PATH, episodes)
    _write_tasks(folder / "meta" / "tasks.parquet", tasks)
    write_json(folder / "meta" / "stats.json", total.summary())
    write_json(folder / "meta" / "info.json", _info(columns, fps, len(episodes), index, len(tasks)))
    return index


def features(columns: Sequence[Column]) -> dict[str, dict]:
    """Return the schema as it is in `info.json`."""
    out = {_feature(column): _described(column) for column in columns}
    out[ACTION] = {"dtype": "float32", "shape": [6], "names": list(_MOTION)}
    out["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
    for name in ("frame_index", "episode_index", "index", "task_index"):
        out[name] = {"dtype": "int64", "shape": [1], "names": None}
    return out


def _feature(column: Column) -> str:
    return _FEATURE_OF.get(column.name, f"observation.{column.name}")


def _described(column: Column) -> dict:
    if column.name == "image":
        return {"dtype": "image", "shape": list(column.shape), "names": ["height", "width", "channels"]}
    names = list(column.names) or (["height", "width"] if len(column.shape) == 2 else None)
    # LeRobot's policies compute in single precision; stamps stay int64, as single precision would lose the seconds
    dtype = "float32" if column.dtype == "float64" else column.dtype
    return {"dtype": dtype, "shape": list(column.shape), "names": names}


def _require_alike(first: Recording, other: Recording) -> None:
    wanted, has = ({(c.name, c.shape) for c in one.columns} for one in (first, other))
    if wanted != has:
        differ = ", ".join(sorted(f"{name} {shape}" for name, shape in wanted ^ has))
        raise InputError(f"{other.path}: not alike {first.path} in {differ}; export them apart")


def _common_rate(recordings: Sequence[Recording]) -> int:
    """Common rate of the recordings, images per second; the format wants a whole number."""
    rates = [recording.rate for recording in recordings]
    if max(rates) - min(rates) > _MOST_UNLIKE * max(rates):
        slow, fast = (recordings[rates.index(pick(rates))].path for pick in (min, max))
        raise InputError(f"{slow} has {min(rates):.0f} images a second, {fast} {max(rates):.0f}; export them apart")
    return max(1, round(float(np.median(rates))))


def _rows(recording: Recording, episode: int, start: int, task: int, fps: int) -> Iterator[dict[str, np.ndarray]]:
    """Yield the value of each feature, frame by frame; a frame's action is the motion to the next one.

    start: number of the first frame among those of all episodes.
    """
    for frame, (row, following) in enumerate(pairwise(chain(recording.rows(), [None]))):
        yield {_feature(column): row[column.name] for column in recording.columns} | {
            ACTION: _motion(row["base_from_gel"], following["base_from_gel"]) if following else np.zeros(6),
            "timestamp": np.array([frame / fps]),
            "frame_index": np.array([frame]),
            "episode_index": np.array([episode]),
            "index": np.array([start + frame]),
            "task_index": np.array([task]),
        }


def _write_rows(rows: Iterator[dict[str, np.ndarray]], columns: Sequence[Column], path: Path) -> Iterator[dict]:
    """Write rows to a file while they are passed on."""
    path.parent.mkdir(parents=True, exist_ok=True)
    schema = _schema(columns)
    with parquet.ParquetWriter(path, schema) as writer:
        while batch := list(islice(rows, _ROWS_AT_A_TIME)):
            writer.write_table(pa.Table.from_pylist([_encoded(row) for row in batch], schema=schema))
            yield from batch


def _motion(pose: np.ndarray, following: np.ndarray) -> np.ndarray:
    """Twist (6,) m, rad from one pose of the gel to the next, in the gel frame of the first."""
    return se3.log(se3.inverse(se3.from_xyzquat(pose)) @ se3.from_xyzquat(following))


def _encoded(row: dict[str, np.ndarray]) -> dict:
    """A row as the tables hold it: single values bare, images as PNG files."""
    plain = {name: value for name, value in row.items() if name != IMAGE}
    out = {name: value.item() if value.shape == (1,) else value.tolist() for name, value in plain.items()}
    _, png = cv2.imencode(".png", cv2.cvtColor(row[IMAGE], cv2.COLOR_RGB2BGR))
    return out | {IMAGE: {"bytes": png.tobytes(), "path": None}}


def _schema(columns: Sequence[Column]) -> pa.Schema:
    plain = {"bool": pa.bool_(), "float32": pa.float32(), "int64": pa.int64()}
    fields = []
    for name, feature in features(columns).items():
        shape = feature["shape"]
        if feature["dtype"] == "image":
            kind = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
        elif shape == [1]:
            kind = plain[feature["dtype"]]
        elif len(shape) == 1:
            kind = pa.list_(plain[feature["dtype"]], shape[0])
        else:
            kind = pa.list_(pa.list_(plain[feature["dtype"]]))
        fields.append((name, kind))
    return pa.schema(fields)


def _write_table(path: Path, rows: list[dict], metadata: dict[str, str] | None = None) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    parquet.write_table(pa.Table.from_pylist(rows).replace_schema_metadata(metadata), path)


def _write_tasks(path: Path, tasks: dict[str, int]) -> None:
    """Write the number of each task, with the task as index: the format's readers load the file as a pandas frame."""
    described = [{"name": "task_index", "pandas_type": "int64", "numpy_type": "int64"}]
    described.append({"name": "task", "pandas_type": "unicode", "numpy_type": "object"})
    for one in described:
        one |= {"field_name": one["name"], "metadata": None}
    frame = {"index_columns": ["task"], "column_indexes": [], "columns": described, "pandas_version": "2.0.0"}
    rows = [{"task_index": number, "task": task} for task, number in tasks.items()]
    _write_table(path, rows, {"pandas": json.dumps(frame)})


def _info(columns: Sequence[Column], fps: int, episodes: int, frames: int, tasks: int) -> dict:
    return {
        "codebase_version": VERSION,
        "robot_type": "midastouch",
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": tasks,
        "chunks_size": _FILES_PER_CHUNK,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 500,
        "fps": fps,
        "splits": {"train": f"0:{episodes}"},
        "data_path": _DATA_PATH,
        "video_path": None,
        "features": features(columns),
    }
