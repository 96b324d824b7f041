#!/usr/bin/python3
"""Colours of a scan by Open3D's colour map optimisation (Zhou and Koltun 2014), as a peer for held_out.

    open3d_colors.py --mode average|rigid|nonrigid --input_path aligned --image_path images --output_path out

Geometry is the scan's mesh as roomtex-texture writes it, the photos are undistorted by roomtex-export, their depth is
the scan's. Writes out/model.ply, with colours at the vertices. Needs Debian's python3-open3d; --bin: where our commands
lie, PATH if not given.
"""

import argparse
import os
import struct
import subprocess

import numpy
import open3d

# What is not named here is as Open3D has it.
FARTHEST = 20.0  # metres; 2.5 would leave out most of a room
ITERATIONS = 300  # as in Open3D's tutorial; the default is none


def read_cameras(path):
    """Intrinsics per camera of a cameras.bin that holds PINHOLE cameras only: width, height, fx, fy, cx, cy."""
    cameras = {}
    with open(path, "rb") as file:
        (count,) = struct.unpack("<Q", file.read(8))
        for _ in range(count):
            number, model, width, height = struct.unpack("<IiQQ", file.read(24))
            if model != 1:
                raise SystemExit(f"{path}: camera {number} is no PINHOLE camera")
            cameras[number] = (width, height) + struct.unpack("<4d", file.read(32))
    return cameras


def read_images(path):
    """Pairs (name, camera, 4 x 4 camera from scan) of an images.bin."""
    images = []
    with open(path, "rb") as file:
        (count,) = struct.unpack("<Q", file.read(8))
        for _ in range(count):
            numbers = struct.unpack("<I7dI", file.read(64))
            name = b""
            while (letter := file.read(1)) != b"\0":
                name += letter
            (points,) = struct.unpack("<Q", file.read(8))
            file.seek(24 * points, os.SEEK_CUR)
            w, x, y, z = numbers[1:5]
            pose = numpy.eye(4)
            pose[:3, :3] = open3d.geometry.get_rotation_matrix_from_quaternion([w, x, y, z])
            pose[:3, 3] = numbers[5:8]
            images.append((name.decode(), numbers[8], pose))
    return images


def read_depth(path):
    """COLMAP's dense map: width&height&channels& and float32, row by row."""
    with open(path, "rb") as file:
        data = file.read()
    width, height, channels, rest = data.split(b"&", 3)
    shape = (int(height), int(width))
    assert int(channels) == 1
    return numpy.frombuffer(rest, dtype="<f4").reshape(shape)


def run(options, name, *arguments):
    program = os.path.join(options.bin, name) if options.bin else name
    line = [program, "--quiet", "--input_path", options.input_path, "--image_path", options.image_path]
    if options.scan_path:
        line += ["--scan_path", options.scan_path]
    done = subprocess.run(line + list(arguments), stdout=subprocess.DEVNULL)
    if done.returncode not in (0, 4):
        raise SystemExit(f"{name} ended with {done.returncode}")


def color_map_option(mode):
    limits = dict(
        maximum_iteration=0 if mode == "average" else ITERATIONS,
        maximum_allowable_depth=FARTHEST,
    )
    if mode == "nonrigid":
        return open3d.pipelines.color_map.NonRigidOptimizerOption(**limits)
    return open3d.pipelines.color_map.RigidOptimizerOption(**limits)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--mode", choices=["average", "rigid", "nonrigid"], default="rigid")
    parser.add_argument("--bin", default="")
    for name in ("input_path", "image_path", "output_path"):
        parser.add_argument("--" + name, required=True)
    parser.add_argument("--scan_path", default="")
    options = parser.parse_args()

    exported = os.path.join(options.output_path, "exported")
    colored = os.path.join(options.output_path, "colored")
    run(options, "roomtex-texture", "--Registration.mode", "none", "--Texture.scale", "1", "--output_evidence", "0",
        "--output_path", colored)
    run(options, "roomtex-export", "--format", "colmap", "--masks", "0", "--max_points", "100", "--colors_path",
        os.path.join(colored, "model.ply"), "--output_path", exported)
    mesh = open3d.io.read_triangle_mesh(os.path.join(colored, "model.ply"))
    cameras = read_cameras(os.path.join(exported, "sparse/0/cameras.bin"))

    pictures, trajectory = [], []
    for name, camera, pose in sorted(read_images(os.path.join(exported, "sparse/0/images.bin"))):
        color = open3d.io.read_image(os.path.join(exported, "images", name))
        depth = read_depth(os.path.join(exported, "stereo/depth_maps", name + ".geometric.bin"))
        pictures.append(open3d.geometry.RGBDImage.create_from_color_and_depth(
            color, open3d.geometry.Image(depth.astype(numpy.float32)), depth_scale=1.0, depth_trunc=FARTHEST,
            convert_rgb_to_intensity=False))
        parameters = open3d.camera.PinholeCameraParameters()
        parameters.intrinsic = open3d.camera.PinholeCameraIntrinsic(*cameras[camera])
        parameters.extrinsic = pose
        trajectory.append(parameters)
    cameras_of_all = open3d.camera.PinholeCameraTrajectory()
    cameras_of_all.parameters = trajectory

    color_map = open3d.pipelines.color_map
    optimise = color_map.run_non_rigid_optimizer if options.mode == "nonrigid" else color_map.run_rigid_optimizer
    result = optimise(mesh, pictures, cameras_of_all, color_map_option(options.mode))
    mesh = result[0] if isinstance(result, tuple) else result
    open3d.io.write_triangle_mesh(os.path.join(options.output_path, "model.ply"), mesh, write_vertex_normals=False)


if __name__ == "__main__":
    main()
