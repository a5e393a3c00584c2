"""An S3-compatible server (moto) on loopback, in a process of its own: ``python s3_server.py FLAG``.

Prints its port. While the file FLAG exists, every write is refused.
"""

import sys
from pathlib import Path

from moto.server import DomainDispatcherApplication, create_backend_app
from werkzeug.serving import WSGIRequestHandler, make_server


class Quiet(WSGIRequestHandler):
    def log_request(self, *_):
        pass


def main(flag: Path) -> None:
    store = DomainDispatcherApplication(create_backend_app)

    def application(environ, start_response):
        if flag.exists() and environ["REQUEST_METHOD"] in ("PUT", "POST", "DELETE"):
            start_response("403 Forbidden", [("Content-Type", "application/xml")])
            return [b"<Error><Code>AccessDenied</Code><Message>the quota is used up</Message></Error>"]
        return store(environ, start_response)

    server = make_server("127.0.0.1", 0, application, threaded=True, request_handler=Quiet)
    print(server.port, flush=True)
    server.serve_forever()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
