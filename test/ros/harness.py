"""What the tests with a ROS master share: a bag fed in lock-step, and mathematics of poses.

Each image is published only after the tracker has answered the one before, so that no test depends on
the speed of the machine.
"""

import copy
import math
import struct
import threading
import zlib

import numpy as np
import rosbag
import rospy
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

IMAGE_TOPIC = '/camera/image_raw'
INFO_TOPIC = '/camera/camera_info'
TRUTH_TOPIC = '/ground_truth/pose'


class Recording:
    """Images, calibration and true camera poses of a simulated bag, in order of their stamps."""

    def __init__(self, path):
        self.images, self.truth, self.info = [], {}, None
        with rosbag.Bag(path) as bag:
            for topic, message, _ in bag.read_messages([IMAGE_TOPIC, INFO_TOPIC, TRUTH_TOPIC]):
                # What rosbag makes is a class of its own: only copies can be published.
                if topic == IMAGE_TOPIC:
                    self.images.append(as_class(message, Image))
                elif topic == INFO_TOPIC:
                    self.info = as_class(message, CameraInfo)
                else:
                    self.truth[message.header.stamp] = matrix_of_pose(message.pose)

    def truth_from_first(self, stamps):
        """T_first_camera of each: what a tracker that starts at stamps[0] sees, but for scale."""
        inverse = np.linalg.inv(self.truth[stamps[0]])
        return [inverse.dot(self.truth[stamp]) for stamp in stamps]


def as_class(message, kind):
    copied = kind()
    for slot in kind.__slots__:
        setattr(copied, slot, copy.copy(getattr(message, slot)))
    return copied


class Inbox:
    """Collects the messages of a topic; waits for the one with a stamp."""

    def __init__(self, topic, kind):
        self.topic = topic
        self.messages = []
        self._changed = threading.Condition()
        self._subscriber = rospy.Subscriber(topic, kind, self._receive, queue_size=1000)

    def _receive(self, message):
        with self._changed:
            self.messages.append(message)
            self._changed.notify_all()

    def clear(self):
        with self._changed:
            self.messages = []

    def wait_for(self, accept, timeout_s=30.0):
        """The first message that `accept` takes; None after the timeout."""
        with self._changed:
            self._changed.wait_for(lambda: any(accept(m) for m in self.messages), timeout_s)
            return next((m for m in self.messages if accept(m)), None)

    def wait_for_stamp(self, stamp, timeout_s=30.0):
        return self.wait_for(lambda m: stamp_of(m) == stamp, timeout_s)

    def connected(self):
        return self._subscriber.get_num_connections() > 0

    def close(self):
        self._subscriber.unregister()


def stamp_of(message):
    if hasattr(message, 'header'):
        return message.header.stamp
    inner = getattr(message, 'markers', None) or getattr(message, 'transforms', None)
    return inner[-1].header.stamp if inner else None


def wait_until(condition, timeout_s=30.0, what='a condition'):
    """Polls by real time; fails with a name."""
    waited = 0.0
    while not condition():
        if waited > timeout_s:
            raise AssertionError('no %s within %g s' % (what, timeout_s))
        threading.Event().wait(0.02)
        waited += 0.02


class Feeder:
    """Publishes images and waits for the tracker's ~state of each."""

    def __init__(self, tracker='/tracker', image_topic=IMAGE_TOPIC, info_topic=INFO_TOPIC,
                 image_class=Image):
        from active_matching_slam.msg import TrackingState
        self.images = rospy.Publisher(image_topic, image_class, queue_size=10)
        self.infos = rospy.Publisher(info_topic, CameraInfo, queue_size=10)
        self.states = Inbox(tracker + '/state', TrackingState)
        wait_until(lambda: self.images.get_num_connections() > 0
                   and self.infos.get_num_connections() > 0 and self.states.connected(),
                   what='connection with ' + tracker)

    def feed(self, image, info=None, expect_answer=True, timeout_s=30.0):
        """Returns the tracker's state after the image, or None when it must not answer."""
        if info is not None:
            self.calibrate(info)
        self.states.clear()
        self.images.publish(image)
        if not expect_answer:
            threading.Event().wait(timeout_s)
            return self.states.wait_for_stamp(image.header.stamp, 0.0)
        state = self.states.wait_for_stamp(image.header.stamp, timeout_s)
        if state is None:
            raise AssertionError('no state for the image at %s' % image.header.stamp)
        return state

    def calibrate(self, info):
        """camera_info and images travel on two connections: lets the first arrive."""
        self.infos.publish(info)
        threading.Event().wait(0.3)


def matrix_of_pose(pose):
    return matrix_of(pose.position, pose.orientation)


def matrix_of(p, q):
    x, y, z, w = q.x, q.y, q.z, q.w
    matrix = np.eye(4)
    matrix[:3, :3] = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                      [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                      [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    matrix[:3, 3] = [p.x, p.y, p.z]
    return matrix


def angle_between(a, b):
    """Of two rotation matrices [rad]."""
    trace = np.trace(a[:3, :3].T.dot(b[:3, :3]))
    return math.acos(min(1.0, max(-1.0, (trace - 1.0) / 2.0)))


def position_errors_after_scaling(estimates, truths):
    """Distances once the one unknown, scale, is fitted: both start at the origin."""
    e = np.array([m[:3, 3] for m in estimates])
    t = np.array([m[:3, 3] for m in truths])
    scale = (e * t).sum() / (e * e).sum()
    return np.linalg.norm(scale * e - t, axis=1), scale


def numbers_in(message):
    """Every floating-point number of a message, however deep."""
    if isinstance(message, float):
        yield message
    elif isinstance(message, (list, tuple)):
        for element in message:
            yield from numbers_in(element)
    elif hasattr(message, '__slots__') and hasattr(message, '_slot_types'):
        for slot in message.__slots__:
            yield from numbers_in(getattr(message, slot))


def all_finite(message):
    return all(math.isfinite(number) for number in numbers_in(message))


def image_like(image, stamp, pixels=None):
    """The image with another stamp, and other grey pixels (a numpy array) where given."""
    copied = copy.copy(image)
    copied.header = copy.copy(image.header)
    copied.header.stamp = stamp
    if pixels is not None:
        copied.height, copied.width = pixels.shape
        copied.step = copied.width
        copied.encoding = 'mono8'
        copied.data = pixels.astype(np.uint8).tobytes()
    return copied


def pixels_of(image):
    """Grey pixels of a mono8 or 3-channel image."""
    data = np.frombuffer(image.data, np.uint8).reshape(image.height, image.step)
    if image.encoding == 'mono8':
        return data[:, :image.width]
    return data[:, :3 * image.width].reshape(image.height, image.width, 3).mean(axis=2)


def png(pixels):
    """A grey png, by the letter of its definition."""
    def chunk(kind, data):
        body = kind + data
        return struct.pack('>I', len(data)) + body + struct.pack('>I', zlib.crc32(body))
    height, width = pixels.shape
    rows = b''.join(b'\0' + row.tobytes() for row in pixels.astype(np.uint8))
    header = struct.pack('>IIBBBBB', width, height, 8, 0, 0, 0, 0)
    return (b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', header) + chunk(b'IDAT', zlib.compress(rows)) +
            chunk(b'IEND', b''))


def compressed(image):
    return CompressedImage(header=copy.deepcopy(image.header), format='png', data=png(pixels_of(image)))


def compress_bag(source, target, count, clock_error_s=0.0):
    """The first `count` images as png with their calibration, stamped by a clock that is wrong."""
    recording = Recording(source)
    error = rospy.Duration(clock_error_s)
    with rosbag.Bag(target, 'w') as bag:
        for image in recording.images[:count]:
            time = image.header.stamp
            packed, info = compressed(image), copy.copy(recording.info)
            packed.header = copy.copy(packed.header)
            packed.header.stamp += error
            info.header = packed.header
            bag.write(INFO_TOPIC, info, time)
            bag.write(IMAGE_TOPIC + '/compressed', packed, time)
