"""The exception for bad input."""

import pytest

from midastouch_common.errors import InputError
from midastouch_common.images import BrokenImageError


@pytest.mark.parametrize("kind", [InputError, BrokenImageError])
def test_the_lines_of_a_quoted_message_are_joined(kind):
    error = kind("my  file.yaml: mapping values are not allowed here\n  in line 7,\n      column 1; correct it")
    assert str(error) == "my  file.yaml: mapping values are not allowed here in line 7, column 1; correct it"
