"""What the view says, in words."""

from midastouch_tools.view.scene import guidance_text, status_text


def test_step_progress_and_what_was_thrown_away_are_told():
    values = {"taken": "2", "wanted": "5", "last_press": "not taken: two contacts", "thrown_away": "7"}
    values |= {"thrown_away_1": "cut off at the edge of the view", "thrown_away_2": "two contacts", "region": "centre"}
    text = guidance_text("2 of 5: press the ball at the centre", values)
    assert text.startswith("# 2 of 5: press the ball at the centre")
    assert "\u25cf\u25cf\u25cb\u25cb\u25cb" in text
    assert "Last press: not taken: two contacts" in text
    assert "Thrown away: 7" in text
    assert "- cut off at the edge of the view\n- two contacts" in text


def test_at_the_start_there_is_the_step_alone():
    text = guidance_text("0 of 5: press the ball at the top left", {"taken": "0", "wanted": "5", "last_press": ""})
    assert "Last" not in text
    assert "Thrown" not in text


def test_the_state_has_its_reason_and_a_bar_for_each_object():
    assert "normal" in status_text("searching", "no touch yet", {})
    text = status_text("searching", "two objects fit", {"mug": 0.62, "bowl": 0.3, "unknown": 0.08})
    assert text.startswith("# searching\n\ntwo objects fit")
    assert "\u25cf" * 6 + "\u25cb" * 4 + " 62% mug" in text
    assert text.index("mug") < text.index("bowl") < text.index("unknown")
    assert "\u25cf" not in status_text("lost", "nothing fits", {})
