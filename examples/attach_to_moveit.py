"""Tell MoveIt what the gripper holds, and where in it: `object_pose` as an attached collision object.

midastouch run inhand hand:=running mesh:=part.ply gripper_frame:=tool0 left_serial:=D1 right_serial:=D2
python examples/attach_to_moveit.py part.ply       # with a system ROS that has moveit_msgs

Further words name links of the gripper that touch the object.
"""

import sys

import rclpy
from geometry_msgs.msg import Point, PoseWithCovarianceStamped
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from midastouch_common.ros import qos
from midastouch_msgs.msg import FilterStatus
from midastouch_perception import ObjectMesh
from midastouch_tools.processes.foreground import ended_by_signals

try:
    from moveit_msgs.msg import AttachedCollisionObject, CollisionObject
    from shape_msgs.msg import Mesh, MeshTriangle
except ModuleNotFoundError as error:
    raise SystemExit(f"{error}: it comes with MoveIt, on a system ROS") from error

SURE = FilterStatus.STATE_CONVERGED
OPEN = FilterStatus.STATE_NO_CONTACT


def shape_of(mesh: ObjectMesh) -> Mesh:
    """Return a mesh as MoveIt takes it."""
    vertices = [Point(x=x, y=y, z=z) for x, y, z in mesh.vertices.tolist()]
    return Mesh(triangles=[MeshTriangle(vertex_indices=face) for face in mesh.faces.tolist()], vertices=vertices)


class Attacher(Node):
    """Node that attaches the object where the filter is sure of it, and detaches it once nothing touches."""

    def __init__(self, mesh: ObjectMesh, links: list[str]):
        super().__init__("attach_to_moveit")
        self.name, self.shape, self.links, self.attached = mesh.name, shape_of(mesh), links, False
        self.state, self.link = "", ""
        self.out = self.create_publisher(AttachedCollisionObject, "attached_collision_object", 10)
        self.create_subscription(PoseWithCovarianceStamped, "left/object_pose", self.on_pose, qos.latched())
        self.create_subscription(FilterStatus, "left/filter_status", self.on_status, qos.latched())

    def on_pose(self, message: PoseWithCovarianceStamped) -> None:
        """Attach the object at a pose that is the first of which the filter is sure."""
        if self.state != SURE or self.attached:
            return
        self.attached, self.link = True, message.header.frame_id
        self.publish(CollisionObject.ADD, header=message.header, pose=message.pose.pose, meshes=[self.shape])
        self.get_logger().info(f"{self.name} is attached to {self.link}")

    def on_status(self, status: FilterStatus) -> None:
        """Detach the object once no sensor of the gripper touches it."""
        self.state = status.state
        if self.state == OPEN and self.attached:
            self.attached = False
            self.publish(CollisionObject.REMOVE)
            self.get_logger().info(f"{self.name} is detached")

    def publish(self, operation: bytes, **fields) -> None:
        """Publish what happens to the object."""
        held = CollisionObject(id=self.name, operation=operation, **fields)
        self.out.publish(AttachedCollisionObject(link_name=self.link, object=held, touch_links=self.links))


def main() -> None:
    """Run the node until a signal comes."""
    if len(sys.argv) < 2 or sys.argv[1].startswith("-"):
        raise SystemExit(__doc__)
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    with ended_by_signals():
        rclpy.spin(Attacher(ObjectMesh.load(sys.argv[1]), sys.argv[2:]))


if __name__ == "__main__":
    main()
