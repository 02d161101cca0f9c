from pathlib import Path

import cv2
import numpy as np
from sequences import smooth_image

from midastouch_tools.cli import main
from midastouch_tools.replay.source import ReplaySource


def test_a_sequence_becomes_a_bag_and_lost_poses_are_counted(real_sequence_folder, tmp_path, capsys):
    def lose(data):
        data["poses"]["DIGIT"][4] = np.nan

    path, _ = real_sequence_folder(n=21, edit=lose)
    assert main(["to-bag", str(path), "--out", str(tmp_path / "x.mcap")]) == 0
    said = capsys.readouterr().out
    assert "10 frames of 035_power_drill" in said
    assert "1 whose pose is missing or jumps left out" in said
    images = [each for each in ReplaySource(tmp_path / "x.mcap").messages() if each.topic.endswith("image_raw")]
    assert len(images) == 10
    assert main(["to-bag", str(tmp_path / "x.mcap"), "--out", str(tmp_path / "y.mcap")]) == 2
    assert "x.mcap: a bag, not a sequence; how to play it: midastouch inspect-bag " in capsys.readouterr().err


def test_the_no_contact_image_and_the_command_to_go_on_come_with_it(
    real_sequence_folder, tmp_path, monkeypatch, capsys
):
    path, _ = real_sequence_folder(n=5)
    free = smooth_image(0)
    cv2.imwrite(str(path / "background.png"), free[..., ::-1])
    monkeypatch.chdir(tmp_path)
    (codebook := Path("out/codebooks/035_power_drill_digit_real.npz")).parent.mkdir(parents=True)
    codebook.touch()
    for bag, beside in (("x.mcap", "x.background.png"), ("y", "y/background.png")):
        assert main(["to-bag", str(path), "--out", bag]) == 0
        assert beside in capsys.readouterr().out
        assert np.array_equal(cv2.imread(beside)[..., ::-1], free)
    assert main(["inspect-bag", "x.mcap"]) == 0
    assert f"mesh:=PATH/035_power_drill.ply codebook:={codebook}" in capsys.readouterr().out
