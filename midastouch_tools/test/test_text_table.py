from midastouch_tools.text_table import number, text_table


def test_columns_are_padded_to_their_widest_cell():
    table = text_table(["name", "mm"], [["a", "1.0"], ["longer", "10.0"]])
    assert table.splitlines() == ["name      mm", "------  ----", "a        1.0", "longer  10.0"]


def test_what_is_too_long_for_the_terminal_wraps_in_its_column(monkeypatch):
    monkeypatch.setenv("COLUMNS", "36")
    reason = "gave up: still ambiguous after 1.50 m: two poses"
    assert text_table(["mug", ""], [["exploration", reason], ["way", "12 mm"]]).splitlines() == [
        "mug",
        "-----------  -----------------------",
        "exploration  gave up: still",
        "             ambiguous after 1.50 m:",
        "             two poses",
        "way          12 mm",
    ]
    assert reason in text_table(["a" * 10, ""], [["b", reason]]).replace("\n" + 12 * " ", " ")
    assert "network-of-22-letters-0" in text_table(["a" * 10, ""], [["b", f"{reason} network-of-22-letters-0"]])


def test_unknown_numbers_are_dashes():
    assert [number(None), number(float("nan")), number(1.26)] == ["-", "-", "1.3"]
