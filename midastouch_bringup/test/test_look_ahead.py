import pytest

from midastouch_bringup.look_ahead import LookAhead
from midastouch_bringup.messages import Message


def messages(text: str) -> list[Message]:
    """One message a second: t for transforms, i for an image."""
    topics = {"t": "/tf", "i": "/image_raw"}
    return [Message(topics[letter], "", second, b"") for second, letter in enumerate(text)]


@pytest.mark.parametrize("text", ["", "t", "iti", "ttii"])
def test_what_is_not_taken_out_comes_in_order(text):
    assert list(LookAhead(iter(messages(text)))) == messages(text)


def test_transforms_are_taken_out_up_to_a_stamp_and_the_rest_keeps_its_place():
    given = messages("iititti")
    ahead = LookAhead(iter(given))
    assert next(ahead) == given[0]
    assert ahead.transform(1) is None
    assert ahead.transform(2) == given[2]
    assert ahead.transform(3) is None
    assert ahead.transform(5) == given[4]
    assert [next(ahead), next(ahead)] == [given[1], given[3]]
    assert ahead.transform(100) == given[5]
    assert ahead.transform(100) is None
    assert list(ahead) == [given[6]]


def test_one_that_was_too_late_is_found_again():
    given = messages("iit")
    ahead = LookAhead(iter(given))
    assert ahead.transform(1) is None
    assert ahead.transform(2) == given[2]
    assert list(ahead) == given[:2]
