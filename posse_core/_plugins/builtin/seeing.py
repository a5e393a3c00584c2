"""What the core sees and how: spacecraft, annotators and sensors."""

from __future__ import annotations

from posse_core._plugins.hooks import hookimpl
from posse_core._plugins.registry import ComponentSpec


@hookimpl
def posse_scenes() -> list[ComponentSpec]:
    package = "posse_core._spacecraft"
    return [
        ComponentSpec(
            "aqua",
            "Aqua-like: a bus with one long solar wing, 8.0 × 16.7 × 4.8 m",
            f"{package}.aqua:Aqua",
            f"{package}.options:AquaOptions",
        ),
        ComponentSpec(
            "cluster",
            "Cluster-like: a spinning drum 2.9 m across with two 5 m booms",
            f"{package}.cluster:Cluster",
            f"{package}.options:ClusterOptions",
        ),
        ComponentSpec(
            "cubesat",
            "a 3U CubeSat with two wings, 10 × 10 × 34 cm",
            f"{package}.cubesat:Cubesat",
            f"{package}.cubesat:CubesatOptions",
        ),
        ComponentSpec(
            "tango",
            "Tango-like, the target of SPEED, SPEED+ and SHIRT: a box under one panel",
            f"{package}.tango:Tango",
            f"{package}.tango:TangoOptions",
        ),
        ComponentSpec(
            "family",
            "a random plausible craft for each seed: bus, wings, dishes, booms",
            f"{package}.family.source:Family",
            f"{package}.options:FamilyOptions",
        ),
        ComponentSpec(
            "arm",
            "a robotic arm with a gripper, 1.2 m, all of its limbs on joints",
            f"{package}.arm:Arm",
            f"{package}.arm:ArmOptions",
        ),
        ComponentSpec(
            "fragment",
            "a piece of a broken spacecraft, another one for every seed",
            f"{package}.fragment:Fragment",
            f"{package}.fragment:FragmentOptions",
        ),
        ComponentSpec(
            "mesh",
            "a mesh file of your own: glTF, OBJ, PLY, STL",
            f"{package}.mesh:MeshFile",
            f"{package}.options:MeshOptions",
        ),
        ComponentSpec(
            "package",
            "a spacecraft package made by 'posse import'",
            f"{package}.package:Package",
            f"{package}.options:PackageOptions",
        ),
    ]


@hookimpl
def posse_annotators() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "albedo",
            "base colour of the surface per pixel, without light",
            "posse_core._annotators.albedo:AlbedoAnnotator",
        ),
        ComponentSpec(
            "box",
            "tight box of the visible pixels, and box of all projected vertices",
            "posse_core._annotators.exact:BoxAnnotator",
        ),
        ComponentSpec("depth", "planar depth per pixel", "posse_core._annotators.exact:DepthAnnotator"),
        ComponentSpec(
            "keypoints",
            "keypoints with visibility: 0 out of frame, 1 occluded, 2 visible",
            "posse_core._annotators.exact:KeypointsAnnotator",
        ),
        ComponentSpec(
            "mask",
            "mask as COCO run-lengths; its area, visible and lit fraction",
            "posse_core._annotators.exact:MaskAnnotator",
        ),
        ComponentSpec(
            "normals",
            "geometric normal per pixel, camera axes",
            "posse_core._annotators.exact:NormalsAnnotator",
        ),
        ComponentSpec(
            "optical-flow",
            "motion in the image per pixel until the next frame, and whether it is visible there",
            "posse_core._annotators.flow:OpticalFlowAnnotator",
        ),
        ComponentSpec(
            "parts",
            "part per pixel, and the visible area of each part",
            "posse_core._annotators.exact:PartsAnnotator",
        ),
        ComponentSpec(
            "pose",
            "attitude, position, range, phase angle, direction of the Sun",
            "posse_core._annotators.exact:PoseAnnotator",
        ),
        ComponentSpec(
            "scene-flow",
            "motion in camera axes per pixel until the next frame",
            "posse_core._annotators.flow:SceneFlowAnnotator",
        ),
    ]


@hookimpl
def posse_sensors() -> list[ComponentSpec]:
    package = "posse_core._sensors"
    return [
        ComponentSpec(
            "camera",
            "a camera beside the chaser's, labelled like it",
            f"{package}.camera.camera:CameraSensor",
            f"{package}.camera.options:CameraOptions",
        ),
        ComponentSpec(
            "events",
            "an event camera (DVS): pixels that report changes of the light, each at its own time",
            f"{package}.events.event_camera:EventCamera",
            f"{package}.events.options:EventsOptions",
        ),
        ComponentSpec(
            "lidar",
            "ranges of a scanned beam or of a flash, with the strength of what returns",
            f"{package}.lidar.lidar:LidarSensor",
            f"{package}.lidar.options:LidarOptions",
        ),
        ComponentSpec(
            "radiance",
            "the light that the image is made of: W m⁻² sr⁻¹ in every pixel and band",
            f"{package}.radiance.radiance:RadianceSensor",
            f"{package}.radiance.options:RadianceOptions",
        ),
        ComponentSpec(
            "stereo",
            "the right eye of a pair with the chaser's camera: image, labels, disparity",
            f"{package}.stereo.stereo:StereoSensor",
            f"{package}.stereo.options:StereoOptions",
        ),
        ComponentSpec(
            "thermal",
            "a long-wave infrared camera, with the true temperature of the surface in every pixel",
            f"{package}.thermal.thermal:ThermalCamera",
            f"{package}.thermal.options:ThermalOptions",
        ),
    ]
