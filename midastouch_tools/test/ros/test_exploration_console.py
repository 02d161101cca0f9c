from midastouch_tools.ros.exploration_console import object_answer, progress_line


def test_the_line_holds_what_one_waits_for():
    answer = object_answer({"bowl": 0.3, "mug": 0.62, "unknown": 0.08}, "")
    line = progress_line("exploring", 0.0451, 23.4, answer, "searching", 0.354)
    assert line == "exploring, 45 mm, 23 s | mug 62% | searching, best pose 35%"


def test_without_probabilities_the_answer_is_the_given_object():
    assert object_answer({}, "eyebolt") == "eyebolt"
    assert object_answer({}, "") == "no object yet"


def test_the_longest_line_fits_a_hundred_columns():
    answer = object_answer({"o" * 80: 1.0}, "")
    assert len(progress_line("exploring", 99.999, 99_999, answer, "uninitialised", 1.0)) <= 100
