"""What the tests with a ROS master share: a bag fed in lock-step, and mathematics of poses.

Each image is published only after the tracker has answered the one before, and connections are
waited for until both sides know of them, so that no test depends on the speed of the machine.
"""

import copy
import math
import struct
import threading
import time
import unittest
import warnings
import zlib

import numpy as np
import rosbag
import rosgraph
import rospy
import rosservice
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_srvs.srv import Trigger

IMAGE_TOPIC = '/camera/image_raw'
INFO_TOPIC = '/camera/camera_info'
TRUTH_TOPIC = '/ground_truth/pose'
# Until something that must happen counts as never to happen.
PATIENCE_S = 120.0


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


def settle(node):
    """Comes back when the node has taken in all that has been sent to it.

    The thread that reads its topics also answers what the type of a service is, here of one that
    every node has.
    """
    def answers():
        try:
            return rosservice.get_service_type(node + '/get_loggers') is not None
        except rosservice.ROSServiceException:  # busy for seconds: asked again
            return False
    wait_until(answers, what='answer of ' + node)


class Inbox:
    """Collects the messages of a topic; waits for the one with a stamp.

    Nothing that is published once it is constructed is missed: all publishers know of it by then.
    """

    def __init__(self, topic, kind):
        self.topic = topic
        self.messages = []
        self._changed = threading.Condition()
        self._subscriber = rospy.Subscriber(topic, kind, self._receive, queue_size=1000)
        wait_until(self.connected, what='connection to ' + topic)

    def _receive(self, message):
        with self._changed:
            self.messages.append(message)
            self._changed.notify_all()

    def clear(self):
        with self._changed:
            self.messages = []

    def wait_for(self, accept, timeout_s=PATIENCE_S):
        """The first message that `accept` takes; None after the timeout."""
        with self._changed:
            self._changed.wait_for(lambda: any(accept(m) for m in self.messages), timeout_s)
            return next((m for m in self.messages if accept(m)), None)

    def wait_for_stamp(self, stamp, timeout_s=PATIENCE_S):
        return self.wait_for(lambda m: stamp_of(m) == stamp, timeout_s)

    def connected(self):
        """With all publishers of the topic that there are now, and there is one."""
        topics = rosgraph.Master(rospy.get_name()).getSystemState()[0]
        publishers = set(dict(topics).get(self.topic, []))
        # rospy counts a connection before the other side knows of it; a header is the other's answer.
        answered = {connection.callerid_pub for connection in self._subscriber.impl.connections
                    if connection.header}
        if not publishers or not publishers <= answered:
            return False
        for node in publishers:
            settle(node)
        return True

    def close(self):
        self._subscriber.unregister()


def stamp_of(message):
    if hasattr(message, 'header'):
        return message.header.stamp
    inner = getattr(message, 'markers', None) or getattr(message, 'transforms', None)
    return inner[-1].header.stamp if inner else None


def wait_until(condition, timeout_s=PATIENCE_S, what='a condition'):
    """Polls by real time; fails with a name."""
    end = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > end:
            raise AssertionError('no %s within %g s' % (what, timeout_s))
        threading.Event().wait(0.02)


def publisher(topic, kind):
    """Hands messages over within publish(): no thread behind it that may come later."""
    with warnings.catch_warnings():
        warnings.simplefilter('ignore', SyntaxWarning)  # wants a queue
        return rospy.Publisher(topic, kind, tcp_nodelay=True, queue_size=None)


class Feeder:
    """Publishes images and waits for the ~state of each from one or more trackers on them."""

    def __init__(self, trackers, image_topic=IMAGE_TOPIC, info_topic=INFO_TOPIC,
                 image_class=Image):
        from active_matching_slam.msg import TrackingState
        self.images = publisher(image_topic, image_class)
        self.infos = publisher(info_topic, CameraInfo)
        self._tracker_nodes = set()
        for tracker in trackers:
            self._tracker_nodes.add(node_of(tracker))
        self.states = {tracker: Inbox(tracker + '/state', TrackingState) for tracker in trackers}
        wait_until(lambda: self._tracker_nodes <= listeners(self.images)
                   and self._tracker_nodes <= listeners(self.infos),
                   what='connection with ' + ', '.join(trackers))

    def feed(self, image, info=None):
        """The first tracker's state after the image, which all have answered."""
        return next(iter(self.feed_all(image, info).values()))

    def feed_all(self, image, info=None):
        """The trackers' states after the image, by name."""
        self._send(image, info)
        states = {tracker: inbox.wait_for_stamp(image.header.stamp)
                  for tracker, inbox in self.states.items()}
        for tracker, state in states.items():
            if state is None:
                raise AssertionError('%s: no state for the image at %s' %
                                     (tracker, image.header.stamp))
        return states

    def feed_in_vain(self, image, info=None, patience_s=0.3):
        """An image that must not be tracked. The answer, should there be one without a reason."""
        self._send(image, info)
        threading.Event().wait(patience_s)
        answers = [inbox.wait_for_stamp(image.header.stamp, 0.0) for inbox in self.states.values()]
        return next((answer for answer in answers if answer is not None and not answer.reason), None)

    def _send(self, image, info):
        if info is not None:
            self.calibrate(info)
        for inbox in self.states.values():
            inbox.clear()
        self.images.publish(image)

    def calibrate(self, info):
        """camera_info and images travel on two connections: lets the first arrive."""
        self.infos.publish(info)
        for node in self._tracker_nodes:
            settle(node)


def node_of(tracker):
    """The node (for a nodelet, its manager) in which a tracker runs; waits until it is there."""
    rospy.wait_for_service(tracker + '/reset', PATIENCE_S)
    return rosservice.get_service_node(tracker + '/reset')


def listeners(publisher):
    """Names of the nodes connected to a rospy publisher."""
    return {connection.endpoint_id for connection in publisher.impl.connections}


class TrackerTestCase(unittest.TestCase):
    """Tests of `trackers` on one camera: the parameter ~bag, in lock-step.

    Each test starts without a map, later than the one before: tf takes nothing twice.
    """

    trackers = ('/tracker', )

    @classmethod
    def setUpClass(cls):
        cls.recording = Recording(rospy.get_param('~bag'))
        cls.images = cls.recording.images
        cls.feeder = Feeder(cls.trackers)
        cls.feeder.calibrate(cls.recording.info)
        cls.shift = rospy.Duration(0)

    def setUp(self):
        self.start_anew()

    def start_anew(self):
        for tracker in self.trackers:
            self.assertTrue(self.service('reset', Trigger, tracker)().success)
        type(self).shift += rospy.Duration(1000)

    def service(self, name, kind, tracker=None):
        """A service of a tracker: the first, where none is named."""
        name = (tracker or self.trackers[0]) + '/' + name
        rospy.wait_for_service(name, PATIENCE_S)
        return rospy.ServiceProxy(name, kind)

    def inbox(self, topic, kind, tracker=None):
        """Of a tracker's topic (as service()), or of one that begins with '/'; ends with the test."""
        if not topic.startswith('/'):
            topic = (tracker or self.trackers[0]) + '/' + topic
        inbox = Inbox(topic, kind)
        self.addCleanup(inbox.close)
        return inbox

    def image(self, index, pixels=None):
        image = self.images[index]
        return image_like(image, image.header.stamp + self.shift, pixels)

    def run_images(self, first, last):
        """The first tracker's states for images first to last - 1."""
        return [self.feeder.feed(self.image(i)) for i in range(first, last)]


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
