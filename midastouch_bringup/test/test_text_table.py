from midastouch_bringup.text_table import number, text_table


def test_columns_are_padded_to_their_widest_cell():
    table = text_table(["name", "mm"], [["a", "1.0"], ["longer", "10.0"]])
    assert table.splitlines() == ["name      mm", "------  ----", "a        1.0", "longer  10.0"]


def test_unknown_numbers_are_dashes():
    assert [number(None), number(float("nan")), number(1.26), number(3.14159, 3)] == ["-", "-", "1.3", "3.142"]
