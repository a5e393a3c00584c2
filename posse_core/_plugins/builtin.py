"""The built-in components, registered through the same hooks as those of third parties."""

from __future__ import annotations

from posse_core._plugins.hooks import hookimpl
from posse_core._plugins.registry import ComponentSpec


@hookimpl
def posse_propagators() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "file",
            "a trajectory from a file: NPZ, CSV or CCSDS OEM, with its own frames",
            "posse_core._propagators.file:FilePropagator",
            options="posse_core._propagators.options:FileOptions",
            capabilities=frozenset({"own-frames"}),
        ),
        ComponentSpec(
            "hcw",
            "Hill-Clohessy-Wiltshire: circular target, small separation",
            "posse_core._propagators.linear:HcwPropagator",
        ),
        ComponentSpec(
            "j2-roe",
            "relative orbital elements under J2 in closed form (Koenig-Guffanti-D'Amico)",
            "posse_core._propagators.j2_roe:J2RoePropagator",
            options="posse_core._propagators.options:J2RoeOptions",
        ),
        ComponentSpec(
            "nonlinear",
            "numerical integration: two-body or J2, drag, solar pressure, Sun and Moon; the reference",
            "posse_core._propagators.nonlinear:NonlinearPropagator",
            options="posse_core._propagators.options:NonlinearOptions",
        ),
        ComponentSpec(
            "roe",
            "exact two-body relative motion from relative orbital elements (the default)",
            "posse_core._propagators.roe:RoePropagator",
            capabilities=frozenset({"exact-two-body"}),
        ),
        ComponentSpec(
            "roe-near-circular",
            "relative orbital elements mapped by T(u): near-circular target",
            "posse_core._propagators.linear:NearCircularPropagator",
        ),
        ComponentSpec(
            "sgp4",
            "target and chaser by SGP4 from a TLE",
            "posse_core._propagators.sgp4:Sgp4Propagator",
        ),
        ComponentSpec(
            "thesis",
            "the thesis' propagation, literally: N instants x H relative orbits",
            "posse_core._propagators.thesis:ThesisPropagator",
            options="posse_core._propagators.options:ThesisOptions",
            capabilities=frozenset({"own-frames"}),
        ),
        ComponentSpec(
            "yamanaka-ankersen",
            "Yamanaka-Ankersen: any eccentricity, small separation",
            "posse_core._propagators.linear:YamanakaAnkersenPropagator",
        ),
    ]


_TARGET, _CAMERA = frozenset({"target"}), frozenset({"camera"})


@hookimpl
def posse_attitude_laws() -> list[ComponentSpec]:
    package = "posse_core._attitude"
    return [
        ComponentSpec(
            "file",
            "recorded attitudes: CCSDS AEM, NPZ or CSV",
            f"{package}.recorded:FileLaw",
            f"{package}.options:FileOptions",
            capabilities=_TARGET | _CAMERA,
        ),
        ComponentSpec(
            "inertial",
            "fixed in inertial axes",
            f"{package}.target:InertialLaw",
            f"{package}.options:InertialOptions",
            capabilities=_TARGET,
        ),
        ComponentSpec(
            "nadir",
            "LVLH axes: body +z towards the Earth, +x along V-bar (the target's default)",
            f"{package}.target:NadirLaw",
            capabilities=_TARGET,
        ),
        ComponentSpec(
            "ned",
            "the thesis' north, east, down of the Earth or the Sun",
            f"{package}.target:NedLaw",
            f"{package}.options:NedOptions",
            capabilities=_TARGET,
        ),
        ComponentSpec(
            "pointing-error",
            "at the target, but for a fixed misalignment and a jitter of each frame",
            f"{package}.camera:PointingErrorLaw",
            f"{package}.options:PointingErrorOptions",
            capabilities=_CAMERA,
        ),
        ComponentSpec(
            "spin",
            "a steady spin about an axis at an angle from the Sun",
            f"{package}.target:SpinLaw",
            f"{package}.options:SpinOptions",
            capabilities=_TARGET,
        ),
        ComponentSpec(
            "sun-pointing",
            "a body axis at the Sun, the next one towards ecliptic north",
            f"{package}.target:SunPointingLaw",
            f"{package}.options:SunPointingOptions",
            capabilities=_TARGET,
        ),
        ComponentSpec(
            "track",
            "at the target, with the orbit's normal upward in the image (the camera's default)",
            f"{package}.camera:TrackLaw",
            f"{package}.options:TrackOptions",
            capabilities=_CAMERA,
        ),
        ComponentSpec(
            "tracking",
            "a body axis at the chaser, the next one near the orbit's normal",
            f"{package}.target:TrackingLaw",
            f"{package}.options:TrackingOptions",
            capabilities=_TARGET,
        ),
        ComponentSpec(
            "tumbling",
            "torque-free motion of a rigid body",
            f"{package}.target:TumblingLaw",
            f"{package}.options:TumblingOptions",
            capabilities=_TARGET,
        ),
    ]


@hookimpl
def posse_joint_laws() -> list[ComponentSpec]:
    package = "posse_core._joints"
    return [
        ComponentSpec(
            "animation",
            "the joint's motion in an animation of the spacecraft's file",
            f"{package}.laws:AnimationLaw",
            f"{package}.options:AnimationOptions",
        ),
        ComponentSpec(
            "bending",
            "hinges of a wing that vibrates in its first bending mode",
            f"{package}.bending:BendingLaw",
            f"{package}.options:BendingOptions",
        ),
        ComponentSpec(
            "fixed",
            "the same value always",
            f"{package}.laws:FixedLaw",
            f"{package}.options:FixedOptions",
        ),
        ComponentSpec(
            "random",
            "a value drawn from a range, for each frame or for the run",
            f"{package}.laws:RandomLaw",
            f"{package}.options:RandomOptions",
        ),
        ComponentSpec(
            "rate",
            "a steady rate from a value at the epoch",
            f"{package}.laws:RateLaw",
            f"{package}.options:RateOptions",
        ),
        ComponentSpec(
            "sun-tracking",
            "turns what faces the Sun, such as a wing's cells, as near to it as axis and limits allow",
            f"{package}.laws:SunTrackingLaw",
        ),
        ComponentSpec(
            "table",
            "values over time from a CSV or NPZ file",
            f"{package}.laws:TableLaw",
            f"{package}.options:TableOptions",
        ),
    ]


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


@hookimpl
def posse_navigators() -> list[ComponentSpec]:
    package = "posse_core._navigation"
    return [
        ComponentSpec(
            "dead-reckoning",
            "the planned motion and the commanded impulses, without any reading",
            f"{package}.coasting:DeadReckoningNavigator",
            f"{package}.options:DynamicsOptions",
        ),
        ComponentSpec(
            "ekf",
            "extended Kalman filter on keypoints or poses: relative motion, attitude, rate",
            f"{package}.kalman:EkfNavigator",
            f"{package}.options:KalmanOptions",
        ),
        ComponentSpec(
            "truth",
            "the true state, to compare with",
            f"{package}.coasting:TruthNavigator",
            f"{package}.options:DynamicsOptions",
            capabilities=frozenset({"truth"}),
        ),
        ComponentSpec(
            "ukf",
            "unscented Kalman filter on keypoints or poses: relative motion, attitude, rate",
            f"{package}.kalman:UkfNavigator",
            f"{package}.options:KalmanOptions",
        ),
    ]


@hookimpl
def posse_controllers() -> list[ComponentSpec]:
    package = "posse_core._guidance"
    return [
        ComponentSpec(
            "hold",
            "keeps the chaser where it is, or at a waypoint, by a deadband",
            f"{package}.hold:HoldController",
            f"{package}.options:HoldOptions",
            capabilities=frozenset({"no-waypoints"}),
        ),
        ComponentSpec(
            "impulsive-mpc",
            "least impulses to reach and hold waypoints, replanned at each instant (the default)",
            f"{package}.impulsive_mpc:ImpulsiveMpc",
            f"{package}.options:MpcOptions",
        ),
        ComponentSpec(
            "lqr",
            "linear-quadratic regulator on the exact linear motion, without safety rules",
            f"{package}.lqr:LqrController",
            f"{package}.options:LqrOptions",
        ),
        ComponentSpec(
            "plan",
            "carries out impulses that were planned beforehand",
            f"{package}.plan:PlanController",
            capabilities=frozenset({"no-waypoints"}),
        ),
    ]


_LABELS_ONLY = frozenset({"labels-only"})
_STATIC_WORLD = frozenset({"global-shutter-only", "no-joints"})
_NO_RATIONAL_LENS = frozenset({"no-rational-lens"})


@hookimpl
def posse_writers() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "bop",
            "models, depth, masks and poses in mm",
            "posse_core._formats.bop:BopWriter",
            capabilities=frozenset({"pinhole-only"}),
        ),
        ComponentSpec(
            "coco",
            "boxes, masks and keypoints",
            "posse_core._formats.coco:CocoWriter",
            capabilities=_LABELS_ONLY,
        ),
        ComponentSpec(
            "colmap",
            "a COLMAP model of each target: poses, sparse points with tracks, masks",
            "posse_core._formats.colmap:ColmapWriter",
            capabilities=_STATIC_WORLD,
        ),
        ComponentSpec(
            "kalibr",
            "intrinsics and extrinsics of all cameras as a Kalibr camchain",
            "posse_core._formats.kalibr:KalibrWriter",
            capabilities=_LABELS_ONLY | _NO_RATIONAL_LENS,
        ),
        ComponentSpec(
            "nerfstudio",
            "transforms.json of each target: poses, sparse points, masks",
            "posse_core._formats.nerfstudio:NerfstudioWriter",
            capabilities=_STATIC_WORLD | _NO_RATIONAL_LENS,
        ),
        ComponentSpec(
            "opencv-calibration",
            "intrinsics and stereo pairs of all cameras as OpenCV's FileStorage",
            "posse_core._formats.opencv_calibration:OpencvCalibrationWriter",
            capabilities=_LABELS_ONLY,
        ),
        ComponentSpec(
            "posse",
            "the four files of the thesis",
            "posse_core._formats.thesis:ThesisWriter",
            capabilities=_LABELS_ONLY,
        ),
        ComponentSpec(
            "speed",
            "poses as in SPEED and SPEED+",
            "posse_core._formats.speed:SpeedWriter",
            capabilities=_LABELS_ONLY,
        ),
        ComponentSpec(
            "yolo", "boxes and keypoints for YOLO-pose", "posse_core._formats.yolo:YoloWriter"
        ),
    ]


@hookimpl
def posse_executors() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "local",
            "worker processes on this machine",
            "posse_core._run.local:LocalExecutor",
            "posse_core._run.attempts:PoolOptions",
        ),
    ]


@hookimpl
def posse_subcommands() -> list[ComponentSpec]:
    return [
        ComponentSpec(
            "collect", "join datasets and drop frames by rules", "posse_core._cli.collect:command"
        ),
        ComponentSpec(
            "crosscheck",
            "compare renderers with exact geometry and with each other",
            "posse_core._cli.crosscheck:command",
        ),
        ComponentSpec(
            "describe",
            "list keys of a scenario and options of a component",
            "posse_core._cli.describe:command",
        ),
        ComponentSpec("detect", "find spacecraft in images", "posse_core._cli.detect:command"),
        ComponentSpec(
            "doctor",
            "check what works on this machine, and how to fix it",
            "posse_core._cli.doctor:command",
        ),
        ComponentSpec("eval", "measure the accuracy of a detector", "posse_core._cli.eval:command"),
        ComponentSpec("export", "export the labels to another format", "posse_core._cli.export:command"),
        ComponentSpec(
            "export-onnx",
            "export a trained model to ONNX and check it",
            "posse_core._cli.export_onnx:command",
        ),
        ComponentSpec(
            "fly", "fly a scenario with the camera in the loop", "posse_core._cli.fly:command"
        ),
        ComponentSpec(
            "import", "make a spacecraft package from a mesh", "posse_core._cli.import_mesh:command"
        ),
        ComponentSpec(
            "import-poses",
            "make a scenario from the labels of another dataset",
            "posse_core._cli.import_poses:command",
        ),
        ComponentSpec(
            "manoeuvres", "list the impulses of a scenario's plan", "posse_core._cli.manoeuvres:command"
        ),
        ComponentSpec(
            "model-errors",
            "compute the errors of the models of relative motion",
            "posse_core._cli.model_errors:command",
        ),
        ComponentSpec(
            "partition",
            "divide a dataset into train, valid and test",
            "posse_core._cli.partition:command",
        ),
        ComponentSpec(
            "plugins", "list installed plugins and their state", "posse_core._cli.plugins:command"
        ),
        ComponentSpec(
            "preview", "show one frame of a scenario before a run", "posse_core._cli.preview:command"
        ),
        ComponentSpec(
            "propagate", "compute the trajectory of a scenario", "posse_core._cli.propagate:command"
        ),
        ComponentSpec("run", "make a labelled dataset from a scenario", "posse_core._cli.run:command"),
        ComponentSpec(
            "track", "track the target over a dataset's frames", "posse_core._cli.track:command"
        ),
        ComponentSpec("train", "train a detector on a dataset", "posse_core._cli.train:command"),
        ComponentSpec("validate", "check the labels of a dataset", "posse_core._cli.validate:command"),
        ComponentSpec(
            "version", "print the versions of POSSE and its plugins", "posse_core._cli.version:command"
        ),
        ComponentSpec("view", "write an HTML page that shows a dataset", "posse_core._cli.view:command"),
    ]
