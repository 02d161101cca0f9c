import numpy as np
import pytest

from midastouch_perception.contact import Contact, ContactDetector, in_steps


@pytest.fixture
def detector(sensor):
    return ContactDetector(sensor.scaled(0.5), begin=3e-6, end=1.5e-6)


def patch(pixels, depth=1e-4):
    penetration = np.zeros((160, 120), np.float32)
    penetration.ravel()[:pixels] = depth
    return penetration


def test_hysteresis(detector, sensor):
    pixel = sensor.scaled(0.5).pixel_area
    between, above, below = (int(area / pixel) for area in (2.2e-6, 3.5e-6, 1e-6))
    said = [detector.update(patch(n)).in_contact for n in (between, above, between, below, between)]
    assert said == [False, True, True, False, False]


def test_area_is_metric(detector, sensor):
    contact = detector.update(patch(1000))
    assert contact.area_m2 == pytest.approx(1000 * (2 * 0.022 / sensor.focal) ** 2)
    assert np.count_nonzero(contact.penetration) == 1000


def test_shallow_pixels_are_no_part_of_a_contact(detector, sensor):
    penetration = patch(1000)
    penetration[100:] = 2e-5
    contact = detector.update(penetration)
    np.testing.assert_array_equal(contact.penetration, in_steps(patch(1000)))
    assert contact.area_m2 == Contact.of(contact.penetration, sensor.scaled(0.5)).area_m2


def test_without_contact_there_is_no_penetration(detector):
    contact = detector.update(patch(10))
    assert (contact.in_contact, contact.area_m2) == (False, 0)
    assert not contact.penetration.any()


def test_shallow_pixels_do_not_count(detector):
    assert not detector.update(patch(5000, 1e-5)).in_contact


def test_a_wire_is_a_contact(detector):
    """A 1.5 mm wire across the pad: 12 px wide at half resolution, 2 % of the image."""
    penetration = np.zeros((160, 120), np.float32)
    penetration[:, 55:59] = 2e-4
    assert detector.update(penetration).in_contact


def test_no_contact_ends_the_contact(detector):
    detector.update(patch(1000))
    detector.no_contact()
    assert not detector.update(patch(55)).in_contact


def test_a_contact_that_the_view_cuts_off_grows_where_it_was(sensor):
    half = sensor.scaled(0.5)

    def square(rows, columns):
        penetration = np.zeros((160, 120), np.float32)
        penetration[rows, columns] = 1e-4
        return Contact.of(penetration, half)

    first = square(slice(0, 40), slice(20, 60))
    assert square(slice(0, 45), slice(18, 62)).grown_from(first)
    assert not square(slice(0, 38), slice(20, 60)).grown_from(first), "smaller"
    assert not square(slice(0, 45), slice(24, 66)).grown_from(first), "slid on"
    assert not square(slice(1, 45), slice(18, 62)).grown_from(square(slice(1, 40), slice(20, 60))), "all in view"
    assert not first.grown_from(Contact.of(np.zeros((160, 120), np.float32), half)), "a first touch"
