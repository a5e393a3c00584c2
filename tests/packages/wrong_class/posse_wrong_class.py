"""Its components' classes are not what their records say."""

from posse_core import ComponentSpec, Detector, Renderer, Writer, hookimpl


@hookimpl
def posse_renderers():
    return [
        ComponentSpec("writes", "a writer", "posse_wrong_class:Writes"),
        ComponentSpec("half", "cannot render", "posse_wrong_class:Half"),
        ComponentSpec("exiting", "ends the process when imported", "posse_wrong_class_exits:Any"),
        ComponentSpec("absent", "not there", "posse_wrong_class:Absent"),
        ComponentSpec("fails", "cannot be made", "posse_wrong_class:Fails"),
    ]


@hookimpl
def posse_detectors():
    words = frozenset({"keypoints"})
    return [ComponentSpec("boxes", "no keypoints", "posse_wrong_class:Boxes", capabilities=words)]


@hookimpl
def posse_subcommands():
    return [ComponentSpec("plain-function", "no command", "posse_wrong_class:posse_detectors")]


class Writes(Writer):
    def write(self, dataset, folder):
        return []


class Half(Renderer):
    def open(self, scene):
        pass

    def close(self):
        pass


class Fails(Half):
    def __init__(self, options):
        raise RuntimeError("no lamp")

    def render(self, request):
        pass


class Boxes(Detector):
    def load(self, path):
        pass

    def predict(self, images):
        return []
