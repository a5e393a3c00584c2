"""Components of every kind that return what they must not, as their option ``fault`` says; and an
annotator with arrays of all types that are allowed."""

from dataclasses import replace

import numpy as np

from posse_core import (
    Annotator,
    AttitudeLaw,
    ComponentSpec,
    Executor,
    FrameResult,
    Labels,
    Material,
    Motion,
    Options,
    Part,
    Propagator,
    Radiance,
    Renderer,
    SceneSource,
    Spacecraft,
    Writer,
    hookimpl,
)


class Faults(Options):
    fault: str = ""


def record(name, cls, **more):
    return ComponentSpec(name, "for tests", f"posse_faulty:{cls}", "posse_faulty:Faults", **more)


@hookimpl
def posse_annotators():
    return [record("many-types", "ManyTypes"), record("faulty", "FaultyAnnotator")]


@hookimpl
def posse_renderers():
    return [record("faulty", "FaultyRenderer")]


@hookimpl
def posse_propagators():
    return [record("faulty", "FaultyPropagator")]


@hookimpl
def posse_attitude_laws():
    return [record("faulty", "FaultyLaw", capabilities=frozenset({"target", "camera"}))]


@hookimpl
def posse_scenes():
    return [record("faulty", "FaultyScene")]


@hookimpl
def posse_writers():
    return [record("faulty", "FaultyWriter")]


@hookimpl
def posse_executors():
    return [record("lazy", "Lazy")]


class FaultyLaw(AttitudeLaw):
    def attitude(self, around):
        R = np.tile(np.eye(3), (len(around.t_s), 1, 1))
        fault = self.options.fault
        if fault == "raises":
            raise ValueError("no luck")
        if fault == "single":
            return R.astype(np.float32)
        if fault == "mirrored":
            R[2, 0, 0] = -1
        if fault == "stretched":
            R[1] *= 1 + 1e-6
        if fault == "nan":
            R[0, 0, 0] = np.nan
        return {"none": None, "lists": R.tolist(), "one": R[0]}.get(fault, R)


class ManyTypes(Annotator):
    def annotate(self, look):
        mask = look.view().mask
        arrays = {
            "seen": mask,
            "shade": np.where(mask, 200, 0).astype(np.uint8),
            "number": np.where(mask, 7, -1).astype(np.int8),
            "half": np.where(mask, 0.5, np.nan).astype(np.float16),
            "pair": np.stack([mask, ~mask], axis=-1),
        }
        return Labels(
            {
                "mean": np.float32(0.5),
                "count": np.int64(3),
                "yes": np.True_,
                "vector": np.arange(3),
                "pair": (1, np.float64(2.5)),
                "nested": {"name": "x", "none": None},
            },
            arrays,
        )


class FaultyAnnotator(Annotator):
    def annotate(self, look):
        if look.index != 1:
            return Labels({"sound": 1})
        match self.options.fault:
            case "none":
                return None
            case "nan":
                return Labels({"mean": {"x": [0.0, np.nan]}})
            case "shape":
                return Labels(arrays={"extra": np.zeros((3, 4))})


class FaultyRenderer(Renderer):
    def open(self, scene):
        pass

    def close(self):
        pass

    def render(self, request):
        if self.options.fault == "none":
            return None
        shape = (request.box.height, request.box.width)
        return Radiance(request.box, np.ones((*shape, 4), np.float32), np.ones(shape, np.float32))


class FaultyPropagator(Propagator):
    def propagate(self, problem):
        n = len(problem.t_s)
        sound = Motion(
            t_s=problem.t_s,
            r_target_eci_m=np.tile([7.0e6, 0.0, 0.0], (n, 1)),
            v_target_eci_m_s=np.tile([0.0, 7546.0, 0.0], (n, 1)),
            r_chaser_rtn_m=np.tile([0.0, -20.0, 0.0], (n, 1)),
            v_chaser_rtn_m_s=np.zeros((n, 3)),
            sequence=np.zeros(n, dtype=np.int64),
        )
        match self.options.fault:
            case "none":
                return None
            case "lists":
                return replace(sound, t_s=list(problem.t_s))
            case "short":
                return replace(sound, r_chaser_rtn_m=sound.r_chaser_rtn_m[1:])
            case "flat":
                return replace(sound, v_chaser_rtn_m_s=np.zeros(n))
            case "nan":
                return replace(sound, r_target_eci_m=sound.r_target_eci_m * np.nan)
            case "times":
                return replace(sound, t_s=problem.t_s + 1.0)
            case "sequence":
                return replace(sound, sequence=np.zeros(n))
            case "raises":
                raise ValueError("no luck")
        return sound


class FaultyScene(SceneSource):
    def build(self):
        sail = Part(
            "sail",
            np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]),
            np.array([[0, 1, 2]], dtype=np.int32),
            np.tile(np.float32([0, 0, 1]), (3, 1)),
            np.zeros((3, 2), np.float32),
            "foil",
        )
        sound = Spacecraft("kite", (sail,), {"foil": Material("foil")}, {"S1": np.zeros(3)})
        match self.options.fault:
            case "none":
                return None
            case "name":
                return replace(sound, name="../kite")
            case "no parts":
                return replace(sound, parts=())
            case "twice":
                return replace(sound, parts=(sail, sail))
            case "faces":
                return replace(sound, parts=(replace(sail, faces=sail.faces + 1),))
            case "nan":
                return replace(
                    sound, parts=(replace(sail, vertices_body_m=sail.vertices_body_m * np.nan),)
                )
            case "material":
                return replace(sound, materials={})
            case "texture":
                grey = Material("foil", base_color_texture=np.zeros((4, 4), np.uint8))
                return replace(sound, materials={"foil": grey})
            case "keypoint":
                return replace(sound, keypoints_body_m={"S1": np.zeros(2)})
            case "skeleton":
                return replace(sound, skeleton=(("S1", "S9"),))
            case "raises":
                raise KeyError("no luck")
        return sound


class FaultyWriter(Writer):
    def write(self, dataset, folder):
        match self.options.fault:
            case "none":
                return None
            case "string":
                return "ranges.txt"
            case "outside":
                return [folder / ".." / "elsewhere.txt"]
            case "absent":
                return [folder / "absent.txt"]
            case "raises":
                raise RuntimeError("no luck")
        (folder / "extra" / "deep").mkdir(parents=True, exist_ok=True)
        (folder / "ranges.txt").write_text("ranges")
        (folder / "extra" / "deep" / "more.txt").write_text("more")
        return [folder / "ranges.txt", folder / "extra"]


class Lazy(Executor):
    def run(self, make_worker, indices):
        import os

        os.environ["POSSE_THREADS"] = "1"
        worker = make_worker()
        for index in indices:
            if index != 1:
                yield FrameResult(index, worker.make(index))
        worker.close()
