from midastouch_perception.codebook import Codebook
from midastouch_perception.objects import bundled_objects
from midastouch_tools.datasets import load_sequence
from midastouch_tools.demo import preparation


def test_slide_and_codebook_are_made_once(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(preparation, "SLIDE_LENGTH", 0.003)
    monkeypatch.setattr(preparation, "CODEBOOK_SIZE", 20)
    mesh = bundled_objects()["ball"]
    preparation.prepare_slide("ball", mesh)
    made = [tmp_path / "out" / "slides" / "ball" / "tactile_data.pkl", tmp_path / "out" / "codebooks" / "ball.npz"]
    assert load_sequence(made[0].parent).object_name == "ball"
    assert len(Codebook.load(made[1]).poses) == 20
    before = [path.stat().st_mtime_ns for path in made]
    monkeypatch.setattr(preparation, "simulate_sequence", None)
    preparation.prepare_slide("ball", mesh)
    assert [path.stat().st_mtime_ns for path in made] == before
