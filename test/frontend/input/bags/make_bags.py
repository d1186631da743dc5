#!/usr/bin/env python3
"""Writes the first pairs of a KITTI sequence as bags of all kinds, with the packages rosbags and mcap.

usage: make_bags.py SEQUENCE OUT PAIRS        (packages: rosbags, mcap, pillow)

OUT/ then holds ros1_{none,bz2,lz4}.bag, ros2_{sqlite,sqlite_zstd,mcap}/ and
mcap_{none,lz4,zstd,plain,no_index}.mcap. Times of receipt are 5 s later than those of the headers.
"""

import pathlib
import sys

import numpy
from mcap.writer import CompressionType, IndexType, Writer as McapWriter
from PIL import Image
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

LATER = 5_000_000_000  # [ns]
IMAGE = "sensor_msgs/msg/Image"
INFO = "sensor_msgs/msg/CameraInfo"


def projection(sequence, label):
    for line in (sequence / "calib.txt").read_text().splitlines():
        if line.startswith(label):
            return numpy.array([float(field) for field in line.split()[1:]])
    sys.exit(f"calib.txt: no {label}")


def messages(sequence, count, types, ros1):
    """(time, topic, type, message) of all pairs, left before right."""
    kinds = types.types

    def header(time, frame):
        sec, nanosec = divmod(time, 10**9)
        stamp = kinds["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
        fields = {"seq": 0} if ros1 else {}
        return kinds["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **fields)

    seconds = (sequence / "times.txt").read_text().split()
    region = kinds["sensor_msgs/msg/RegionOfInterest"](
        x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    for index in range(count):
        time = round(float(seconds[index]) * 1e9)
        for side, folder, label in (("left", "image_0", "P0:"), ("right", "image_1", "P1:")):
            pixels = numpy.array(Image.open(sequence / folder / f"{index:06d}.png"))
            height, width = pixels.shape
            p = projection(sequence, label)
            k = p.reshape(3, 4)[:, :3].flatten()
            matrices = ({"D": numpy.zeros(5), "K": k, "R": numpy.eye(3).flatten(), "P": p} if ros1 else
                        {"d": numpy.zeros(5), "k": k, "r": numpy.eye(3).flatten(), "p": p})
            yield time, f"/stereo/{side}/camera_info", INFO, kinds[INFO](
                header=header(time, side), height=height, width=width, distortion_model="plumb_bob",
                binning_x=0, binning_y=0, roi=region, **matrices)
            yield time, f"/stereo/{side}/image_raw", IMAGE, kinds[IMAGE](
                header=header(time, side), height=height, width=width, encoding="mono8", is_bigendian=0,
                step=width, data=pixels.flatten())


def write(writer, types, all_messages, serialize):
    connections = {}
    for time, topic, kind, message in all_messages:
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, kind, typestore=types)
        writer.write(connections[topic], time + LATER, serialize(message, kind))


def write_mcap(path, types, all_messages, **options):
    with open(path, "wb") as file:
        writer = McapWriter(file, **options)
        writer.start(profile="ros2", library="make_bags")
        channels = {}
        for number, (time, topic, kind, message) in enumerate(all_messages):
            if topic not in channels:
                text, _ = types.generate_msgdef(kind)
                schema = writer.register_schema(kind, "ros2msg", text.encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], time + LATER, bytes(types.serialize_cdr(message, kind)),
                               time + LATER, number)
        writer.finish()


def main():
    sequence, out, count = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), int(sys.argv[3])
    out.mkdir(parents=True, exist_ok=True)
    ros1, ros2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
    for name, compression in (("none", None), ("bz2", Ros1Writer.CompressionFormat.BZ2),
                              ("lz4", Ros1Writer.CompressionFormat.LZ4)):
        writer = Ros1Writer(out / f"ros1_{name}.bag")
        if compression:
            writer.set_compression(compression)
        with writer:
            write(writer, ros1, messages(sequence, count, ros1, True), ros1.serialize_ros1)
    for name, plugin, mode in (("sqlite", StoragePlugin.SQLITE3, None),
                               ("sqlite_zstd", StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
                               ("mcap", StoragePlugin.MCAP, CompressionMode.STORAGE)):
        writer = Ros2Writer(out / f"ros2_{name}", version=9, storage_plugin=plugin)
        if mode:
            writer.set_compression(mode, CompressionFormat.ZSTD)
        with writer:
            write(writer, ros2, messages(sequence, count, ros2, False), ros2.serialize_cdr)
    for name, options in (("none", {"compression": CompressionType.NONE}),
                          ("lz4", {"compression": CompressionType.LZ4}),
                          ("zstd", {"compression": CompressionType.ZSTD}),
                          ("plain", {"use_chunking": False}),
                          ("no_index", {"compression": CompressionType.ZSTD, "index_types": IndexType.NONE,
                                        "repeat_channels": False, "repeat_schemas": False})):
        write_mcap(out / f"mcap_{name}.mcap", ros2, messages(sequence, count, ros2, False), **options)


if __name__ == "__main__":
    main()
