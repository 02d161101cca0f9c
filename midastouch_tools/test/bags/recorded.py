"""Messages as they are recorded, and bags of them."""

import cv2
import numpy as np

from midastouch_common.frames import BASE_FRAME, GEL_FRAME
from midastouch_tools.bags.messages import COMPRESSED_TYPE, Message, header, typestore
from midastouch_tools.bags.messages import new_message as new
from midastouch_tools.bags.writer import BagWriter

SECOND, MS = 1_000_000_000, 1_000_000
STORE = typestore()


def tf(stamp_ns, row, parent=BASE_FRAME, child=GEL_FRAME, recorded_ns=None, topic="/tf"):
    """A transform message whose pose is a row [x y z qx qy qz qw]."""
    transform = new(
        "geometry_msgs/msg/Transform",
        translation=STORE.types["geometry_msgs/msg/Vector3"](*row[:3]),
        rotation=STORE.types["geometry_msgs/msg/Quaternion"](*row[3:]),
    )
    stamped = STORE.types["geometry_msgs/msg/TransformStamped"](header(stamp_ns, parent), child, transform)
    return Message.of(topic, STORE.types["tf2_msgs/msg/TFMessage"]([stamped]), recorded_ns or stamp_ns)


def image(stamp_ns, pixels=None, encoding="rgb8", recorded_ns=None, step=None, topic="/image_raw"):
    pixels = np.zeros((320, 240, 3), np.uint8) if pixels is None else pixels
    (height, width), data = pixels.shape[:2], pixels.reshape(-1)
    sizes = {"height": height, "width": width, "step": step or pixels[0].size}
    content = new(
        "sensor_msgs/msg/Image", header=header(stamp_ns, "digit_optical_frame"), encoding=encoding, data=data, **sizes
    )
    return Message.of(topic, content, recorded_ns or stamp_ns)


def compressed(message, ending=".png"):
    """An image message, without loss unless as JPEG, as image_transport would publish it."""
    content = message.content
    encoded = cv2.imencode(ending, content.data.reshape(320, 240, 3)[..., ::-1])[1].reshape(-1)
    small = STORE.types[COMPRESSED_TYPE](content.header, f"rgb8; {ending[1:]} compressed bgr8", encoded)
    return Message.of(f"{message.topic}/compressed", small, message.stamp_ns)


def edited(message, edit):
    """A message whose content `edit` has changed."""
    content = message.content
    edit(content)
    return Message.of(message.topic, content, message.stamp_ns, message.latched)


def cut_off(message):
    """A compressed image message of which the second half was lost."""

    def halve(content):
        content.data = content.data[: len(content.data) // 2]

    return edited(message, halve)


def write(path, *messages, metadata=None):
    """A bag of messages; its path."""
    with BagWriter(path, metadata) as bag:
        for message in messages:
            bag.write(message)
    return path


STILL = [0.0, 0, 0, 0, 0, 0, 1]
MOVED = [0.1, 0, 0, 0, 0, np.sin(0.25), np.cos(0.25)]
