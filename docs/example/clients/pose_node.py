"""Publish the pose of a cochlea in ROS 2. NOT RUN: there is no ROS 2 where this is tested.

Reads a request (side and touches, mm, tracker frame) from a file, asks gp-core serve at 127.0.0.1:18950, and
publishes geometry_msgs/PoseStamped on /cochlea_pose, in metres, frame_id "tracker", only if the pose may be
used.
"""

import json
import sys
import urllib.error
import urllib.request
from pathlib import Path

import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node


def ask(request: dict, port: int = 18950) -> dict:
    """Return the answer; an HTTPError of status 409 means that the pose is withheld."""
    data = json.dumps(request).encode()
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/estimate", data, timeout=30) as answer:
        return json.load(answer)


def stamped(answer: dict) -> PoseStamped:
    """Return the pose in metres; x of its frame is the modiolar axis, from base to apex."""
    message = PoseStamped()
    seconds, part = divmod(answer["stamp_unix_s"], 1)
    message.header.stamp = Time(sec=int(seconds), nanosec=int(part * 1e9))
    message.header.frame_id = answer["frame"]
    x, y, z = (value / 1000 for value in answer["cochlea_origin_mm"])
    message.pose.position.x, message.pose.position.y, message.pose.position.z = x, y, z
    q = message.pose.orientation
    q.x, q.y, q.z, q.w = answer["quaternion_xyzw"]
    return message


def main() -> None:
    """Ask once, and publish ten times a second until Ctrl-C."""
    request = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    try:
        message = stamped(ask(request))
    except urllib.error.HTTPError as error:
        sys.exit(f"no pose (HTTP {error.code}): {error.read().decode()[:400]}")
    rclpy.init()
    node = Node("cochlea_pose")
    publisher = node.create_publisher(PoseStamped, "cochlea_pose", 10)
    node.create_timer(0.1, lambda: publisher.publish(message))
    rclpy.spin(node)


if __name__ == "__main__":
    main()
