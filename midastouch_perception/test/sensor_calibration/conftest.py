import pytest


@pytest.fixture
def digit(another_digit):
    """One that nothing has pressed yet: its noise goes on with every image."""
    return another_digit(6)
