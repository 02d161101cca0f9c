"""Message of a contact, as `tdn` measures it and `digit_sim` knows it."""

from __future__ import annotations

from std_msgs.msg import Header

from midastouch_msgs.msg import TactileContact

from ..contact import Contact


def contact_to_msg(contact: Contact, header: Header) -> TactileContact:
    """Return the message; its header has the image's stamp and the gel frame."""
    return TactileContact(
        header=header,
        in_contact=contact.in_contact,
        state=contact.state.value,
        area=contact.area_m2,
        depth=contact.depth_m,
    )
