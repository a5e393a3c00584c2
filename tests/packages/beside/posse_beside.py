"""Its classes stand beside its hooks, so every command imports their interfaces."""

from posse_core import ComponentSpec, Detector, Renderer, Writer, hookimpl


@hookimpl
def posse_renderers():
    return [ComponentSpec("dark", "no light", "posse_beside:Dark")]


@hookimpl
def posse_writers():
    return [ComponentSpec("nothing", "no files", "posse_beside:Nothing")]


@hookimpl
def posse_detectors():
    return [ComponentSpec("blind", "no detections", "posse_beside:Blind")]


class Dark(Renderer):
    def open(self, scene):
        pass

    def render(self, request):
        raise NotImplementedError

    def close(self):
        pass


class Nothing(Writer):
    def write(self, dataset, folder):
        return []


class Blind(Detector):
    def load(self, path):
        pass

    def predict(self, images):
        return [[] for _ in images]
